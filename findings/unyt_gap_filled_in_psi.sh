#!/usr/bin/env bash
# Three gauges read 30 kPa, nothing and 50 kPa. The gap is filled with what the neighbour's data sheet
# says, 5 psi (34 kPa), by `np.nan_to_num(read, nan=...)`. Quantities of unyt know their units, so one
# would guess that the fill is converted, or refused, as `np.where` refuses arguments in two units. It
# is neither: the array takes the unit of the fill, and keeps its numbers. What read 30 kPa is now
# 30 psi, seven times as much, and a fill in seconds makes seconds of loads. No warning.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq unyt==3.2.0 numpy==2.4.6
venv/bin/python -W error - <<'PYTHON'
import sys

import numpy as np
import unyt

read = unyt.unyt_array([30.0, np.nan, 50.0], "kPa")
fill = unyt.unyt_quantity(5.0, "psi")
filled = np.nan_to_num(read, nan=fill)
try:
    np.where(np.isnan(read), fill, read)
    mixed = "taken"
except unyt.exceptions.UnitInconsistencyError:
    mixed = "refused"
seen = (
    [round(float(value), 1) for value in filled.to("kPa")],
    str(filled.units),
    str(np.nan_to_num(read, nan=unyt.unyt_quantity(1.0, "s")).units),
    mixed,
)
print("unyt", unyt.__version__, "numpy", np.__version__)
print("expected: 30.0, 34.5 and 50.0 kPa, or an error; in seconds an error")
print("seen: in kPa", seen[0], "- unit", seen[1], "- filled in seconds", seen[2], "- np.where", mixed)
sys.exit(0 if seen == ([206.8, 34.5, 344.7], "psi", "s", "refused") else "changed")
PYTHON
