"""What was studied about the particle model."""
