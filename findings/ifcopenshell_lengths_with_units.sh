#!/usr/bin/env bash
# A model in millimetres says of a door that it opens 5 m wide, with a unit of its own: IFC lets a
# property or a quantity name its unit, and takes that of the project only where there is none. One
# would guess that `convert_file_length_units`, which makes a model of metres of it, turns 5,000 mm
# into 5 m, and leaves 5 m as they are. It divides all lengths by 1,000. What had a unit of its own
# keeps that unit: 5 m become 0.005 m, without a message. IfcOpenShell's own `get_property_unit`
# knows, before and after, that the value is in metres.
# The shapes are right, so nothing looks wrong. What is read from properties and quantities (clear
# widths, stand-offs, heights) is a thousand times too small, but only in some of the objects.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq ifcopenshell==0.9.0.post1 numpy==2.4.6
venv/bin/python -W ignore - <<'PYTHON'
import sys

import ifcopenshell
from ifcopenshell.util import unit as units


def model():
    """Return a model in millimetres with 5 m in four ways, two of them with metres as unit."""
    made = ifcopenshell.file(schema="IFC4")
    length = made.createIfcSIUnit(None, "LENGTHUNIT", "MILLI", "METRE")
    metre = made.createIfcSIUnit(None, "LENGTHUNIT", None, "METRE")
    assignment = made.createIfcUnitAssignment([length])
    made.createIfcProject(ifcopenshell.guid.new(), Name="site", UnitsInContext=assignment)
    for name, value, unit in (("plain", 5000.0, None), ("metres", 5.0, metre)):
        made.createIfcPropertySingleValue(name, None, made.createIfcLengthMeasure(value), unit)
        made.createIfcQuantityLength(name, None, unit, value)
    return made


def told(made):
    """Return each length with the name of its unit."""
    found = {}
    for item in made.by_type("IfcPropertySingleValue") + made.by_type("IfcQuantityLength"):
        unit = units.get_property_unit(item, made)
        value = getattr(item, "NominalValue", None)
        value = item.LengthValue if value is None else value.wrappedValue
        found[item.is_a(), item.Name] = value, units.get_full_unit_name(unit)
    return found


before = told(model())
after = told(units.convert_file_length_units(model(), "METRE"))
print("ifcopenshell", ifcopenshell.version)
print("expected: 5 METRE in all four")
for what, length in before.items():
    print("seen:", *what, *length, "- converted:", *after[what])
kinds = ("IfcPropertySingleValue", "IfcQuantityLength")
as_found = all(after[kind, "plain"] == (5.0, "METRE") for kind in kinds)
as_found = as_found and all(before[kind, "metres"] == (5.0, "METRE") for kind in kinds)
as_found = as_found and all(after[kind, "metres"] == (0.005, "METRE") for kind in kinds)
sys.exit(0 if as_found else "changed")
PYTHON
