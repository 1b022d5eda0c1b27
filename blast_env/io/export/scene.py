"""The site, the barrier and the loads of a blast as bodies and surfaces in space."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import shapely

from blast_env.arrays import FloatArray
from blast_env.bays import Bay
from blast_env.geometry import Layout, Rectangle
from blast_env.io.export.bill import LayoutPlan
from blast_env.io.export.gltf import Mesh, write_glb
from blast_env.layout.build_site import barrier_outline, outlines
from blast_env.particles.objects import Colour, LoadColours
from blast_env.plots.plan import BARRIER, EXPLOSIVE, FAINT, PROTECTED, STRUCTURE
from blast_env.plots.style import nice_ceiling, unit_interval
from blast_env.site import Scenario
from blast_env.site.blast_site import Charge
from blast_env.site.structures import StructureOutline

if TYPE_CHECKING:  # Numba takes half a second to import
    from blast_env.evaluation.engines.gas import GasResult

_OFF_M: Final = 0.02
"""Distance of the surfaces of loads from their walls, so that viewers tell them apart."""

_CHARGE_M: Final = 0.5
_AXES: Final = "glTF: x is the site's x, y is height, z is minus the site's y; metres"


def write_layout_scene(plan: LayoutPlan, path: Path) -> None:
    """Write a layout on its site as glTF: ground, structures and the pieces of the barrier."""
    meshes = [*_site(plan.scenario, plan.layout), *_charge(plan.charge)]
    write_glb(meshes, path, plan.scenario.name, {"axes": _AXES})


def write_blast_scene(result: "GasResult", path: Path) -> None:
    """Write a blast on its site as glTF: the site, the barrier and the charge, and the loads.

    The colours of loads are those of the legend of pictures, by the peak specific impulse of each
    bay, or of each face of a cell where a structure has no bays.
    """
    scenario, site = result.blast.scenario, result.run.site
    loads = [*_bay_loads(result), *_face_loads(result)]
    largest = max((float(values.max()) for *_, values in loads if len(values)), default=0.0)
    top = nice_ceiling(largest) if largest > 0.0 else 1.0
    meshes = [*_site(scenario, tuple(result.blast.layout)), *_charge(site.charge)]
    for name, quads_m, values in loads:
        extras = {"impulse_pa_s": float(values[0])} if len(values) == 1 else {}
        colours = np.repeat(load_colours_of(values / top), 2, axis=0)
        meshes.append(Mesh(name, _triangles(quads_m), colours, is_lit=False, extras=extras))
    legend = {
        "quantity": "peak specific impulse",
        "unit": "Pa s",
        "low": 0.0,
        "high": top,
        "colours": [list(colour) for colour in LoadColours()],
    }
    write_glb(meshes, path, scenario.name, {"axes": _AXES, "legend": legend})


def load_colours_of(shares: FloatArray) -> FloatArray:
    """Return the colours of loads from their shares of the end of the scale, 0 to 1 (n, 3)."""
    stops = np.array([unit_interval(colour) for colour in LoadColours()])
    at = np.linspace(0.0, 1.0, len(stops))
    clipped = np.clip(np.nan_to_num(shares), 0.0, 1.0)
    return np.column_stack([np.interp(clipped, at, stops[:, k]) for k in range(3)])


def _site(scenario: Scenario, layout: Layout) -> Iterator[Mesh]:
    """Yield the ground, the structures, and the pieces of the barrier."""
    ground = scenario.site.rectangle_m
    square_m = _quad(ground, 0.0)
    yield _mesh("ground", _triangles(square_m[np.newaxis]), FAINT)
    barrier = [barrier_outline(scenario, layout)] if layout else []
    for outline in (*outlines(scenario, layout), *barrier):
        if outline.footprint is not None:
            top_m = _top_m(outline.height_m, scenario)
            body_m = prism(outline.footprint.polygon, outline.base_m, top_m)
            yield _mesh(outline.name, body_m, _colour(outline))
            continue
        for block in outline.blocks:
            plan = shapely.box(*block.rectangle_m)
            body_m = prism(plan, block.base_m, _top_m(block.height_m, scenario))
            colour = (
                BARRIER if outline.is_barrier else PROTECTED if outline.protected else STRUCTURE
            )
            name = block.name or outline.name
            extras = {"as_high_as_the_air": True} if block.height_m is None else {}
            yield _mesh(name, body_m, colour, extras)


def _colour(outline: StructureOutline) -> Colour:
    return PROTECTED if outline.protected else STRUCTURE


def _top_m(height_m: float | None, scenario: Scenario) -> float:
    return scenario.air_height_m if height_m is None else height_m


def _charge(charge: Charge | None) -> Iterator[Mesh]:
    """Yield a charge as an octahedron of fixed size."""
    if charge is None:
        return
    (x, y), height_m = charge.position_m, max(charge.height_m, _CHARGE_M)
    ring = [(_CHARGE_M, 0.0), (0.0, _CHARGE_M), (-_CHARGE_M, 0.0), (0.0, -_CHARGE_M)]
    corners = []
    for (x1, y1), (x2, y2) in zip(ring, [*ring[1:], ring[0]], strict=True):
        corners += [
            [(x1, y1, 0.0), (x2, y2, 0.0), (0.0, 0.0, _CHARGE_M)],
            [(x2, y2, 0.0), (x1, y1, 0.0), (0.0, 0.0, -_CHARGE_M)],
        ]
    extras = {"tnt_kg": charge.tnt_kg}
    yield _mesh("charge", np.array(corners) + (x, y, height_m), EXPLOSIVE, extras)


def _mesh(name: str, triangles_m: FloatArray, colour: Any, extras: Any = None) -> Mesh:
    colours = np.tile(unit_interval(colour), (len(triangles_m), 1))
    return Mesh(name, triangles_m, colours, extras=extras or {})


def prism(plan: shapely.Polygon, base_m: float, top_m: float) -> FloatArray:
    """Return the triangles of a body between two heights over a plan, m (n, 3, 3)."""
    plan = shapely.orient_polygons(plan)  # the outer border counterclockwise, holes clockwise
    flat = shapely.constrained_delaunay_triangles(plan)
    faces = np.array(
        [shapely.orient_polygons(part).exterior.coords[:3] for part in shapely.get_parts(flat)]
    )
    low, high = (
        np.concatenate((faces, np.full((*faces.shape[:2], 1), z)), axis=2) for z in (base_m, top_m)
    )
    quads = [
        [(*start, base_m), (*end, base_m), (*end, top_m), (*start, top_m)]
        for ring in shapely.get_rings(plan)
        for start, end in zip(ring.coords[:-1], ring.coords[1:], strict=True)
    ]
    return np.concatenate((low[:, ::-1], high, _triangles(np.array(quads))))


def _triangles(quads_m: FloatArray) -> FloatArray:
    """Return two triangles for each quadrilateral (n, 4, 3)."""
    return np.asarray(quads_m[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3))


def _quad(rectangle: Rectangle, z_m: float) -> FloatArray:
    left, bottom, right, top = rectangle
    return np.array(
        [(left, bottom, z_m), (right, bottom, z_m), (right, top, z_m), (left, top, z_m)]
    )


_Loads = tuple[str, FloatArray, FloatArray]


def _bay_loads(result: "GasResult") -> Iterator[_Loads]:
    """Yield the name of each bay, its surface (1, 4, 3) and its impulse (1,)."""
    by_name = {outline.name: outline for outline in result.run.site.structures}
    impulses = dict(zip(result.bays["bay"], result.bays["impulse_pa_s"], strict=True))
    for filled in result.bay_loads.bays:
        bay = filled.bay
        quad_m = bay_corners_m(bay, by_name[bay.structure])
        yield bay.name, quad_m[np.newaxis], np.array([float(impulses[bay.name])])


def bay_corners_m(bay: Bay, structure: StructureOutline) -> FloatArray:
    """Return the corners of a bay, counterclockwise as it is seen from outside, m (4, 3)."""
    around = structure.rectangle_m
    if bay.line is not None:
        start, end = np.array(bay.line.start_m), np.array(bay.line.end_m)
        along = (end - start) / np.linalg.norm(end - start)
        first, last = start + bay.left_m * along, start + bay.right_m * along
        outward = np.array([along[1], -along[0]])  # the building is on the left
    else:
        low, high = bay.left_m, bay.right_m
        sides = {
            "south": ((low, around.bottom), (high, around.bottom), (0.0, -1.0)),
            "east": ((around.right, low), (around.right, high), (1.0, 0.0)),
            "north": ((high, around.top), (low, around.top), (0.0, 1.0)),
            "west": ((around.left, high), (around.left, low), (-1.0, 0.0)),
        }
        first, last, outward = (np.array(place) for place in sides[bay.wall])
    first, last = first + _OFF_M * outward, last + _OFF_M * outward
    return np.array(
        [
            (*first, bay.floor_m),
            (*last, bay.floor_m),
            (*last, bay.top_m),
            (*first, bay.top_m),
        ]
    )


_FACES: Final[dict[str, Sequence[int]]] = {
    "west": (-1, 0, 0),
    "east": (1, 0, 0),
    "south": (0, -1, 0),
    "north": (0, 1, 0),
    "roof": (0, 0, 1),
    "underside": (0, 0, -1),
}


def _face_loads(result: "GasResult") -> Iterator[_Loads]:
    """Yield the name of each structure, its faces of cells without bays, and their impulses."""
    table, side_m = result.on_walls, result.run.grid.cell_m
    with_bays = {(filled.bay.structure, filled.bay.wall) for filled in result.bay_loads.bays}
    for outline in result.run.site.structures:
        if outline.is_barrier:
            continue
        own = table[table["structure"].astype(str) == outline.name]
        faces = own["face"].astype(str).to_numpy()
        is_free = np.array([(outline.name, face) not in with_bays for face in faces], dtype=bool)
        own, faces = own[is_free], faces[is_free]
        centres_m = own[["x_m", "y_m", "z_m"]].to_numpy(dtype=np.float64)
        normals = np.array([_FACES[face] for face in faces], dtype=np.float64).reshape(-1, 3)
        quads_m = _cell_faces_m(centres_m, normals, side_m)
        yield f"loads of {outline.name}", quads_m, own["impulse_pa_s"].to_numpy(dtype=np.float64)


def _cell_faces_m(centres_m: FloatArray, normals: FloatArray, side_m: float) -> FloatArray:
    """Return squares around centres, counterclockwise against their normals (n, 4, 3)."""
    across = np.abs(np.roll(normals, 1, axis=1))
    up = np.cross(normals, across)
    signs = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
    corners = [
        centres_m + _OFF_M * normals + 0.5 * side_m * (a * across + b * up) for a, b in signs
    ]
    return np.stack(corners, axis=1) if len(centres_m) else np.empty((0, 4, 3))
