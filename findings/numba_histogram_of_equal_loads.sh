#!/usr/bin/env bash
# A compiled function counts the peak loads of runs in five bins between the smallest and the
# largest, by `np.histogram`. Behind a wall all runs have the same load. One would guess that the
# counts add up to the number of runs, as they do in NumPy, which makes the bins a little wider than
# the loads if these are equal. Numba makes bins without any width, and counts nothing: five zeros
# for eight runs, as if there had been none. There is no message, and one run alone is not counted
# either. With bins that are given as edges, [0, 3, 3], both count three loads of 3 in the last one.
# Shares by bin are then zero divided by zero, and a cumulated share never comes to one.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq numba==0.68.1 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import sys

import numba
import numpy as np


def counts(loads_kpa):
    return np.histogram(loads_kpa, 5)[0]


def counts_by_edges(loads_kpa):
    return np.histogram(loads_kpa, np.array([0.0, 3.0, 3.0]))[0]


runs = {
    "eight that differ": np.array([1.0, 2.0, 3.0, 3.0, 4.0, 5.0, 5.0, 6.0]),
    "eight equal ones": np.full(8, 101.3),
    "one": np.array([101.3]),
    "three equal whole numbers": np.array([3, 3, 3]),
}
compiled, compiled_by_edges = numba.njit(counts), numba.njit(counts_by_edges)
seen = {}
print("numba", numba.__version__, "numpy", np.__version__)
for name, loads_kpa in runs.items():
    seen[name] = counts(loads_kpa).tolist(), compiled(loads_kpa).tolist()
    print(f"{name}: expected, by NumPy: {seen[name][0]}; seen, compiled: {seen[name][1]}")
three = np.full(3, 3.0)
by_edges = counts_by_edges(three).tolist(), compiled_by_edges(three).tolist()
print("edges given:", *by_edges)
different, *equal = seen.values()
as_found = different[0] == different[1] and by_edges[0] == by_edges[1] == [0, 3]
as_found = as_found and [sum(plain) for plain, _ in equal] == [8, 1, 3]
as_found = as_found and all(found == [0] * 5 for _, found in equal)
sys.exit(0 if as_found else "changed")
PYTHON
