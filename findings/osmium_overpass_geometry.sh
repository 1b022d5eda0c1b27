#!/usr/bin/env bash
# The Overpass API writes OpenStreetMap XML with places in the ways themselves, if it is asked for
# geometry (`out geom`) or for centres (`out center`). One would guess that osmium, which has a
# field for the place of each node of a way, reads all of it. It reads the places of ways. It gives
# no areas of them, and it refuses the whole file for a centre, or for the places in the members of
# a relation.
# Queries of this kind are the usual way to fetch the buildings of one site, and courtyards are
# relations.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq osmium==4.3.2
venv/bin/python - <<'PYTHON'
import importlib.metadata
import sys

import osmium

PLACES = [(0.0, 0.0), (0.001, 0.0), (0.001, 0.001), (0.0, 0.001), (0.0, 0.0)]
IDS = (1, 2, 3, 4, 1)
refs = "".join(
    f'<nd ref="{k}" lon="{x}" lat="{y}"/>' for k, (x, y) in zip(IDS, PLACES, strict=True)
)
way = f'<way id="10">{refs}<tag k="building" v="yes"/></way>'
centre = '<way id="10"><center lon="0.0005" lat="0.0005"/><nd ref="1"/></way>'
places = "".join(f'<nd lon="{x}" lat="{y}"/>' for x, y in PLACES)
relation = f'<relation id="5"><member type="way" ref="10" role="outer">{places}</member></relation>'


def read(content):
    with open("map.osm", "w") as file:
        file.write(f'<osm version="0.6">{content}</osm>')
    try:
        items = osmium.FileProcessor("map.osm")
        known = sum(node.location.valid() for each in items for node in each.nodes)
        areas = sum(each.is_area() for each in osmium.FileProcessor("map.osm").with_areas())
    except RuntimeError as error:
        return str(error)
    return f"{known} places, {areas} areas"


seen = [read(way), read(centre), read(relation)]
print("osmium", importlib.metadata.version("osmium"))
print("expected: 5 places and 1 area of the way; the others are read, or their additions passed over")
print("seen:", seen)
wanted = [
    "5 places, 0 areas",
    "Unknown element in <way>: center",
    "No element inside <member> allowed",
]
sys.exit(0 if seen == wanted else "changed")
PYTHON
