#!/usr/bin/env bash
# The elements of an OpenStreetMap file may stand in any order, as XML has them. One would guess
# that areas are built, or that an error says that they cannot be. Where the ways stand before their
# nodes there is neither: the file is read to its end and has no area. A script that writes houses
# before their corners makes such a file. A map without a single building looks like open ground, on
# which every blast is computed without its streets and courtyards.
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

PLACES = [(0.0, 0.0), (0.001, 0.0), (0.001, 0.001), (0.0, 0.001)]
nodes = "".join(f'<node id="{k}" lon="{x}" lat="{y}"/>' for k, (x, y) in enumerate(PLACES, 1))
refs = "".join(f'<nd ref="{k}"/>' for k in (1, 2, 3, 4, 1))
way = f'<way id="10">{refs}<tag k="building" v="yes"/></way>'


def areas(content):
    with open("map.osm", "w") as file:
        file.write(f'<osm version="0.6">{content}</osm>')
    return sum(each.is_area() for each in osmium.FileProcessor("map.osm").with_areas())


seen = areas(nodes + way), areas(way + nodes)
print("osmium", importlib.metadata.version("osmium"))
print("expected: one area in both orders, or an error")
print("seen: nodes first", seen[0], "- ways first", seen[1])
sys.exit(0 if seen == (1, 0) else "changed")
PYTHON
