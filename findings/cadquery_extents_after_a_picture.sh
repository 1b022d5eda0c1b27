#!/usr/bin/env bash
# Extents of a solid are measured before and after it is drawn, or written as STL. One would guess
# that a picture changes nothing of what it shows. CadQuery keeps the triangles of the picture with
# the solid, and from then on takes its extents from them, widened by how far triangles may be off:
# a sphere of 10 m is 11.0, 10.7 and 11.4 m wide, no longer the same in all directions. Its volume
# stays that of the sphere, and so nothing looks wrong. Flat walls keep their extents.
# A script that measures a round tank or bollard gives another clearance if it shows it first, and
# the coarser the picture, the more so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq cadquery==2.8.0
venv/bin/python -W ignore - <<'PYTHON'
import importlib.metadata
import sys

import cadquery


def told(solid):
    box = solid.BoundingBox()
    return [round(length, 1) for length in (box.xlen, box.ylen, box.zlen, solid.Volume())]


seen = {}
plane = cadquery.Workplane()
solids = {"sphere": plane.sphere(5.0), "wall": plane.box(10.0, 0.5, 3.0)}
for name, solid in solids.items():
    before = told(solid.val())
    cadquery.exporters.export(solid, f"{name}.stl", tolerance=1.0, angularTolerance=1.0)
    seen[name] = before, told(solid.val())
print("cadquery", importlib.metadata.version("cadquery"))
print("expected: extents and volume that stay")
for name, (before, after) in seen.items():
    print("seen:", name, before, "- once written:", after)
as_found = seen["sphere"] == ([10.0, 10.0, 10.0, 523.6], [11.0, 10.7, 11.4, 523.6])
as_found = as_found and seen["wall"] == ([10.0, 0.5, 3.0, 15.0],) * 2
sys.exit(0 if as_found else "changed")
PYTHON
