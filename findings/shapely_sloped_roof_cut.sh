#!/usr/bin/env bash
# A sloped roof is a polygon with heights at its corners, here 0 m at the eaves and 10 m at the
# ridge. One would guess that its intersection with a plan has the roof's own heights at the new
# corners: between two eaves and ridges, 2 m and 8 m. That is so where a new corner lies on an edge
# of the roof. A new corner inside the roof gets the height of the nearest corners instead: 0 and
# 10 m, without a word.
# Whoever cuts a model of a town into sites has roofs that stand too low at one end and too high at
# the other, and the same roof, cut a little larger, has the right heights.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq shapely==2.2.0
venv/bin/python - <<'PYTHON'
import sys

import shapely
from shapely import Polygon, box

roof = Polygon([(0, 0, 0), (10, 0, 10), (10, 10, 10), (0, 10, 0)])
seen = {}
for name, plan in (("across the edges", box(2, -1, 8, 11)), ("inside", box(2, 2, 8, 8))):
    part = roof.intersection(plan)
    seen[name] = sorted({z for x, y, z in part.exterior.coords})
print("shapely", shapely.__version__, "GEOS", shapely.geos_version_string)
print("expected: heights of 2 and 8 m, which are x of the corners")
print("seen:", seen)
sys.exit(0 if seen == {"across the edges": [2.0, 8.0], "inside": [0.0, 10.0]} else "changed")
PYTHON
