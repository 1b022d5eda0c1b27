#!/usr/bin/env bash
# A map has one building of two wings that overlap, and one with a courtyard that sticks out of it
# a little. One would guess that `shapely.make_valid` covers both wings, and takes the courtyard off.
# It draws all rings together, and what lies in an even number of them is outside: the common corner
# of the wings becomes open ground, and the rest of the courtyard in front of the house becomes a
# house. The result is valid, so that nothing else warns of it. `method="structure"` does as guessed.
# A blast enters through the hole between the wings, and is stopped by a wall that is not there.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq shapely==2.2.0
venv/bin/python - <<'PYTHON'
import sys

import shapely

wings = shapely.MultiPolygon([shapely.box(0, 0, 20, 20), shapely.box(10, 10, 30, 30)])
court = shapely.box(10, 10, 24, 24).exterior
house = shapely.Polygon(shapely.box(0, 0, 20, 20).exterior, [court])
usual = [shapely.make_valid(each).area for each in (wings, house)]
other = [shapely.make_valid(each, method="structure").area for each in (wings, house)]
print("shapely", shapely.__version__, "GEOS", shapely.geos_version_string)
print("expected: 700 and 300")
print("seen:", usual, '- with method="structure":', other)
sys.exit(0 if usual == [600.0, 396.0] and other == [700.0, 300.0] else "changed")
PYTHON
