#!/usr/bin/env bash
# `set_precision` puts an outline on a grid, and later operations keep to a grid. The docstring says
# that they take the finer one of their two geometries, so one would guess that the common area of a
# plot and a house is one number. It is the grid of the first that counts. The house, drawn to the
# decimetre, covers 10.89 m2 of a plot on a grid of 1 m. The other way round it is moved to whole
# metres first, and covers 16.
# Covered shares and overlaps then hang on which outline was written first, and `a - b` and `b & a`
# do not fit together.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq shapely==2.2.0
venv/bin/python - <<'PYTHON'
import sys

import shapely

plot = shapely.set_precision(shapely.box(0, 0, 10, 10), 1.0)
house = shapely.box(0.3, 0.3, 3.6, 3.6)
first, second = (
    round(shapely.intersection(*pair).area, 6) for pair in ((plot, house), (house, plot))
)
print("shapely", shapely.__version__, "GEOS", shapely.geos_version_string)
print("expected: 10.89 both ways; the house is in the plot:", shapely.contains(plot, house))
print("seen: plot & house", first, "- house & plot", second)
sys.exit(0 if (first, second) == (16.0, 10.89) else "changed")
PYTHON
