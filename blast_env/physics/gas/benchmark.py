"""What a blast costs: cell updates per CPU second, memory. `python -m` runs it."""

import time
from dataclasses import dataclass
from math import ceil
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from blast_env.physics.gas.faces import exposed_faces
from blast_env.physics.gas.grid import GasGrid
from blast_env.physics.gas.probes import FaceLoads, Gauges, GroundMap, Snapshots
from blast_env.physics.gas.solver import GasSolver

CELL_M: Final = 0.5
_SIZE_M: Final = (40.0, 30.0, 12.0)
_WALLS_M: Final = (((15.0, 10.0, 0.0), (15.5, 20.0, 3.0)), ((25.0, 5.0, 0.0), (25.5, 15.0, 3.0)))
_BUILDING_M: Final = (((32.0, 10.0, 0.0), (36.0, 20.0, 6.0)),)
_GAUGES_M: Final = ((20.0, 15.0, 0.0), (31.0, 15.0, 0.0))
_CHARGE_M: Final = (10.0, 15.0, 0.0)
_CHARGE_KG: Final = 100.0
_CHARGE_RADIUS_M: Final = 1.5
_HEAT_J_KG: Final = 4.52e6
_UNTIL_S: Final = 0.06


@dataclass(frozen=True)
class GasBenchmark:
    """Cost of one blast.

    Attributes:
        first_step_s: Time of a first step by the clock, compiling or loading what was compiled.
        cpu_s: CPU time of the blast.
        clock_s: Its time by the clock.
        steps: Steps.
        cell_updates: Cells moved on, see `GasSolver`.
        least_step_s: Shortest step by the clock of those that moved all cells.
        cells: Cells of the grid.
        arrays_bytes: Size of the state.
        process_bytes: Most memory that the process had so far, Python and its packages included.
    """

    first_step_s: float
    cpu_s: float
    clock_s: float
    steps: int
    cell_updates: int
    least_step_s: float
    cells: int
    arrays_bytes: int
    process_bytes: int

    @property
    def updates_per_cpu_s(self) -> float:
        """Cell updates per CPU second, over the whole blast."""
        return self.cell_updates / self.cpu_s

    def __str__(self) -> str:
        return (
            f"blast: {self.cpu_s:.2f} CPU s, {self.clock_s:.2f} s by the clock, "
            f"{self.steps} steps, {self.cell_updates / 1e6:.1f} million cell updates, "
            f"{self.updates_per_cpu_s / 1e6:.1f} million per CPU s\n"
            f"shortest full step: {1e3 * self.least_step_s:.2f} ms, "
            f"{2.0 * self.cells / self.least_step_s / 1e6:.1f} million cell updates per s\n"
            f"first step with compiling: {self.first_step_s:.2f} s; "
            f"state {self.arrays_bytes / 2**20:.1f} MiB, "
            f"process {self.process_bytes / 2**20:.0f} MiB"
        )


def site(cell_m: float = CELL_M) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return solid cells and those of the building among them: two walls and a building."""
    walls, building = (np.zeros([round(m / cell_m) for m in _SIZE_M], dtype=bool) for _ in "12")
    for cells, boxes_m in ((walls, _WALLS_M), (building, _BUILDING_M)):
        for low_m, high_m in boxes_m:
            ends = zip(low_m, high_m, strict=True)
            cells[tuple(slice(round(a / cell_m), ceil(b / cell_m)) for a, b in ends)] = True
    return walls | building, building


def hot_sphere(solver: GasSolver) -> None:
    """Put a charge into the solver: its mass and its heat in a sphere."""
    grid = solver.grid
    places = np.meshgrid(*(grid.centres_m(axis) for axis in range(3)), indexing="ij")
    square = sum((places[axis] - _CHARGE_M[axis]) ** 2 for axis in range(3))
    hot = (square < _CHARGE_RADIUS_M**2) & ~grid.solid
    density = _CHARGE_KG / (float(hot.sum()) * grid.cell_m**3)
    solver.set_state(
        density_kg_m3=np.where(hot, density, solver.density_kg_m3),
        pressure_pa=np.where(hot, 0.4 * density * _HEAT_J_KG, solver.pressure_pa),
    )


def measure(
    precision: Literal["single", "double"] = "single",
    threads: int = 1,
    *,
    record: bool = True,
    cell_m: float = CELL_M,
) -> GasBenchmark:
    """Run one blast and return what it cost.

    Args:
        precision: Of the state.
        threads: Threads that share the blast.
        record: Whether loads on the building, gauges, maps and pictures are recorded.
        cell_m: Side of a cell.
    """
    solid, building = site(cell_m)
    grid = GasGrid(cell_m, solid)
    faces = exposed_faces(grid, building)

    def start() -> GasSolver:
        recorders = (
            FaceLoads(len(faces)),
            Gauges(grid, [grid.cell_at(place) for place in _GAUGES_M]),
            GroundMap(grid),
            Snapshots(grid, 2, 3, np.linspace(0.0, _UNTIL_S, 60).tolist()),
        )
        solver = GasSolver(
            grid,
            faces=faces,
            recorders=recorders if record else (),
            precision=precision,
            threads=threads,
        )
        hot_sphere(solver)
        return solver

    begin = time.perf_counter()
    start().step()
    first_step_s = time.perf_counter() - begin
    solver = start()
    least_s = np.inf
    clock_s, cpu_s = time.perf_counter(), time.process_time()
    while solver.time_s < _UNTIL_S:
        before, updates = time.perf_counter(), solver.cell_updates
        solver.step()
        if solver.cell_updates - updates == 2 * solid.size:
            least_s = min(least_s, time.perf_counter() - before)
    return GasBenchmark(
        first_step_s=first_step_s,
        cpu_s=time.process_time() - cpu_s,
        clock_s=time.perf_counter() - clock_s,
        steps=solver.steps,
        cell_updates=solver.cell_updates,
        least_step_s=float(least_s),
        cells=solid.size,
        arrays_bytes=solver.state.nbytes,
        process_bytes=_process_bytes(),
    )


def _process_bytes() -> int:
    """Return the most memory that this process has had."""
    import resource  # here, because Windows has none

    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


if __name__ == "__main__":
    precisions: tuple[Literal["single", "double"], ...] = ("single", "double")
    for chosen in precisions:
        for count in (1, 2):
            print(f"--- {chosen} precision, {count} thread(s)")
            print(measure(chosen, count))
