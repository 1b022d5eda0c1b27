"""Where the scenario of an episode comes from."""

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from blast_env.errors import BlastEnvError
from blast_env.scenario import BuildZone, Scenario, load_scenario


class ScenarioSource(Protocol):
    """Gives each episode its scenario.

    All scenarios of a source have sites of one size and build zones of as many rows and columns,
    so that they share the observation and the action space.
    """

    @property
    def representative(self) -> Scenario:
        """A scenario of the size that all have; always the same one."""

    def sample(self, rng: np.random.Generator) -> Scenario:
        """Draw the scenario of an episode, with nothing but `rng`."""


@dataclass(frozen=True)
class SingleScenario:
    """Gives every episode the same scenario.

    Attributes:
        scenario: The scenario.
    """

    scenario: Scenario

    @property
    def representative(self) -> Scenario:
        """The scenario."""
        return self.scenario

    def sample(self, rng: np.random.Generator) -> Scenario:  # noqa: ARG002
        """Return the scenario; nothing is drawn."""
        return self.scenario


def scenario_source(scenario: str | Path | Scenario | ScenarioSource) -> ScenarioSource:
    """Return the source for what a user calls a scenario.

    Args:
        scenario: Bundled name, path of a scenario file, a scenario, or a source.

    Raises:
        ScenarioError: If there is no such scenario, or anything is wrong with it.
        BlastEnvError: If it has no build zone, or is anything else.
    """
    if isinstance(scenario, str | Path):
        scenario = load_scenario(scenario)
    source = SingleScenario(scenario) if isinstance(scenario, Scenario) else scenario
    if not (hasattr(source, "sample") and hasattr(source, "representative")):
        raise BlastEnvError(
            f"scenario is {source!r}, must be a name, a path, a Scenario or a ScenarioSource"
        )
    zone_of(source.representative)
    return source


def zone_of(scenario: Scenario) -> BuildZone:
    """Return the build zone of a scenario.

    Raises:
        BlastEnvError: If it has none.
    """
    if scenario.build_zone is None:
        raise BlastEnvError(
            f"scenario {scenario.name!r} has no build zone, so nothing can be placed in it"
        )
    return scenario.build_zone


def check_size(scenario: Scenario, representative: Scenario) -> None:
    """Refuse a scenario of another size than the one that the spaces were made for.

    Args:
        scenario: The scenario that was drawn.
        representative: The scenario that the spaces were made for.

    Raises:
        BlastEnvError: If site or build zone have another size, or there is no build zone.
    """
    for what, size, expected in zip(
        ("site (width, height in m)", "build zone (rows, columns)"),
        _sizes(scenario),
        _sizes(representative),
        strict=True,
    ):
        if size != expected:
            raise BlastEnvError(
                f"scenario {scenario.name!r}: the {what} is {size}, must be {expected} as in"
                f" {representative.name!r}: the spaces of an environment do not change"
            )


def _sizes(scenario: Scenario) -> tuple[tuple[float, float], tuple[int, int]]:
    zone = zone_of(scenario)
    return (scenario.site.width_m, scenario.site.height_m), (zone.rows, zone.columns)
