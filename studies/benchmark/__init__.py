"""The benchmark's data: reference layouts of the problems, and results of strong methods."""
