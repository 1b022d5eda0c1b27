"""The reference engine, with pymunk."""
