"""Gas dynamics: the compressible Euler equations in three dimensions around solid cells."""
