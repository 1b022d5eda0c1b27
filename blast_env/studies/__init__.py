"""Studies of the model that commands run: benchmark, calibration, pressure, shielding."""
