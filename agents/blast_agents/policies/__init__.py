"""Policies for stable-baselines3 that select a cell of the build zone."""
