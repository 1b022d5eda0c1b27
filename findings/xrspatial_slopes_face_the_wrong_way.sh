#!/usr/bin/env bash
# A hillside rises to the north, so that it faces south. xarray-spatial's `aspect` gives the
# direction that a slope faces, "clockwise in degrees with 0 (due north)". The raster has
# coordinates, so one would guess that it is 180 degrees, however the rows lie. It is where the
# first row is the northernmost, as in a GeoTIFF. Where coordinates grow with the rows, as NetCDF
# files often have them, and whatever was sorted by `sortby("y")`, it is 0: north, for the same
# heights at the same places. `hillshade` is lit from the other side as well. The steepness is right
# either way, and east and west are, so that a look at slopes shows nothing.
# Whoever looks for ground that slopes towards a charge, or drains away from it, finds that which
# slopes the other way.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq xarray-spatial==0.5.3 xarray==2026.9.0 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import importlib.metadata
import sys

import numpy as np
import xarray
from xrspatial import aspect, hillshade, slope

y, x = np.arange(7.0), np.arange(7.0)
north = xarray.DataArray(np.tile(y[:, None], 7), coords={"y": y, "x": x}, dims=("y", "x"))
east = xarray.DataArray(np.tile(x, (7, 1)), coords={"y": y, "x": x}, dims=("y", "x"))


def middle(function, heights):
    """Return the value at x = 3, y = 3 with rows from the north and with rows from the south."""
    both = heights.sortby("y", ascending=False), heights.sortby("y")
    return [round(float(function(one).sel(x=3.0, y=3.0)), 2) for one in both]


seen = {
    "aspect, rises to the north": middle(aspect, north),
    "aspect, rises to the east": middle(aspect, east),
    "slope, rises to the north": middle(slope, north),
    "hillshade, rises to the north": middle(hillshade, north),
}
print("xarray-spatial", importlib.metadata.version("xarray-spatial"))
print("expected: 180 degrees, 270, 45, and one shade, whichever row is first")
for name, found in seen.items():
    print("seen,", name, "- rows from the north, from the south:", *found)
shades = seen.pop("hillshade, rises to the north")
as_found = list(seen.values()) == [[180.0, 0.0], [270.0, 270.0], [45.0, 45.0]]
sys.exit(0 if as_found and abs(shades[0] - shades[1]) > 0.3 else "changed")
PYTHON
