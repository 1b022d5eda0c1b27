"""Loads, cost and memory of blasts on cells that grow, over those of uniform cells."""

from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from time import process_time

from blast_env.evaluation.engines.gas import GasEngine
from blast_env.site import Scenario
from studies.bench import own_memory_mb, street

_WARM_UP_M = 20.0


@dataclass(frozen=True)
class StructureLoad:
    """Mean loads on the counted walls of a structure.

    Attributes:
        name: Name of the structure.
        impulse_pa_s: Peak specific impulse.
        peak_pa: Peak overpressure.
    """

    name: str
    impulse_pa_s: float
    peak_pa: float


@dataclass(frozen=True)
class CellsCompared:
    """A blast without a barrier on one choice of cells.

    Attributes:
        cells: The choice, for display.
        loads: Loads on the protected structures.
        cell_updates: Number of cell updates.
        cpu_s: Processor time.
        memory_mb: Peak memory of the process.
    """

    cells: str
    loads: tuple[StructureLoad, ...]
    cell_updates: int
    cpu_s: float
    memory_mb: float


def compare_cells(scenario: Scenario, engine: GasEngine) -> CellsCompared:
    """Run a blast in a process of its own, for its time and memory.

    Raises:
        BrokenProcessPool: If the process is killed, as for want of memory.
    """
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(_compared, scenario, engine).result()


def _compared(scenario: Scenario, engine: GasEngine) -> CellsCompared:
    engine.blast(street(_WARM_UP_M)).run()  # compiles code that is not on disk yet
    began = process_time()
    result = engine.blast(scenario).run()
    cpu_s = process_time() - began
    structures = result.structures
    loads = tuple(
        StructureLoad(str(row["structure"]), float(row["impulse_pa_s"]), float(row["peak_pa"]))
        for _, row in structures[structures["protected"]].iterrows()
    )
    updates = result.run.solver.cell_updates
    return CellsCompared(engine.cell_words, loads, updates, cpu_s, own_memory_mb())
