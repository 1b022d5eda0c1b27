#!/usr/bin/env bash
# A relation of the kind multipolygon has outer rings, and inner ones for its courtyards. If an
# extract has lost the outer ring, the inner one is left. One would guess that such a relation gives
# no area, or an error. It gives an area, filled: the roles of members do not count, only how rings
# lie in each other.
# The courtyard of a building then stands there as a building, and the house around it, that shields
# the courtyard, is gone.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq osmium==4.3.2 shapely==2.2.0
venv/bin/python - <<'PYTHON'
import importlib.metadata
import sys

import osmium
import shapely

PLACES = [(0.0, 0.0), (0.001, 0.0), (0.001, 0.001), (0.0, 0.001)]
nodes = "".join(f'<node id="{k}" lon="{x}" lat="{y}"/>' for k, (x, y) in enumerate(PLACES, 1))
refs = "".join(f'<nd ref="{k}"/>' for k in (1, 2, 3, 4, 1))
member = '<member type="way" ref="10" role="inner"/>'
tags = '<tag k="type" v="multipolygon"/><tag k="building" v="yes"/>'
with open("map.osm", "w") as file:
    file.write(f'<osm version="0.6">{nodes}<way id="10">{refs}</way>')
    file.write(f'<relation id="5">{member}{tags}</relation></osm>')
factory = osmium.geom.WKTFactory()
found = [
    shapely.from_wkt(factory.create_multipolygon(each))
    for each in osmium.FileProcessor("map.osm").with_areas()
    if each.is_area()
]
print("osmium", importlib.metadata.version("osmium"))
print("expected: no area, for the only ring is a courtyard")
print("seen:", [each.wkt for each in found])
sys.exit(0 if [each.area > 0.0 for each in found] == [True] else "changed")
PYTHON
