#!/usr/bin/env bash
# `mean`, `sum` and `std` of an array are NumPy's functions in a compiled function too, and one
# would guess that they have NumPy's accuracy. Numba adds the values one by one in the array's own
# type; NumPy adds them in pairs. A million cells of still air in single precision, each at
# 101,325 Pa, have a mean of 100,549 Pa with Numba, and deviate from it by 776 Pa.
# That is a blast of -0.8 kPa in a site where nothing has happened. It grows with the number of
# cells, so that a coarse grid is right and a finer one is not; small tests do not show it.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq numba==0.68.1 numpy==2.4.6
venv/bin/python - <<'PYTHON'
import sys

import numba
import numpy as np


def moments(pressure_pa):
    return pressure_pa.mean(), pressure_pa.std()


compiled = numba.njit(moments)
seen = {}
for cells in (1_000, 100_000, 1_000_000):
    still = np.full(cells, 101_325.0, np.float32)
    seen[cells] = [tuple(round(float(x), 1) for x in f(still)) for f in (moments, compiled)]
print("numba", numba.__version__, "numpy", np.__version__)
print("expected: a mean of 101,325 Pa and a deviation of 0 Pa")
for cells, (by_numpy, by_numba) in seen.items():
    print(f"seen of {cells:,} cells: NumPy", by_numpy, "- Numba", by_numba)
by_numpy, (mean, deviation) = seen[1_000_000]
as_found = by_numpy == (101_325.0, 0.0) and abs(mean - 100_549.0) < 1.0
sys.exit(0 if as_found and abs(deviation - 776.0) < 1.0 else "changed")
PYTHON
