#!/usr/bin/env bash
# Two streets have 300 windows each, and bytes say which of them a blast has broken: 60 and 15. The
# share by street is the sum by street over the count by street. xarray names two packages that make
# groups faster, flox and numbagg, and uses them as soon as they are installed. One would guess that
# they change no number. The count becomes 44, since numbagg counts in the type of what it counts,
# and a byte ends at 255: of the first street 136 per cent are broken. There is no message.
# Counts of two bytes begin anew at 65,536. The sum is right, but wraps as well if one says
# `skipna=True`, for whole numbers of 32 bits, too. Without groups all is right. The option
# `use_numbagg=False` changes nothing, since it is flox that asks numbagg; `use_flox=False` helps.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq xarray==2026.9.0 flox==0.11.2 numbagg==0.9.6 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import importlib.metadata
import sys

import numpy as np
import xarray as xr

WINDOWS, BROKEN = 300, (60, 15)
street = np.repeat([0, 1], WINDOWS)
flags = np.concatenate([np.arange(WINDOWS) < broken for broken in BROKEN]).astype(np.uint8)


def by_street(values):
    by_window = xr.DataArray(values, dims="window", coords={"street": ("window", street)})
    return by_window.groupby("street")


def numbers():
    """Return counts, sums, and sums with `skipna=True` of bytes and of 32 bits, by street."""
    broken = by_street(flags)
    areas_mm2 = by_street(np.full(2 * WINDOWS, 1_500_000_000, np.int32))
    found = broken.count(), broken.sum(), by_street(flags * 10).sum(skipna=True)
    return [kind.values.tolist() for kind in (*found, areas_mm2.sum(skipna=True))]


plain = [[300, 300], [60, 15], [600, 150], [450_000_000_000] * 2]
seen = {}
for without in ({"use_flox": False}, {}, {"use_numbagg": False}):
    with xr.set_options(**without):
        seen[str(without)] = numbers()
versions = [f"{name} {importlib.metadata.version(name)}" for name in ("xarray", "flox", "numbagg")]
print(*versions)
print("expected: counts, sums, sums of ten times the bytes and of 32 bits:", plain)
for without, found in seen.items():
    print("seen, options", without, found)
    print("      shares (per cent):", [round(100 * s / n) for s, n in zip(found[1], found[0])])
wrapped = [[44, 44], [60, 15], [88, 150], [-971_566_080] * 2]
flox_off, both_on, numbagg_off = seen.values()
as_found = flox_off == plain and both_on == numbagg_off == wrapped
sys.exit(0 if as_found else "changed")
PYTHON
