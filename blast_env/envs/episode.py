"""Episodes of placing, one or many at once: place, blast, observe, reward."""

from collections import OrderedDict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import fsum
from typing import Any, Final

import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import concatenate, create_empty_array
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
    loads_together,
)
from blast_env.evaluation.store import BlastStore
from blast_env.geometry import Layout
from blast_env.layout import LayoutState
from blast_env.layout.batch import LayoutBatch, PlacementRules
from blast_env.layout.placement import CheckedLayout
from blast_env.site import AnyCharge, Scenario
from blast_env.site.blast_site import Charge
from blast_env.site.objective import ConditionalValueAtRisk, MeanRisk, Risk, WorstRisk
from blast_env.values import real_number, whole_number

Terms = Mapping[str, float]
"""The terms of a reward by their names."""

ILLEGAL_TERM: Final = "invalid_actions"
"""The name of the reward term for illegal actions."""

INVALID_ACTIONS: Final = ("nearest", "penalty")
"""The consequences of an illegal action, by name."""

_NO_CHARGE: Final = Charge((0.0, 0.0), 0.0)
_NOTHING: Final = Assessment(0.0, 0.0, 0.0, 0.0, False)
_MOST_SHOWN: Final = 64
"""Most charges of a site for which the constant observations are kept."""


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


@dataclass(frozen=True, eq=False)
class Task:
    """What all episodes of an environment have in common.

    Attributes:
        source: Source of the scenario of each episode.
        threat_model: Draws the charges of an episode.
        realisations: Number of blasts per charge, with different seeds.
        risk: Reduces the loads of several charges to one; that of the scenario if `None`.
        observation: The kind of observation.
        actions: The kind of action space.
        reward: The reward.
        illegal: The consequences of illegal actions.
        engine: Computes the loads.
        store: Where the loads are.
        counts: Counts the blasts.
    """

    source: ScenarioSource
    threat_model: ThreatModel
    realisations: int
    risk: Risk | None
    observation: Observation
    actions: Actions
    reward: Reward
    illegal: IllegalActions
    engine: Engine
    store: BlastStore
    counts: BlastCounts = field(default_factory=BlastCounts)

    def evaluator(self, scenario: Scenario) -> BlastEvaluator:
        """Return what runs the blasts of a site; see `BlastEvaluator` for errors."""
        return BlastEvaluator(scenario, self.engine, cache=self.store, counts=self.counts)


@dataclass(frozen=True, eq=False)
class _Shown:
    """What an agent is shown from the beginning, with the actions that follow from it."""

    observable: Observable
    observation: EpisodeObservation
    actions: NumberedActions


@dataclass(frozen=True, eq=False)
class _Site:
    """What all episodes on one site have in common.

    Attributes:
        evaluator: Runs the blasts.
        empty: The site without a barrier.
        rules: The rules of placing on it.
        actions: The numbered actions.
        terms: The terms of the reward, all 0.
        shown: What an agent is shown, by the charges.
        bare: The loads without a barrier, by the threats.
        outcomes: The information before the end, by the number of charges.
    """

    evaluator: BlastEvaluator
    empty: LayoutState
    rules: PlacementRules
    actions: NumberedActions
    terms: Terms
    shown: OrderedDict[tuple[AnyCharge, ...], _Shown] = field(default_factory=OrderedDict)
    bare: OrderedDict[Any, Assessment] = field(default_factory=OrderedDict)
    outcomes: dict[int, Mapping[str, Any]] = field(default_factory=dict)

    @classmethod
    def of(cls, task: Task, scenario: Scenario) -> "_Site":
        """Return the common parts of a site.

        Raises:
            BlastEnvError: If the scenario has another size than the representative one, or the
                reward names the term that the environment adds itself.
        """
        check_size(scenario, task.source.representative)
        names, empty = task.reward.terms(scenario), LayoutState.empty(scenario)
        if ILLEGAL_TERM in names:
            raise BlastEnvError(
                f"the reward has a term {ILLEGAL_TERM!r}, which the environment adds itself"
            )
        return cls(
            task.evaluator(scenario),
            empty,
            PlacementRules.of(empty),
            NumberedActions.of(task.actions, scenario),
            dict.fromkeys((*names, ILLEGAL_TERM), 0.0),
        )

    def no_outcome(self, charges: int) -> Mapping[str, Any]:
        """Return the information on the blasts before the end of an episode."""
        if charges not in self.outcomes:
            nothing = (_NOTHING, _NOTHING, (_NO_CHARGE,) * charges)
            self.outcomes[charges] = _outcome(self.evaluator, *nothing)
        return self.outcomes[charges]

    def shown_of(self, task: Task, charges: tuple[AnyCharge, ...]) -> _Shown:
        """Return what is shown of an episode with some charges."""
        found = self.shown.get(charges)
        if found is not None:
            return found
        sources = task.threat_model.shown(self.empty.scenario, charges)
        among = bool(task.source.representative.vehicles)
        observable = Observable(self.empty.scenario, sources, among)
        observation = task.observation.episode(observable)
        made = _Shown(observable, observation, self.actions.with_sources(sources))
        if isinstance(observation, BatchedObservation):  # others may keep a state
            _keep(self.shown, charges, made)
        return made


def _keep(kept: OrderedDict[Any, Any], key: Any, value: Any) -> None:
    kept[key] = value
    if len(kept) > _MOST_SHOWN:
        kept.popitem(last=False)


@dataclass(eq=False)
class Episode:
    """The state of an episode, besides its layout.

    Attributes:
        site: The common parts of its site.
        shown: What the agent is shown.
        case: The scenario and the threats, and how their loads combine into one number.
        terms: The terms of the last reward; before the first action all are 0.
        transition: The change by the last action.
        chosen: The choices so far for the next module or piece; `None` before the first.
        invalid_actions: Number of illegal actions so far.
        without_effect: Number of those that changed nothing.
        repeated: The last action if it changed nothing; `None` otherwise.
        begun: Whether there has been an action.
        ended: Whether the charge has gone off.
        loads: The loads with each layout against which the charges went off.
    """

    site: _Site
    shown: _Shown
    case: LoadCaseSet
    terms: Terms
    transition: Transition
    chosen: ActionChoice | None = None
    invalid_actions: int = 0
    without_effect: int = 0
    repeated: int | None = None
    begun: bool = False
    ended: bool = False
    loads: dict[Layout, Assessment] = field(default_factory=dict)

    @property
    def evaluator(self) -> BlastEvaluator:
        """What runs its blasts."""
        return self.site.evaluator

    def assess(self) -> tuple[Assessment, Assessment]:
        """Return the loads with the final layout and without a barrier."""
        return self.loads[self.transition.after], self.loads[()]

    @cached_property
    def no_outcome(self) -> Mapping[str, Any]:
        """The information on the blasts before the end: loads and counts are 0."""
        return self.site.no_outcome(len(self.case.threats) // self.case.realisations)

    @property
    def outcome(self) -> Mapping[str, Any]:
        """The information on the blasts."""
        if not self.ended:
            return self.no_outcome
        charges = self.case.charges_against(self.transition.after)
        return _outcome(self.evaluator, *self.assess(), charges)

    @cached_property
    def constants(self) -> Mapping[str, Any]:
        """The information that does not change in the episode."""
        seeds = [threat.seed for threat in self.case.threats]
        count = len(seeds) // self.case.realisations
        return {
            "scenario_hash": self.evaluator.scenario_hash,
            "calibration": self.evaluator.calibration_name,
            "blast_seeds": tuple([tuple(seeds[index::count]) for index in range(count)]),
        }


def _outcome(
    evaluator: BlastEvaluator,
    protected: Assessment,
    unprotected: Assessment,
    charges: tuple[Charge, ...],
) -> Mapping[str, Any]:
    """Return the information on blasts."""
    has_blasts = unprotected is not _NOTHING
    counts = evaluator.counts if has_blasts else BlastCounts()
    found: dict[str, Any] = {
        "impulse_psi_s": protected.impulse_psi_s,
        "impulse_pa_s": protected.impulse_pa_s,
        "unprotected_impulse_pa_s": unprotected.impulse_pa_s,
        "reduction": protected.reduction_from(unprotected) if has_blasts else 0.0,
        "calibration_in_range": protected.in_range,
        "charges": charges,
        "blasts": counts.blasts,
        "cache_hits": counts.cache_hits,
        "cache_hit_rate": counts.cache_hit_rate,
    }
    if evaluator.engine.medium == "particles":
        return found | {"impulse_sim": protected.impulse_sim}
    if not evaluator.engine.gives_peaks(evaluator.scenario):
        return found
    found |= {"peak_pa": protected.peak_pa, "unprotected_peak_pa": unprotected.peak_pa}
    if not evaluator.scenario.objective.is_response:
        return found
    levels = [each.level.label if each.level else "" for each in (protected, unprotected)]
    return found | {
        "response": protected.load,
        "unprotected_response": unprotected.load,
        "level_of_protection": levels[0],
        "unprotected_level_of_protection": levels[1],
    }


class Episodes:
    """Episodes of one task side by side, each begun again when it has ended.

    Args:
        task: The task.
        count: Number of episodes.

    Attributes:
        task: The task.
        layouts: The layouts, in arrays.
        running: The state of each episode; empty before the first `begin`.
    """

    def __init__(self, task: Task, count: int) -> None:
        self.task = task
        self.layouts = LayoutBatch(LayoutState.empty(task.source.representative), count)
        self.running: list[Episode] = []
        self._sites: OrderedDict[int, _Site] = OrderedDict()
        self._most_sites = max(count, 4)

    def begin(self, index: int, rng: np.random.Generator, options: ResetOptions) -> None:
        """Draw an episode; options do not change the amount drawn from the random stream.

        Raises:
            LayoutError: If the layout of the options does not fit the build zone.
            ScenarioError: If the charge of the options is not clear of a structure or the border.
            BlastEnvError: If the scenario has another size than the representative one.
        """
        task = self.task
        scenario = task.source.sample(rng)
        site = self._site(scenario)
        drawn = task.threat_model.draw(scenario, rng)
        seeds = SeedRange.TRAINING.draw(rng, (len(drawn), task.realisations))
        if options.blast_seed is not None:
            seeds = options.blast_seed + np.arange(seeds.size).reshape(seeds.shape)
        charges = tuple(options.charge(each) for each in drawn) if options.fix_charge else drawn
        start, rules = site.empty, site.rules
        is_empty = isinstance(options.layout, Sequence) and not options.layout
        if options.fix_charge or not is_empty:  # another type is refused by name
            possible = scenario.with_possible_charges(charges) if options.fix_charge else scenario
            start = LayoutState.of(possible, options.layout)
            rules = PlacementRules.of(start)
        threats = tuple(
            LoadCase(charge, seed)
            for of_realisation in seeds.T.tolist()
            for charge, seed in zip(charges, of_realisation, strict=True)
        )
        episode = Episode(
            site,
            site.shown_of(task, charges),
            LoadCaseSet(scenario, threats, task.realisations, task.risk),
            site.terms,
            Transition(scenario.objective, *(start.checked,) * 3, begins=True, ended=False),
        )
        self.layouts.begin(index, rules, start)
        if index == len(self.running):
            self.running.append(episode)
        self.running[index] = episode

    def place(self, index: int, action: int) -> None:
        """Make a choice, place a module or a piece, or finish.

        Args:
            index: The episode.
            action: One of its `NumberedActions`.
        """
        episode, illegal = self.running[index], self.task.illegal
        actions, choice = episode.shown.actions, self._choice(index)
        before = episode.transition.after
        finishes = action == actions.finish and choice.choices == 0
        found = None if finishes else actions.narrowed(choice, action)
        if found is None and not finishes:
            episode.invalid_actions += 1
            nearest = actions.nearest(choice, action) if illegal.moves else None
            found = None if nearest is None else actions.narrowed(choice, nearest)
        after = before
        if isinstance(found, ActionChoice):
            episode.chosen = found
        elif found is not None:
            self.layouts.place(index, found)
            episode.chosen = None
            after = CheckedLayout(self.layouts.layouts[index])
            after.scenario = self.layouts.rules[index].scenario
        has_effect = finishes or found is not None
        episode.without_effect += not has_effect
        repeats = illegal.moves and action == episode.repeated
        exhausted = episode.without_effect >= illegal.limit
        stops = finishes or (not has_effect and (repeats or exhausted))
        episode.repeated = None if has_effect else action
        episode.ended = stops or not self.layouts.legal[index].any()
        objective, initial = episode.transition.objective, episode.transition.initial
        episode.transition = Transition(
            objective, initial, before, after, not episode.begun, episode.ended
        )
        episode.begun = True

    def blast(self, indices: Iterable[int]) -> None:
        """Set off the charges of episodes against the layouts that the last transition needs.

        The blasts of all of them run in one batch.

        Raises:
            BlastEnvError: As `BlastEvaluator.loads_of_many`.
        """
        due: list[tuple[Episode, Layout]] = []
        for index in indices:
            episode = self.running[index]
            turn = episode.transition
            layouts = tuple(self.task.reward.layouts(turn))
            if turn.ended:
                layouts = (*layouts, turn.after, ())
            due += [
                (episode, layout)
                for layout in dict.fromkeys(layouts)
                if layout not in episode.loads and not self._is_known(episode, layout)
            ]
        asked = [
            (episode.evaluator, layout, threat)
            for episode, layout in due
            for threat in episode.case.threats
        ]
        loads = iter(loads_together(asked))
        for episode, layout in due:
            own = [next(loads) for _ in episode.case.threats]
            episode.loads[layout] = Assessment.of(episode.case, layout, own)
            if not layout:
                _keep(episode.site.bare, _of_threats(episode), episode.loads[()])

    def reward(self, index: int) -> float:
        """Return the reward of the last action, whose terms the information has.

        Raises:
            BlastEnvError: If the terms differ from those that the reward names.
        """
        episode = self.running[index]
        has_effect = episode.repeated is None
        terms = {
            **self.task.reward(episode.transition, episode.loads),
            ILLEGAL_TERM: 0.0 if has_effect else -self.task.illegal.cost,
        }
        if [*terms] != [*episode.terms]:
            found, named = (", ".join([*each][:-1]) for each in (terms, episode.terms))
            raise BlastEnvError(
                f"the reward has the terms {found}, must have those that it names: {named}"
            )
        episode.terms = terms
        return fsum(terms.values())

    def observe(self, indices: Sequence[int], space: spaces.Space[Any]) -> Any:
        """Return the observations of some episodes, with a leading axis (episodes, ...).

        The choices so far for the next piece limit the cells that are shown as free.
        """
        episodes = [self.running[index] for index in indices]
        observations = [each.shown.observation for each in episodes]
        kind = observations[0]
        if not isinstance(kind, BatchedObservation):
            own: list[Any] = [self._observed(index) for index in indices]
            empty: Any = create_empty_array(space, len(own))
            return concatenate(space, own, empty)
        pairs = zip(indices, episodes, strict=True)
        possible = {index: e.chosen.possible for index, e in pairs if e.chosen is not None}
        observed = kind.observe_many(observations, self.layouts.placements(indices, possible))
        if isinstance(space, spaces.Dict):
            observed |= {MASK: self.masks(indices)}
        return observed

    def _observed(self, index: int) -> Any:
        episode = self.running[index]
        shown = self.layouts.state(index)
        if episode.chosen is not None:
            shown = shown.limited_to(episode.chosen.possible)
        observed = episode.shown.observation.observe(shown)
        if isinstance(observed, Mapping):
            return {**observed, MASK: self.masks([index])[0]}
        return observed

    def masks(self, indices: Sequence[int]) -> NDArray[np.int8]:
        """Return the masks of legal actions (episodes, actions), as `sample(mask=...)` wants them.

        When the charge has gone off, only finishing is legal.
        """
        actions = self.running[indices[0]].shown.actions
        masks = np.zeros((len(indices), actions.finish + 1), dtype=np.int8)
        are_all = len(indices) == len(self.running)
        if actions.are_plain:
            legal = self.layouts.legal if are_all else self.layouts.legal[list(indices)]
            masks[:, :-1] = legal.reshape(len(legal), -1)
            masks[:, -1] = 1
        for position, index in enumerate(indices):
            episode = self.running[index]
            if episode.ended:
                masks[position, :-1], masks[position, -1] = 0, 1
            elif not actions.are_plain:
                masks[position] = episode.shown.actions.mask(self._choice(index))
        return masks

    def information(self, index: int) -> dict[str, Any]:
        """Return the information after `reset` and after every action.

        Keys, shapes and types are the same throughout an episode. Until the charge has gone off,
        loads, charges and counts are 0 and levels are empty.
        """
        episode = self.running[index]
        return {
            "action_mask": self.masks([index])[0],
            "invalid_actions": episode.invalid_actions,
            "placed": len(self.layouts.layouts[index]),
            "layout": self.layouts.table[index].copy(),
            "reward_terms": dict(episode.terms),
            **episode.outcome,
            **episode.constants,
        }

    def _choice(self, index: int) -> ActionChoice:
        """Return the choices so far for the next module or piece of an episode."""
        return self.running[index].chosen or ActionChoice(self.layouts.legal[index])

    def _is_known(self, episode: Episode, layout: Layout) -> bool:
        """Take the loads without a barrier from an earlier episode of the same threats."""
        known = None if layout else episode.site.bare.get(_of_threats(episode))
        if known is None:
            return False
        episode.loads[()] = known
        episode.evaluator.counts.cache_hits += len(episode.case.threats)
        return True

    def _site(self, scenario: Scenario) -> _Site:
        """Return the common parts of a site; those of the last ones are kept."""
        key = id(scenario)
        found = self._sites.get(key)
        if found is None or found.empty.scenario is not scenario:
            found = self._sites[key] = _Site.of(self.task, scenario)
            if len(self._sites) > self._most_sites:
                self._sites.popitem(last=False)
        self._sites.move_to_end(key)
        return found


def _of_threats(episode: Episode) -> tuple[Any, ...]:
    """Return what the loads without a barrier depend on; without noise, seeds have no effect."""
    threats = episode.case.threats
    if episode.evaluator.engine.has_noise:
        return threats
    return tuple([each.charge for each in threats])


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
