"""What a blast of gas dynamics costs, beside other codes where they are installed."""

from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from shutil import which
from time import perf_counter
from typing import Final

from blast_env.files import scratch_folder
from blast_env.physics.gas.benchmark import CELL_M, GasBenchmark, measure
from blast_env.studies.gas import openfoam, pyclaw
from blast_env.studies.gas.histories import Histories

_UNTIL_S: Final = 0.02
_PYCLAW_CELL_M: Final = 0.125
_FOAM_CELL_M: Final = 0.5


@dataclass(frozen=True)
class OtherCode:
    """A scene on the same cells by this project and by another code, in turn.

    Attributes:
        name: The other code.
        scene: What was run.
        ours_per_s: Cell updates a CPU second of this project.
        theirs_per_s: Those of the other code.
    """

    name: str
    scene: str
    ours_per_s: float
    theirs_per_s: float


@dataclass(frozen=True)
class Crowd:
    """The same blast in one process and in several at once, by the clock.

    Attributes:
        processes: How many.
        ratio: How many times the blasts of one process they run.
        process_bytes: Most memory that one of them had.
    """

    processes: int
    ratio: float
    process_bytes: int


def gas_blasts(sizes_m: tuple[float, ...] = (2.0 * CELL_M, CELL_M)) -> dict[float, GasBenchmark]:
    """Return the cost of the benchmark's blast by the side of the cells, after a first run."""
    measure(cell_m=max(sizes_m))
    return {cell_m: measure(cell_m=cell_m) for cell_m in sizes_m}


def measure_crowd(processes: int, blasts: int = 3) -> Crowd:
    """Run blasts in one fresh process, then as many in each of several at once."""
    with get_context("spawn").Pool(processes) as pool:
        pool.map(_blast_bytes, range(processes), chunksize=1)  # everything is loaded
        start = perf_counter()
        sizes = [pool.apply(_blast_bytes, (0,)) for _ in range(blasts)]
        alone_s = perf_counter() - start
        start = perf_counter()
        sizes += pool.map(_blast_bytes, range(processes * blasts), chunksize=blasts)
        together_s = perf_counter() - start
    return Crowd(processes, processes * alone_s / together_s, max(sizes))


def _blast_bytes(_: int) -> int:
    return measure().process_bytes


def beside_pyclaw(python: Path) -> OtherCode:
    """Run the plane scene of `studies.gas.pyclaw` with both codes.

    Args:
        python: An interpreter that has clawpack.

    Raises:
        BlastEnvError: If it cannot be run, or has none.
    """
    own, other = (
        run(_PYCLAW_CELL_M, _UNTIL_S) for run in (pyclaw.ours, partial(_by_pyclaw, python))
    )
    scene = f"plane, cells of {_PYCLAW_CELL_M:g} m"
    return OtherCode("PyClaw", scene, *(each.cell_updates / each.cpu_s for each in (own, other)))


def _by_pyclaw(python: Path, cell_m: float, until_s: float) -> Histories:
    return pyclaw.by_pyclaw(cell_m, until_s, python)


def beside_foam() -> OtherCode | None:
    """Run the scene of `studies.gas.openfoam` with both codes; `None` if it is not installed."""
    if which("rhoCentralFoam") is None:
        return None
    scene = openfoam.scene(_FOAM_CELL_M)
    with scratch_folder() as folder:
        runs = (
            openfoam.ours(scene, _UNTIL_S),
            openfoam.rho_central_foam(scene, _UNTIL_S, folder / "case"),
        )
    rates = (each.cell_updates / each.cpu_s for each in runs)
    return OtherCode("rhoCentralFoam", f"3-D, cells of {_FOAM_CELL_M:g} m", *rates)
