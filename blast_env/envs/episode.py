"""One episode of placing, and the task common to all episodes of an environment."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import fsum
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from blast_env.envs.actions import ActionChoice, Actions, NumberedActions
from blast_env.envs.arguments import ResetOptions, strategy
from blast_env.envs.observable import (
    MASK,
    BatchedObservation,
    EpisodeObservation,
    Observable,
    Observation,
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
from blast_env.evaluation.cases import LoadCase, LoadCaseSet, SeedRange
from blast_env.evaluation.engines import Engine
from blast_env.evaluation.evaluator import (
    Assessment,
    BlastCounts,
    BlastEvaluator,
    DesignProblem,
    Evaluators,
)
from blast_env.geometry import Layout
from blast_env.layout import LayoutState
from blast_env.site import AnyCharge, AnySource, Scenario
from blast_env.site.blast_site import Charge
from blast_env.site.objective import ConditionalValueAtRisk, MeanRisk, Risk, WorstRisk
from blast_env.values import real_number, whole_number

Terms = Mapping[str, float]
"""The terms of a reward by their names."""

ILLEGAL_TERM: Final = "invalid_actions"
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
        terms: The terms of the last reward; before the first action all are 0.
        chosen: The choices so far for the next module or piece; `None` before the first.
        invalid_actions: Number of illegal actions so far.
        without_effect: Number of those that changed nothing.
        repeated: The last action if it changed nothing; `None` otherwise.
        before: The modules placed before the last action.
        has_effect: Whether that changed the placement or the choices, or finished.
        stops: Whether it ends the episode, however many places are left.
        begun: Whether there has been an action.
        ended: Whether the charge has gone off.
    """

    observable: Observable
    problem: DesignProblem
    observation: EpisodeObservation
    initial: Layout
    placement: LayoutState
    actions: NumberedActions
    terms: Terms
    chosen: ActionChoice | None = None
    invalid_actions: int = 0
    without_effect: int = 0
    repeated: int | None = None
    before: LayoutState = field(init=False)
    has_effect: bool = True
    stops: bool = False
    begun: bool = False
    ended: bool = False

    @property
    def choice(self) -> ActionChoice:
        """The choices so far for the next module or piece."""
        return self.chosen or ActionChoice(self.placement.legal)

    def action_mask(self) -> NDArray[np.bool_]:
        """Return the mask of legal actions (actions,); see `NumberedActions.mask`.

        When the charge has gone off, only finishing is legal.
        """
        if not self.ended:
            return self.actions.mask(self.choice)
        mask = np.zeros(self.actions.finish + 1, dtype=np.bool_)
        mask[-1] = True
        return mask

    @property
    def shown(self) -> LayoutState:
        """The placement to observe: the choices so far limit the cells that it shows as free."""
        if self.chosen is None:
            return self.placement
        return self.placement.limited_to(self.chosen.possible)

    def observe(self) -> Any:
        """Return the observation."""
        observed = self.observation.observe(self.shown)
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
            BlastEnvError: If the terms of the reward differ from those it names.
        """
        self.move(action, illegal)
        return self.pay(reward, illegal)

    def move(self, action: int, illegal: IllegalActions) -> None:
        """Do the first part of `act`, which needs neither the next mask nor a blast."""
        self.before, choice = self.placement, self.choice
        finishes = action == self.actions.finish and choice.choices == 0
        found = None if finishes else self.actions.narrowed(choice, action)
        if found is None and not finishes:
            self.invalid_actions += 1
            nearest = self.actions.nearest(choice, action) if illegal.moves else None
            found = None if nearest is None else self.actions.narrowed(choice, nearest)
        if isinstance(found, ActionChoice):
            self.chosen = found
        elif found is not None:
            self.placement, self.chosen = self.placement.place(found), None
        self.has_effect = finishes or found is not None
        self.without_effect += not self.has_effect
        repeats = illegal.moves and action == self.repeated
        exhausted = self.without_effect >= illegal.limit
        self.stops = finishes or (not self.has_effect and (repeats or exhausted))
        self.repeated = None if self.has_effect else action

    def pay(self, reward: Reward, illegal: IllegalActions) -> dict[str, float]:
        """Do the second part of `act`, with the blasts."""
        self.ended = self.ends
        transition = Transition(
            initial=self.initial,
            before=self.before.checked,
            after=self.placement.checked,
            begins=not self.begun,
            ended=self.ended,
            problem=self.problem,
        )
        self.begun = True
        terms = {**reward(transition), ILLEGAL_TERM: 0.0 if self.has_effect else -illegal.cost}
        if [*terms] != [*self.terms]:
            found, named = (", ".join([*each][:-1]) for each in (terms, self.terms))
            raise BlastEnvError(
                f"the reward has the terms {found}, must have those that it names: {named}"
            )
        self.terms = terms
        return terms

    @property
    def ends(self) -> bool:
        """Whether the charge goes off after the last move."""
        return self.stops or self.placement.is_full

    def blasts_due(self) -> Iterator[tuple[BlastEvaluator, Layout, LoadCase]]:
        """Yield the blasts without a barrier on the first move, and those at the end."""
        layouts: list[Layout] = [] if self.begun else [()]
        layouts += [self.placement.checked] if self.ends else []
        for layout in layouts:
            for threat in self.problem.threats:
                yield self.problem.evaluator, layout, threat

    def assess(self) -> tuple[Assessment, Assessment]:
        """Return the assessments of the layout and of the site without a barrier.

        Raises:
            BlastEnvError: As `BlastEvaluator.loads_of_many`.
        """
        return self.problem.assess(self.placement.checked), self.problem.assess(())

    def information(self) -> dict[str, Any]:
        """Return the information after `reset` and after every action.

        Keys, shapes and types are the same throughout an episode. Until the charge has gone off,
        loads, charges and counts are 0 and levels are empty.
        """
        placement, problem = self.placement, self.problem
        case = problem.case
        charges = len(case.charges)
        seeds = [threat.seed for threat in case.threats]
        return {
            "action_mask": self.action_mask().astype(np.int8),  # as `sample(mask=...)` wants it
            "invalid_actions": self.invalid_actions,
            "placed": len(placement.layout),
            "layout": placement.catalogue.table(placement.layout),
            "reward_terms": dict(self.terms),
            **self._outcome(),
            "scenario_hash": problem.evaluator.scenario_hash,
            "calibration": problem.evaluator.calibration_name,
            "blast_seeds": tuple(tuple(seeds[index::charges]) for index in range(charges)),
        }

    def _outcome(self) -> dict[str, Any]:
        """Return the information on the blasts at the end."""
        case, nothing = self.problem.case, Assessment(0.0, 0.0, 0.0, 0.0, False)
        counts = self.problem.evaluator.counts if self.ended else BlastCounts()
        protected, unprotected = self.assess() if self.ended else (nothing, nothing)
        charges = (_NO_CHARGE,) * len(case.charges)
        if self.ended:
            charges = case.charges_against(self.placement.layout)
        return {
            "impulse_psi_s": protected.impulse_psi_s,
            "impulse_pa_s": protected.impulse_pa_s,
            "unprotected_impulse_pa_s": unprotected.impulse_pa_s,
            **self._outcome_where_known(protected, unprotected),
            "reduction": protected.reduction_from(unprotected) if self.ended else 0.0,
            "calibration_in_range": protected.in_range,
            "charges": charges,
            "blasts": counts.blasts,
            "cache_hits": counts.cache_hits,
            "cache_hit_rate": counts.cache_hit_rate,
        }

    def _outcome_where_known(
        self, protected: Assessment, unprotected: Assessment
    ) -> dict[str, Any]:
        """Return simulation units or peaks by the engine, the response by the objective."""
        evaluator, objective = self.problem.evaluator, self.problem.scenario.objective
        if evaluator.engine.medium == "particles":
            return {"impulse_sim": protected.impulse_sim}
        if not evaluator.engine.gives_peaks(self.problem.scenario):
            return {}
        peaks = {"peak_pa": protected.peak_pa, "unprotected_peak_pa": unprotected.peak_pa}
        if not objective.is_response:
            return peaks
        levels = [each.level.label if each.level else "" for each in (protected, unprotected)]
        return {
            **peaks,
            "response": protected.load,
            "unprotected_response": unprotected.load,
            "level_of_protection": levels[0],
            "unprotected_level_of_protection": levels[1],
        }


_NO_CHARGE: Final = Charge((0.0, 0.0), 0.0)


def terms_of(reward: Reward, scenario: Scenario) -> Terms:
    """Return the terms of a reward before the first action: all are 0.

    Raises:
        BlastEnvError: If it names the term that the environment adds itself.
    """
    names = reward.terms(scenario)
    if ILLEGAL_TERM in names:
        raise BlastEnvError(
            f"the reward has a term {ILLEGAL_TERM!r}, which the environment adds itself"
        )
    return dict.fromkeys((*names, ILLEGAL_TERM), 0.0)


def total(terms: Mapping[str, float]) -> float:
    """Return the sum of the terms of a reward."""
    return fsum(terms.values())


VISIBLE_REALISATIONS: Final = 2
"""Default number of blasts for a visible charge."""

HIDDEN_THREATS: Final = 16
"""Default number of charges for a hidden threat, one blast each."""


_MOST_OBSERVATIONS: Final = 64


@dataclass(frozen=True, eq=False)
class _Prepared:
    """Parts that episodes on one site have in common.

    Attributes:
        empty: The site without a barrier.
        actions: The numbered actions.
        observations: Observations by the places of the charge as shown to the agent.
    """

    empty: LayoutState
    actions: NumberedActions
    observations: dict[tuple[AnySource, ...], EpisodeObservation] = field(default_factory=dict)

    def observation(self, kind: Observation, observable: Observable) -> EpisodeObservation:
        """Return the observation of an episode; those that are observed in batches are kept."""
        found = self.observations.get(observable.sources)
        if found is not None:
            return found
        made = kind.episode(observable)
        if isinstance(made, BatchedObservation):
            if len(self.observations) == _MOST_OBSERVATIONS:
                self.observations.clear()
            self.observations[observable.sources] = made
        return made


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
        prepared: Parts of episodes on the last site, for the next one on it.
    """

    source: ScenarioSource
    threat_model: ThreatModel
    realisations: int
    risk: Risk | None
    observation: Observation
    actions: Actions
    evaluators: Evaluators
    prepared: "list[_Prepared]" = field(default_factory=list, repr=False)

    def start(self, rng: np.random.Generator, options: ResetOptions, reward: Reward) -> Episode:
        """Draw an episode; options do not change the amount drawn from the random stream.

        Raises:
            LayoutError: If the layout of the options does not fit the build zone.
            ScenarioError: If the charge of the options is not clear of a structure or the border.
            BlastEnvError: If the scenario has another size than the representative one.
        """
        scenario = self.source.sample(rng)
        prepared = self._prepared_for(scenario)
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
            bool(self.source.representative.vehicles),
        )
        placement = prepared.empty
        is_empty = isinstance(options.layout, Sequence) and not options.layout
        if possible is not scenario or not is_empty:  # another type is refused by name
            placement = LayoutState.of(possible, options.layout)
        return Episode(
            observable=observable,
            problem=DesignProblem(evaluator, self._case(scenario, charges, seeds)),
            observation=prepared.observation(self.observation, observable),
            initial=placement.checked,
            placement=placement,
            actions=prepared.actions.with_sources(observable.sources),
            terms=terms_of(reward, scenario),
        )

    def _prepared_for(self, scenario: Scenario) -> "_Prepared":
        """Return the parts that all episodes on a site share.

        Raises:
            BlastEnvError: If the scenario has another size than the representative one.
        """
        if not self.prepared or self.prepared[0].empty.scenario is not scenario:
            check_size(scenario, self.source.representative)
            actions = NumberedActions.of(self.actions, scenario)
            self.prepared[:] = [_Prepared(LayoutState.empty(scenario), actions)]
        return self.prepared[0]

    def _case(
        self, scenario: Scenario, charges: Sequence[AnyCharge], seeds: NDArray[np.int64]
    ) -> LoadCaseSet:
        """Return the load case of a layout; `seeds` has the shape (charges, realisations)."""
        threats = tuple(
            LoadCase(charge, int(seed))
            for of_realisation in seeds.T
            for charge, seed in zip(charges, of_realisation, strict=True)
        )
        return LoadCaseSet(scenario, threats, self.realisations, self.risk)


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
