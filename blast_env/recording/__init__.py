"""Tables of a blast, and their export to Excel and Parquet."""
