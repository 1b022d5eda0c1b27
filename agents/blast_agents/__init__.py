"""Training, search and comparison of protective layouts."""
