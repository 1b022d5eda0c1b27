#!/usr/bin/env bash
# IfcOpenShell gives the corners of a wall and the place of the wall in the model, which together
# say where it stands. One would guess that both are in one unit. Corners are in metres, whatever
# the unit of the file. Places of `util.placement` are in the unit of the file, most often
# millimetres.
# Both are right for files in metres, of which tests are made. In others a wall's own extents are
# right and its distance from the charge is a thousand times too large, or a storey's height from
# its placement.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq ifcopenshell==0.9.0.post1
venv/bin/python - <<'PYTHON'
import sys

import ifcopenshell
import ifcopenshell.geom
import numpy as np
from ifcopenshell.util.placement import get_local_placement

model = ifcopenshell.file(schema="IFC4")
make = model.create_entity


def axes(x):
    return make("IfcAxis2Placement3D", make("IfcCartesianPoint", (float(x), 0.0, 0.0)))


context = make("IfcGeometricRepresentationContext", None, "Model", 3, 1e-5, axes(0))
metre = make("IfcSIUnit", UnitType="LENGTHUNIT", Prefix="MILLI", Name="METRE")
project = make("IfcProject", GlobalId=ifcopenshell.guid.new())
project.RepresentationContexts = [context]
project.UnitsInContext = make("IfcUnitAssignment", [metre])
middle = make("IfcAxis2Placement2D", make("IfcCartesianPoint", (4000.0 / 2, 300.0 / 2)))
profile = make("IfcRectangleProfileDef", "AREA", None, middle, 4000.0, 300.0)
up = make("IfcDirection", (0.0, 0.0, 1.0))
solid = make("IfcExtrudedAreaSolid", profile, axes(0), up, 3000.0)
form = make("IfcShapeRepresentation", context, "Body", "SweptSolid", [solid])
place = make("IfcLocalPlacement", None, axes(5000))
wall = make("IfcWall", GlobalId=ifcopenshell.guid.new(), ObjectPlacement=place)
wall.Representation = make("IfcProductDefinitionShape", None, None, [form])
shape = ifcopenshell.geom.create_shape(ifcopenshell.geom.settings(), wall)
length = float(np.reshape(shape.geometry.verts, (-1, 3))[:, 0].max())
left = float(get_local_placement(place)[0, 3])
print("ifcopenshell", ifcopenshell.version)
print("expected: a wall 4 m long, 5 m from zero, both in one unit")
print("seen:", length, "long,", left, "from zero")
sys.exit(0 if np.allclose((length, left), (4.0, 5000.0)) else "changed")
PYTHON
