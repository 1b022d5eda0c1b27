"""Strategies with names: threat models, sources of scenarios, rewards, risk measures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isnan
from pathlib import Path
from types import MappingProxyType
from typing import Final, NamedTuple, Protocol, runtime_checkable

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.bundled import GENERATED, OF_ANY_SIZE
from blast_env.envs.arguments import strategy
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import Engine
from blast_env.evaluation.evaluator import Assessment
from blast_env.geometry import Layout
from blast_env.site import (
    AnyCharge,
    AnyScenario,
    AnySource,
    ObjectiveSection,
    Scenario,
    find_scenario,
)
from blast_env.site.objective import ConditionalValueAtRisk, MeanRisk, Risk, WorstRisk
from blast_env.site.sources import source_of
from blast_env.values import real_number, whole_number


class ThreatModel(Protocol):
    """Draws the charges of an episode and determines their observable part."""

    def draw(self, scenario: Scenario, rng: np.random.Generator) -> tuple[AnyCharge, ...]:
        """Draw the charges for the assessment of the layout, with `rng` as the only randomness."""

    def shown(self, scenario: Scenario, charges: tuple[AnyCharge, ...]) -> tuple[AnySource, ...]:
        """Return the place of the charge, or its possible places, as shown to the agent."""


@dataclass(frozen=True)
class VisibleThreat:
    """One charge at a place known to the agent: a layout for each charge."""

    def draw(self, scenario: Scenario, rng: np.random.Generator) -> tuple[AnyCharge, ...]:
        """Draw one charge."""
        return (scenario.sample_charge(rng),)

    def shown(
        self,
        scenario: Scenario,  # noqa: ARG002
        charges: tuple[AnyCharge, ...],
    ) -> tuple[AnySource, ...]:
        """Return the charge itself, or the vehicle that brings it."""
        return tuple(source_of(charge) for charge in charges)


@dataclass(frozen=True)
class HiddenThreat:
    """Several charges, of which the agent sees only the possible places: one layout for all.

    Attributes:
        threats: Number of charges per episode.
    """

    threats: int

    def draw(self, scenario: Scenario, rng: np.random.Generator) -> tuple[AnyCharge, ...]:
        """Draw the charges, independently except for the ranks of vehicles' places."""
        return scenario.sample_charges(rng, self.threats)

    def shown(
        self,
        scenario: Scenario,
        charges: tuple[AnyCharge, ...],  # noqa: ARG002
    ) -> tuple[AnySource, ...]:
        """Return the sources of the scenario, without the charges drawn."""
        return scenario.charge


VISIBLE_REALISATIONS: Final = 2
"""Default number of blasts for a visible charge."""

HIDDEN_THREATS: Final = 16
"""Default number of charges for a hidden threat, one blast each."""


def find_threat_model(threat: str | ThreatModel, threats: int | None) -> ThreatModel:
    """Return the threat model for the arguments `threat` and `threats`.

    Raises:
        UnknownNameError: If there is no threat model of that name.
        BlastEnvError: If the number of threats is out of bounds, or is not 1 for a threat model
            other than `"hidden"`.
    """
    count = HIDDEN_THREATS if threats is None else whole_number("threats", threats, 1, 1000)
    models: dict[str, ThreatModel] = {"visible": VisibleThreat(), "hidden": HiddenThreat(count)}
    chosen = strategy("threat", threat, models)
    if threats not in (None, 1) and threat != "hidden":
        raise BlastEnvError(f"threats is {threats}, must be 1 unless threat is 'hidden'")
    return chosen


def find_realisations(realisations: int | None, threat: str | ThreatModel, engine: Engine) -> int:
    """Return the number of blasts per charge for the arguments `realisations` and `threat`.

    Raises:
        BlastEnvError: If the number is out of bounds; it must be 1 for an engine without noise.
    """
    if not engine.has_noise:
        if realisations not in (None, 1):
            raise BlastEnvError(
                f"realisations is {realisations}, must be 1: {engine.name} has no noise"
            )
        return 1
    if realisations is None:
        return VISIBLE_REALISATIONS if threat == "visible" else 1
    return whole_number("realisations", realisations, 1, 1000)


class ScenarioSource(Protocol):
    """Provides the scenario of each episode.

    All scenarios of a source have sites and build zones of one size, and catalogues with items of
    the same names and sizes, so that they share the observation and the action space. Some of the
    items may be out of stock. If any scenario has a vehicle, the representative one has.
    """

    @property
    def representative(self) -> Scenario:
        """A scenario of the common size; always the same one."""

    def sample(self, rng: np.random.Generator) -> Scenario:
        """Draw the scenario of an episode, with `rng` as the only randomness."""


@dataclass(frozen=True)
class SingleScenario:
    """Provides the same scenario for every episode.

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


def scenario_source(scenario: AnyScenario | ScenarioSource) -> ScenarioSource:
    """Return the source for the argument `scenario` of an environment.

    Args:
        scenario: Bundled name, `"sites"`, `"item_sites"` or `"large_sites"` for generated sites for
            training, path of a scenario file, a scenario or its plain data, or a source.

    Raises:
        ScenarioError: If there is no such scenario, or it is invalid.
        BlastEnvError: If it has no build zone, has another type, or is a kind of generated sites of
            any size.
    """
    source: ScenarioSource
    if isinstance(scenario, str) and scenario in OF_ANY_SIZE:
        raise BlastEnvError(
            f"scenario is {scenario!r}, whose sites differ in size and catalogue: an environment"
            f" takes one of them, as of blast_env.sites.{scenario.removesuffix('s')}(seed), or one"
            f" of the kinds {', '.join(GENERATED)}"
        )
    if isinstance(scenario, str) and scenario in GENERATED:
        from blast_env.sites import training_sites  # generation is a room of its own

        source = training_sites(scenario)
    elif isinstance(scenario, str | Path | Mapping | Scenario):
        source = SingleScenario(find_scenario(scenario))
    else:
        source = scenario
    if not (hasattr(source, "sample") and hasattr(source, "representative")):
        raise BlastEnvError(
            f"scenario is {source!r}, must be a name, a path, a Scenario or a ScenarioSource"
        )
    source.representative.zone  # noqa: B018  # refuses a scenario without a build zone
    return source


def check_size(scenario: Scenario, representative: Scenario) -> None:
    """Refuse a scenario whose size does not fit the spaces of the environment.

    Args:
        scenario: The scenario drawn.
        representative: The scenario that determines the spaces.

    Raises:
        BlastEnvError: If site, build zone or items have another size, there is no build zone, or
            it has a vehicle and the representative has none. In the opposite case, observations
            show that there is no vehicle.
    """
    has_room = bool(representative.vehicles)
    for what, size, expected in zip(
        (
            "site (width, height in m)",
            "build zone (rows, columns)",
            "catalogue (item, turned, size)",
            "room for vehicles (none or some)",
            "objective (term of the reward)",
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
        (variant.name, variant.turned, variant.rows, variant.columns)
        for variant in zone.catalogue.variants
    ]
    vehicles = ("some",) if scenario.vehicles or has_room else ("none",)
    term = (scenario.objective.term,)
    return (site.width_m, site.height_m), zone.shape, tuple(variants), vehicles, term


class Transition(NamedTuple):
    """The change of the layout by one action.

    Attributes:
        objective: The objective of the scenario.
        initial: The layout at `reset`.
        before: The layout before the action.
        after: The layout after it; the same, unless the action placed a module or a piece.
        begins: Whether it is the first action of the episode.
        ended: Whether the charge goes off now.
    """

    objective: ObjectiveSection
    initial: Layout
    before: Layout
    after: Layout
    begins: bool
    ended: bool


@runtime_checkable
class Reward(Protocol):
    """The reward of an action, in named terms.

    A time limit around the environment may truncate an episode after any action, without the
    environment's knowledge. So the sum until then should not exceed the sum after finishing.
    """

    def terms(self, scenario: Scenario) -> tuple[str, ...]:
        """Return the names of the terms; `invalid_actions` is reserved for the environment."""

    def layouts(self, transition: Transition) -> Sequence[Layout]:
        """Return the layouts of the transition, or (), whose loads the reward of it needs.

        The environment sets off the charges against them, once in an episode. At the end, it does
        so against `after` and () in any case.
        """

    def __call__(
        self, transition: Transition, loads: Mapping[Layout, Assessment]
    ) -> Mapping[str, float]:
        """Return the terms, in the order of their names; the reward is their sum.

        Args:
            transition: The change of the layout.
            loads: The loads with the layouts asked for so far.
        """


@runtime_checkable
class EndReward(Protocol):
    """A reward that follows from the reduction by the whole layout, of many turns at once.

    It pays when an episode begins or ends, and is asked in no other turn.
    """

    def terms(self, scenario: Scenario) -> tuple[str, ...]:
        """Return the names of the terms; `invalid_actions` is reserved for the environment."""

    def paid(self, begins: BoolArray, ended: BoolArray, reductions: FloatArray) -> FloatArray:
        """Return the terms, in the order of their names (turns, terms).

        Args:
            begins: Whether each turn is the first one of its episode (turns,).
            ended: Whether the charge goes off in it.
            reductions: The relative reduction of the load where it does, NaN where nothing arrives
                without a barrier; elsewhere 0.
        """


UNPROTECTED: Final = "unprotected"
"""The name of the term with the load without a barrier."""


@dataclass(frozen=True)
class TerminalReward:
    """Minus the load with the whole layout, in units of the load without a barrier.

    The load is that of the scenario's objective, by default the impulse. The first action pays -1,
    the load without a barrier. When the charge goes off, what the layout takes off comes back. So a
    truncated episode pays as much as one without a barrier.

    Critics of libraries start with values of the order of 1, beside which some hundredths of a
    psi s do not count: hence the unit (docs/researchers/training.md).
    """

    def terms(self, scenario: Scenario) -> tuple[str, ...]:
        """Return `unprotected`, and `impulse`, `peak`, `load` (both) or `response`, taken off."""
        return UNPROTECTED, scenario.objective.term

    def paid(self, begins: BoolArray, ended: BoolArray, reductions: FloatArray) -> FloatArray:  # noqa: ARG002
        """Return -1 at the beginning, and at the end the share of the load taken off.

        Where nothing arrives, all of it counts as taken off.
        """
        terms = np.empty((len(begins), 2))
        terms[:, 0] = np.where(begins, -1.0, 0.0)
        terms[:, 1] = np.where(np.isnan(reductions), 1.0, reductions)
        return terms


@dataclass(frozen=True)
class IncrementalReward:
    """What each module takes off the load, paid at once; needs a set of blasts per module.

    The unit is the load without a barrier, as of `TerminalReward`. The first action also pays minus
    the load with the layout at `reset`: no barrier, unless an option sets one. So the sum at any
    time is minus the load with the present layout, as if the agent finished then.
    """

    def terms(self, scenario: Scenario) -> tuple[str, ...]:
        """Return the term of the load, named as by `TerminalReward`."""
        return (scenario.objective.term,)

    def layouts(self, transition: Transition) -> Sequence[Layout]:
        """Return the layouts before and after the action, and at first the initial one."""
        changed = (transition.before, transition.after) if _has_changed(transition) else ()
        first = (transition.initial,) if transition.begins else ()
        return (*changed, *first, ()) if changed or first else ()

    def __call__(
        self, transition: Transition, loads: Mapping[Layout, Assessment]
    ) -> Mapping[str, float]:
        """Return the share of the load that the action took off."""
        share = 0.0
        if _has_changed(transition):
            share += _taken_off(loads[transition.after], loads[()])
            share -= _taken_off(loads[transition.before], loads[()])
        if transition.begins:
            share += _taken_off(loads[transition.initial], loads[()]) - 1.0
        return {transition.objective.term: share}


def _taken_off(load: Assessment, unprotected: Assessment) -> float:
    """Return the share of the load without a barrier that is missing; 1 where nothing arrives."""
    share = load.reduction_from(unprotected)
    return 1.0 if isnan(share) else share


def _has_changed(transition: Transition) -> bool:
    return transition.after != transition.before


@dataclass(frozen=True)
class ReductionReward:
    """The relative reduction of the load by the whole layout, paid when the charge goes off.

    It is `info["reduction"]`: the share of the load without a barrier that the layout takes off, 0
    without a barrier, and of the same order on every site. The load includes the power law of the
    particle model. A truncated episode pays 0, as does a site without a load.
    """

    def terms(self, scenario: Scenario) -> tuple[str, ...]:  # noqa: ARG002
        """Return `reduction`."""
        return ("reduction",)

    def paid(self, begins: BoolArray, ended: BoolArray, reductions: FloatArray) -> FloatArray:  # noqa: ARG002
        """Return the term `reduction`, 0 before the end."""
        return np.where(np.isnan(reductions), 0.0, reductions)[:, np.newaxis]


REWARDS: Final[Mapping[str, Reward | EndReward]] = MappingProxyType(
    {
        "terminal": TerminalReward(),
        "incremental": IncrementalReward(),
        "relative": ReductionReward(),
    }
)
"""The rewards, by their names."""


def find_risk(risk: str | Risk | None, cvar_level: float) -> Risk | None:
    """Return the risk measure for the arguments `risk` and `cvar_level`; `None` for none.

    Raises:
        UnknownNameError: If there is no risk measure of that name.
        BlastEnvError: If the level is not a number or is out of bounds.
    """
    level = real_number("cvar_level", cvar_level, 0.0, 1.0)
    if risk is None:
        return None
    measures: dict[str, Risk] = {
        "mean": MeanRisk(),
        "cvar": ConditionalValueAtRisk(level),
        "worst": WorstRisk(),
    }
    return strategy("risk", risk, measures)
