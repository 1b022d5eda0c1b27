#!/usr/bin/env bash
# Mass and place of a charge are one group of a study by SALib, the height of a wall is another: one
# asks what the charge decides, as against the wall. One would guess that inputs of one group are
# drawn as freely as others, and are only counted together. The samples of Sobol and Morris are so.
# The Latin hypercube draws one column for the whole group: the largest mass comes with the
# farthest place, and their correlation is 1. The docstring of `latin.sample` has no word on groups.
# With twice the distance for eight times the mass, here the ends of both ranges, all charges have
# one scaled distance: by the samples the charge decides nothing, and the wall all. Each column by
# itself is as it should be, so that a look at ranges or histograms shows nothing.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq SALib==1.6.0 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import importlib.metadata
import sys

import numpy as np
from SALib.sample import latin, morris, sobol

ALONE = {
    "num_vars": 3,
    "names": ["cube root of mass", "stand-off", "height"],
    "bounds": [[4.0, 8.0], [20.0, 40.0], [1.0, 3.0]],
}
GROUPED = ALONE | {"groups": ["charge", "charge", "wall"]}


def told(drawn):
    """Return the correlation of mass and place, and the deviation of scaled distances."""
    both = np.corrcoef(drawn[:, 0], drawn[:, 1])[0, 1]
    return round(float(both), 2), round(float(np.std(drawn[:, 1] / drawn[:, 0])), 2)


seen = {
    "sobol, grouped": told(sobol.sample(GROUPED, 1024, seed=0)),
    "morris, grouped": told(morris.sample(GROUPED, 1024, num_levels=8, seed=0)),
    "latin, grouped": told(latin.sample(GROUPED, 4096, seed=0)),
    "latin, alone": told(latin.sample(ALONE, 4096, seed=0)),
}
print("SALib", importlib.metadata.version("SALib"))
print("expected: correlations near 0, and scaled distances that vary")
for name, found in seen.items():
    print("seen,", name, "- correlation, deviation of scaled distances (m/kg^(1/3))", *found)
as_found = seen.pop("latin, grouped") == (1.0, 0.0)
as_found = as_found and all(abs(both) < 0.1 and spread > 1.4 for both, spread in seen.values())
sys.exit(0 if as_found else "changed")
PYTHON
