#!/usr/bin/env bash
# Heights on a grid of 1 m are triangles in startinpy: flat ground, and a house of 10 m. A height
# between them is read by `interpolate`, which has several methods, and "does not modify the
# triangulation", as its documentation says. One would guess that a height is the same whatever has
# been asked before. By "Laplace" and by "NNI" startinpy puts each place in as a corner and takes it
# out again. On a grid both diagonals of a square are right, and the square may get the other one:
# beside the house a height by "TIN" goes from 0 to 5 m, or from 5 to 0 m, after a question there.
# The place that was taken out stays in `points` as a row of NaN, so that a mean height is NaN, and
# in files (`write_obj`) as one corner more. "TIN", "NN" and "IDW" leave all as it was.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq startinpy==0.12.3 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import importlib.metadata
import sys
from pathlib import Path

import numpy as np
import startinpy

CORNERS = [(2.5, 2.5), (5.5, 2.5), (2.5, 5.5), (5.5, 5.5)]
"""Places on the ground, each half a metre off a corner of the house."""


def told(method):
    """Ask for heights by a method, and return those by TIN before and after, rows and corners."""
    places = [(float(x), float(y)) for y in range(9) for x in range(9)]
    heights = [10.0 if 3 <= x <= 5 and 3 <= y <= 5 else 0.0 for x, y in places]
    site = startinpy.DT()
    site.insert([(*place, height) for place, height in zip(places, heights, strict=True)])
    before = site.interpolate({"method": "TIN"}, CORNERS).tolist()
    site.interpolate({"method": method, "radius": 2.0, "power": 2.0}, CORNERS)
    after = site.interpolate({"method": "TIN"}, CORNERS).tolist()
    site.write_obj("site.obj")
    corners = sum(line.startswith("v ") for line in Path("site.obj").read_text().splitlines())
    return before, after, int(np.isnan(site.points).all(axis=1).sum()), corners


seen = {method: told(method) for method in ("TIN", "NN", "IDW", "Laplace", "NNI")}
print("startinpy", importlib.metadata.version("startinpy"))
print("expected: the same heights before and after, no row of NaN, 81 corners in the file")
for method, (before, after, rows, corners) in seen.items():
    print(f"seen, {method}: {before} then {after} m, rows of NaN {rows}, corners {corners}")
still = ([0.0, 5.0, 5.0, 0.0], [0.0, 5.0, 5.0, 0.0], 0, 81)
turned = ([0.0, 5.0, 5.0, 0.0], [5.0, 5.0, 0.0, 5.0], 1, 82)
as_found = all(seen[method] == still for method in ("TIN", "NN", "IDW"))
as_found = as_found and all(seen[method] == turned for method in ("Laplace", "NNI"))
sys.exit(0 if as_found else "changed")
PYTHON
