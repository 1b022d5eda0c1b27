#!/usr/bin/env bash
# Gauges stand on a grid of 5 m, and those within 10 m of a window are looked for. `KDTree` has a
# search by radius (`query_ball_point`) and one for the nearest with a bound, which by its docstring
# returns neighbours "within this distance". One would guess that both have the same gauges. The
# radius takes in those at just 10 m, the bound leaves them out: of 13 gauges it gives 9, and a
# window whose nearest gauge is 10 m away has none, which is told by a distance of infinity.
# `count_neighbors` and `query_pairs` go with the radius, and so does the bound of shapely's
# `query_nearest`. Places measured at random never show it; places on a grid do it all the time.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq scipy==1.17.1 shapely==2.2.0 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import sys

import numpy as np
import scipy
import shapely
from scipy.spatial import KDTree

BOUND_M = 10.0
WINDOW = [0.0, 0.0]
gauges = [(5.0 * x, 5.0 * y) for x in range(-4, 5) for y in range(-4, 5)]
tree, window = KDTree(gauges), KDTree([WINDOW])
distances_m, _ = tree.query(WINDOW, k=len(gauges), distance_upper_bound=BOUND_M)
counts = {
    "query_ball_point": len(tree.query_ball_point(WINDOW, BOUND_M)),
    "count_neighbors": int(window.count_neighbors(tree, BOUND_M)),
    "query": int(np.isfinite(distances_m).sum()),
}
alone = KDTree([(BOUND_M, 0.0)])
nearest = {
    "query": float(alone.query(WINDOW, distance_upper_bound=BOUND_M)[0]),
    "query_ball_point": alone.query_ball_point(WINDOW, BOUND_M),
    "query_pairs": len(KDTree([WINDOW, (BOUND_M, 0.0)]).query_pairs(BOUND_M)),
    "shapely": shapely.STRtree([shapely.Point(BOUND_M, 0.0)])
    .query_nearest(shapely.Point(WINDOW), max_distance=BOUND_M)
    .tolist(),
}
print("scipy", scipy.__version__, "shapely", shapely.__version__)
print("expected: 13 gauges by each, and one gauge at 10 m that is found by each")
print("seen, gauges within 10 m:", counts)
print("seen, one gauge at 10 m:", nearest)
as_found = list(counts.values()) == [13, 13, 9]
as_found = as_found and list(nearest.values()) == [np.inf, [0], 1, [0]]
sys.exit(0 if as_found else "changed")
PYTHON
