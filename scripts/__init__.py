"""Studies and demonstrations whose results can be looked at."""
