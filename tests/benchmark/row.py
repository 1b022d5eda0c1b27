"""An engine for tests of the benchmark: barriers near one row help, and nothing blows."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from blast_env.evaluation import BlastLoads
from blast_env.geometry import Element
from blast_env.site import AnyCharge, Scenario
from tests.evaluation.engines.shade import ShadeEngine


@dataclass(frozen=True)
class RowEngine(ShadeEngine):
    """What stands takes off the more, the nearer it is to the row."""

    row: int = 12
    name: str = "row"
    version: str = "row 1"

    def loads(
        self, scenario: Scenario, layout: Sequence[Element], charge: AnyCharge, seed: int
    ) -> BlastLoads:
        """Return the loads."""
        unprotected = super().loads(scenario, (), charge, seed)
        left = 1.0
        for element in layout:
            left *= 1.0 - 0.1 / (1.0 + abs(element[0] - self.row))
        structures = tuple(
            replace(structure, impulse_pa_s=left * structure.impulse_pa_s)
            for structure in unprotected.structures
        )
        return BlastLoads(structures, left * unprotected.module_impulse_n_s)
