#!/usr/bin/env bash
# Sites have different numbers of runs, here three, two and one, for which there is Awkward Array. A
# run that failed is NaN. One would guess that the largest load of a site with such a run is NaN, as
# the mean is: `ak.max` does what NumPy's does, by its docstring, and there is `ak.nanmax` for those
# who want NaN left out. By site (`ak.max(loads, axis=1)`) NaN is left out all the same, and the
# largest load of a site without any run that went well is minus infinity. Of all runs together
# (`ak.max(loads)`) it is NaN: the largest of the largest loads is not the largest of all.
# `argmax` leaves NaN out in both, and so points at another load than `max` has. `sort` puts NaN first,
# not last as NumPy does: the middle of three sorted loads with one NaN is the smallest that is known.
# A look at the largest loads by site shows no failed run, and takes the site of which nothing is
# known for the safest one. There is no message.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq awkward==2.14.0 numpy==2.4.6
venv/bin/python - <<'PYTHON'
import sys

import awkward as ak
import numpy as np

NAN = float("nan")
runs_kpa = [[10.0, NAN, 30.0], [40.0, 20.0], [NAN]]
loads = ak.Array(runs_kpa)
print("awkward", ak.__version__)
found = {}
for name in ("max", "min", "mean", "argmax"):
    of, of_rows = getattr(ak, name), getattr(np, name)
    by_site, of_all = of(loads, axis=1).to_list(), of(loads, axis=None)
    expected = [of_rows(np.array(runs)).item() for runs in runs_kpa]
    of_flat = of_rows(np.concatenate([np.array(runs) for runs in runs_kpa]))
    found[name] = by_site, float(of_all)
    print(f"{name}: expected, by NumPy, {expected} and {of_flat} of all, seen {by_site} and {of_all}")
sorted_kpa = ak.sort(loads, axis=1).to_list()
print("sorted: expected", [np.sort(runs).tolist() for runs in runs_kpa], "seen", sorted_kpa)
print("nanmax:", ak.nanmax(loads, axis=1).to_list(), ak.nanmax(loads))
as_found = found["max"][0] == [30.0, 40.0, -np.inf] and found["min"][0] == [10.0, 20.0, np.inf]
as_found = as_found and np.isnan([found["max"][1], found["min"][1], found["mean"][1]]).all()
as_found = as_found and found["argmax"] == ([2, 0, 0], 3.0) and np.isnan(found["mean"][0][0])
as_found = as_found and np.isnan(sorted_kpa[0][0]) and sorted_kpa[0][1:] == [10.0, 30.0]
sys.exit(0 if as_found and ak.nanmax(loads, axis=1).to_list() == [30.0, 40.0, None] else "changed")
PYTHON
