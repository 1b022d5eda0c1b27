"""The reference engine, on pymunk."""
