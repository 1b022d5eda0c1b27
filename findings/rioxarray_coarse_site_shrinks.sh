#!/usr/bin/env bash
# A model of heights has cells of 1 m. It is opened with rioxarray, averaged over 10 by 10 cells
# with xarray's `coarsen`, and taken to another coordinate system with `rio.reproject`. The
# coordinates say that cells are 10 m apart, so one would guess that the site is as large as before.
# Its cells are counted as 1 m, as they were in the file: the outermost ones end 0.5 m from their
# centres, and a site of 40 m is 31 m wide. What stood at its edges is 4.5 m nearer to the middle,
# and all distances are shorter by a quarter.
# `to_raster` writes the same model with the right size, and a model that was made in memory and
# never was in a file is right with both. There is no message.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq rioxarray==0.19.0 rasterio==1.4.4 xarray==2026.9.0 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import sys

import numpy as np
import rasterio
import rioxarray
import xarray

centres = np.arange(40) + 0.5
heights = xarray.DataArray(
    np.zeros((40, 40)),
    coords={"y": 5400000.0 + centres[::-1], "x": 500000.0 + centres},
    dims=("y", "x"),
).rio.write_crs(32632)
heights[:, 30:] = 6.0  # a house along the eastern edge
heights.rio.to_raster("fine.tif")


def widths(model):
    """Return the width of a model of 10 m cells, and of the house in it, after reprojection."""
    coarse = model.coarsen(x=10, y=10).mean()
    again = coarse.rio.reproject(25832)  # the same map, by its European name
    left, _, right, _ = again.rio.bounds()
    cells = int((again[0] > 3.0).sum())
    coarse.rio.to_raster("coarse.tif")
    with rasterio.open("coarse.tif") as file:
        written = file.bounds.right - file.bounds.left
    return [round(float(one), 2) for one in (right - left, cells * (right - left) / 4, written)]


with rioxarray.open_rasterio("fine.tif") as file:
    from_file = widths(file[0].load())
in_memory = widths(heights)
print("rioxarray", rioxarray.__version__, "xarray", xarray.__version__)
print("expected: 40 m wide, with a house of 10 m; 40 m as a file")
print("seen, model from a file:   ", from_file)
print("seen, model made in memory:", in_memory)
as_found = in_memory == [40.0, 10.0, 40.0] and from_file == [31.0, 7.75, 40.0]
sys.exit(0 if as_found else "changed")
PYTHON
