"""Reduction of the impulse by rules, random layouts and a search, with items, by gas dynamics.

The places of the charge are known, but not which of them it takes: one layout serves for all. Gas
dynamics is deterministic, so that a layout needs one blast per place. A separate search for every
place shows the reduction by the layout for one place at the others.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.design.rules import expected_charge, random_layout
from blast_env.design.search import LayoutProblem, ProposerKind, find_proposer, proposers
from blast_env.design.search.registry import Rule
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, Case, SeedRange, Threat
from blast_env.evaluation.comparison import check_something_arrives
from blast_env.evaluation.engines import Engine
from blast_env.evaluation.engines.contract import load_plugin
from blast_env.geometry import Layout, Piece
from blast_env.layout import Placement
from blast_env.site import AnyCharge, PointSource, Scenario, VehicleCharge, VehicleSource
from blast_env.site.scene import Charge
from studies.difficulty.study import TaskResult, WayOutcome

METHOD: Final = "population_annealing"
"""Search method; it begins with the best of rules, random layouts and random walls."""

_BARE: Final = "no barrier"
_RANDOM: Final = "random layouts (mean)"
_CACHE_SIZE: Final = 100_000
_BEST_RANDOM: Final = 3  # best random layouts among the starts of the search


class Purchase(Enum):
    """The first use of the budget by a rule."""

    HEIGHT = "height"
    LENGTH = "length"
    DISTANCE = "distance"


class NamedRule(NamedTuple):
    """A rule with its purchase; `None` for more than one."""

    rule: Rule
    buys: Purchase | None


_BUYS: Final[Mapping[str, Purchase]] = MappingProxyType(
    {
        "wall_near_charge": Purchase.HEIGHT,
        "wall_in_middle": Purchase.HEIGHT,
        "wall_near_building": Purchase.HEIGHT,
        "long_wall_near_charge": Purchase.LENGTH,
        "long_wall_in_middle": Purchase.LENGTH,
        "long_wall_near_building": Purchase.LENGTH,
        "line_of_posts": Purchase.DISTANCE,
    }
)
"""The purchase of rules with a single one, by their names in the registry."""


def rules_of(scenario: Scenario) -> Mapping[str, NamedRule]:
    """Return the rules of the registry that suit a scenario, by title."""
    rows = proposers(ProposerKind.RULE, suiting=[scenario])
    return {
        row.title: NamedRule(load_plugin(row.place), _BUYS.get(name)) for name, row in rows.items()
    }


@dataclass(frozen=True)
class ItemEffort:
    """Limits on the number of blasts of a study.

    Attributes:
        layouts: Random layouts.
        budget: Blasts of the search for one layout against all places.
        tried: Places used in this search; its finalists are judged at all places.
        finalists: Number of the search's last improvements that are judged.
        place_budget: Blasts of the search for each single place.
    """

    layouts: int = 50
    budget: int = 1000
    tried: int = 2
    finalists: int = 8
    place_budget: int = 100

    def blasts(self, scenario: Scenario) -> int:
        """Return the maximum number of blasts of a study of a scenario."""
        places, rules = len(every_place(scenario)), len(rules_of(scenario))
        judged = 1 + self.layouts + rules + self.finalists + places
        return judged * places + self.budget + places * self.place_budget


def every_place(scenario: Scenario) -> tuple[Threat, ...]:
    """Return one threat for each place of the charge: each point, and each rank of a vehicle.

    Raises:
        BlastEnvError: If the charge may be anywhere on a line or area, or the places are not
            equally likely: their mean would not be the scenario's expected value.
    """
    charges: list[AnyCharge] = []
    shares = []
    for source in scenario.charge:
        if isinstance(source, PointSource):
            own: list[AnyCharge] = [Charge(source.position_m, source.tnt_kg, source.height_m)]
        elif isinstance(source, VehicleSource):
            own = [VehicleCharge(source, rank) for rank in range(source.places)]
        else:
            raise BlastEnvError(
                f"{scenario.name}: a source of kind {source.kind!r} has no end of places, must be "
                "points or vehicles"
            )
        charges += own
        shares += [source.weight / len(own)] * len(own)
    if not np.allclose(shares, shares[0]):
        raise BlastEnvError(
            f"{scenario.name}: the places of the charge have weights from {min(shares):g} to "
            f"{max(shares):g}, must all be as likely"
        )
    seeds = SeedRange.JUDGEMENT.seeds(0, len(charges))
    return tuple(Threat(charge, seed) for charge, seed in zip(charges, seeds, strict=True))


@dataclass(frozen=True, eq=False)
class ItemResult:
    """Results of the study of a scenario.

    Attributes:
        scenario: The scenario.
        effort: Limits on the number of blasts.
        places: The places of the charge.
        task: The rows of the table, each judged at all places.
        finalists: Successive best layouts of the search.
        of_places: Best layouts of the searches for single places.
        buys: Purchase of each rule of the table.
        searched_blasts: Blasts used by the search.
    """

    scenario: Scenario
    effort: ItemEffort
    places: tuple[Threat, ...]
    task: TaskResult
    finalists: WayOutcome
    of_places: WayOutcome
    buys: tuple[Purchase | None, ...]
    searched_blasts: int

    @property
    def best(self) -> WayOutcome:
        """The layout with the largest reduction, of the rules and the search."""
        return self.task.best

    @cached_property
    def over_rules(self) -> float:
        """Lead in reduction of the best found over the best rule, at least 0."""
        return self.best.reduction.value - self.task.best_rule.reduction.value

    def rule_loss(self, name: str) -> float | None:
        """Return the shortfall of a rule against the best found; `None` if the rule is missing."""
        for row in self.task.rules:
            if row.name == name:
                return self.best.reduction.value - row.reduction.value
        return None

    @cached_property
    def random_percentiles(self) -> tuple[float, float]:
        """10th and 90th percentile of the reduction by random layouts."""
        low, high = np.quantile(self.task.random.layout_reductions, (0.1, 0.9))
        return float(low), float(high)

    @cached_property
    def elsewhere(self) -> FloatArray:
        """Reduction by the best layout for one place at another one (places, places).

        The best layout for a place has the largest reduction there of all layouts judged.
        """
        rows = (self.task.random, *self.task.rules, self.finalists, self.of_places)
        impulse = np.concatenate([each.impulse_pa_s for each in rows])
        best = impulse[impulse.argmin(axis=0)]
        return np.asarray(1.0 - best / self.task.bare.unprotected_pa_s)

    @property
    def loss_elsewhere(self) -> float:
        """Largest shortfall of the best layout for one place at another one."""
        return float((np.diag(self.elsewhere) - self.elsewhere).max())

    @cached_property
    def purchases(self) -> Mapping[Purchase, float]:
        """Reduction by the best rule with a single purchase, by purchase."""
        found: dict[Purchase, float] = {}
        for row, buys in zip(self.task.rules, self.buys, strict=True):
            if buys is not None:
                found[buys] = max(row.reduction.value, found.get(buys, -np.inf))
        return found

    @property
    def better_buy(self) -> Purchase:
        """The single purchase with the largest reduction."""
        return max(self.purchases, key=lambda each: self.purchases[each])


def cost_of(scenario: Scenario, layout: Layout) -> float:
    """Return the cost of a layout."""
    return Placement.of(scenario, layout).cost


def pieces_text(layout: Layout) -> str:
    """Return the number of pieces of each item in a layout, the most frequent first."""
    counts = Counter(each.item for each in layout if isinstance(each, Piece))
    return ", ".join(f"{count} {item}" for item, count in counts.most_common()) or "-"


class ItemStudy:
    """Runs the blasts of a scenario with a catalogue.

    Args:
        scenario: The scenario.
        effort: Limits on the number of blasts.
        engine: Name of the engine, or an engine.
        processes: Worker processes.
        progress: Called with the finished share of the blasts.
        cache: Folder of stored blasts, with which an interrupted study continues.

    Attributes:
        evaluator: Runs the blasts and caches them.
        places: The places of the charge.

    Raises:
        BlastEnvError: As `every_place`, or if the engine is unknown.
    """

    def __init__(
        self,
        scenario: Scenario,
        effort: ItemEffort,
        engine: str | Engine = "gas",
        processes: int = 2,
        progress: Callable[[float], None] | None = None,
        cache: Path | None = None,
    ) -> None:
        self.evaluator = BlastEvaluator(scenario, engine, cache_size=_CACHE_SIZE, cache=cache)
        self.places = every_place(scenario)
        self._scenario = scenario
        self._effort = effort
        self._processes = processes
        self._progress = progress
        self._rules = rules_of(scenario)

    def result(self) -> ItemResult:
        """Run the study and return its results."""
        scenario, effort = self._scenario, self._effort
        bare = self._impulses([()])
        check_something_arrives([Case(scenario, self.places)], bare)

        def outcome(name: str, layouts: Sequence[Layout]) -> WayOutcome:
            return WayOutcome(name, tuple(layouts), self._impulses(layouts), bare[0])

        rng = np.random.default_rng(0)
        random = outcome(_RANDOM, [random_layout(scenario, rng) for _ in range(effort.layouts)])
        hidden = expected_charge(scenario.charge)
        rules = {name: each.rule(scenario, hidden) for name, each in self._rules.items()}
        task_rules = tuple(outcome(name, [layout]) for name, layout in rules.items())
        best_random = np.argsort(random.impulse_pa_s.mean(axis=1), kind="stable")[:_BEST_RANDOM]
        starts = (*rules.values(), *(random.layouts[index] for index in best_random))
        found, blasts = self._searched(starts)
        finalists = outcome("finalists", found)
        best = int(finalists.impulse_pa_s.mean(axis=1).argmin())
        of_places = [self._for_place(place) for place in self.places]
        return ItemResult(
            scenario=scenario,
            effort=effort,
            places=self.places,
            task=TaskResult(
                bare=WayOutcome(_BARE, ((),), bare, bare[0]),
                random=random,
                rules=task_rules,
                searched=outcome(f"{METHOD}, {blasts} blasts", [found[best]]),
            ),
            finalists=finalists,
            of_places=outcome("best for a place", of_places),
            buys=tuple(each.buys for each in self._rules.values()),
            searched_blasts=blasts,
        )

    def _searched(self, starts: tuple[Layout, ...]) -> tuple[list[Layout], int]:
        """Return the last improvements of the search for all places, and its number of blasts."""
        effort = self._effort
        # Evenly spaced places, the first and last included; the search does not see the others.
        chosen = np.linspace(0, len(self.places) - 1, min(effort.tried, len(self.places)))
        tried = [self.places[round(each)] for each in chosen]
        case = Case(self._scenario, tuple(tried))
        problem = LayoutProblem(self.evaluator, case, self._processes)
        method = find_proposer(METHOD, _distinct(starts))
        result = method.propose(problem, effort.budget, 0, lambda _: self._report(0.0))
        history = [each.layout for each in result.history[-effort.finalists :]]
        return history or [result.layout], result.blasts

    def _for_place(self, place: Threat) -> Layout:
        """Return the best layout of a search for a single place of the charge."""
        scenario = self._scenario
        starts = tuple(each.rule(scenario, place.charge) for each in self._rules.values())
        problem = LayoutProblem(self.evaluator, Case(scenario, (place,)), self._processes)
        method = find_proposer(METHOD, _distinct(starts))
        return method.propose(
            problem, self._effort.place_budget, 0, lambda _: self._report(0.0)
        ).layout

    def _impulses(self, layouts: Sequence[Layout]) -> FloatArray:
        """Return the impulse on the protected structures, Pa*s (layouts, places)."""
        pairs = product(layouts, self.places)
        loads = self.evaluator.loads_of_many(pairs, self._processes, self._report)
        impulses = np.array([each.protected_impulse_pa_s for each in loads])
        return impulses.reshape(len(layouts), len(self.places))

    def _report(self, _: float) -> None:
        """Report the finished share of all blasts, regardless of the share of a batch."""
        if self._progress is not None:
            done = self.evaluator.blasts + self.evaluator.cache_hits
            self._progress(min(done / self._effort.blasts(self._scenario), 1.0))


def _distinct(layouts: Sequence[Layout]) -> tuple[Layout, ...]:
    """Return the layouts without duplicates and empty ones."""
    return tuple({tuple(sorted(each)): each for each in layouts if each}.values())
