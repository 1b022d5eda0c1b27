#!/usr/bin/env bash
# Houses have names, and momepy gives measures of shapes and streets by name. A table that has been
# sorted by height has the same number for each house, or street, as before, one would guess. It has
# with nearly all measures of momepy. With two, order counts, unless the names ascend.
# `centroid_corner_distance` tells how far corners are from the middle of a house, and gives houses
# the numbers of others: a hut of 4 by 3 m has 25 m here, and a hall of 40 by 30 m has 2.5 m.
# `describe_agg` sums up heights by street. With `q=(10, 90)` it leaves out the lowest and the highest
# tenth of each street, but takes the n-th house of the table for the one that is named n, to know
# its street: a tower of 100 m stays in, and a street of houses of 3 to 11 m has a mean of 17.8 m, not
# 7.5 m. Without `q` it is right. Names other than 0, 1, 2, ... are an error there, at least.
# There is no message. Release 1.0.0, which needs a newer Python, does the same. A `sort_index()`
# before helps.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq momepy==0.11.0 geopandas==1.2.0 libpysal==4.14.1 networkx==3.6.1 \
    numba==0.65.1 pandas==3.1.1 shapely==2.2.0 numpy==2.4.6 scipy==1.17.1
venv/bin/python -W ignore - <<'PYTHON'
import sys

import geopandas as gpd
import momepy
import pandas as pd
from shapely.geometry import box

print("momepy", momepy.__version__)
houses = gpd.GeoSeries([box(0, 0, 40, 30), box(50, 0, 54, 3)], index=["hall", "hut"])
corners_m = [
    momepy.centroid_corner_distance(houses[list(names)])["mean"].sort_index().to_dict()
    for names in (("hall", "hut"), ("hut", "hall"))
]
print("corners from the middle: expected {'hall': 25.0, 'hut': 2.5}, seen", *corners_m)

northern_m = [*(float(height) for height in range(3, 12)), 100.0]
southern_m = [*(float(height) for height in range(20, 29)), 100.0]
heights_m = pd.Series([*northern_m, *southern_m])
street = pd.Series(["northern"] * 10 + ["southern"] * 10)


def means(table, share):
    """Return the mean height by street."""
    return momepy.describe_agg(table, street[table.index], q=share)["mean"].round(1).to_dict()


by_height = heights_m.sort_values()
whole = [means(table, None) for table in (heights_m, by_height)]
inner = [means(table, (10, 90)) for table in (heights_m, by_height)]
print("mean heights: expected", whole[0], "seen, sorted by height:", whole[1])
print("from a tenth to nine tenths: expected", inner[0], "seen, sorted by height:", inner[1])
as_found = corners_m == [{"hall": 25.0, "hut": 2.5}, {"hall": 2.5, "hut": 25.0}]
as_found = as_found and whole[0] == whole[1] == {"northern": 16.3, "southern": 31.6}
as_found = as_found and inner[0] == {"northern": 7.5, "southern": 24.5}
as_found = as_found and inner[1] == {"northern": 17.8, "southern": 34.4}
sys.exit(0 if as_found else "changed")
PYTHON
