"""Other codes: they run what `blast-env bench --gas` times them by."""
