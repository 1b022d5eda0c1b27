"""The published blasts as a cache, so that they need not be run again."""

import json
import re
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from blast_env.benchmark.data.gas_blasts import load
from blast_env.evaluation import BlastCache, BlastKey
from blast_env.evaluation.engines import BlastLoads, StructureLoad
from blast_env.site import Scenario

_CELLS: Final = "cell_m=0.5"
_GROWING: Final = r"cells='(?:coarse|fine)'"
_VERSION: Final = r"\bgas (\d+) \("
_COLUMNS: Final = (
    "engine",
    "scenario_hash",
    "layout",
    "charge_x_m",
    "charge_y_m",
    "charge_height_m",
    "tnt_kg",
    "structure",
    "impulse_pa_s",
    "peak_pa",
)

ChargeNumbers = tuple[float, float, float, float]
"""x, y and height in m, and mass in kg."""


@dataclass(eq=False)
class PublishedBlasts:
    """The blasts of `load("gas_blasts")` as a cache for gas dynamics with uniform cells of 0.5 m.

    They serve the version of the engine that ran them alone: another one has other loads.

    Attributes:
        scenarios: Scenarios of the blasts, by their hashes.
        behind: A cache for other blasts; without one they are not kept.
        rows: Impulse in Pa s and peak in Pa on each structure, by version of the engine, hash,
            layout and charge.
    """

    scenarios: Mapping[str, Scenario]
    behind: BlastCache | None = None
    rows: dict[tuple[str, str, str, ChargeNumbers], dict[str, tuple[float, float]]] = field(
        init=False
    )

    def __post_init__(self) -> None:
        """Read the tables."""
        self.rows = defaultdict(dict)
        table = load()
        table = table[table.scenario_hash.isin(list(self.scenarios))]
        table = table[~table.engine.str.contains(_GROWING)]
        columns = [table[name].tolist() for name in _COLUMNS]
        for engine, scenario_hash, layout, x_m, y_m, height_m, tnt_kg, structure, *loads in zip(
            *columns, strict=True
        ):
            row = _version(engine), scenario_hash, _normal(layout), (x_m, y_m, height_m, tnt_kg)
            self.rows[row][structure] = loads[0], loads[1]

    def get(self, key: BlastKey) -> BlastLoads | None:
        """Return the loads of a published blast, or those from the cache behind; else `None`."""
        charge = (*key.charge.position_m, key.charge.height_m, key.charge.tnt_kg)
        known = None
        if _CELLS in key.engine and not re.search(_GROWING, key.engine):
            row = _version(key.engine), key.scenario_hash, _normal(json.dumps(key.layout)), charge
            known = self.rows.get(row)
        if known is None:
            return None if self.behind is None else self.behind.get(key)
        structures = self.scenarios[key.scenario_hash].structures
        loads = tuple(
            StructureLoad.on(each, *known[each.name], in_range=True) for each in structures
        )
        modules = sum(each.modules for each in structures)
        return BlastLoads(loads, np.zeros(modules))  # the tables have no loads per module

    def add(self, key: BlastKey, loads: BlastLoads) -> None:
        """Add a blast to the cache behind, if there is one."""
        if self.behind is not None:
            self.behind.add(key, loads)


def _version(engine: str) -> str:
    """Return the version in the text of a gas engine; empty without one."""
    found = re.search(_VERSION, engine)
    return "" if found is None else found[1]


def _normal(layout: str) -> str:
    return json.dumps(sorted(json.loads(layout)))
