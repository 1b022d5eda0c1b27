"""Pressure over time, held against Kingery & Bulmash."""
