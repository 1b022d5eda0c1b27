"""One episode of placing, and the task common to all episodes of an environment."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import fsum, isnan
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from blast_env.envs.actions import ActionChoice, Actions, NumberedActions
from blast_env.envs.arguments import ResetOptions, strategy
from blast_env.envs.observations import (
    MASK,
    EpisodeObservation,
    Observable,
    Observation,
    SimulatedModuleLoads,
)
from blast_env.envs.strategies import (
    HiddenThreat,
    Reward,
    ScenarioSource,
    ThreatModel,
    Transition,
    VisibleThreat,
    check_size,
)
from blast_env.errors import BlastEnvError
from blast_env.evaluation.cases import Case, LoadCase, SeedRange
from blast_env.evaluation.comparison import Assessment
from blast_env.evaluation.engines import Engine
from blast_env.evaluation.evaluator import BlastAsked, Evaluators
from blast_env.evaluation.problem import DesignProblem
from blast_env.geometry import Layout
from blast_env.layout import Placement
from blast_env.layout.placement import met_by_blasts
from blast_env.site import AnyCharge, Scenario
from blast_env.statistics import ConditionalValueAtRisk, MeanRisk, Risk, WorstRisk
from blast_env.values import real_number, whole_number

ILLEGAL_TERM: Final = "illegal_actions"
"""The name of the reward term for illegal actions."""


INVALID_ACTIONS: Final = ("nearest", "penalty")
"""The consequences of an illegal action, by name."""


@dataclass(frozen=True)
class IllegalActions:
    """The consequences of illegal actions.

    Attributes:
        moves: Whether the nearest legal placement of the same item takes the place of an illegal
            one; if so, the same action twice in succession without effect ends the episode.
        cost: Cost of an illegal action without effect, in the unit of the reward.
        limit: Number of these after which the episode ends as if finished.
    """

    moves: bool
    cost: float
    limit: int


@dataclass(frozen=True)
class _Outcome:
    """The state after an action.

    Attributes:
        placement: The modules placed.
        chosen: The choices for the next module or piece.
        is_illegal: Whether the action was illegal.
        has_effect: Whether it changed the placement or the choices, or finished.
        ended: Whether the episode ends.
    """

    placement: Placement
    chosen: ActionChoice
    is_illegal: bool
    has_effect: bool
    ended: bool


@dataclass
class Episode:
    """The state of an episode.

    Attributes:
        observable: The observable part of the episode before the end.
        problem: Assesses layouts.
        observation: Observes the episode.
        initial: The layout at the start.
        placement: The modules placed so far.
        actions: The numbered actions.
        chosen: The choices so far for the next module or piece.
        illegal_actions: Number of illegal actions so far.
        without_effect: Number of those that changed nothing.
        repeated: The last action if it changed nothing; `None` otherwise.
        begun: Whether there has been an action.
        ended: Whether the charge has gone off.
    """

    observable: Observable
    problem: DesignProblem
    observation: EpisodeObservation
    initial: Layout
    placement: Placement
    actions: NumberedActions
    chosen: ActionChoice = field(init=False)
    illegal_actions: int = 0
    without_effect: int = 0
    repeated: int | None = None
    begun: bool = False
    ended: bool = False

    def __post_init__(self) -> None:
        self.chosen = ActionChoice(self.placement.legal)

    def action_mask(self) -> NDArray[np.bool_]:
        """Return the mask of legal actions (actions,); see `NumberedActions.mask`.

        When the charge has gone off, only finishing is legal.
        """
        if not self.ended:
            return self.actions.mask(self.chosen)
        mask = np.zeros(self.actions.finish + 1, dtype=np.bool_)
        mask[-1] = True
        return mask

    def observe(self) -> Any:
        """Return the observation; the choices so far limit the cells that it shows as free."""
        placement = self.placement
        if self.chosen.choices:
            placement = placement.limited_to(self.chosen.possible)
        observed = self.observation.observe(placement)
        if isinstance(observed, Mapping):
            return {**observed, MASK: self.action_mask().astype(np.int8)}
        return observed

    def act(self, action: int, reward: Reward, illegal: IllegalActions) -> dict[str, float]:
        """Make a choice, place a module or a piece, or finish; return the terms of the reward.

        Args:
            action: One of `actions`.
            reward: The reward of the action.
            illegal: The consequences of an illegal action.

        Raises:
            BlastEnvError: If the reward has a term with the reserved name `ILLEGAL_TERM`.
        """
        before = self.placement
        after = self._after(action, illegal)
        self.placement, self.chosen, self.ended = after.placement, after.chosen, after.ended
        self.illegal_actions += after.is_illegal
        self.without_effect += not after.has_effect
        self.repeated = None if after.has_effect else action
        transition = Transition(
            initial=self.initial,
            before=before.checked,
            after=self.placement.checked,
            begins=not self.begun,
            ended=self.ended,
            problem=self.problem,
        )
        self.begun = True
        terms = reward(transition)
        if ILLEGAL_TERM in terms:
            raise BlastEnvError(
                f"the reward has a term {ILLEGAL_TERM!r}, which the environment adds itself"
            )
        return {**terms, ILLEGAL_TERM: 0.0 if after.has_effect else -illegal.cost}

    def blasts_due(self, action: int, illegal: IllegalActions) -> tuple[BlastAsked, ...]:
        """Return the blasts that `final_information` requests if the action ends the episode.

        Args:
            action: The action of the next call of `act`.
            illegal: The consequences of an illegal action.
        """
        after = self._after(action, illegal)
        case = self.problem.case
        barrier = met_by_blasts(after.placement.layout)
        layouts = (barrier, ()) if after.ended else ()
        return tuple(
            BlastAsked(case.scenario, layout, threat)
            for layout in layouts
            for threat in case.threats
        )

    def _after(self, action: int, illegal: IllegalActions) -> _Outcome:
        """Return the state after an action."""
        placement, chosen = self.placement, self.chosen
        if action == self.actions.finish and chosen.choices == 0:
            return _Outcome(placement, chosen, is_illegal=False, has_effect=True, ended=True)
        found = self.actions.narrowed(chosen, action)
        is_illegal = found is None
        if is_illegal and illegal.moves:
            nearest = self.actions.nearest(chosen, action)
            found = None if nearest is None else self.actions.narrowed(chosen, nearest)
        if found is None:
            exhausted = self.without_effect + 1 >= illegal.limit
            repeats = illegal.moves and action == self.repeated
            ended = exhausted or repeats or placement.is_full
            return _Outcome(placement, chosen, is_illegal=True, has_effect=False, ended=ended)
        if isinstance(found, ActionChoice):
            chosen = found
        else:
            placement = placement.place(found)
            chosen = ActionChoice(placement.legal)
        return _Outcome(placement, chosen, is_illegal, has_effect=True, ended=placement.is_full)

    def assess(self) -> tuple[Assessment, Assessment]:
        """Return the assessments of the layout and of the site without a barrier.

        Raises:
            BlastEnvError: As `BlastEvaluator.loads_of_many`.
        """
        return self.problem.assess(self.placement.checked), self.problem.assess(())

    def information(self) -> dict[str, Any]:
        """Return the information after every action and after `reset`."""
        mask = self.action_mask().astype(np.int8)  # the type for `sample(mask=...)` of a space
        return {"action_mask": mask, "illegal_actions": self.illegal_actions}

    def final_information(self, evaluators: Evaluators) -> dict[str, Any]:
        """Return the information after the charge has gone off.

        Args:
            evaluators: The evaluators, which count the blasts.
        """
        protected, unprotected = self.assess()
        case = self.problem.case
        seeds = [threat.seed for threat in case.threats]
        return {
            "impulse_psi_s": protected.impulse_psi_s,
            "impulse_pa_s": protected.impulse_pa_s,
            "unprotected_impulse_pa_s": unprotected.impulse_pa_s,
            **_where_known(protected, unprotected),
            "reduction": protected.reduction_from(unprotected),
            "layout": self.placement.layout,
            "scenario_hash": self.problem.evaluator.scenario_hash,
            "calibration": self.problem.evaluator.calibration_name,
            "calibration_in_range": protected.in_range,
            "charges": case.charges_against(self.placement.layout),
            "blast_seeds": tuple(
                tuple(seeds[index :: len(case.charges)]) for index in range(len(case.charges))
            ),
            "blasts": evaluators.blasts,
            "cache_hits": evaluators.cache_hits,
            "cache_hit_rate": evaluators.cache_hit_rate,
        }


def _where_known(protected: Assessment, unprotected: Assessment) -> dict[str, Any]:
    """Return simulation units or peaks by the engine, and the response, if the objective has it."""
    if protected.impulse_sim is not None:
        return {"impulse_sim": protected.impulse_sim}
    if isnan(unprotected.peak_pa):
        return {}
    peaks = {"peak_pa": protected.peak_pa, "unprotected_peak_pa": unprotected.peak_pa}
    if protected.level is None or unprotected.level is None:
        return peaks
    return {
        **peaks,
        "response": protected.load,
        "unprotected_response": unprotected.load,
        "level_of_protection": protected.level.label,
        "unprotected_level_of_protection": unprotected.level.label,
    }


def total(terms: Mapping[str, float]) -> float:
    """Return the sum of the terms of a reward."""
    return fsum(terms.values())


VISIBLE_REALISATIONS: Final = 2
"""Default number of blasts for a visible charge."""

HIDDEN_THREATS: Final = 16
"""Default number of charges for a hidden threat, one blast each."""


@dataclass(frozen=True, eq=False)
class Task:
    """The task of an environment: scenarios, threats, observations and actions.

    Attributes:
        source: Source of the scenario of each episode.
        threat_model: Draws the charges of an episode.
        realisations: Number of blasts per charge, with different seeds.
        risk: Reduces the loads of several charges to one; that of the scenario if `None`.
        observation: The kind of observation.
        actions: The kind of action space.
        evaluators: Run the blasts.
    """

    source: ScenarioSource
    threat_model: ThreatModel
    realisations: int
    risk: Risk | None
    observation: Observation
    actions: Actions
    evaluators: Evaluators

    def start(self, rng: np.random.Generator, options: ResetOptions) -> Episode:
        """Draw an episode; options do not change the amount drawn from the random stream.

        Raises:
            LayoutError: If the layout of the options does not fit the build zone.
            ScenarioError: If the charge of the options is not clear of a structure or the border.
            BlastEnvError: If the scenario has another size than the representative one.
        """
        scenario = self.source.sample(rng)
        check_size(scenario, self.source.representative)
        drawn = self.threat_model.draw(scenario, rng)
        seeds = SeedRange.TRAINING.draw(rng, (len(drawn), self.realisations))
        if options.blast_seed is not None:
            seeds = options.blast_seed + np.arange(seeds.size).reshape(seeds.shape)
        charges = tuple(options.charge(each) for each in drawn)
        possible = scenario.with_possible_charges(charges) if options.fix_charge else scenario
        evaluator = self.evaluators.of(scenario)
        observable = Observable(
            scenario,
            self.threat_model.shown(scenario, charges),
            SimulatedModuleLoads(self.evaluators),
            bool(self.source.representative.vehicles),
        )
        placement = Placement.of(possible, options.layout)
        return Episode(
            observable=observable,
            problem=DesignProblem(evaluator, self._case(scenario, charges, seeds)),
            observation=self.observation.episode(observable),
            initial=placement.checked,
            placement=placement,
            actions=NumberedActions.of(self.actions, scenario, observable.sources),
        )

    def _case(
        self, scenario: Scenario, charges: Sequence[AnyCharge], seeds: NDArray[np.int64]
    ) -> Case:
        """Return the load case of a layout; `seeds` has the shape (charges, realisations)."""
        threats = tuple(
            LoadCase(charge, int(seed))
            for of_realisation in seeds.T
            for charge, seed in zip(charges, of_realisation, strict=True)
        )
        return Case(scenario, threats, self.realisations, self.risk)


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
