#!/usr/bin/env bash
# Formats of meshes number the corners of a solid element in different orders. meshio converts
# between some thirty of them, and changes the order for some, as that of bricks of 20 nodes between
# Gmsh and VTK. One would guess that it does wherever orders differ. A block of 24 m3 tells by its
# volume, as PyVista measures it. From a MED file of Gmsh's its bricks come inside out, -24 m3. So
# do wedges in VTK's files, also in those that Gmsh itself writes. Bricks of 20 nodes in an Exodus
# file have the nodes amid upright edges and those amid upper edges exchanged: VTK finds 2 m3.
# There is no message, corners are at their places, and a file that meshio reads back itself is
# right. Masses and outward directions of walls, and with them the sign of a load, are not.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq meshio==5.3.5 gmsh==4.15.2 pyvista==0.49.1 vtk==9.7.2 \
    netCDF4==1.7.5.1.post1 h5py==3.16.0 numpy==2.4.6
venv/bin/python -W ignore - > /dev/null <<'PYTHON'
import gmsh
import meshio

SOLIDS = ("hexahedron", "hexahedron20", "wedge")


def block(name, nodes_on_edges, bricks):
    """Write a block of 2 m by 3 m by 4 m as Gmsh has it, and return it as meshio reads it."""
    gmsh.clear()
    gmsh.option.setNumber("Mesh.ElementOrder", 2 if nodes_on_edges else 1)
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
    floor = gmsh.model.occ.addRectangle(0, 0, 0, 2, 3)
    gmsh.model.occ.extrude([(2, floor)], 0, 0, 4, numElements=[2], recombine=True)
    gmsh.model.occ.synchronize()
    if bricks:
        gmsh.model.mesh.setTransfiniteAutomatic()
    gmsh.model.addPhysicalGroup(3, [1], 1)
    gmsh.model.mesh.generate(3)
    gmsh.write(f"{name}.msh")
    gmsh.write(f"{name}.med")
    gmsh.write(f"{name}.vtk")
    mesh = meshio.read(f"{name}.msh")
    return meshio.Mesh(mesh.points, [one for one in mesh.cells if one.type in SOLIDS])


gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
bricks = block("bricks", False, True)
bricks.write("bricks.vtu")
meshio.read("bricks.med").write("bricks_of_med.vtu")
wedges = block("wedges", False, False)
wedges.write("wedges.vtu")
fine = block("fine", True, True)
fine.write("fine.vtu")
fine.write("fine.e")
PYTHON
venv/bin/python -W ignore - <<'PYTHON'
import importlib.metadata
import sys

import pyvista

WANTED = {
    "bricks.vtu": 24.0,
    "bricks_of_med.vtu": -24.0,
    "wedges.vtk": -24.0,
    "wedges.vtu": -24.0,
    "fine.vtu": 24.0,
    "fine.e": 2.0,
}


def volume(name):
    mesh = pyvista.read(name)
    mesh = mesh.combine() if isinstance(mesh, pyvista.MultiBlock) else mesh
    return round(float(mesh.compute_cell_sizes()["Volume"].sum()), 3)


seen = {name: volume(name) for name in WANTED}
used = ("meshio", "gmsh", "pyvista", "vtk")
print(*(f"{name} {importlib.metadata.version(name)}" for name in used))
print("expected: 24 m3 of each")
for name, found in seen.items():
    print("seen,", name, found)
sys.exit(0 if seen == WANTED else "changed")
PYTHON
