"""Policies for stable-baselines3 that choose a cell of the build zone."""
