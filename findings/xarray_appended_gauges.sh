#!/usr/bin/env bash
# Records of shots are appended to a Zarr store with `to_zarr(append_dim="shot")`. The gauges of the
# second shot were read in another order. One would guess that xarray puts them in order by their
# names, as `concat` does, or refuses them, as it does if there is one more. It writes the names of
# the second shot over those of the first, whose values stay: the northern gauge has the pressure of
# the southern one. With `mode="a-"` the names of the first stay, and the second shot is wrong.
# The same happens to distances: after a shot at 10, 20 and 40 m, the peaks of one at 5, 10 and 20 m
# are told as those at 10, 20 and 40 m.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq xarray==2026.9.0 zarr==3.1.6 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import sys

import xarray as xr
import zarr


def shot(number, gauges, peaks_kpa):
    return xr.Dataset(
        {"peak_kpa": (("shot", "gauge"), [peaks_kpa])},
        coords={"shot": [number], "gauge": gauges},
    )


first, second = shot(1, ["north", "south"], [40.0, 10.0]), shot(2, ["south", "north"], [12.0, 45.0])


def north(records):
    return records.peak_kpa.sel(gauge="north").values.tolist()


seen = {}
for mode in ("a", "a-"):
    first.to_zarr(f"shots{mode}.zarr")
    second.to_zarr(f"shots{mode}.zarr", append_dim="shot", mode=mode)
    seen[mode] = north(xr.open_zarr(f"shots{mode}.zarr"))
expected = north(xr.concat([first, second], dim="shot", join="outer"))
try:
    shot(3, ["north", "south", "west"], [1.0, 2.0, 3.0]).to_zarr("shotsa.zarr", append_dim="shot")
    third = "appended"
except ValueError:
    third = "refused"
print("xarray", xr.__version__, "zarr", zarr.__version__)
print("expected: peaks in the north of", expected, "kPa")
print("seen:", seen, "- a shot with a third gauge is", third)
as_found = seen == {"a": [10.0, 45.0], "a-": [40.0, 12.0]} and expected == [40.0, 45.0]
sys.exit(0 if as_found and third == "refused" else "changed")
PYTHON
