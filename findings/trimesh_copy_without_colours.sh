#!/usr/bin/env bash
# A copy of a mesh looks like the mesh, one would guess. trimesh keeps the colours of corners in two
# ways: a mesh of a glTF file without a material has them as its colours, and copies keep them. With
# a material, be it one without any key, they are an attribute of its texture, which a copy has not:
# no error, and no colours. A program that copies meshes to move them, as out of the axes of glTF,
# shows the loads on walls in the colour of the material, though the file has them.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq trimesh==5.2.0
venv/bin/python - <<'PYTHON'
import base64
import json
import sys

import numpy as np
import trimesh


def document(has_material):
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype="<f4")
    colours = np.array([[255, 0, 0, 255]] * 3, dtype="u1")
    content = corners.tobytes() + colours.tobytes()
    primitive = {"attributes": {"POSITION": 0, "COLOR_0": 1}}
    if has_material:
        primitive["material"] = 0
    found = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
             "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5121, "normalized": True, "count": 3,
             "type": "VEC4"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 12},
        ],
        "buffers": [
            {"byteLength": len(content), "uri": "data:application/octet-stream;base64,"
             + base64.b64encode(content).decode()},
        ],
    }
    if has_material:
        found["materials"] = [{}]
    return found


def colours_of(mesh):
    if isinstance(mesh.visual, trimesh.visual.ColorVisuals):
        return mesh.visual.vertex_colors[:1].tolist()
    return {key: values[:1].tolist() for key, values in mesh.visual.vertex_attributes.items()}


seen = {}
for has_material in (False, True):
    name = f"with_{has_material}.gltf"
    with open(name, "w") as file:
        json.dump(document(has_material), file)
    (mesh,) = trimesh.load_scene(name).geometry.values()
    seen[has_material] = colours_of(mesh), colours_of(mesh.copy())
print("trimesh", trimesh.__version__)
print("expected: a copy has the colours of the mesh")
print("seen without a material, mesh and copy:", *seen[False])
print("seen with a material, mesh and copy:", *seen[True])
red = [[255, 0, 0, 255]]
sys.exit(0 if seen == {False: (red, red), True: ({"color": red}, {})} else "changed")
PYTHON
