#!/usr/bin/env bash
# Models of New York have their coordinates in feet: plan in EPSG:2263, heights in EPSG:6360, and both
# together as the system "EPSG:2263+6360". `to_crs` goes to a map in metres (EPSG:32618). One would
# guess that heights go to metres as well, or are dropped, or that there is an error, since the map
# has none. The plan shrinks to metres. Heights keep their feet, whether or not the old system says
# that they are feet. Only a new system with a height of its own makes metres of them.
# A house of 100 feet is 100 m high, and shields what is behind it as one three times as high does.
# In plan nothing looks wrong.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq geopandas==1.2.0 shapely==2.2.0 pyproj==3.7.2 pandas==3.1.1 numpy==2.4.6
venv/bin/python -W error - <<'PYTHON'
import sys

import geopandas
import pyproj
from shapely import Polygon

FEET_TO_M = 1200.0 / 3937.0
WALL = Polygon(
    [(987_000.0, 210_000.0, 0.0), (987_100.0, 210_000.0, 0.0), (987_100.0, 210_001.0, 100.0)]
)
"""A wall of 100 by 100 feet, which leans a little so as to have a plan."""


def told(old, new):
    """Return length and height of the wall, in the units of the new system."""
    (x, y, low), (end_x, end_y, _), (_, _, high), _ = (
        geopandas.GeoSeries([WALL], crs=old).to_crs(new).iloc[0].exterior.coords
    )
    return round(((end_x - x) ** 2 + (end_y - y) ** 2) ** 0.5, 1), round(high - low, 1)


axes = [axis.unit_name for axis in pyproj.CRS("EPSG:2263+6360").axis_info]
ways = [("EPSG:2263", "EPSG:32618"), ("EPSG:2263+6360", "EPSG:32618")]
ways.append(("EPSG:2263+6360", "EPSG:32618+5703"))
seen = {f"{old} to {new}": told(old, new) for old, new in ways}
print("geopandas", geopandas.__version__, "pyproj", pyproj.__version__)
print("PROJ", pyproj.proj_version_str, "- units of EPSG:2263+6360:", axes)
print("expected: 30.5 by 30.5 m, for 100 feet are", round(100.0 * FEET_TO_M, 1), "m")
for name, (length, height) in seen.items():
    print(f"seen, {name}:", length, "by", height, "m")
as_found = list(seen.values()) == [(30.5, 100.0), (30.5, 100.0), (30.5, 30.5)]
sys.exit(0 if as_found else "changed")
PYTHON
