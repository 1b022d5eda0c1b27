"""Checks of the gas engine, with results in docs/engineers/gas.md."""
