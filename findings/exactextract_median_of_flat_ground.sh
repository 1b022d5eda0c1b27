#!/usr/bin/env bash
# A block of 100 by 100 cells is flat at 0 m, and one cell has a mast of 30 m. One would guess that
# the median of the heights is 0 m, as it is in NumPy, and 90 per cent of them as well.
# exactextract, which makes statistics of a raster by polygon, gives 15 m and 27 m, and 3 m for a
# tenth, however many cells are flat: cells of one height become one value with a weight, and a
# quantile lies on a straight line from each value to the next, as if the ground rose to the mast.
# Where no two cells are equal, it has NumPy's quantiles, and mean and sum are right throughout. So
# heights in whole metres, many of which are equal, are worst off. For these it also cuts what
# follows the point, towards zero: the median of 3 and 4 is 3.
# The first is known to the developers (exactextractr, issue 113). There is no message.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq exactextract==0.3.0 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import importlib.metadata
import sys

import numpy as np
from exactextract import exact_extract
from exactextract.raster import NumPyRasterSource

SHARES = (0.1, 0.5, 0.9)


def quantiles(heights_m):
    """Return quantiles and the mean of all heights, by exactextract and by NumPy."""
    rows, columns = heights_m.shape
    raster = NumPyRasterSource(heights_m, xmin=0, ymin=0, xmax=columns, ymax=rows)
    ring = [[0, 0], [columns, 0], [columns, rows], [0, rows], [0, 0]]
    outline = {"type": "Polygon", "coordinates": [ring]}
    block = {"type": "Feature", "geometry": outline, "properties": {}}
    asked = [*(f"quantile(q={share})" for share in SHARES), "median", "mean"]
    found = exact_extract(raster, [block], asked)[0]["properties"]
    names = [*(f"quantile_{round(100 * share)}" for share in SHARES), "median", "mean"]
    by_numpy = [*np.quantile(heights_m, SHARES), np.median(heights_m), heights_m.mean()]
    return [found[name] for name in names], [float(value) for value in by_numpy]


flat = np.zeros((100, 100))
flat[50, 50] = 30.0
cases = {
    "one mast": flat,
    "no two equal": np.arange(10.0).reshape(2, 5),
    "3 and 4 as floats": np.array([[3.0, 4.0]]),
    "3 and 4 as integers": np.array([[3, 4]]),
}
seen = {}
print("exactextract", importlib.metadata.version("exactextract"), "numpy", np.__version__)
print("quantiles of 10, 50 and 90 per cent, median, mean:")
for name, heights_m in cases.items():
    seen[name] = quantiles(heights_m)
    print(f"{name}: expected {seen[name][1]}; seen {seen[name][0]}")
as_found = np.allclose(seen["one mast"], [[3.0, 15.0, 27.0, 15.0, 0.003], [0, 0, 0, 0, 0.003]])
as_found = as_found and all(np.allclose(*seen[name]) for name in list(cases)[1:3])
as_found = as_found and np.allclose(seen["3 and 4 as integers"][0], [3, 3, 3, 3, 3.5])
sys.exit(0 if as_found else "changed")
PYTHON
