"""The published blasts in a store, so that they need not be run again."""

import json
import re
from collections import defaultdict
from collections.abc import Iterable
from typing import Any, Final

import numpy as np

from blast_env.benchmark.data.gas_blasts import load
from blast_env.evaluation import BlastEvaluator, BlastStore, LoadCase
from blast_env.evaluation.engines import find_engine
from blast_env.evaluation.record import BlastLoads, StructureLoad
from blast_env.layout import LayoutState
from blast_env.site import Charge, Scenario

_BLAST: Final = ("layout", "charge_x_m", "charge_y_m", "tnt_kg", "charge_height_m")
_LOADS: Final = ("structure", "impulse_pa_s", "peak_pa")


def remember_published(store: BlastStore, scenarios: Iterable[Scenario]) -> int:
    """Keep the blasts of `load("gas_blasts")` in the memory of a store; return their number.

    They are of gas dynamics with uniform cells of 0.5 m. Those of another version of the engine
    are left out. The tables have no loads per module, which are 0.

    Args:
        store: The store, with memory for all of them.
        scenarios: The scenarios whose blasts are kept.
    """
    engine, table, count = find_engine("gas", 0.5), load(), 0
    versions = {text: _version(text) for text in table["engine"].unique()}
    table = table[table["engine"].map(versions) == _version(engine.version)]
    for scenario in scenarios:
        evaluator = BlastEvaluator(scenario, engine, cache=store)
        catalogue = LayoutState.empty(scenario).catalogue
        found: dict[tuple[Any, ...], dict[str, tuple[float, float]]] = defaultdict(dict)
        rows = table[table["scenario_hash"] == scenario.content_hash]
        columns = [rows[name].tolist() for name in (*_BLAST, *_LOADS)]
        for *blast, structure, impulse_pa_s, peak_pa in zip(*columns, strict=True):
            found[tuple(blast)][structure] = impulse_pa_s, peak_pa
        for (text, x_m, y_m, tnt_kg, height_m), known in found.items():
            layout = [catalogue.element_from(tuple(load), "layout") for load in json.loads(text)]
            threat = LoadCase(Charge((x_m, y_m), tnt_kg, height_m), 0)
            loads = tuple(
                StructureLoad.on(structure, *known[structure.name], in_range=True)
                for structure in scenario.structures
            )
            modules = np.zeros(sum(structure.modules for structure in scenario.structures))
            store.remember(evaluator.key(layout, threat), BlastLoads(loads, modules))
        count += len(found)
    return count


def _version(engine: str) -> str:
    """Return the version in the text of a gas engine; empty without one."""
    found = re.search(r"\bgas (\d+) \(", engine)
    return "" if found is None else found[1]
