"""The event-driven engine: hard discs without time steps, compiled with Numba."""
