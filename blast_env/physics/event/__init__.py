"""The event-driven engine: hard discs without a time step, compiled with Numba."""
