#!/usr/bin/env bash
# A linear programme is the same in each unit, one would guess, as long as its limit is far above
# the tolerances, which are 1e-7. The chance of an accident is 4e-10 for each lorry with explosives
# that passes the northern gate, and 6e-9 at the southern one; there may be 0.001 in a year.
# `linprog` sends all lorries through the north and more through the south, and calls it optimal,
# with a slack of zero. HiGHS takes coefficients of up to 1e-9 out of the matrix, and SciPy has its
# slack from what is left.
# The true number is five times the limit. Told in millions of lorries, the same programme keeps it.
# `res.success` and `res.slack` do not show it; `A @ res.x` does.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq scipy==1.17.1 numpy==2.4.6
venv/bin/python - <<'PYTHON'
import sys

import numpy as np
import scipy
from scipy.optimize import linprog

CHANCES = np.array([4e-10, 6e-9])
"""Accidents for each lorry, by gate."""
LIMIT = 0.001


def planned(unit):
    """Return lorries, their accidents in a year, and the slack of the limit, by unit of lorries."""
    limits = {"A_ub": [CHANCES * unit], "b_ub": [LIMIT], "bounds": [(0, 1e7 / unit)] * 2}
    found = linprog([-1.0, -1.0], **limits)
    assert found.success
    lorries = found.x * unit
    return lorries.round().tolist(), round(float(CHANCES @ lorries), 9), float(found.slack[0])


seen = {"lorries": planned(1.0), "millions of lorries": planned(1e6)}
print("scipy", scipy.__version__)
print("expected: 2,500,000 lorries by the northern gate, none by the southern, 0.001 accidents")
for name, (lorries, accidents, slack) in seen.items():
    print(f"seen, in {name}:", lorries, "lorries,", accidents, "accidents, slack", slack)
lorries, accidents, slack = seen["lorries"]
as_found = lorries == [1e7, 166_667.0] and accidents == 0.005 and abs(slack) < 1e-9
sys.exit(0 if as_found and seen["millions of lorries"][:2] == ([2.5e6, 0.0], LIMIT) else "changed")
PYTHON
