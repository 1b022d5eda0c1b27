"""The blast model: parameters, particles, structures, collisions and the engines that run it."""
