#!/usr/bin/env bash
# In a scene of glTF a mesh is placed by a node, which may scale it: a wall of 1 m drawn once stands
# as walls of many lengths. One would guess that the volume and the area of a scene are those of what
# stands there, as its bounds are, and as its `to_mesh` has them. They count each place of a mesh,
# and leave its scale out: walls three times as large in all directions have the volume of the mesh
# as it was drawn.
# Masses of barriers by the volume of a scene, and glass by its area, are then wrong by the scale,
# which for a model in millimetres is a thousand in each direction.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq trimesh==5.2.0
venv/bin/python - <<'PYTHON'
import io
import sys

import numpy as np
import trimesh

scene = trimesh.Scene()
scene.add_geometry(trimesh.creation.box((1.0, 1.0, 1.0)), transform=np.diag([3.0, 3.0, 3.0, 1.0]))
read = trimesh.load_scene(io.BytesIO(scene.export(file_type="glb")), file_type="glb")
mesh = read.to_mesh()
of_mesh = [float(value) for value in (mesh.volume, mesh.area)]
of_scene = [float(value) for value in (read.volume, read.area)]
print("trimesh", trimesh.__version__)
print("expected: volume 27 and area 54; the extents are", read.extents.tolist())
print("seen: scene", of_scene, "- its mesh", of_mesh)
as_found = np.allclose(of_scene, (1.0, 6.0)) and np.allclose(of_mesh, (27.0, 54.0))
sys.exit(0 if as_found else "changed")
PYTHON
