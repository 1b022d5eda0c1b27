#!/usr/bin/env bash
# The common area of two plans is empty where one of them is empty, one would guess. It is so for a
# polygon. Where the other is a collection of areas and lines, the intersection with an empty
# polygon raises an error of the inside of GEOS, while that with any other polygon is found.
# Plans of buildings become such collections without anybody's asking: the difference of two plans
# whose walls run along each other has lines where rounding leaves no area. A program that buffers a
# thin wall inwards, to nothing, and cuts with the result then ends at some buildings turned against
# the axes, and at none in its tests of upright boxes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq shapely==2.2.0
venv/bin/python - <<'PYTHON'
import sys

import shapely

empty, house = shapely.Polygon(), shapely.box(1, 1, 2, 2)
mixed = shapely.GeometryCollection([shapely.box(0, 0, 4, 4), shapely.LineString([(6, 0), (9, 0)])])
print("shapely", shapely.__version__, "GEOS", shapely.geos_version_string)
print("expected: the intersection with an empty polygon is empty")
print("seen of a polygon:", shapely.intersection(house, empty))
print("seen of a collection and a house:", shapely.intersection(mixed, house))
try:
    seen = shapely.intersection(mixed, empty)
except shapely.errors.GEOSException as error:
    print("seen of a collection:", error)
    sys.exit(0)
sys.exit(f"changed: {seen}")
PYTHON
