#!/usr/bin/env bash
# The fewest blocks of a wall are looked for whose load is not above 30 kPa. With fewer than three
# blocks the simulation fails, and the load is NaN. One would guess that SciPy's
# `differential_evolution` counts a limit as broken where the load is not a number. It counts as
# met. Of all layouts the one without a single block is the best, its success is True, and the
# message is that of a search that went well. That `constr_violation` is NaN is the only trace,
# while an objective function of NaN ends in NaN and without success.
# With infinity in place of NaN the seven blocks are found that are right. Without whole numbers the
# search ends in a ValueError, since it is polished at the end, by a method that refuses NaN.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq scipy==1.17.1 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import sys

import numpy as np
import scipy
from scipy.optimize import NonlinearConstraint, differential_evolution


def fewest(failed):
    """Return the fewest blocks, and whether the search says that it went well."""

    def load(blocks):
        return failed if blocks[0] < 3 else 100.0 * np.exp(-blocks[0] / 5.0)  # kPa

    found = differential_evolution(
        lambda blocks: blocks[0],
        bounds=[(0, 20)],
        integrality=[True],
        constraints=NonlinearConstraint(load, -np.inf, 30.0),
        rng=0,
    )
    return round(float(found.x[0])), bool(found.success), found.message


seen = {failed: fewest(failed) for failed in (np.nan, np.inf)}
print("SciPy", scipy.__version__)
print("expected: 7 blocks (25 kPa), whatever stands for a failed run")
for failed, found in seen.items():
    print(f"seen, {failed} for a failed run: blocks, success", *found)
as_found = seen[np.inf][:2] == (7, True) and seen[np.nan][0] < 3 and seen[np.nan][1]
sys.exit(0 if as_found else "changed")
PYTHON
