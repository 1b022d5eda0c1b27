"""The blast model: parameters, particles, structures, collisions and engines."""
