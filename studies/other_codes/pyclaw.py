"""The gas solver against PyClaw's Euler equations with walls, on one plane scene.

A cylinder of compressed air bursts beside a wall and a building, both infinitely high. The cells
and the initial state are the same; the schemes differ: HLLC and MUSCL-Hancock here, HLLE and
limited waves, split by dimension, there. PyClaw runs in a separate interpreter, to keep its
dependencies apart from this project's.
"""

import subprocess
from pathlib import Path
from time import process_time
from types import MappingProxyType
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError
from blast_env.files import scratch_folder
from blast_env.gas.grid import FaceKind, GasGrid
from blast_env.gas.probes import Gauges
from blast_env.gas.solver import AIR_DENSITY_KG_M3, AIR_PRESSURE_PA, GasSolver
from blast_env.gas.state import GAMMA
from studies.other_codes.histories import Histories

GAUGES_M: Final = MappingProxyType(
    {
        "before the wall": (6.9, 8.1),
        "behind the wall": (7.6, 8.1),
        "before the building": (12.4, 8.1),
        "side of the building": (13.6, 5.9),
        "behind the building": (14.6, 8.1),
    }
)
_SIZE_M: Final = (20.0, 16.0)
_SOLIDS_M: Final = (((7.0, 4.0), (7.5, 12.0)), ((12.5, 6.0), (14.5, 10.0)))
_CENTRE_M: Final = (4.0, 8.0)
_RADIUS_M: Final = 0.8
_RATIO: Final = 10.0
"""Ratio of the pressure in the cylinder to that of still air; the same for the densities."""
_WORKER: Final = Path(__file__).with_name("pyclaw_worker.py")


def plane_grid(cell_m: float) -> GasGrid:
    """Return the scene as one layer of cells between two mirror planes.

    Raises:
        BlastEnvError: If 0.5 m is not a whole number of cells.
    """
    if not (0.0 < cell_m <= 0.5 and np.isclose(0.5 / cell_m, round(0.5 / cell_m))):
        raise BlastEnvError(f"cell_m is {cell_m:g}, must be 0.5 m divided by a whole number")
    solid = np.zeros((round(_SIZE_M[0] / cell_m), round(_SIZE_M[1] / cell_m), 1), dtype=np.bool_)
    for low, high in _SOLIDS_M:
        inside = (
            slice(round(a / cell_m), round(b / cell_m)) for a, b in zip(low, high, strict=True)
        )
        solid[tuple(inside)] = True
    return GasGrid(cell_m, solid, z_high=FaceKind.MIRROR)


def _started(grid: GasGrid, gauges: Gauges) -> GasSolver:
    """Return the project's solver with the cylinder; its smooth edge is resolved by the cells."""
    x_m, y_m = grid.centres_m(0)[:, None, None], grid.centres_m(1)[None, :, None]
    away = np.hypot(x_m - _CENTRE_M[0], y_m - _CENTRE_M[1]) / _RADIUS_M
    ratio = 1.0 + (_RATIO - 1.0) * np.exp(-(away**4))
    solver = GasSolver(grid, recorders=[gauges])
    solver.set_state(density_kg_m3=AIR_DENSITY_KG_M3 * ratio, pressure_pa=AIR_PRESSURE_PA * ratio)
    return solver


def _gauges(grid: GasGrid) -> Gauges:
    middle_m = 0.5 * grid.cell_m
    return Gauges(grid, [grid.cell_at((x_m, y_m, middle_m)) for x_m, y_m in GAUGES_M.values()])


def ours(cell_m: float, until_s: float) -> Histories:
    """Run the scene with the project's solver, for which one layer is the least efficient grid."""
    gauges = _gauges(plane_grid(cell_m))
    solver = _started(plane_grid(cell_m), gauges)
    begin = process_time()
    solver.advance(until_s)
    cpu_s = process_time() - begin
    return Histories(gauges.time_s, gauges.history_pa, float(solver.cell_updates), cpu_s)


def by_pyclaw(cell_m: float, until_s: float, python: Path) -> Histories:
    """Run the scene with PyClaw.

    Args:
        cell_m: Side of a cell.
        until_s: Simulated time at the end.
        python: An interpreter with clawpack.

    Raises:
        BlastEnvError: If the interpreter cannot be run, or fails.
    """
    grid = plane_grid(cell_m)
    gauges = _gauges(grid)
    solver = _started(grid, gauges)
    density, pressure = (
        values[:, :, 0] / still
        for values, still in (
            (solver.density(), AIR_DENSITY_KG_M3),
            (solver.pressure(), AIR_PRESSURE_PA),
        )
    )
    nothing = np.zeros_like(density)
    with scratch_folder() as folder:
        given, found = folder / "scene.npz", folder / "found.npz"
        np.savez(
            given,
            state=np.stack([density, nothing, nothing, pressure / (GAMMA - 1.0)]),
            air=~grid.solid[:, :, 0],
            cell_m=cell_m,
            gauges=gauges.cells[:, :2],
            until=until_s * solver.velocity_m_s,
        )
        _run(python, given, found)
        with np.load(found) as arrays:
            times: FloatArray = arrays["times"] / solver.velocity_m_s
            overpressure: FloatArray = arrays["overpressure"] * AIR_PRESSURE_PA
            cpu_s = float(arrays["cpu_s"])
    return Histories(times, overpressure, float(density.size * len(times)), cpu_s)


def _run(python: Path, given: Path, found: Path) -> None:
    try:
        done = subprocess.run(
            [python.absolute(), _WORKER, given, found],
            cwd=given.parent,  # PyClaw writes a log where it runs
            capture_output=True,
            text=True,
            check=False,
        )
    except OSError as error:
        raise BlastEnvError(f"{python} cannot be run: {error}") from error
    if done.returncode != 0:
        last = done.stderr.strip().splitlines()[-1:] or [""]
        raise BlastEnvError(
            f"PyClaw failed with status {done.returncode}: {last[0]}; {python} must be an "
            "interpreter with clawpack (pip install clawpack; needs gfortran)"
        )
