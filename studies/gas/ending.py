"""Comparison of loads at the end of a run with those of a run several times as long."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from time import process_time
from typing import Final

import numpy as np
from pydantic import TypeAdapter

from blast_env.arrays import FloatArray
from blast_env.evaluation import BlastEvaluator, LoadCase
from blast_env.evaluation.engines.gas import GasBlast, GasEngine, GasResult
from blast_env.geometry import Layout
from blast_env.response.facade import respond
from blast_env.response.levels import LevelOfProtection
from blast_env.results import EndReason
from blast_env.rules import random_layout
from blast_env.site import Scenario, bundled_scenarios, load_scenario
from blast_env.sites import FAMILIES, generate_site
from blast_env.store import Store

_LARGE_M: Final = 50.0


@dataclass(frozen=True)
class Ending:
    """The loads that a run waits for, at its end and later.

    Attributes:
        time_s: End of the run.
        cpu_s: CPU time of the run until then.
        reason: Reason for its end.
        missed: Largest share of the load of a counted protected wall that arrived after the end.
        missed_of_all: Share of the load of the protected buildings that arrived after the end.
        levels: Level of protection of the facades, at the end and later; `None` without any.
    """

    time_s: float
    cpu_s: float
    reason: EndReason
    missed: float
    missed_of_all: float
    levels: tuple[LevelOfProtection | None, LevelOfProtection | None]


_ENDING: Final = TypeAdapter(Ending)


def ending(blast: GasBlast, times: float = 4.0, store: Store | None = None) -> Ending:
    """Run a blast to its end, and continue its gas to `times` times that time.

    What is in the store is not run again.
    """
    inputs = BlastEvaluator(blast.scenario, blast.engine).key(blast.layout, LoadCase(blast.threat))
    key = json.dumps(("ending", inputs, times))
    found = None if store is None else store.read(key, _ENDING.validate_json)
    if found is None:
        found = _ending(blast, times)
        if store is not None:
            store.put(key, _ENDING.dump_json(found))
    return found


def _ending(blast: GasBlast, times: float) -> Ending:
    start = process_time()
    result = blast.run()
    cpu_s, time_s, reason = process_time() - start, result.time_s, result.end_reason
    now = _Loads.of(result)
    result.run.solver.advance(times * time_s)
    later = _Loads.of(result.now())
    return Ending(
        time_s,
        cpu_s,
        reason,
        float((1.0 - now.on_walls_pa_s / later.on_walls_pa_s).max(initial=0.0)),
        1.0 - now.on_buildings_pa_s / later.on_buildings_pa_s,
        (now.level, later.level),
    )


@dataclass(frozen=True, eq=False)
class _Loads:
    """Current loads on counted protected walls and protected buildings, and the level."""

    on_walls_pa_s: FloatArray
    on_buildings_pa_s: float
    level: LevelOfProtection | None

    @classmethod
    def of(cls, result: GasResult) -> "_Loads":
        walls = result.walls
        protected = {
            structure.name for structure in result.blast.scenario.structures if structure.protected
        }
        chosen = walls[walls["counts"] & walls["structure"].isin(protected)]
        bays = result.bay_loads
        level = None
        if bays.bays:
            level = respond(bays.bays, *bays.histories).level_of_protection
        impulse = chosen["impulse_pa_s"].to_numpy(dtype=np.float64)
        return cls(impulse, result.loads().protected_impulse_pa_s, level)


def sites(generated: int) -> Iterator[tuple[str, Scenario, GasEngine]]:
    """Yield the bundled sites, then `generated` sites of each family, if they protect a structure.

    Each has a title and an engine, whose cells grow if the site is large.
    """
    found = {name: load_scenario(name) for name in bundled_scenarios()}
    for family, ranges in FAMILIES.items():
        found |= {f"{family}/{seed}": generate_site(seed, ranges) for seed in range(generated)}
    for title, site in found.items():
        if any(structure.protected for structure in site.structures):
            large = max(site.site.width_m, site.site.height_m) > _LARGE_M
            yield title, site, GasEngine(cells="coarse" if large else "uniform")


def layouts(site: Scenario) -> dict[str, Layout]:
    """Return no barrier and, on sites with a build zone, a random layout."""
    found: dict[str, Layout] = {"none": ()}
    if site.build_zone is not None:
        found["random"] = random_layout(site, np.random.default_rng(0))
    return found
