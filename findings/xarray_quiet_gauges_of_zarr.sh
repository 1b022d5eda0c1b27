#!/usr/bin/env bash
# Peak pressures of four gauges were written to a Zarr store in format 2, that of zarr before its
# release 3: two gauges behind a wall have zero, two have 10 and 20 kPa. One would guess that xarray
# reads four numbers, as zarr does. It reads two, and NaN for the quiet ones. A Zarr array has a
# fill value, the one of chunks that were never written, which is zero unless one says otherwise.
# For format 2 xarray takes it for the mark of missing values, for format 3 it does not.
# Means leave NaN out: the mean is 15 kPa and not 7.5, and the lowest peak is 10 kPa. There is no
# message. Stores that xarray has written itself are right, and so are those without a zero.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq xarray==2026.9.0 zarr==3.1.6 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import sys

import numpy as np
import xarray
import zarr

PEAKS = np.array([0.0, 0.0, 10.0, 20.0])  # kPa


def read_back(form):
    """Return the peaks as zarr and as xarray read them, and the mean by xarray."""
    store = f"peaks{form}.zarr"
    group = zarr.open_group(store, mode="w", zarr_format=form)
    names = {"dimension_names": ["gauge"]} if form == 3 else {}
    peaks = group.create_array("peak", shape=(4,), chunks=(4,), dtype="f8", **names)
    if form == 2:
        peaks.attrs["_ARRAY_DIMENSIONS"] = ["gauge"]
    peaks[:] = PEAKS
    with xarray.open_zarr(store, consolidated=False) as found:
        peak = found["peak"].load()
    by_zarr = zarr.open_group(store, mode="r")["peak"][:].tolist()
    return by_zarr, peak.values.tolist(), float(peak.mean())


seen = {form: read_back(form) for form in (2, 3)}
print("xarray", xarray.__version__, "zarr", zarr.__version__)
print("expected: peaks", PEAKS.tolist(), "by both, and a mean of", PEAKS.mean())
for form, (by_zarr, by_xarray, mean) in seen.items():
    print(f"seen, format {form}: zarr {by_zarr}, xarray {by_xarray}, mean {mean}")
as_found = all(found[0] == PEAKS.tolist() for found in seen.values())
as_found = as_found and str(seen[2][1:]) == "([nan, nan, 10.0, 20.0], 15.0)"
as_found = as_found and seen[3][1:] == (PEAKS.tolist(), 7.5)
sys.exit(0 if as_found else "changed")
PYTHON
