#!/usr/bin/env bash
# The pressure rises from gauge to gauge: 20, 30 and 40 kPa, and before the first one by a reading of
# an old gauge, 1 psi (6.9 kPa). `np.diff(read, prepend=old)` gives the steps. With quantities of Pint
# one would guess that the old reading is converted, as `np.insert` does it, or that another unit is
# refused, as a sum of kPa and seconds is. Pint takes the bare number: the first step is 19 kPa instead
# of 13.1, and a time of 1 s in the place of the pressure passes as well. `append` does the same, and
# so does `to_begin` of `np.ediff1d`. No warning.
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
read, old = units.Quantity(np.array([20.0, 30.0, 40.0]), "kPa"), units.Quantity(1.0, "psi")
second = units.Quantity(1.0, "s")
steps = {
    "of np.insert": np.diff(np.insert(read, 0, old)),
    "prepend": np.diff(read, prepend=old),
    "append, the last one": np.diff(read, append=old)[::-1],
    "to_begin": np.ediff1d(read, to_begin=old),
    "prepend in seconds": np.diff(read, prepend=second),
}
seen = {name: round(float(value[0].to("kPa").magnitude), 1) for name, value in steps.items()}
try:
    read[0] + second
    added = "taken"
except pint.DimensionalityError:
    added = "refused"
print("pint", pint.__version__, "numpy", np.__version__)
print("expected: 13.1, 13.1, -33.1 and 6.9 kPa; seconds refused, as in a sum")
print("seen:", seen, "- a sum", added)
wanted = [13.1, 19.0, -39.0, 1.0, 19.0]
sys.exit(0 if [*seen.values()] == wanted and added == "refused" else "changed")
PYTHON
