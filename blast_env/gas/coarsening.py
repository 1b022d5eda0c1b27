"""A run of the gas whose cells are doubled when the front has run far enough.

A front needs cells that are small compared with the length of its wave, which grows with the
distance from the charge. A blast therefore begins with small cells, of which few are needed near
the charge. When the front is far enough away, the whole grid changes to cells of twice the side,
with time steps of twice the length. Mass, momentum and energy are conserved. Recorders see the grid
of the smallest cells throughout.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from scipy.spatial import KDTree

from blast_env.gas.faces import Faces, exposed_faces
from blast_env.gas.grid import GasGrid
from blast_env.gas.solver import GasSolver, Recorder
from blast_env.gas.state import Reals

_HALF: Final = 4
"""Number of solid cells, out of eight, that make a cell of twice the side solid."""


class CoarseningSolver:
    """A gas solver whose cells are doubled at given times.

    Args:
        solver: The solver of the smallest cells; its recorders become those of the whole run.
        doubled_s: Times of doubling, in ascending order.

    Attributes:
        grid: The grid of the smallest cells.
        faces: The faces on it.
        recorders: The recorders of the run.
        current: The current solver.
    """

    def __init__(self, solver: GasSolver, doubled_s: Sequence[float]) -> None:
        self.grid, self.faces = solver.grid, solver.faces
        self.pressure_pa, self.density_kg_m3 = solver.pressure_pa, solver.density_kg_m3
        self.recorders: tuple[Recorder, ...] = solver.recorders
        solver.recorders = ()
        self.current = solver
        self._doubled_s = list(doubled_s)
        self._cells: list[NDArray[np.int64]] = [np.arange(n) for n in self.grid.shape]
        self._of_face: NDArray[np.int64] | None = None
        self._nearest_air: NDArray[np.int64] | None = None

    @property
    def time_s(self) -> float:
        """Simulated time."""
        return self.current.time_s

    @property
    def steps(self) -> int:
        """Number of steps."""
        return self.current.steps

    @property
    def cell_updates(self) -> int:
        """Number of cell updates; see `GasSolver`."""
        return self.current.cell_updates

    @property
    def floored_cells(self) -> int:
        """Number of cells raised to the floor of density or pressure."""
        return self.current.floored_cells

    @property
    def wall_pressure(self) -> Reals:
        """Mean pressures on `faces` during the last step, in the solver's units (n,)."""
        pressure = self.current.wall_pressure
        return pressure if self._of_face is None else pressure[self._of_face]

    def wall_overpressure_pa(self) -> NDArray[np.float64]:
        """Return the mean overpressures on `faces` during the last step (n,)."""
        pressure = self.current.wall_overpressure_pa()
        return pressure if self._of_face is None else pressure[self._of_face]

    def overpressure_at(self, cells: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the overpressures in some of the smallest cells, given as x, y and z (n, 3)."""
        own = np.stack([self._cells[axis][cells[:, axis]] for axis in range(3)], axis=1)
        if self._nearest_air is not None:
            own = self._nearest_air[:, own[:, 0], own[:, 1], own[:, 2]].T
        return self.current.overpressure_at(own)

    def overpressure_in(self, axis: int, layer: int) -> NDArray[np.float64]:
        """Return the overpressures in a layer of the smallest cells, along the other axes."""
        plane = self.current.overpressure_in(axis, int(self._cells[axis][layer]))
        return plane[np.ix_(*(self._cells[other] for other in range(3) if other != axis))]

    def advance(self, until_s: float) -> None:
        """Continue until the simulated time is at least `until_s`."""
        while self.time_s < until_s:
            self.step()

    def step(self) -> None:
        """Make one time step, after doubling the cells if that is due."""
        while self._doubled_s and self.time_s >= self._doubled_s[0]:
            del self._doubled_s[0]
            self._double()
        before_s = self.time_s
        self.current.step()
        for recorder in self.recorders:
            recorder.record(self, self.time_s - before_s)

    def _double(self) -> None:
        fine = self.current.grid
        grid = with_double_cells(fine)
        faces = exposed_faces(grid, grid.solid)
        self.current = self.current.on_double_cells(grid, faces)
        # 1. Smallest cells in the new ones: two by two, behind the layer that the skirt gave.
        self._cells = [
            cells // 2 + (low > 0)
            for cells, (low, _) in zip(self._cells, fine.buffer_layers_by_axis, strict=True)
        ]
        # 2. Recorders keep their faces: each reads the nearest new one with its normal.
        self._of_face = nearest_faces(self.faces, self.grid, faces, grid)
        # 3. Air that has become solid reads the nearest air.
        nearest = distance_transform_edt(grid.solid, return_distances=False, return_indices=True)
        self._nearest_air = np.asarray(nearest, dtype=np.int64)


def shape_to_double(
    shape: tuple[int, int, int], buffer_layers: int, times: int
) -> tuple[int, int, int]:
    """Extend a shape at its high ends so that its cells can be doubled `times` times.

    Args:
        shape: Cells along x, y and z of a grid with ground below and otherwise open borders.
        buffer_layers: Layers of the skirt; each doubling takes one.
    """
    # A layer at each open end comes from the skirt, so the shape is extended to what then divides.
    ends = (2, 2, 1) if buffer_layers else (0, 0, 0)
    nx, ny, nz = (n + (2 * taken - n) % 2**times for n, taken in zip(shape, ends, strict=True))
    return nx, ny, nz


def with_double_cells(grid: GasGrid) -> GasGrid:
    """Return a grid of cells of twice the side, solid if at least half of their volume is.

    The first layer of a skirt is as thick as these cells, and becomes a layer of the grid.
    """
    # (1) Eight cells become one, which is solid if four of them are; (2) the innermost layer of a
    # skirt is twice as thick as a cell: it joins the grid; (3) the origin moves out by it.
    nx, ny, nz = (n // 2 for n in grid.shape)
    eighths = grid.solid.reshape(nx, 2, ny, 2, nz, 2).sum(axis=(1, 3, 5))
    taken = [(int(low > 0), int(high > 0)) for low, high in grid.buffer_layers_by_axis]
    origin = [
        at - 2.0 * grid.cell_m * low for at, (low, _) in zip(grid.origin_m, taken, strict=True)
    ]
    return replace(
        grid,
        cell_m=2.0 * grid.cell_m,
        solid=np.pad(eighths >= _HALF, taken, mode="edge"),
        origin_m=(origin[0], origin[1], origin[2]),
        buffer_layers=max(grid.buffer_layers - 1, 0),
    )


def nearest_faces(
    faces: Faces, grid: GasGrid, others: Faces, other_grid: GasGrid
) -> NDArray[np.int64]:
    """Return the index of the nearest face of another grid with the same normal (faces,)."""
    nearest = np.zeros(len(faces), dtype=np.int64)
    centres_m, other_centres_m = faces.centres_m(grid), others.centres_m(other_grid)
    for axis in range(3):
        for side in (-1, 1):
            # One tree for each normal, so that no face finds one on the other side of a thin wall.
            own = np.flatnonzero((faces.axis == axis) & (faces.side == side))
            there = np.flatnonzero((others.axis == axis) & (others.side == side))
            if len(own):
                nearest[own] = there[KDTree(other_centres_m[there]).query(centres_m[own])[1]]
    return nearest
