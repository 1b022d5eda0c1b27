"""Fitting of calibrations to blasts in a free field, and the paper's tables."""
