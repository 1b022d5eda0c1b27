"""The table of the rules of thumb.

A new rule is a function and a line of `RULES`: search, benchmark, page and environments have it.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType
from typing import Final

from blast_env.errors import BlastEnvError
from blast_env.geometry import Layout
from blast_env.rules import posts, walls
from blast_env.site import AnyCharge, AnyScenario, Scenario, find_scenario

Rule = Callable[[AnyScenario, AnyCharge | None], Layout]
"""Returns a layout for a charge without a blast; `None` for an unknown charge."""


class Need(Enum):
    """Properties that a rule, or another proposer, may require of a site."""

    CATALOGUE = "catalogue (build_zone.items)"
    VEHICLE = "vehicle (a source of kind 'vehicle')"
    HARDENING = "measure that hardens facades (build_zone.hardening)"

    def is_met(self, scenario: Scenario) -> bool:
        """Return whether a scenario has the property."""
        if self is Need.CATALOGUE:
            return bool(scenario.zone.items)
        if self is Need.HARDENING:
            return bool(scenario.zone.hardening)
        return bool(scenario.vehicles)


@dataclass(frozen=True)
class RuleRow:
    """The description of a rule.

    Attributes:
        title: Name for readers.
        rule: The rule.
        needs: Properties that it requires of a site.
    """

    title: str
    rule: Rule
    needs: Collection[Need] = ()

    def suits(self, scenario: Scenario) -> bool:
        """Return whether a scenario has all required properties."""
        return all(need.is_met(scenario) for need in self.needs)

    def layout(self, scenario: Scenario, charge: AnyCharge | None) -> Layout | None:
        """Return the rule's layout, in its order of placement.

        Args:
            scenario: The scenario; it has a build zone.
            charge: The charge, if it is known.

        Returns:
            The layout; `None` if the scenario lacks something, or the rule has no layout for it,
            for example a wall without a line of sight.
        """
        if not self.suits(scenario):
            return None
        try:
            return self.rule(scenario, charge)
        except BlastEnvError:
            return None


_CATALOGUE: Final = (Need.CATALOGUE,)
_VEHICLE: Final = (Need.VEHICLE,)
_HARDENING: Final = (Need.HARDENING,)

RULES: Final[Mapping[str, RuleRow]] = MappingProxyType(
    {
        "wall_near_charge": RuleRow("wall near the charge", walls.wall_near_charge),
        "wall_in_middle": RuleRow("wall in the middle", walls.wall_in_middle),
        "wall_near_building": RuleRow("wall near the building", walls.wall_near_building),
        "long_wall_near_charge": RuleRow(
            "long wall near the charge", walls.long_wall_near_charge, _CATALOGUE
        ),
        "long_wall_in_middle": RuleRow(
            "long wall in the middle", walls.long_wall_in_middle, _CATALOGUE
        ),
        "long_wall_near_building": RuleRow(
            "long wall near the building", walls.long_wall_near_building, _CATALOGUE
        ),
        "ring_around_charge": RuleRow(
            "ring around the charge", walls.ring_around_charge, _CATALOGUE
        ),
        "ring_around_building": RuleRow(
            "ring around the building", walls.ring_around_building, _CATALOGUE
        ),
        "line_of_posts": RuleRow("line of posts", posts.line_of_posts, _VEHICLE),
        "posts_and_wall": RuleRow("posts and a wall", posts.posts_and_wall, _VEHICLE),
        "sight_lines": RuleRow("most sight lines cut", walls.sight_lines),
        "hardening_alone": RuleRow("hardening alone", walls.hardening_alone, _HARDENING),
        "hardening_and_sight_lines": RuleRow(
            "hardening and sight lines", walls.hardening_and_sight_lines, _HARDENING
        ),
    }
)
"""The rules of the package, by name."""


def layouts_by_rule(scenario: AnyScenario, charge: AnyCharge | None = None) -> dict[str, Layout]:
    """Return the layout of each applicable rule, by title, without simulating a blast.

    Args:
        scenario: The scenario; it has a build zone.
        charge: The charge, if it is known.
    """
    found = find_scenario(scenario)
    proposed = ((row.title, row.layout(found, charge)) for row in RULES.values())
    return {title: tuple(sorted(layout)) for title, layout in proposed if layout is not None}
