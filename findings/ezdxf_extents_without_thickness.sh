#!/usr/bin/env bash
# A drawing's houses are often outlines with a thickness, which CAD programs show as solids. One
# would guess that the extents that ezdxf gives of such a house reach to its roof. They end at its
# floor: the thickness is no part of them.
# Who takes heights of buildings from the extents of their entities has a site of flat houses, that
# shield nothing and are hit by nothing.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq ezdxf==1.4.5
venv/bin/python - <<'PYTHON'
import sys

import ezdxf
from ezdxf import bbox

space = ezdxf.new().modelspace()
outline = [(0, 0), (20, 0), (20, 10), (0, 10)]
house = space.add_lwpolyline(outline, close=True, dxfattribs={"elevation": 1.0, "thickness": 9.0})
extents = bbox.extents([house])
print("ezdxf", ezdxf.__version__)
print("expected: heights from 1 to 10")
print("seen:", extents.extmin.z, "to", extents.extmax.z)
sys.exit(0 if (extents.extmin.z, extents.extmax.z) == (1.0, 1.0) else "changed")
PYTHON
