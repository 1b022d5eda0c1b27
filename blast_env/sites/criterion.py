"""Which sites are worth solving."""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

from blast_env.scenario import Scenario
from blast_env.sites.measures import SiteMeasures


class Objection(NamedTuple):
    """Why a site is not used.

    Attributes:
        rule: What it does not keep, in the same words for all sites.
        found: What it has instead.
    """

    rule: str
    found: str


class SiteCriterion(Protocol):
    """Decides whether a site is used: a pure function of the scenario."""

    def objection(self, scenario: Scenario) -> Objection | None:
        """Return why a site is not used, or `None` if it is."""


@dataclass(frozen=True)
class SightLineCriterion:
    """Sites where a good layout does much, none does everything, and places make a difference.

    Told from the sight lines (`SiteMeasures`) in a few milliseconds, without a blast.
    `scripts/check_sites.py` compares it with blasts.

    Attributes:
        least_open_share: Share of the sight lines that other structures must leave open.
        least_layout_share: Share of these that the sight-line layout must cut at least.
        most_layout_share: Share that it may cut at most, and any straight wall.
        least_advantage: How much more it must cut than random layouts do on average.
    """

    least_open_share: float = 0.6
    least_layout_share: float = 0.5
    most_layout_share: float = 0.9
    least_advantage: float = 0.3

    def objection(self, scenario: Scenario) -> Objection | None:
        """Return why a site is not used, or `None` if it is.

        Raises:
            BlastEnvError: If it has no build zone.
        """
        shares = SiteMeasures.of(scenario)
        advantage = shares.layout_share - shares.random_share
        least, most = self.least_layout_share, self.most_layout_share
        for what, value, low, high in (
            ("open share of the sight lines", shares.open_share, self.least_open_share, 1.0),
            ("share cut by the sight-line layout", shares.layout_share, least, most),
            ("share cut by the best straight wall", shares.wall_share, 0.0, most),
            ("advantage over random layouts", advantage, self.least_advantage, 1.0),
        ):
            if not low <= value <= high:
                bound = f"at least {low:g}" if value < low else f"at most {high:g}"
                return Objection(f"{what}: must be {bound}", f"is {value:.3f}")
        return None
