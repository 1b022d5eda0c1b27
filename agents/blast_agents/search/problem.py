"""What a search is asked, and what it answers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final, Protocol

import numpy as np
import pandas as pd

from blast_agents.rules import expected_charge
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, Threat
from blast_env.geometry import Cell, Layout
from blast_env.physics.scene import Charge
from blast_env.scenario import Scenario
from blast_env.statistics import MeanRisk, Risk

SEED_SPAN = 2**31
"""Seeds of blasts are drawn below this, as the environment does."""


@dataclass(frozen=True, eq=False)
class LayoutProblem:
    """One scenario, the threats that a layout has to stand, and how they become one number.

    All layouts meet the same charges, fans and air (common random numbers), so that what differs
    is due to the layouts. The number is the environment's: the mean over the realisations of each
    charge, then the risk measure over the charges.

    Attributes:
        evaluator: Runs the blasts and remembers them; it has the scenario.
        threats: At least one, none twice; threats with the same charge are realisations of it.
            A search may look at the first few alone, so different charges should come first.
        risk: How the charges become one number.
        processes: Worker processes; they change nothing but the time.

    Raises:
        BlastEnvError: If there are no threats, one is there twice, the scenario has no build zone,
            or `processes` is below 1.
    """

    evaluator: BlastEvaluator
    threats: tuple[Threat, ...]
    risk: Risk = field(default_factory=MeanRisk)
    processes: int = 1

    def __post_init__(self) -> None:
        """Check that there is something to search."""
        if not self.threats:
            raise BlastEnvError("threats: there are none, must be at least one")
        if len(set(self.threats)) < len(self.threats):
            raise BlastEnvError("threats: one is there twice, must be none twice")
        if self.scenario.build_zone is None:
            raise BlastEnvError(f"{self.scenario.name} has no build zone: no layout to search for")
        if self.processes < 1:
            raise BlastEnvError(f"processes is {self.processes}, must be at least 1")

    @property
    def scenario(self) -> Scenario:
        """The scenario."""
        return self.evaluator.scenario

    @property
    def stock(self) -> int:
        """Most modules that a layout may have."""
        zone = self.scenario.build_zone
        return 0 if zone is None else zone.stock

    @property
    def charge(self) -> Charge:
        """The charge if it is known, else the middle of where the scenario lets one be."""
        known = {threat.charge for threat in self.threats}
        return known.pop() if len(known) == 1 else expected_charge(self.scenario.charge)

    def loads_pa_s(self, pairs: Sequence[tuple[Layout, Threat]]) -> list[float]:
        """Return the impulse on the protected structures in each blast, Pa*s.

        Raises:
            LayoutError: If a layout does not fit the build zone.
        """
        loads = self.evaluator.loads_of_many(pairs, self.processes)
        return [each.protected_impulse_pa_s for each in loads]

    def combined_pa_s(self, impulses_pa_s: Sequence[float]) -> float:
        """Return the one number for the impulses under the first threats, Pa*s.

        Args:
            impulses_pa_s: One a threat, in the order of `threats`; at least one, perhaps not all.
        """
        of_charge: dict[Charge, list[float]] = {}
        for threat, impulse_pa_s in zip(self.threats, impulses_pa_s, strict=False):
            of_charge.setdefault(threat.charge, []).append(impulse_pa_s)
        return self.risk(np.array([float(np.mean(each)) for each in of_charge.values()]))

    def impulse_pa_s(self, layout: Sequence[Cell]) -> float:
        """Return the impulse with a layout over all threats, Pa*s; outside any budget.

        Raises:
            LayoutError: If the layout does not fit the build zone.
        """
        return self.combined_pa_s(self.loads_pa_s([(tuple(layout), each) for each in self.threats]))


def visible_threats(charge: Charge, realisations: int, seed: int) -> tuple[Threat, ...]:
    """Return threats for a known charge: the same charge with different fans and air.

    Args:
        charge: The charge.
        realisations: How many, at least one.
        seed: Decides the seeds of the blasts.

    Raises:
        BlastEnvError: If there are to be none.
    """
    return _threats([charge], realisations, np.random.default_rng(seed))


def hidden_threats(
    scenario: Scenario, charges: int, realisations: int, seed: int
) -> tuple[Threat, ...]:
    """Return threats for a hidden charge, drawn from where the scenario lets it be.

    Args:
        scenario: The scenario.
        charges: How many charges, at least one.
        realisations: How many fans and airs for each of them, at least one.
        seed: Decides the charges and the seeds of the blasts.

    Returns:
        First one realisation of each charge, then another of each, and so on. The first charge is
        the one in the middle of all, and each further one as far as possible from those before it,
        so that the first few stand for all.

    Raises:
        BlastEnvError: If there are to be none.
    """
    rng = np.random.default_rng(seed)
    drawn = [scenario.sample_charge(rng) for _ in range(charges)]
    return _threats(_spread_first(drawn), realisations, rng)


def _spread_first(charges: Sequence[Charge]) -> list[Charge]:
    """Return charges, each as far as possible from those before it, the middle one first."""
    places_m = np.array([charge.position_m for charge in charges]).reshape(-1, 2)
    apart_m = np.hypot(*(places_m[:, np.newaxis] - places_m).T)
    order: list[int] = []
    nearest_m = -apart_m.sum(axis=0)
    while len(order) < len(charges):
        order.append(int(np.argmax(nearest_m)))
        nearest_m = apart_m[order].min(axis=0)
        nearest_m[order] = -np.inf
    return [charges[index] for index in order]


def _threats(
    charges: Sequence[Charge], realisations: int, rng: np.random.Generator
) -> tuple[Threat, ...]:
    if realisations < 1:
        raise BlastEnvError(f"realisations is {realisations}, must be at least 1")
    seeds = iter(rng.choice(SEED_SPAN, size=realisations * len(charges), replace=False).tolist())
    return tuple(Threat(charge, next(seeds)) for _ in range(realisations) for charge in charges)


@dataclass(frozen=True)
class Candidate:
    """A layout and what the search knew of it.

    Attributes:
        blasts: Blasts that the search had spent by then.
        layout: Its cells, sorted.
        impulse_pa_s: Impulse over the threats that it had met, Pa*s.
        threats: How many threats that were, counted from the first.
    """

    blasts: int
    layout: Layout
    impulse_pa_s: float
    threats: int


@dataclass(frozen=True)
class Progress:
    """How far a search has come.

    Attributes:
        blasts: Blasts spent.
        budget: Most that it may spend.
        best: The best layout so far; `None` before the first.
    """

    blasts: int
    budget: int
    best: Candidate | None


@dataclass(frozen=True)
class SearchResult:
    """What a search found.

    Attributes:
        method: Name of the method.
        layout: The best layout, its cells sorted; empty if the search ended before it had one.
        impulse_pa_s: Its impulse over the threats that it has met, Pa*s; `None` without a blast.
            The search chose it by these blasts, so that on others it will be somewhat more.
        threats: How many threats it has met.
        blasts: Blasts spent: distinct pairs of layout and threat that the search asked for,
            whatever a cache knew of them.
        budget: Most that it might have spent.
        seed: What decided everything that was drawn.
        history: The best layout each time that it changed.
        interrupted: Whether it was ended from outside (Ctrl-C) before it was through.
        front: The layouts of which none has both less impulse and fewer modules, by number of
            modules; only of methods that search for it.
    """

    method: str
    layout: Layout
    impulse_pa_s: float | None
    threats: int
    blasts: int
    budget: int
    seed: int
    history: tuple[Candidate, ...]
    interrupted: bool
    front: tuple[Candidate, ...] = ()

    def best_at(self, blasts: int) -> Candidate | None:
        """Return the best layout after so many blasts, or `None` if there was none yet.

        A search plans for its whole budget. What it has after part of it is less than what a
        search with that budget finds.
        """
        by_then = [each for each in self.history if each.blasts <= blasts]
        return by_then[-1] if by_then else None

    def history_table(self) -> pd.DataFrame:
        """Return one row each time that the best layout changed."""
        return _table(self.history)

    def front_table(self) -> pd.DataFrame:
        """Return one row a layout of the front."""
        return _table(self.front)


def _table(candidates: tuple[Candidate, ...]) -> pd.DataFrame:
    return pd.DataFrame(
        [
            (each.blasts, each.impulse_pa_s, each.threats, len(each.layout), _cells_text(each))
            for each in candidates
        ],
        columns=["blasts", "impulse_pa_s", "threats", "modules", "layout"],
    )


def _cells_text(candidate: Candidate) -> str:
    """Return the cells of a layout for one field of a table: `3,4 3,5`."""
    return " ".join(f"{row},{column}" for row, column in candidate.layout)


LAYOUTS_PER_REALISATION: Final = 500
"""A known charge is met with one fan and air more for so many layouts that the budget pays for."""


CHARGES_PER_ROOT_BLAST: Final = 0.3
"""Of a hidden charge's places a layout meets so many times the square root of the budget."""


CONFIRMED_LAYOUTS: Final = 32
"""Layouts of which the blasts that are held back can pay for all threats."""


MOST_CONFIRMING_SHARE: Final = 0.2
"""Largest share of the budget that is held back to let the best layouts meet more threats."""


@dataclass(frozen=True)
class Plan:
    """How a search divides its blasts.

    Attributes:
        threats: How many threats a layout meets while the search explores.
        exploring_blasts: How many blasts it spends on exploring.
    """

    threats: int
    exploring_blasts: int

    @property
    def exploring_layouts(self) -> int:
        """How many layouts it can try, at least one."""
        return max(1, self.exploring_blasts // self.threats)

    @classmethod
    def of(cls, problem: LayoutProblem, budget: int) -> "Plan":
        """Return the plan for a budget.

        A layout's impulse differs little from one fan and air to the next, less than layouts do
        from each other: against a known charge it pays to try many layouts under one threat each,
        and to find out the lucky ones among the best at the end. It differs much from one place of
        the charge to the next: what stands well against one may do nothing against the others, so
        that against a hidden charge layouts meet several places from the start.
        """
        most = len(problem.threats)
        if len({threat.charge for threat in problem.threats}) == 1:
            wanted = budget // LAYOUTS_PER_REALISATION
        else:
            wanted = round(CHARGES_PER_ROOT_BLAST * budget**0.5)
        threats = max(1, min(wanted, most, budget))
        if threats == most:
            return cls.thorough(problem, budget)
        held_back = min(CONFIRMED_LAYOUTS * most, int(MOST_CONFIRMING_SHARE * budget))
        return cls(threats, budget - held_back)

    @classmethod
    def thorough(cls, problem: LayoutProblem, budget: int) -> "Plan":
        """Return the plan by which every layout meets every threat at once."""
        return cls(len(problem.threats), budget)


Report = Callable[[Progress], None]
"""Is told after every batch of blasts how far a search has come."""


class SearchMethod(Protocol):
    """Looks for the layout with the least impulse."""

    @property
    def name(self) -> str:
        """Name in tables and on the command line."""

    def search(
        self, problem: LayoutProblem, budget: int, seed: int, report: Report | None = None
    ) -> SearchResult:
        """Return the best layout that was found.

        The same arguments give the same result. Ctrl-C ends the search: the best so far is
        returned.

        Args:
            problem: What is minimised.
            budget: Most blasts that may be spent; see `SearchResult.blasts`.
            seed: Decides everything that is drawn.
            report: Is told how far it has come.

        Raises:
            BlastEnvError: If the method cannot do anything with the budget.
        """


@dataclass(frozen=True, eq=False)
class Unprotected:
    """What arrives at the protected structures without a barrier.

    Its blasts are for the reader of a result; they count in no search's budget.

    Attributes:
        problem: The threats and how they become one number.
        impulses_pa_s: One a threat, Pa*s.
    """

    problem: LayoutProblem
    impulses_pa_s: tuple[float, ...]

    @classmethod
    def of(cls, problem: LayoutProblem) -> "Unprotected":
        """Simulate the threats without a barrier.

        Raises:
            BlastEnvError: If nothing arrives under the first threat: there is nothing to reduce.
        """
        impulses_pa_s = tuple(problem.loads_pa_s([((), threat) for threat in problem.threats]))
        if not impulses_pa_s[0] > 0.0:
            raise BlastEnvError(
                f"{problem.scenario.name}: nothing arrives at the protected structures without a "
                f"barrier under {problem.threats[0]}: there is nothing to reduce"
            )
        return cls(problem, impulses_pa_s)

    @property
    def impulse_pa_s(self) -> float:
        """The one number for all threats, Pa*s."""
        return self.problem.combined_pa_s(self.impulses_pa_s)

    def reduction(self, candidate: Candidate) -> float:
        """Return by which share a layout lowers the impulse under the threats that it has met."""
        bare_pa_s = self.problem.combined_pa_s(self.impulses_pa_s[: candidate.threats])
        return 1.0 - candidate.impulse_pa_s / bare_pa_s
