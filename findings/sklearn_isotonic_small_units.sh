#!/usr/bin/env bash
# An isotonic fit knows nothing but the order of x, so one would guess that its unit is free. With x
# in single precision it is not: values that differ by less than 1e-6 count as one place, however
# small they all are, and their y is averaged. Five loads of 0.1 to 0.5 Pa, told in MPa, make a fit
# that is constant; the same numbers in double precision, or in Pa, are fitted exactly.
# Whoever calibrates guesses of a network (single precision) against small loads gets the mean.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq scikit-learn==1.9.1
venv/bin/python - <<'PYTHON'
import sys

import numpy as np
import sklearn
from sklearn.isotonic import IsotonicRegression

load_pa = np.array([0.1, 0.2, 0.3, 0.4, 0.5])
seen = {}
for kind in (np.float64, np.float32):
    for unit, scale in (("Pa", 1.0), ("MPa", 1e-6)):
        x, y = (load_pa * scale).astype(kind), np.arange(1.0, 6.0).astype(kind)
        seen[kind.__name__, unit] = IsotonicRegression().fit(x, y).predict(x).tolist()
print("scikit-learn", sklearn.__version__)
print("expected: 1 to 5, in each unit")
for (kind, unit), fit in seen.items():
    print("seen:", kind, unit, fit)
line, mean = [1.0, 2.0, 3.0, 4.0, 5.0], [3.0] * 5
wanted = {
    ("float64", "Pa"): line,
    ("float64", "MPa"): line,
    ("float32", "Pa"): line,
    ("float32", "MPa"): mean,
}
sys.exit(0 if seen == wanted else "changed")
PYTHON
