"""Small flows for the tests of the gas."""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np
import pytest
from numpy.typing import NDArray

from blast_env.gas import FaceKind, FaceLoads, Faces, GasGrid, GasSolver, exposed_faces

CLOSED: dict[str, Any] = dict.fromkeys(
    ("x_low", "x_high", "y_low", "y_high", "z_low", "z_high"), FaceKind.MIRROR
)
Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
Kind = TypeVar("Kind")
BLAST_PA = 5e7
BLAST_KG_M3 = 50.0


def pipe(
    length: int, axis: int, cell_m: float, *, low: str = "open", high: str = "open", width: int = 1
) -> GasGrid:
    """Return a row of cells along an axis, open at its ends unless said otherwise."""
    shape = [width] * 3
    shape[axis] = length
    kinds = dict(CLOSED)
    name = "xyz"[axis]
    kinds[f"{name}_low"], kinds[f"{name}_high"] = FaceKind(low), FaceKind(high)
    return GasGrid(cell_m, np.zeros(shape, dtype=bool), **kinds)


def along(values: NDArray[Any], axis: int) -> NDArray[Any]:
    """Return values that change along one axis as an array over three."""
    shape = [1, 1, 1]
    shape[axis] = len(values)
    return values.reshape(shape)


def row(values: Floats, axis: int) -> Floats:
    """Return the values of the first row of cells along an axis."""
    return np.moveaxis(values, axis, 0)[:, 0, 0]


def velocity_along(speed: Any, axis: int) -> list[Any]:
    """Return the velocity components of a motion along one axis."""
    return [speed if k == axis else 0.0 for k in range(3)]


def blast(
    solid: Bools,
    centre: tuple[float, float, float],
    *,
    radius: float = 2.5,
    cell_m: float = 0.5,
    loaded: Callable[[GasGrid], Faces] | None = None,
    looking: Callable[[GasGrid, int], Sequence[Any]] | None = None,
    faces: dict[str, Any] | None = None,
    pressure_pa: float = BLAST_PA,
    density_kg_m3: float = BLAST_KG_M3,
    **options: Any,
) -> GasSolver:
    """Return a solver with a hot ball in still air; lengths in cells.

    Args:
        solid: Solid cells.
        centre: Of the ball.
        radius: Of the ball.
        cell_m: Side of a cell.
        loaded: Chooses the faces whose loads are wanted.
        looking: Makes recorders for the grid and as many faces.
        faces: Kinds of the grid's faces.
        pressure_pa: Of the ball.
        density_kg_m3: Of the ball.
        options: Of the solver.
    """
    grid = GasGrid(cell_m, solid, **(faces or {}))
    places = np.indices(solid.shape) + 0.5
    distance = np.sqrt(sum((places[k] - centre[k]) ** 2 for k in range(3)))
    hot = (distance < radius) & ~solid
    if loaded is not None:
        options["faces"] = loaded(grid)
    if looking is not None:
        options["recorders"] = looking(grid, len(options.get("faces", ())))
    solver = GasSolver(grid, **options)
    solver.set_state(
        density_kg_m3=np.where(hot, density_kg_m3, solver.density_kg_m3),
        pressure_pa=np.where(hot, pressure_pa, solver.pressure_pa),
        fuel_kg_m3=np.where(hot, density_kg_m3, 0.0),
    )
    return solver


def street() -> Bools:
    """Return a site without any symmetry: walls of different height, and a small house."""
    solid = np.zeros((30, 26, 10), dtype=bool)
    solid[12:14, 4:20, 0:4] = True
    solid[20:25, 10:15, 0:8] = True
    solid[5:9, 22, 0:3] = True
    return solid


def check_nothing_is_lost(solver: GasSolver) -> None:
    """Run for hundreds of steps in double precision, and check that mass and energy stay."""
    before = solver.totals()
    solver.advance(0.06)
    after = solver.totals()
    assert solver.steps > 150
    assert solver.floored_cells == 0
    assert after.mass_kg == pytest.approx(before.mass_kg, rel=1e-12)
    assert after.energy_j == pytest.approx(before.energy_j, rel=1e-12)


def all_faces(grid: GasGrid) -> Faces:
    """Return the faces of all solid cells."""
    return exposed_faces(grid, grid.solid)


def face_loads(_: GasGrid, faces: int) -> list[FaceLoads]:
    """Return a recorder of the loads on faces."""
    return [FaceLoads(faces)]


def recorder(solver: GasSolver, kind: type[Kind]) -> Kind:
    """Return the recorder of this kind."""
    (found,) = (recorder for recorder in solver.recorders if isinstance(recorder, kind))
    return found
