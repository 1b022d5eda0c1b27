"""Questions to blasts: reduction, verdict, grid error, probability, capacity, screening."""
