#!/usr/bin/env bash
# A model of heights has cells of 1 m, and a wall of 6 m that is one cell thick. It is read in cells
# of 4 m, as averages, which keep the volume of what stands there. Overviews, smaller copies in the
# file that viewers want, make reading faster and change no cell of the model: one would guess that
# the averages are the same with them. They are averages of what the overviews have. These are made
# of every second and fourth row here, the usual way: the wall is gone, or has four times its volume
# if it is one row further on. There is no message, and the arguments of the read are the same.
# Most published models of heights have overviews. The full read and `reproject` leave them alone.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq rasterio==1.4.4 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import sys

import numpy as np
import rasterio
from rasterio.enums import Resampling
from rasterio.transform import from_origin
from rasterio.warp import reproject

SIZE, COARSE_M = 64, 4


def volumes(row, has_overviews):
    """Return the volume of the wall (m3): of all cells, averaged by a read, and by `reproject`."""
    height = np.zeros((SIZE, SIZE), np.float32)
    height[row] = 6.0
    north_west = from_origin(0.0, SIZE, 1.0, 1.0)
    form = {"width": SIZE, "height": SIZE, "count": 1, "dtype": "float32", "crs": "EPSG:32632"}
    with rasterio.open("heights.tif", "w", driver="GTiff", transform=north_west, **form) as file:
        file.write(height, 1)
        if has_overviews:
            file.build_overviews([2, 4], Resampling.nearest)
    coarse = np.zeros((SIZE // COARSE_M, SIZE // COARSE_M), np.float32)
    with rasterio.open("heights.tif") as file:
        full = file.read(1)
        read = file.read(1, out_shape=coarse.shape, resampling=Resampling.average)
        reproject(
            rasterio.band(file, 1),
            coarse,
            dst_transform=from_origin(0.0, SIZE, COARSE_M, COARSE_M),
            dst_crs=file.crs,
            resampling=Resampling.average,
        )
    return [round(float(h.sum()) * m**2) for h, m in ((full, 1), (read, 4), (coarse, 4))]


seen = {(row, known): volumes(row, known) for row in (20, 21) for known in (False, True)}
print("rasterio", rasterio.__version__, "GDAL", rasterio.__gdal_version__)
print("expected: a volume of 384 m3, however it is read")
for (row, known), found in seen.items():
    print("seen: row", row, "with" if known else "without", "overviews:", found)
right = [384, 384, 384]
as_found = all(seen[row, False] == right for row in (20, 21))
as_found = as_found and seen[20, True] == [384, 1536, 384] and seen[21, True] == [384, 0, 384]
sys.exit(0 if as_found else "changed")
PYTHON
