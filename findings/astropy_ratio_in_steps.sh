#!/usr/bin/env bash
# Charges stand 50, 500 and 5,000 m away, and the steps of a table of distances over a kilometre are
# at 0.1 and 1. As quotients of astropy (m / km) the distances are pure numbers with a scale, and
# comparisons, `np.interp`, `np.digitize` and `np.histogram` heed it: 0.05, 0.5 and 5. One would guess
# the same of `np.searchsorted`, which is what digitize is made of. It does so only if the steps are a
# quantity: if they are plain numbers it takes the 50, the 500 and the 5,000 themselves, and puts all
# of them behind the last step. It takes distances in kilometres as well, which are no pure numbers
# and which a comparison and np.digitize refuse. No warning.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq astropy==8.0.2 numpy==2.4.6
venv/bin/python -W error - <<'PYTHON'
import sys

import astropy
import numpy as np
from astropy import units

steps = [0.1, 1.0]
away = np.array([50.0, 500.0, 5000.0]) * units.m / units.km
kilometres = away.to(units.one) * units.km


def refused(ask):
    try:
        ask()
    except units.UnitsError:
        return "refused"
    return "taken"


seen = {
    "comparisons": [sum(bool(one > step) for step in steps) for one in away],
    "np.digitize": np.digitize(away, steps).tolist(),
    "np.searchsorted, steps a quantity": np.searchsorted(steps * units.one, away).tolist(),
    "np.searchsorted": np.searchsorted(steps, away).tolist(),
    "kilometres > 1": refused(lambda: kilometres > 1.0),
    "np.digitize of kilometres": refused(lambda: np.digitize(kilometres, steps)),
    "np.searchsorted of kilometres": refused(lambda: np.searchsorted(steps, kilometres)),
}
print("astropy", astropy.__version__, "numpy", np.__version__)
print("expected: [0, 1, 2] by each, and kilometres refused")
for name, value in seen.items():
    print(f"seen, {name}:", value)
first, last = [*seen.values()][:4], [*seen.values()][4:]
as_found = [[0, 1, 2]] * 3 + [[2, 2, 2]], ["refused", "refused", "taken"]
sys.exit(0 if (first, last) == as_found else "changed")
PYTHON
