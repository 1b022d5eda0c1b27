"""Fitting a power law to a reference on many blasts in a free field."""
