"""Comparisons of the gas engine with other codes on the same scene."""
