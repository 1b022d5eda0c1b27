"""The benchmark's data: what problems are scored between, and how strong methods do."""
