"""What is chosen by name: threat models, sources of scenarios, rewards."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final, Protocol

import numpy as np

from blast_env.errors import BlastEnvError
from blast_env.evaluation.comparison import Objective
from blast_env.geometry import Layout
from blast_env.scenario import AnyCharge, AnyScenario, AnySource, Scenario, ScenarioField
from blast_env.scenario.vehicles import source_of
from blast_env.sites import FAMILIES, training_sites


class ThreatModel(Protocol):
    """Draws the charges of an episode and decides what may be seen of them."""

    def draw(self, scenario: Scenario, rng: np.random.Generator) -> tuple[AnyCharge, ...]:
        """Draw the charges that the layout is assessed against, with nothing but `rng`."""

    def shown(self, scenario: Scenario, charges: tuple[AnyCharge, ...]) -> tuple[AnySource, ...]:
        """Return where the charge is, or may be, as far as the agent may know."""


@dataclass(frozen=True)
class VisibleThreat:
    """One charge, and the agent sees where it is: a layout for each charge."""

    def draw(self, scenario: Scenario, rng: np.random.Generator) -> tuple[AnyCharge, ...]:
        """Draw one charge."""
        return (scenario.sample_charge(rng),)

    def shown(
        self,
        scenario: Scenario,  # noqa: ARG002
        charges: tuple[AnyCharge, ...],
    ) -> tuple[AnySource, ...]:
        """Return the charge itself, or the vehicle that brings it."""
        return tuple(source_of(each) for each in charges)


@dataclass(frozen=True)
class HiddenThreat:
    """Several charges, of which the agent sees only where they may be: one layout for all.

    Attributes:
        threats: How many charges are drawn for an episode.
    """

    threats: int

    def draw(self, scenario: Scenario, rng: np.random.Generator) -> tuple[AnyCharge, ...]:
        """Draw the charges, independently of each other but for the ranks of vehicles' places."""
        return scenario.sample_charges(rng, self.threats)

    def shown(
        self,
        scenario: Scenario,
        charges: tuple[AnyCharge, ...],  # noqa: ARG002
    ) -> tuple[AnySource, ...]:
        """Return the places of the scenario; nothing of the charges."""
        return scenario.charge


class ScenarioSource(Protocol):
    """Gives each episode its scenario.

    All scenarios of a source have sites of one size, build zones of as many rows and columns, and
    catalogues with items of the same names and sizes, so that they share the observation and the
    action space. Some of the items may be out of stock. If any has a vehicle, the representative
    one has.
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
        scenario: The scenario; its bundled name or path will do.
    """

    scenario: ScenarioField = ScenarioField()

    @property
    def representative(self) -> Scenario:
        """The scenario."""
        return self.scenario

    def sample(self, rng: np.random.Generator) -> Scenario:  # noqa: ARG002
        """Return the scenario; nothing is drawn."""
        return self.scenario


def scenario_source(scenario: AnyScenario | ScenarioSource) -> ScenarioSource:
    """Return the source for what a user calls a scenario.

    Args:
        scenario: Bundled name, `"sites"`, `"item_sites"` or `"large_sites"` for generated sites to
            train on, path of a scenario file, a scenario or its plain data, or a source.

    Raises:
        ScenarioError: If there is no such scenario, or anything is wrong with it.
        BlastEnvError: If it has no build zone, or is anything else.
    """
    source: ScenarioSource
    if isinstance(scenario, str) and scenario in FAMILIES:
        source = training_sites(scenario)
    elif isinstance(scenario, str | Path | Mapping | Scenario):
        source = SingleScenario(scenario)
    else:
        source = scenario
    if not (hasattr(source, "sample") and hasattr(source, "representative")):
        raise BlastEnvError(
            f"scenario is {source!r}, must be a name, a path, a Scenario or a ScenarioSource"
        )
    source.representative.zone  # noqa: B018  # refuses a scenario without one
    return source


def check_size(scenario: Scenario, representative: Scenario) -> None:
    """Refuse a scenario of another size than the one that the spaces were made for.

    Args:
        scenario: The scenario that was drawn.
        representative: The scenario that the spaces were made for.

    Raises:
        BlastEnvError: If site, build zone or items have another size, there is no build zone, or
            it has a vehicle and the representative has none. The other way round, observations
            show that there is no vehicle.
    """
    has_room = bool(representative.vehicles)
    for what, size, expected in zip(
        (
            "site (width, height in m)",
            "build zone (rows, columns)",
            "catalogue (item, turned, size)",
            "room for vehicles (none or some)",
        ),
        _sizes(scenario, has_room and not scenario.vehicles),
        _sizes(representative, False),
        strict=True,
    ):
        if size != expected:
            raise BlastEnvError(
                f"scenario {scenario.name!r}: the {what} is {size}, must be {expected} as in"
                f" {representative.name!r}: the spaces of an environment do not change"
            )


def _sizes(scenario: Scenario, has_room: bool) -> tuple[tuple[object, ...], ...]:
    site, zone = scenario.site, scenario.zone
    variants = [
        (each.name, each.turned, each.rows, each.columns) for each in zone.catalogue.variants
    ]
    vehicles = ("some",) if scenario.vehicles or has_room else ("none",)
    return (site.width_m, site.height_m), zone.shape, tuple(variants), vehicles


@dataclass(frozen=True)
class Transition:
    """What one action changed.

    Attributes:
        initial: The layout at `reset`.
        before: The layout before the action.
        after: The layout after it; the same, unless the action placed a module.
        begins: Whether it is the first action of the episode.
        ended: Whether the charge goes off now.
        objective: Assesses layouts under the threats of the episode.
    """

    initial: Layout
    before: Layout
    after: Layout
    begins: bool
    ended: bool
    objective: Objective

    @property
    def term(self) -> str:
        """Name of the reward's term for the load: `impulse`, `peak` or `load`."""
        return self.objective.case.scenario.objective.term


class Reward(Protocol):
    """Pays for an action, in named terms.

    An episode may be cut off after any action, by a time limit that a user puts round the
    environment, and the environment does not learn of it. So what is paid until then should be no
    more than what finishing would have paid.
    """

    def __call__(self, transition: Transition) -> Mapping[str, float]:
        """Return the terms; the reward is their sum.

        Always the same names, and none that the environment uses itself (`illegal_actions`).
        """


DEPOSIT: Final = 2.0
"""Times the load without a barrier: more than any layout lets through; measured by
`python -m studies.noise deposit`."""


@dataclass(frozen=True)
class TerminalReward:
    """Minus the load with the whole layout, paid when the charge goes off.

    The load is what the scenario's objective counts: the impulse unless it says otherwise.

    The first action also pays a deposit, which comes back when the charge goes off: an episode that
    is cut off before loses it. It is more than any layout lets through, so that to finish always
    pays better than to be cut off.
    """

    def __call__(self, transition: Transition) -> Mapping[str, float]:
        """Return the term of the load, 0 before the end, and `deposit`, 0 in between.

        The load's is named `impulse` (psi s), `peak` (psi) or `load` (both, without a unit).
        """
        paid = transition.objective.paid
        load = deposit = 0.0
        if transition.begins != transition.ended:
            deposit = DEPOSIT * paid(())
        if transition.ended:
            load = -paid(transition.after)
        return {transition.term: load, "deposit": deposit if transition.ended else -deposit}


@dataclass(frozen=True)
class IncrementalReward:
    """What each module takes off the load, paid at once; a set of blasts per module.

    A placement earns I(before) - I(after), where I is what the scenario's objective counts. The
    first action also pays -I(initial), the load with the layout at `reset`, which is the one
    without a barrier unless an option says otherwise. So what has been paid is at any time minus
    the load with what stands: what finishing would come to, and over an episode the sum of
    `TerminalReward`.
    """

    def __call__(self, transition: Transition) -> Mapping[str, float]:
        """Return the term of the load, named as by `TerminalReward`."""
        load = 0.0
        paid = transition.objective.paid
        if transition.after != transition.before:
            load += paid(transition.before) - paid(transition.after)
        if transition.begins:
            load -= paid(transition.initial)
        return {transition.term: load}


REWARDS: Final[Mapping[str, Reward]] = MappingProxyType(
    {"terminal": TerminalReward(), "incremental": IncrementalReward()}
)
"""The rewards that have names."""
