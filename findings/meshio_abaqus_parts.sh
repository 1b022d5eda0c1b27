#!/usr/bin/env bash
# An input file of Abaqus has a wall and a roof as two parts, each with corners that are numbered
# from 1, and an assembly that says where they stand, as Abaqus/CAE writes models. One would guess
# that meshio reads both, at their places, or says that it knows no parts. It reads the elements of
# both and keeps the corners of the last part alone. The wall's element points to corners of the
# roof now, so that there are two roofs and no wall, and no message. What the assembly says, a wall
# 10 m further on here, is passed over, and so is a second wall of the same part.
# The number of elements is right, shapes and places are not. A model of a single part lacks only
# its place.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq meshio==5.3.5 numpy==2.4.6
cat > site.inp <<'TEXT'
*Heading
*Part, name=wall
*Node
1, 0.0, 0.0, 0.0
2, 0.5, 0.0, 0.0
3, 0.5, 4.0, 0.0
4, 0.0, 4.0, 0.0
5, 0.0, 0.0, 3.0
6, 0.5, 0.0, 3.0
7, 0.5, 4.0, 3.0
8, 0.0, 4.0, 3.0
*Element, type=C3D8
1, 1, 2, 3, 4, 5, 6, 7, 8
*End Part
*Part, name=roof
*Node
1, 0.0, 0.0, 3.0
2, 8.0, 0.0, 3.0
3, 8.0, 4.0, 3.0
4, 0.0, 4.0, 3.0
5, 0.0, 0.0, 3.2
6, 8.0, 0.0, 3.2
7, 8.0, 4.0, 3.2
8, 0.0, 4.0, 3.2
*Element, type=C3D8
1, 1, 2, 3, 4, 5, 6, 7, 8
*End Part
*Assembly, name=site
*Instance, name=roof-1, part=roof
*End Instance
*Instance, name=wall-1, part=wall
10.0, 0.0, 0.0
*End Instance
*End Assembly
TEXT
venv/bin/python -W ignore - <<'PYTHON'
import sys

import meshio
import numpy as np

mesh = meshio.read("site.inp")
boxes = [mesh.points[element] for block in mesh.cells for element in block.data]
sizes = [np.ptp(corners, axis=0).round(3).tolist() for corners in boxes]
places = [corners.min(axis=0).round(3).tolist() for corners in boxes]
print("meshio", meshio.__version__)
print("expected: sizes of a wall and of a roof (m) [[0.5, 4.0, 3.0], [8.0, 4.0, 0.2]],")
print("          lowest corners [[10.0, 0.0, 0.0], [0.0, 0.0, 3.0]], 16 corners; or an error")
print("seen:", len(mesh.points), "corners, sizes", sizes, "lowest corners", places)
roof = ([8.0, 4.0, 0.2], [0.0, 0.0, 3.0])
as_found = len(mesh.points) == 8 and list(zip(sizes, places)) == [roof, roof]
sys.exit(0 if as_found else "changed")
PYTHON
