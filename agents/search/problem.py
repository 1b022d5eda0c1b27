"""What a search minimises: the impulse on the protected structures over a set of threats."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from agents.rules import expected_charge
from blast_env.envs.risk import MeanRisk, Risk
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, Threat
from blast_env.scenario import Cell, Charge, Scenario

Layout = tuple[Cell, ...]
"""The cells of a layout; those that a search returns are sorted."""

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
