"""A problem small enough that every layout can be tried, and evaluators that watch or break off."""

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from functools import cache
from itertools import combinations

import numpy as np

from blast_env import load_scenario
from blast_env.design.search import DesignProblem, Layout
from blast_env.errors import LayoutError
from blast_env.evaluation import BlastEvaluator, BlastLoads, BlastStore, LoadCase, LoadCaseSet
from blast_env.geometry import Element
from blast_env.layout import LayoutState
from blast_env.site import Scenario
from tests.agents.sites import site
from tests.evaluation.engines.rays import RaysEngine

CALIBRATION = "ballistic_kb_100kg"


def small_scenario(rows: int = 4, columns: int = 3, stock: int = 3) -> Scenario:
    """Return a site with a few cells between the charge, a little off the middle, and building."""
    scenario = site(
        charge_m=(5.0, 20.5), corner_m=(15.0, 19.0), rows=rows, columns=columns, stock=stock
    )
    return scenario.model_copy(update={"calibration": CALIBRATION})


def ballistic(name: str) -> Scenario:
    """Return a bundled scenario in thin air, in which a blast takes a few milliseconds."""
    document = load_scenario(name).model_dump()
    document |= {"simulation": {"preset": "ballistic"}, "calibration": CALIBRATION}
    return Scenario.from_document(document, name)


@cache
def known_blasts() -> BlastStore:
    """Return one store for all tests: the same blasts come again and again."""
    return BlastStore.of(None, 10_000)


def small_problem(
    evaluator: BlastEvaluator | None = None, realisations: int = 2, processes: int = 1
) -> DesignProblem:
    """Return the problem of the small site's own charge: 299 layouts, 598 blasts."""
    evaluator = evaluator or BlastEvaluator(small_scenario(), RaysEngine(), cache=known_blasts())
    charge = evaluator.scenario.sample_charge(np.random.default_rng(0))
    seeds = np.random.default_rng(5).choice(2**31, realisations, replace=False)
    threats = tuple(LoadCase(charge, seed) for seed in seeds.tolist())
    case = LoadCaseSet(evaluator.scenario, threats, realisations, charge=charge)
    return DesignProblem(evaluator, case, processes)


def every_layout(problem: DesignProblem) -> list[Layout]:
    """Return every legal layout, in ascending number of modules or pieces."""
    empty = LayoutState.empty(problem.scenario)
    actions = np.flatnonzero(empty.places(empty.usable)).tolist()
    places = [empty.catalogue.element(action) for action in actions]
    found: list[Layout] = []
    for count in range(min(problem.stock, len(places)) + 1):
        for layout in combinations(places, count):
            with suppress(LayoutError):
                found.append(LayoutState.of(problem.scenario, layout).layout)
    return found


class WatchedEvaluator(BlastEvaluator):
    """Tells somebody which blasts are asked for, before they are run."""

    def __init__(
        self, scenario: Scenario, watch: Callable[[list[tuple[Layout, LoadCase]]], None]
    ) -> None:
        super().__init__(scenario, RaysEngine(), cache=known_blasts())
        self._watch = watch

    def loads_of_many(
        self,
        pairs: Iterable[tuple[Sequence[Element], LoadCase]],
        processes: int = 1,
        progress: Callable[[float], None] | None = None,
    ) -> list[BlastLoads]:
        asked = [(tuple(layout), threat) for layout, threat in pairs]
        self._watch(asked)
        return super().loads_of_many(asked, processes, progress)
