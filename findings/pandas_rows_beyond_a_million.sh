#!/usr/bin/env bash
# Northings of points are whole metres, kept in four bytes, and what is left of a metre is in single
# precision. pandas adds them up to doubles, as NumPy does: 5,412,345.25 m. It names a package that
# makes this faster, numexpr, and uses it as soon as it is installed. One would guess that this
# changes no number. It does in a table of more than a million rows: the sum is in single precision
# there, whose steps are 0.5 m, and is 5,412,345.0 or .5. With northings in eight bytes as well.
# So the rows of a table have other numbers than the first half of it, or than each row by itself.
# Counts go the other way: in four bytes their product with 7 wraps below a million rows, and does
# not above. Squared reciprocals of whole numbers (`n ** -2`) are an error below, and zero above.
# That single precision with a constant becomes double above is known to the developers (issue 61951);
# we found nothing on whole numbers, which lose digits. `pd.set_option("compute.use_numexpr", False)`
# helps. There is no message.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq pandas==3.1.1 numexpr==2.14.2 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import sys

import numexpr
import numpy as np
import pandas as pd

LIMIT = 1_000_000
north_m = np.full(LIMIT + 1, 5_412_345, np.int32)
rest_m = np.tile(np.array([0.2, 0.3, 0.7, 0.8], np.float32), LIMIT // 4 + 1)[: LIMIT + 1]
points = pd.DataFrame({"north": north_m, "rest": rest_m, "count": np.full(LIMIT + 1, 400_000_000)})
points["count"] = points["count"].astype(np.int32)


def sums(table):
    """Return the type of the sums, and the first four."""
    found = table["north"] + table["rest"]
    return str(found.dtype), [round(float(value), 2) for value in found[:4]]


def reciprocals(table):
    """Return the first squared reciprocal, or the name of the error."""
    try:
        return float((table["count"] ** -2).iloc[0])
    except ValueError as error:
        return type(error).__name__


print("pandas", pd.__version__, "numexpr", numexpr.__version__)
seen = {rows: sums(points[:rows]) for rows in (4, LIMIT, LIMIT + 1)}
exact = ("float64", [5412345.2, 5412345.3, 5412345.7, 5412345.8])
for rows, found in seen.items():
    print(f"{rows} rows: expected {exact}, seen {found}")
products = [int((points["count"][:rows] * 7).iloc[0]) for rows in seen]
powers = [reciprocals(points[:rows]) for rows in seen]
print("400,000,000 times 7:", products, "to the power of -2:", powers)
pd.set_option("compute.use_numexpr", False)
print("without numexpr:", sums(points))
as_found = seen[4] == seen[LIMIT] == sums(points) == exact
as_found = as_found and seen[LIMIT + 1] == ("float32", [5412345.0, 5412345.5, 5412345.5, 5412346.0])
as_found = as_found and products == [-1_494_967_296, -1_494_967_296, 2_800_000_000]
sys.exit(0 if as_found and powers == ["ValueError", "ValueError", 0.0] else "changed")
PYTHON
