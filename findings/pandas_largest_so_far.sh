#!/usr/bin/env bash
# Runs of a study are ranked by how far off their safe distance is, and a run without any has an
# infinite one. The largest so far is `cummax`, or `expanding().max()`; the largest of the last runs
# is `rolling(...).max()`. One would guess that infinity is larger than all other numbers in each.
# It is in `cummax` and in `max`. The windows of pandas take every infinity for a missing value: the
# largest so far goes on as if that run had not been, and a mean is that of the others, though
# `count` counts it. Where all values of a window are asked for, it has no result. The documentation
# of these functions has no word on it.
# Whoever looks for the run at which a design was lost for the first time does not find it.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq pandas==3.1.1 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import sys

import numpy as np
import pandas

distances = pandas.Series([20.0, 30.0, np.inf, 25.0, 35.0])  # m
seen = {
    "cummax": distances.cummax(),
    "expanding().max()": distances.expanding().max(),
    "expanding().mean()": distances.expanding().mean(),
    "expanding().count()": distances.expanding().count(),
    "rolling(2, min_periods=1).max()": distances.rolling(2, min_periods=1).max(),
    "rolling(2).max()": distances.rolling(2).max(),
}
seen = {name: found.tolist() for name, found in seen.items()}
print("pandas", pandas.__version__, "for", distances.tolist())
print("expected: the largest so far", seen["cummax"], "both ways, and means that end in infinity")
for name, found in seen.items():
    print("seen,", name, found)
as_found = seen["expanding().max()"] == [20.0, 30.0, 30.0, 30.0, 35.0]
as_found = as_found and seen["expanding().mean()"] == [20.0, 25.0, 25.0, 25.0, 27.5]
as_found = as_found and seen["expanding().count()"][-1] == 5.0
as_found = as_found and seen["rolling(2, min_periods=1).max()"] == [20.0, 30.0, 30.0, 25.0, 35.0]
as_found = as_found and str(seen["rolling(2).max()"]) == "[nan, 30.0, nan, nan, 35.0]"
as_found = as_found and seen["cummax"] == [20.0, 30.0, np.inf, np.inf, np.inf]
sys.exit(0 if as_found else "changed")
PYTHON
