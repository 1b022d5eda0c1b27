#!/usr/bin/env bash
# A hatch shows a block with a courtyard and a house in the courtyard, as three outlines in each other
# and the style "nested", by which CAD programs fill every other ring. One would guess that ezdxf's
# `geo.proxy`, which makes GeoJSON of drawings, has block and house, or at least both as two hatches
# would be. The house is left out, without a message: the first hole of a polygon counts, what is in
# it does not. ezdxf's own rings, as `from_hatch` gives them, are three.
# Two blocks side by side in one hatch are two polygons, except in the style "ignore", which is about
# what is inside: there the second is left out too.
# The courtyard is open ground then, for the people who stand in it and the blast that comes in.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq ezdxf==1.4.5 shapely==2.2.0 numpy==2.4.6
venv/bin/python -W error - <<'PYTHON'
import sys

import ezdxf
import shapely
from ezdxf.addons import geo
from ezdxf.path import from_hatch
from shapely.geometry import shape

NESTED, OUTERMOST, IGNORE = 0, 1, 2
EXTERNAL, OUTER, DEFAULT = 1, 16, 0
modelspace = ezdxf.new().modelspace()


def hatch(style, *squares):
    """Return a hatch of squares from one corner, x = y, to another, with their kinds."""
    made = modelspace.add_hatch(dxfattribs={"hatch_style": style})
    for low, high, kind in squares:
        corners = [(low, low), (high, low), (high, high), (low, high)]
        made.paths.add_polyline_path(corners, is_closed=True, flags=kind)
    return made


def area(made):
    return shape(geo.proxy(made).__geo_interface__).area


courtyard = [(0, 40, EXTERNAL), (10, 30, OUTER), (15, 25, DEFAULT)]
beside = [(0, 40, EXTERNAL), (50, 70, EXTERNAL)]
block = hatch(NESTED, *courtyard)
rings = sum(1 for ring in from_hatch(block))
alone = area(hatch(NESTED, (15, 25, EXTERNAL)))
seen = {
    "nested": area(block),
    "beside, outermost": area(hatch(OUTERMOST, *beside)),
    "beside, ignore": area(hatch(IGNORE, *beside)),
}
print("ezdxf", ezdxf.__version__, "shapely", shapely.__version__)
print("rings of the hatch:", rings, "- the house by itself:", alone, "m2")
print("expected: nested 1300 m2 (1600 less 400 and the house of 100); beside 2000 m2 in both")
print("seen:", seen)
as_found = seen == {"nested": 1200.0, "beside, outermost": 2000.0, "beside, ignore": 1600.0}
sys.exit(0 if as_found and rings == 3 and alone == 100.0 else "changed")
PYTHON
