"""What observations of placing have in common."""

from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from blast_env.evaluation.evaluator import BlastEvaluator
from blast_env.evaluation.threats import draw_threats
from blast_env.scenario import AnySource, Placement, Scenario
from blast_env.scenario.usability import Surroundings, empty_zone

Array = NDArray[Any]
"""An observation; its data type is that of the space."""

FULL_CHARGE_KG: Final = 1000.0
"""TNT-equivalent mass that is shown as 1; larger ones as well."""

FULL_STOCK: Final = 100
"""Number of modules in stock that is shown as 1; larger ones as well."""


@dataclass(frozen=True, eq=False)
class Sight:
    """What may be known of an episode before the charge goes off.

    Observations are made from this and from the modules placed so far, so that nothing else can
    slip into them: with a hidden threat, `sources` are those of the scenario.

    Attributes:
        scenario: The scenario.
        sources: Where the charge is, or may be.
        evaluator: Runs blasts of the scenario.
    """

    scenario: Scenario
    sources: tuple[AnySource, ...]
    evaluator: BlastEvaluator

    def unprotected_module_impulse_sim(self, blasts: int) -> NDArray[np.float64]:
        """Return the load on each module of the structures without a barrier.

        The mean over blasts of charges from `sources`, with seeds from 0 on: not those that the
        layout is assessed with.

        Args:
            blasts: Number of blasts.

        Returns:
            Simulation units (modules,), in the order of the scenario's structures, row by row.
        """
        shown = self.scenario.model_copy(update={"charge": self.sources})
        threats = draw_threats(shown, range(blasts))
        loads = self.evaluator.loads_of_many([((), threat) for threat in threats])
        mean: NDArray[np.float64] = np.mean([each.module_impulse_sim for each in loads], axis=0)
        return mean


class EpisodeObservation(Protocol):
    """Observes one episode."""

    def observe(self, placement: Placement) -> Array:
        """Return a fresh array in the space, for the modules placed so far."""


class Observation(Protocol):
    """A kind of observation."""

    def space(self, scenario: Scenario) -> spaces.Space[Array]:
        """Return the space, a `Box` that depends on the sizes of site and build zone alone."""

    def episode(self, sight: Sight) -> EpisodeObservation:
        """Prepare the observations of an episode; what does not change is worked out here."""


def charge_share(tnt_kg: float) -> float:
    """Return a charge's mass as it is shown: (mass / 1000 kg)^(1/3), at most 1.

    The cube root, because distances scale with it (Hopkinson and Cranz): a charge of eight times
    the mass acts as one of the same mass at half the distance.
    """
    return float(min((tnt_kg / FULL_CHARGE_KG) ** (1.0 / 3.0), 1.0))


def stock_shares(placement: Placement) -> tuple[float, float, float]:
    """Return what there is left to build with, each from 0 to 1.

    Returns:
        The share of the stock, the number of modules as a share of 100 (at most 1), and the share
        of the budget (1 without a budget).
    """
    zone = placement.scenario.build_zone
    if zone is None:
        return 0.0, 0.0, 0.0
    left, budget_left = placement.stock_left, placement.budget_left
    of_budget = 1.0 if zone.budget is None or budget_left is None else budget_left / zone.budget
    return left / zone.stock, min(left / FULL_STOCK, 1.0), of_budget


def occupied_cells(placement: Placement) -> NDArray[np.bool_]:
    """Return which cells of the build zone hold a module, shape (rows, columns)."""
    occupied = np.zeros(placement.free.shape, dtype=bool)
    if placement.cells:
        occupied[tuple(np.array(placement.cells).T)] = True
    return occupied


def cost_shares(scenario: Scenario) -> NDArray[np.float64]:
    """Return the cost of a module on each cell as a share of the highest, (rows, columns)."""
    zone = scenario.build_zone
    if zone is None:
        return np.zeros((0, 0))
    radius_m = scenario.charge_radius_m
    costs = empty_zone(
        Surroundings(zone, scenario.structures, scenario.charge, radius_m)
    ).module_costs
    shares: NDArray[np.float64] = costs / costs.max()
    return shares
