#!/usr/bin/env bash
# Two sites are one file of CityJSON each, in one coordinate system, and number their houses from 1.
# One would guess that `merge` of cjio keeps all houses under new names, or refuses equal ones. It
# takes equal names for the same house: of house 1 in the second file nothing is kept if both are in
# the same level of detail. If they are not, it becomes a second shape of the first house, which
# stands at two places then, 100 m apart, with the attributes of the first.
# There is no message, and what is near the charge at the second site is missing or has the height
# of another house. Names that begin with the site's own keep all.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq cjio==0.10.1 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import importlib.metadata
import sys

from cjio.cityjson import CityJSON

FACES = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]


def site(name, west_m, height_m, level):
    """Return a site of one house, 10 m by 10 m."""
    plan = [(0, 0), (10, 0), (10, 10), (0, 10)]
    corners = [[(west_m + x) * 1000, y * 1000, z * 1000] for z in (0, height_m) for x, y in plan]
    shape = {"type": "Solid", "lod": level, "boundaries": [[[list(face)] for face in FACES]]}
    house = {"type": "Building", "attributes": {"height": height_m}, "geometry": [shape]}
    content = {
        "type": "CityJSON",
        "version": "2.0",
        "transform": {"scale": [0.001] * 3, "translate": [500000.0, 5000000.0, 0.0]},
        "metadata": {"referenceSystem": "https://www.opengis.net/def/crs/EPSG/0/25832"},
        "CityObjects": {name: house},
        "vertices": corners,
    }
    return CityJSON(j=content)


def merged(name, level):
    """Return, of each shape, its house, height by attribute, place (m) and height (m)."""
    model = site("house-1", 0, 10, "2.2")
    model.merge([site(name, 100, 20, level)])
    model.decompress()
    shapes = []
    for found, house in model.j["CityObjects"].items():
        for shape in house["geometry"]:
            numbers = {corner for (face,) in shape["boundaries"][0] for corner in face}
            places = [model.j["vertices"][number] for number in numbers]
            west, top = min(p[0] for p in places), max(p[2] for p in places)
            shapes.append((found, house["attributes"]["height"], west - 500000.0, top))
    return shapes


first = ("house-1", 10, 0.0, 10.0)
seen = {
    "other names": merged("east-1", "2.2"),
    "the same name and level": merged("house-1", "2.2"),
    "the same name": merged("house-1", "1.2"),
}
print("cjio", importlib.metadata.version("cjio"))
print("expected: house of 10 m and house of 20 m that stands 100 m east, under two names")
for case, shapes in seen.items():
    print("seen:", case, shapes)
as_found = seen["other names"] == [first, ("east-1", 20, 100.0, 20.0)]
as_found = as_found and seen["the same name and level"] == [first]
as_found = as_found and seen["the same name"] == [first, ("house-1", 10, 100.0, 20.0)]
sys.exit(0 if as_found else "changed")
PYTHON
