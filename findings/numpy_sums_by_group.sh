#!/usr/bin/env bash
# Readings kept in half precision take a quarter of the memory. Their sum in double precision is
# `sum(dtype=float64)`, which converts a few thousand of them at a time: 128 MB of readings need less
# than 1 MB more. One would guess that `np.add.reduceat`, the sums by group, does the same, since it
# has the same `dtype` and far fewer results. It converts all readings first, and needs four times
# their memory for it.
# Without `dtype` the sums by group need nothing, but are of half precision, and infinite beyond
# 65,504. A table of 8 GB needs 32 GB more so.
# What helps: `sum(axis=0, dtype=float64)` of each group, in a loop.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq numpy==2.4.6
venv/bin/python -W error - <<'PYTHON'
import sys
import tracemalloc

import numpy as np

READINGS, GROUP = 64_000_000, 1_000
readings = np.ones(READINGS, dtype=np.float16)
firsts = np.arange(0, READINGS, GROUP)


def further_mb(sums):
    """Return the memory that sums take while they are made, without what they return."""
    tracemalloc.reset_peak()
    before = tracemalloc.get_traced_memory()[0]
    found = sums()
    return (tracemalloc.get_traced_memory()[1] - before - found.nbytes) / 1e6


tracemalloc.start()
seen = {
    "sum": further_mb(lambda: readings.sum(dtype=np.float64)),
    "sum of rows": further_mb(lambda: readings.reshape(-1, GROUP).sum(axis=1, dtype=np.float64)),
    "reduceat": further_mb(lambda: np.add.reduceat(readings, firsts, dtype=np.float64)),
    "reduceat in half precision": further_mb(lambda: np.add.reduceat(readings, firsts)),
}
print("numpy", np.__version__, "- readings:", readings.nbytes / 1e6, "MB")
print("expected: less than 1 MB more for all four")
print("seen, MB more:", {name: round(own, 1) for name, own in seen.items()})
small = all(own < 1.0 for name, own in seen.items() if name != "reduceat")
sys.exit(0 if small and 500.0 < seen["reduceat"] < 530.0 else "changed")
PYTHON
