"""A bounded store of the loads that were simulated already."""

from collections import OrderedDict
from typing import NamedTuple

from blast_env.errors import BlastEnvError
from blast_env.evaluation.loads import BlastLoads
from blast_env.scenario import Cell, Charge


class BlastKey(NamedTuple):
    """All that the loads of a blast depend on.

    Attributes:
        scenario_hash: Content hash of the scenario.
        layout: The layout's cells, sorted.
        charge: The charge.
        seed: Seed of fan and air.
        engine: Name of the engine.
    """

    scenario_hash: str
    layout: tuple[Cell, ...]
    charge: Charge
    seed: int
    engine: str


class LoadsCache:
    """Keeps the loads that were asked for last.

    Args:
        size: Most loads that are kept; 0 keeps none. One takes 8 bytes a module and about a
            kilobyte beside.

    Raises:
        BlastEnvError: If the size is negative.
    """

    def __init__(self, size: int) -> None:
        if size < 0:
            raise BlastEnvError(f"cache_size is {size}, must be at least 0")
        self.size = size
        self._loads: OrderedDict[BlastKey, BlastLoads] = OrderedDict()

    def __len__(self) -> int:
        return len(self._loads)

    def get(self, key: BlastKey) -> BlastLoads | None:
        """Return the loads of a blast, or `None` if they are not there (any more)."""
        loads = self._loads.get(key)
        if loads is not None:
            self._loads.move_to_end(key)
        return loads

    def add(self, key: BlastKey, loads: BlastLoads) -> None:
        """Keep the loads of a blast; the ones that were asked for longest ago may have to go."""
        self._loads[key] = loads
        self._loads.move_to_end(key)
        if len(self._loads) > self.size:
            self._loads.popitem(last=False)
