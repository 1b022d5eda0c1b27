#!/usr/bin/env bash
# A shape that is used many times, as a window, is mapped from an origin to a target
# (IfcMappedItem). By these words one would guess that the origin comes to lie on the target, so
# that the origin is taken off. IFC reads the origin as the system in which the shape is drawn, and
# so does IfcOpenShell: it is added. The difference is nothing where origins are zero, as most
# programs write them, and twice the origin elsewhere: windows stand beside their openings, on
# another bay or in the open.
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

model = ifcopenshell.file(schema="IFC4")
make = model.create_entity


def axes(x):
    return make("IfcAxis2Placement3D", make("IfcCartesianPoint", (float(x), 0.0, 0.0)))


context = make("IfcGeometricRepresentationContext", None, "Model", 3, 1e-5, axes(0))
metre = make("IfcSIUnit", UnitType="LENGTHUNIT", Prefix=None, Name="METRE")
project = make("IfcProject", GlobalId=ifcopenshell.guid.new())
project.RepresentationContexts = [context]
project.UnitsInContext = make("IfcUnitAssignment", [metre])
middle = make("IfcAxis2Placement2D", make("IfcCartesianPoint", (4.0 / 2, 0.3 / 2)))
profile = make("IfcRectangleProfileDef", "AREA", None, middle, 4.0, 0.3)
up = make("IfcDirection", (0.0, 0.0, 1.0))
solid = make("IfcExtrudedAreaSolid", profile, axes(0), up, 3.0)
form = make("IfcShapeRepresentation", context, "Body", "SweptSolid", [solid])
zero = make("IfcCartesianPoint", (0.0, 0.0, 0.0))
target = make("IfcCartesianTransformationOperator3D", None, None, zero, 1.0, None)
item = make("IfcMappedItem", make("IfcRepresentationMap", axes(1), form), target)
mapped = make("IfcShapeRepresentation", context, "Body", "MappedRepresentation", [item])
place = make("IfcLocalPlacement", None, axes(0))
wall = make("IfcWall", GlobalId=ifcopenshell.guid.new(), ObjectPlacement=place)
wall.Representation = make("IfcProductDefinitionShape", None, None, [mapped])
shape = ifcopenshell.geom.create_shape(ifcopenshell.geom.settings(), wall)
left = float(np.reshape(shape.geometry.verts, (-1, 3))[:, 0].min())
print("ifcopenshell", ifcopenshell.version)
print("expected: a shape from 0 to 4, mapped from an origin at 1 to a target at 0, begins at -1")
print("seen: it begins at", left)
sys.exit(0 if np.isclose(left, 1.0) else "changed")
PYTHON
