#!/usr/bin/env bash
# One of 2,048 runs of a sensitivity study failed, and its result is NaN. One would guess that the
# indices are NaN then, as those by RBD-FAST are, so that nobody overlooks it. The indices of Sobol
# are zero, and their confidence intervals as well: no input matters, and that is certain. There is
# no warning. A variance that is not a number counts as one that is zero.
# Whoever drops inputs without influence from a study of a blast drops the charge.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq SALib==1.6.0 numpy==2.4.6
venv/bin/python - <<'PYTHON'
import importlib.metadata
import sys

import numpy as np
from SALib.analyze import rbd_fast, sobol
from SALib.sample import sobol as sample

problem = {
    "num_vars": 3,
    "names": ["charge_kg", "standoff_m", "colour"],
    "bounds": [[10.0, 100.0], [10.0, 50.0], [0.0, 1.0]],
}
inputs = sample.sample(problem, 256, seed=1)
peak = np.cbrt(inputs[:, 0]) / inputs[:, 1]
failed = peak.copy()
failed[5] = np.nan
seen = {}
for name, values in (("all", peak), ("one failed", failed)):
    found = sobol.analyze(problem, values, seed=1)
    seen[name] = {key: found[key].round(2).tolist() for key in ("S1", "ST", "ST_conf")}
by_fast = np.array(rbd_fast.analyze(problem, inputs, failed, seed=1)["S1"])
print("SALib", importlib.metadata.version("SALib"), "-", len(peak), "runs")
print("seen if all ended:", seen["all"])
print("expected if one failed: NaN, as by RBD-FAST:", by_fast.tolist())
print("seen if one failed:", seen["one failed"])
zero = [0.0, 0.0, 0.0]
as_found = seen["one failed"] == {"S1": zero, "ST": zero, "ST_conf": zero}
as_found = as_found and np.isnan(by_fast).all() and seen["all"]["ST"][1] > 0.5
sys.exit(0 if as_found else "changed")
PYTHON
