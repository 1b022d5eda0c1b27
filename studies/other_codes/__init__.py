"""The gas engine against other codes on the same scene."""
