"""Fitting a calibration on many blasts in a free field, and the paper's own tables."""
