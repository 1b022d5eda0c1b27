"""Which charges an episode is about, and what the agent may know of them."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from blast_env.scenario import AnySource, Charge, PointSource, Scenario


class ThreatModel(Protocol):
    """Draws the charges of an episode and decides what may be seen of them."""

    def draw(self, scenario: Scenario, rng: np.random.Generator) -> tuple[Charge, ...]:
        """Draw the charges that the layout is assessed against, with nothing but `rng`."""

    def shown(self, scenario: Scenario, charges: tuple[Charge, ...]) -> tuple[AnySource, ...]:
        """Return where the charge is, or may be, as far as the agent may know."""


@dataclass(frozen=True)
class VisibleThreat:
    """One charge, and the agent sees where it is: a layout for each charge."""

    def draw(self, scenario: Scenario, rng: np.random.Generator) -> tuple[Charge, ...]:
        """Draw one charge."""
        return (scenario.sample_charge(rng),)

    def shown(
        self,
        scenario: Scenario,  # noqa: ARG002
        charges: tuple[Charge, ...],
    ) -> tuple[AnySource, ...]:
        """Return the charge itself."""
        return tuple(
            PointSource(position_m=each.position_m, tnt_kg=each.tnt_kg) for each in charges
        )


@dataclass(frozen=True)
class HiddenThreat:
    """Several charges, of which the agent sees only where they may be: one layout for all.

    Attributes:
        threats: How many charges are drawn for an episode.
    """

    threats: int

    def draw(self, scenario: Scenario, rng: np.random.Generator) -> tuple[Charge, ...]:
        """Draw the charges, independently of each other."""
        return tuple(scenario.sample_charge(rng) for _ in range(self.threats))

    def shown(
        self,
        scenario: Scenario,
        charges: tuple[Charge, ...],  # noqa: ARG002
    ) -> tuple[AnySource, ...]:
        """Return the places of the scenario; nothing of the charges."""
        return scenario.charge
