#!/usr/bin/env bash
# A block that has a house and a round tower, both extruded, is inserted with a scale of 2 in x and
# 3 in y. One would guess that house and tower keep their heights, which no scale changes. The house
# does. The tower becomes an ellipse, for which DXF has no thickness, and its height is gone without
# an error.
# An oval tank or tower of 12 m is then an outline without a height, and a program that gives such
# outlines a usual height has another obstacle in the way of the blast.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq ezdxf==1.4.5
venv/bin/python - <<'PYTHON'
import sys

import ezdxf

document = ezdxf.new()
block = document.blocks.new("SITE")
block.add_lwpolyline([(0, 0), (9, 0), (9, 9)], close=True, dxfattribs={"thickness": 12.0})
block.add_circle((20, 0), 4.0, dxfattribs={"thickness": 12.0})
insert = document.modelspace().add_blockref("SITE", (0, 0), dxfattribs={"xscale": 2, "yscale": 3})
heights = {}
for entity in insert.virtual_entities():
    has_thickness = entity.dxf.is_supported("thickness")
    heights[entity.dxftype()] = entity.dxf.thickness if has_thickness else None
print("ezdxf", ezdxf.__version__)
print("expected: both are 12 high")
print("seen:", heights)
sys.exit(0 if heights == {"LWPOLYLINE": 12.0, "ELLIPSE": None} else "changed")
PYTHON
