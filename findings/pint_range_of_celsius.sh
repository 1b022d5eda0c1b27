#!/usr/bin/env bash
# Gauges in a room read 10 to 35 degrees Celsius after a fire ball. Pint knows places on a scale
# (degC) from differences (delta_degC): the highest less the lowest is a difference of 25, which is
# 25 K, and so are a standard deviation and steps from gauge to gauge. One would guess the same of
# `np.ptp`, whose result is the highest less the lowest. Pint gives it as a place: 25 degC, which is
# 298 K as soon as it is told in kelvins.
# Heat is mass by specific heat by difference. A program that computes it by `ptp`, in SI units, has
# twelve times the heat, with the right unit (J) and no warning.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq pint==0.25.3 numpy==2.4.6
venv/bin/python -W error - <<'PYTHON'
import sys

import numpy as np
import pint

units = pint.UnitRegistry()
read = units.Quantity(np.array([10.0, 35.0]), "degC")
capacity = units.Quantity(60.0 * 1005.0, "J/K")
"""Of the air in a room of 50 m3."""
rises = {
    "max - min": read.max() - read.min(),
    "np.diff": np.diff(read)[0],
    "2 np.std": 2.0 * np.std(read),
    "np.ptp": np.ptp(read),
}
seen = {}
for name, rise in rises.items():
    heat = (capacity * rise.to_base_units()).to("MJ")
    seen[name] = (f"{rise.magnitude:g} {rise.units}", f"{heat.magnitude:.2f} {heat.units}")
print("pint", pint.__version__, "numpy", np.__version__)
print("expected: a difference of 25 degrees and a heat of 1.51 MJ by each")
for name, (rise, heat) in seen.items():
    print(f"seen, {name}:", rise, "-", heat)
right = ("25 delta_degree_Celsius", "1.51 megajoule")
wanted = {**dict.fromkeys(seen, right), "np.ptp": ("25 degree_Celsius", "17.98 megajoule")}
sys.exit(0 if seen == wanted else "changed")
PYTHON
