#!/usr/bin/env bash
# A field of pressures stands on the ground, in cells. A slice at the height of the ground shows what
# the lowest cells have, one would guess, as a slice at the upper end shows the highest ones, and as
# `vtkCutter` does. `vtkPlaneCutter`, which PyVista's `slice` runs, gives an empty slice at the
# lowest end of a grid, and a whole one at the uppermost. There is no message.
# The ground is where a pressure field is looked at first. An empty picture there looks like a field
# without values, and a mean or an integral over the slice is that of nothing.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq vtk==9.7.2
venv/bin/python - <<'PYTHON'
import sys

import vtk

HEIGHTS = (0.0, 0.001, 1.0, 2.0)
"""Both ends of a grid of 4 x 3 x 2 cells, just above the lower one, and between its layers."""


def slices(kind, setter):
    grid = vtk.vtkImageData()
    grid.SetDimensions(5, 4, 3)
    counts = []
    for height in HEIGHTS:
        plane = vtk.vtkPlane()
        plane.SetOrigin(0.0, 0.0, height)
        plane.SetNormal(0.0, 0.0, 1.0)
        cutter = kind()
        getattr(cutter, setter)(plane)
        cutter.SetInputData(grid)
        cutter.Update()
        found = cutter.GetOutputDataObject(0)
        if found.IsA("vtkPartitionedDataSet"):
            parts = [found.GetPartition(k) for k in range(found.GetNumberOfPartitions())]
        else:
            parts = [found]
        area = vtk.vtkMassProperties()
        total = 0.0
        for part in parts:
            triangles = vtk.vtkTriangleFilter()
            triangles.SetInputData(part)
            triangles.Update()
            if triangles.GetOutput().GetNumberOfCells():
                area.SetInputConnection(triangles.GetOutputPort())
                area.Update()
                total += area.GetSurfaceArea()
        counts.append(round(total, 6))
    return counts


by_planes = slices(vtk.vtkPlaneCutter, "SetPlane")
by_functions = slices(vtk.vtkCutter, "SetCutFunction")
print("vtk", vtk.vtkVersion.GetVTKVersion())
print("expected: an area of 12 at both ends, as between them")
print("seen: at", HEIGHTS, "vtkPlaneCutter", by_planes, "- vtkCutter", by_functions)
as_found = by_planes == [0.0, 12.0, 12.0, 12.0] and by_functions == [12.0] * 4
sys.exit(0 if as_found else "changed")
PYTHON
