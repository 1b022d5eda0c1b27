"""What can propose a layout, by name."""

from collections.abc import Sequence
from typing import Final

from blast_agents.posts import VEHICLE_RULES
from blast_agents.rules import expected_charge, rules_for

from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.geometry import Layout
from blast_env.scenario import AnyCharge, Scenario
from blast_env.scenario.vehicles import source_of
from blast_env.sites import Visibility, visibility_layout

PACKAGED: Final = "the package's proposal"
"""What `blast-env propose` gives: weights or a surrogate, the best rule where neither can."""

SIGHT_LINES: Final = "most sight lines cut"

METHODS: Final = ("genetic", "annealing", "greedy", "random")
"""Searches that the page offers."""


def proposers(scenario: Scenario) -> tuple[str, ...]:
    """Return the names of what proposes a layout, the best first; none without a build zone."""
    if scenario.build_zone is None:
        return ()
    against_vehicles = VEHICLE_RULES if scenario.vehicles else ()
    return (PACKAGED, *rules_for(scenario), SIGHT_LINES, *against_vehicles)


def proposed(name: str, scenario: Scenario, charges: Sequence[AnyCharge]) -> Layout:
    """Return the layout of a rule.

    Args:
        name: The rule.
        scenario: The scenario; it has a build zone.
        charges: One is known; of more of them, each may be the one.

    Raises:
        UnknownNameError: If there is no such rule for the scenario; the message names the nearest.
        BlastEnvError: If the rule finds nothing to build.
    """
    known = tuple(source_of(each) for each in charges)
    if name == SIGHT_LINES:
        seen = scenario.model_copy(update={"charge": known})
        return visibility_layout(scenario, Visibility.of(seen))
    if name in VEHICLE_RULES and scenario.vehicles:
        return VEHICLE_RULES[name](scenario, None)
    rules = rules_for(scenario)
    if name not in rules:
        raise UnknownNameError("rule", name, proposers(scenario))
    if not known:
        raise BlastEnvError("threats: there are none, must be at least one")
    return rules[name](scenario, expected_charge(known))
