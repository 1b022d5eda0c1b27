#!/usr/bin/env bash
# A block of 1 x 2 x 3 m is heavier at one end, so that its centre of mass is 1 m off. trimesh
# lets one set it (`mesh.center_mass = ...`), and by its docstring the moments of inertia are about
# it. One would guess those of the volume about that point: 12.5, 11.0 and 2.5, as trimesh's own
# `moment_inertia_frame` has them for a block whose centre is not set. They are 0.5, -1.0 and 2.5,
# one of them below zero, which no body has.
# What the parallel axes add from the centre of the volume to the point is taken off instead, and
# with distances from the origin of the coordinates. So moments change with the place: the same
# block 10 m higher has -119.5 and -121.0 if its upper end is the heavier one, and 120.5 and 119.0
# if it is the lower one. `moment_inertia_frame` of such a block begins with these, and is as wrong.
# There is no message.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq trimesh==5.2.0 numpy==2.4.6 scipy==1.17.1
venv/bin/python -W ignore - <<'PYTHON'
import sys

import numpy as np
import trimesh

OFF_M = 1.0


def moments(up_m, off_m):
    """Return moments about a point: by a frame, by a centre that is set there, and by both."""
    block = trimesh.creation.box((1.0, 2.0, 3.0))
    block.apply_translation((0.0, 0.0, up_m))
    there = trimesh.transformations.translation_matrix((0.0, 0.0, up_m + off_m))
    found = [block.moment_inertia_frame(there)]
    block.center_mass = (0.0, 0.0, up_m + off_m)
    found += [block.moment_inertia, block.moment_inertia_frame(there)]
    return [np.diag(matrix).round(3).tolist() for matrix in found]


print("trimesh", trimesh.__version__)
mass, (a, b, c) = 6.0, (1.0, 2.0, 3.0)
about_the_middle = np.array([b * b + c * c, a * a + c * c, a * a + b * b]) * mass / 12.0
expected = (about_the_middle + mass * OFF_M**2 * np.array([1.0, 1.0, 0.0])).tolist()
seen = {(up, off): moments(up, off) for up in (0.0, 10.0) for off in (OFF_M, -OFF_M)}
print("expected:", expected, "wherever the block stands")
for (up_m, off_m), (by_frame, by_centre, by_both) in seen.items():
    print(f"seen, middle at {up_m} m, centre {off_m:+} m from it: {by_centre}")
    print(f"  by a frame before it is set: {by_frame}; after: {by_both}")
as_found = all(by_frame == expected for by_frame, _, _ in seen.values())
as_found = as_found and all(by_both == by_centre for _, by_centre, by_both in seen.values())
wrong = [[0.5, -1.0, 2.5], [0.5, -1.0, 2.5], [-119.5, -121.0, 2.5], [120.5, 119.0, 2.5]]
as_found = as_found and [by_centre for _, by_centre, _ in seen.values()] == wrong
sys.exit(0 if as_found else "changed")
PYTHON
