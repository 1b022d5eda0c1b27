"""Comparison of the peak specific impulse with the sum of all positive phases."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.evaluation.engines.gas import GasBlast, GasEngine, GasResult
from blast_env.gas.grid import GasGrid
from blast_env.gas.solver import Gas, Recorder
from blast_env.geometry import Layout
from blast_env.site import Scenario, load_scenario
from studies.bench import street
from studies.gas.cells import engine_with

STREET: Final = "street of 100 m, 500 kg"


@dataclass(frozen=True)
class LongRun:
    """A site with the cells and the duration of the runs that sum up all positive phases.

    Attributes:
        name: Bundled name, or `STREET`.
        cells: Side of the cells in m, or "coarse".
        until_s: Duration: echoes in a street last for a second.
    """

    name: str
    cells: str
    until_s: float

    @property
    def site(self) -> Scenario:
        """The scenario."""
        return street(100.0) if self.name == STREET else load_scenario(self.name)

    @property
    def engine(self) -> GasEngine:
        """The engine, which ends a run when its loads are known."""
        return engine_with(self.cells)


LONG_RUNS: Final = (
    LongRun("visitor_entrance", "0.5", 0.18),
    LongRun("visitor_entrance", "0.25", 0.18),
    LongRun("control_room", "0.5", 0.18),
    LongRun("street_front", "coarse", 1.3),
    LongRun("campus", "coarse", 1.0),
    LongRun("car_park", "coarse", 1.0),
    LongRun("government_forecourt", "coarse", 1.0),
    LongRun(STREET, "coarse", 1.3),
)
"""The rows of the table in docs/engineers/gas.md."""


class PositivePhases:
    """Recorder of the sum of all positive phases on the faces of the solver."""

    def __init__(self) -> None:
        self.impulse_pa_s: FloatArray = np.zeros(0)

    def record(self, solver: Gas, step_s: float) -> None:
        """Add a step."""
        part = step_s * np.maximum(solver.wall_overpressure_pa(), 0.0)
        self.impulse_pa_s = part if not len(self.impulse_pa_s) else self.impulse_pa_s + part


@dataclass(frozen=True)
class LoadsByDefinition:
    """The loads of a blast on the protected structures by both definitions.

    Loads are means over the cell faces of the counted walls.

    Attributes:
        positive_pa_s: Sum of all positive phases until the end of a long run.
        impulse_pa_s: Peak specific impulse.
        reached_s: Mean time of the peak specific impulse over these faces.
        last_s: Largest time of it on any of them.
        end_s: End of a run that waits for it.
    """

    positive_pa_s: float
    impulse_pa_s: float
    reached_s: float
    last_s: float
    end_s: float


def both_loads(
    scenario: Scenario, layout: Layout, engine: GasEngine, until_s: float
) -> LoadsByDefinition:
    """Run a blast until a time, and again until its loads are known."""
    phases = PositivePhases()

    def recorders(_: GasGrid) -> Sequence[Recorder]:
        return (phases,)

    long = GasBlast(scenario, layout, engine=replace(engine, until=until_s))
    result: GasResult = long.run(recorders=recorders)
    run = result.run
    names = {
        structure.name: structure.faces for structure in run.site.structures if structure.protected
    }
    counts = np.array(
        [
            name in names and face in names[name]
            for name, face in zip(result.faces["structure"], result.faces["face"], strict=True)
        ]
    )
    short = GasBlast(scenario, layout, engine=engine).run()
    reached_s = run.loads.impulse_time_s[counts]
    return LoadsByDefinition(
        positive_pa_s=float(phases.impulse_pa_s[counts].mean()),
        impulse_pa_s=float(run.loads.impulse_pa_s[counts].mean()),
        reached_s=float(reached_s.mean()),
        last_s=float(reached_s.max()),
        end_s=short.time_s,
    )
