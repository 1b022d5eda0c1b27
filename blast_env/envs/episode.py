"""Episodes of placing, one or many at once: place, blast, observe, reward."""

import warnings
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from itertools import islice
from math import isnan
from typing import Any, Final

import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import concatenate, create_empty_array
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.envs.actions import ActionChoice, Actions, NumberedActions, Suggestions
from blast_env.envs.arguments import ResetOptions
from blast_env.envs.observable import (
    MASK,
    BatchObservation,
    EpisodeObservation,
    Observable,
    Observation,
)
from blast_env.envs.observations import FeaturesObservation
from blast_env.envs.strategies import (
    EndReward,
    Reward,
    ScenarioSource,
    ThreatModel,
    Transition,
    check_size,
)
from blast_env.errors import BlastEnvError, BlastEnvWarning
from blast_env.evaluation.cases import LoadCase, LoadCaseSet, SeedRange, check_loaded
from blast_env.evaluation.engines import Engine
from blast_env.evaluation.evaluator import (
    Assessment,
    BlastCounts,
    BlastEvaluator,
    BlastStore,
    loads_together,
)
from blast_env.geometry import Layout
from blast_env.layout import LayoutState
from blast_env.layout.batch import LayoutBatch, PlacementRules
from blast_env.layout.placement import LegalLayout
from blast_env.site import AnyCharge, Scenario, VehicleCharge, VehicleSource
from blast_env.site.blast_site import Charge
from blast_env.site.objective import Risk

ILLEGAL_TERM: Final = "invalid_actions"
"""The name of the reward term for illegal actions."""

INVALID_ACTIONS: Final = ("nearest", "penalty")
"""The consequences of an illegal action, by name."""

_NO_CHARGE: Final = Charge((0.0, 0.0), 0.0)
_NOTHING: Final = Assessment(0.0, 0.0, 0.0, 0.0, False)
_FINISHES, _CHOOSES, _ILLEGAL = -1, -2, -3
"""In the place of an element's number: the action finishes, is a choice, or has no effect."""

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
    reward: Reward | EndReward
    illegal: IllegalActions
    engine: Engine
    store: BlastStore
    counts: BlastCounts = field(default_factory=BlastCounts)

    @cached_property
    def rules(self) -> tuple[str, ...]:
        """The rules that suggest actions, by title, in their order; none of other action spaces."""
        return self.actions.rules(self.source.representative)

    @cached_property
    def shows_suggestions(self) -> bool:
        """Whether the vector `"features"` goes on with the values of suggestions."""
        return isinstance(self.observation, FeaturesObservation) and bool(self.rules)

    def case(
        self,
        scenario: Scenario,
        charges: tuple[AnyCharge, ...],
        seeds: NDArray[np.int64] | None = None,
    ) -> LoadCaseSet:
        """Return the scenario and the threats of an episode.

        Args:
            scenario: The scenario.
            charges: The charges.
            seeds: Seeds of their blasts (charges, realisations); without noise they have no effect.
        """
        if seeds is None:
            seeds = np.zeros((len(charges), self.realisations), dtype=np.int64)
        threats = tuple(
            LoadCase(charge, seed)
            for of_realisation in seeds.T.tolist()
            for charge, seed in zip(charges, of_realisation, strict=True)
        )
        return LoadCaseSet(scenario, threats, self.realisations, self.risk)


@dataclass(frozen=True, eq=False)
class _AgentView:
    """What an agent is shown from the beginning, with the actions that follow from it."""

    observable: Observable
    observation: EpisodeObservation
    actions: NumberedActions
    charges: tuple[AnyCharge, ...]
    case: LoadCaseSet | None

    @cached_property
    def vehicles(self) -> tuple[VehicleSource, ...]:
        """The vehicles that bring the charges."""
        sources = [item.source for item in self.charges if isinstance(item, VehicleCharge)]
        return tuple({id(source): source for source in sources}.values())


@dataclass(frozen=True, eq=False)
class _Site:
    """What all episodes on one site have in common.

    Attributes:
        evaluator: Runs the blasts.
        empty: The site without a barrier.
        rules: The rules of placing on it.
        actions: The numbered actions.
        nothing: The information on the blasts before the end, without the charges.
        shown: What an agent is shown, by the charges.
        bare: The loads without a barrier, by the threats.
        observed: What the observation keeps for all of them.
    """

    evaluator: BlastEvaluator
    empty: LayoutState
    rules: PlacementRules
    actions: NumberedActions
    nothing: Mapping[str, Any]
    shown: OrderedDict[tuple[AnyCharge, ...], _AgentView] = field(default_factory=OrderedDict)
    bare: OrderedDict[Any, Assessment] = field(default_factory=OrderedDict)
    observed: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, task: Task, scenario: Scenario) -> "_Site":
        """Return the common parts of a site.

        Raises:
            BlastEnvError: If the scenario has another size than the representative one, or the
                engine does not suit it.
        """
        check_size(scenario, task.source.representative)
        empty = LayoutState.empty(scenario)
        evaluator = BlastEvaluator(scenario, task.engine, cache=task.store, counts=task.counts)
        return cls(
            evaluator,
            empty,
            PlacementRules.of(empty),
            task.actions.numbered(scenario, task.source.representative),
            _outcome(evaluator, _NOTHING, _NOTHING, ()),
        )

    def shown_of(self, task: Task, charges: tuple[AnyCharge, ...]) -> _AgentView:
        """Return what is shown of an episode with some charges."""
        found = self.shown.get(charges)
        if found is not None:
            return found
        sources = tuple(task.threat_model.shown(self.empty.scenario, charges))
        among = bool(task.source.representative.vehicles)
        observable = Observable(self.empty.scenario, sources, among, self.observed)
        observation = task.observation.episode(observable)
        case = None if task.engine.has_noise else task.case(self.empty.scenario, charges)
        made = _AgentView(
            observable, observation, self.actions.with_sources(sources), charges, case
        )
        if isinstance(observation, BatchObservation):  # others may keep a state
            _keep(self.shown, charges, made)
        return made


def _keep(kept: OrderedDict[Any, Any], key: Any, value: Any) -> None:
    kept[key] = value
    if len(kept) > _MOST_SHOWN:
        kept.popitem(last=False)


@dataclass(eq=False)
class Episode:
    """An episode, besides its layout and what changes in every turn.

    Attributes:
        task: The task.
        site: The common parts of its site.
        shown: What the agent is shown.
        seeds: Seeds of the blasts of each charge (charges, realisations).
        initial: The layout at the beginning.
        chosen: The choices so far for the next module or piece; `None` before the first.
        invalid_actions: Number of illegal actions so far.
        without_effect: Number of those that changed nothing.
        final: The layout against which the charge has gone off; `None` before.
        loads: The loads with each layout against which the charges went off.
    """

    task: Task
    site: _Site
    shown: _AgentView
    seeds: NDArray[np.int64]
    initial: Layout
    chosen: ActionChoice | None = None
    invalid_actions: int = 0
    without_effect: int = 0
    final: LegalLayout | None = None
    loads: dict[Layout, Assessment] = field(default_factory=dict)

    @property
    def ended(self) -> bool:
        """Whether the charge has gone off."""
        return self.final is not None

    def assess(self) -> tuple[Assessment, Assessment]:
        """Return the loads with the final layout and without a barrier."""
        assert self.final is not None
        return self.loads[self.final], self.loads[()]

    @property
    def reduction(self) -> float:
        """The share of the load that the final layout takes off; NaN where nothing arrives."""
        protected, unprotected = self.assess()
        return protected.reduction_from(unprotected)

    @cached_property
    def case(self) -> LoadCaseSet:
        """The scenario and the threats, and how their loads combine into one number."""
        if self.shown.case is not None:
            return self.shown.case
        return self.task.case(self.site.empty.scenario, self.shown.charges, self.seeds)

    @property
    def loads_key(self) -> tuple[Any, ...]:
        """What the loads without a barrier depend on; without noise, seeds have no effect."""
        return self.case.threats if self.task.engine.has_noise else self.shown.charges

    @property
    def outcome(self) -> Mapping[str, Any]:
        """The information on the blasts; before the end, loads and counts are 0."""
        if self.final is None:
            no_charges = (_NO_CHARGE,) * len(self.shown.charges)
            return {**self.site.nothing, "charges": no_charges}
        charges = self.case.charges_against(self.final)
        return _outcome(self.site.evaluator, *self.assess(), charges)

    @cached_property
    def constants(self) -> Mapping[str, Any]:
        """The information that does not change in the episode."""
        return {
            "scenario_hash": self.site.empty.scenario.content_hash,
            "calibration": self.site.evaluator.calibration_name,
            "blast_seeds": tuple(map(tuple, self.seeds.tolist())),
        }


def _outcome(
    evaluator: BlastEvaluator,
    protected: Assessment,
    unprotected: Assessment,
    charges: tuple[Charge, ...],
) -> Mapping[str, Any]:
    """Return the information on blasts."""
    has_blasts = unprotected is not _NOTHING
    # Before the end zeros of the same keys and types, as vector environments need.
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
    # Entries depend on the engine and the objective alone: all steps have one structure.
    if evaluator.engine.medium == "particles":
        return found | {"impulse_sim": protected.impulse_sim}
    if not evaluator.engine.gives_peaks(evaluator.scenario):
        return found
    found |= {"peak_pa": protected.peak_pa, "unprotected_peak_pa": unprotected.peak_pa}
    if not evaluator.scenario.objective.is_response:
        return found
    found_levels = (protected.level, unprotected.level)
    levels = ["" if level is None else level.label for level in found_levels]
    return found | {
        "response": protected.load,
        "unprotected_response": unprotected.load,
        "level_of_protection": levels[0],
        "unprotected_level_of_protection": levels[1],
    }


def _check_bare(episode: Episode, without_load: Sequence[str]) -> None:
    """Refuse a site without a load; warn of one on which no layout is better than another.

    Raises:
        BlastEnvError: If no air touches a protected building.
    """
    load, scenario = episode.loads[()].load, episode.site.empty.scenario
    if isnan(load):
        check_loaded(episode.case, without_load)
    if load == 0.0 and scenario.objective.target is not None:
        warnings.warn(
            f"{scenario.name}: by {episode.task.engine.name} the facades reach their target without"
            " a barrier: every layout gets the same reward",
            BlastEnvWarning,
            stacklevel=2,
        )


@cache
def _kernels() -> Any:
    from blast_env.envs import turn_kernels  # Numba takes long to import

    return turn_kernels


class Episodes:
    """Episodes of one task side by side, each begun again when it has ended.

    Args:
        task: The task.
        count: Number of episodes.

    Raises:
        BlastEnvError: If the reward names the term that the environment adds itself.

    Attributes:
        task: The task.
        code: How agents write actions.
        layouts: The layouts, in arrays.
        running: Each episode; empty before the first `begin`.
        ended: Whether the charge of each has gone off (episodes,).
        term_names: The names of the reward's terms.
        terms: The terms of the last reward of each; before the first action 0 (episodes, terms).
    """

    def __init__(self, task: Task, count: int) -> None:
        self.task = task
        self.running: list[Episode] = []
        self._sites: OrderedDict[int, _Site] = OrderedDict()
        self._most_sites = max(count, 4)
        first = self.site_of(task.source.representative)  # an unsuitable engine fails here
        self._meets_vehicles = bool(first.empty.scenario.vehicles)
        catalogue = task.source.representative.zone.catalogue
        self.code = task.actions.code(catalogue, first.actions.finish + 1)
        self.layouts = LayoutBatch(first.empty, first.rules, count)
        self.ended: BoolArray = np.zeros(count, dtype=np.bool_)
        self._turns_made: IntArray = np.zeros(count, dtype=np.int64)
        self._before: IntArray = np.zeros(count, dtype=np.int64)  # elements before the last turn
        self._without_effect: dict[int, int] = {}  # those of the last actions that had none
        self._turns: dict[int, Transition] = {}  # the last ones, for a reward that asks for them
        self._ended_now: list[int] = []
        reward, names = task.reward, task.reward.terms(task.source.representative)
        if ILLEGAL_TERM in names:
            raise BlastEnvError(
                f"the reward has a term {ILLEGAL_TERM!r}, which the environment adds itself"
            )
        self.term_names = *names, ILLEGAL_TERM
        self.terms: FloatArray = np.zeros((count, len(self.term_names)))
        self._at_ends = reward if isinstance(reward, EndReward) else None
        self._of_turns = None if isinstance(reward, EndReward) else reward

    def begin(
        self,
        indices: Sequence[int],
        rngs: Sequence[np.random.Generator],
        options: Sequence[ResetOptions],
    ) -> None:
        """Draw episodes; options do not change the amount drawn from the random streams.

        Args:
            indices: The episodes; at first all of them in their order.
            rngs: The random numbers of each of them.
            options: The fixed parts of each of them.

        Raises:
            LayoutError: If the layout of the options does not fit the build zone.
            ScenarioError: If the charge of the options is not clear of a structure or the border.
            BlastEnvError: If the scenario has another size than the representative one.
        """
        # 1. All are drawn first: what is refused leaves every episode as it was.
        begun: dict[int, Episode] = {}
        together: dict[int, tuple[_Site, LayoutState, list[int]]] = {}
        for index, rng, fixed in zip(indices, rngs, options, strict=True):
            start, episode = self._drawn(rng, fixed)
            begun[index] = episode
            together.setdefault(id(start), (episode.site, start, []))[2].append(index)
        # 2. Those that begin with the empty layout of their site are begun together.
        for index, episode in begun.items():
            if index == len(self.running):
                self.running.append(episode)
            self.running[index] = episode
            self._without_effect.pop(index, None)
        for site, start, own in together.values():
            rules = site.rules if start is site.empty else PlacementRules.of(start)
            self.layouts.begin(own, rules, start)
        rows = self._rows(indices)
        self.ended[rows], self._turns_made[rows], self.terms[rows] = False, 0, 0.0

    def _rows(self, indices: Sequence[int] | IntArray) -> slice | Sequence[int] | IntArray:
        """Return an index of some episodes in arrays: of all of them one that copies nothing."""
        return slice(None) if len(indices) == len(self.running) else indices

    def _drawn(
        self, rng: np.random.Generator, options: ResetOptions
    ) -> tuple[LayoutState, Episode]:
        """Draw site, charges and seeds of blasts of an episode; return its first layout and it."""
        task = self.task
        # 1. Site, charges, seeds: always in this order, and as many numbers, whatever is fixed
        # afterwards.
        site = self.site_of(task.source.sample(rng))
        charges = tuple(task.threat_model.draw(site.empty.scenario, rng))
        seeds = SeedRange.TRAINING.draw(rng, (len(charges), task.realisations))
        # 2. What is fixed takes the place of what was drawn.
        if options.blast_seed is not None:
            seeds = options.blast_seed + np.arange(seeds.size).reshape(seeds.shape)
        if options.fix_charge:
            charges = tuple(options.charge(charge) for charge in charges)
        # 3. The layout: that of the site, unless an option may say something else.
        start = site.empty
        is_empty = isinstance(options.layout, Sequence) and not options.layout
        if options.fix_charge or not is_empty:  # another type is refused by name
            scenario = start.scenario
            if options.fix_charge:
                scenario = scenario.with_possible_charges(charges)
            start = LayoutState.of(scenario, options.layout)
        shown = site.shown_of(task, charges)
        return start, Episode(task, site, shown, seeds, start.checked)

    def place(self, indices: Sequence[int], actions: Sequence[int] | IntArray) -> None:
        """Make a choice, place a module or a piece, or finish, in each of some episodes.

        Args:
            indices: The episodes.
            actions: One of its `ActionNumbers` for each.
        """
        chosen, wanted = np.array(indices), np.asarray(actions, dtype=np.int64)
        layouts, rows = self.layouts, self._rows(chosen)
        # 1. What the actions do; the masks are those before them.
        found = self._all_made(chosen, wanted)
        self._turns_made[rows] += 1
        if self._of_turns is not None:
            self._before[rows] = layouts.placed[rows]
        # 2. Elements are placed, in all layouts at once. Other actions may end their episodes.
        places = found >= 0
        without_effect, self._without_effect = self._without_effect, {}
        all_place = np.count_nonzero(places) == len(places)
        if all_place:
            layouts.place(chosen, found)
        else:
            layouts.place(chosen[places], found[places])
        if self.task.rules:
            self._place_rests(chosen[places], wanted[places])
        ended = layouts.is_full[rows]
        if not all_place:
            ended = ended | self._stops(chosen, wanted, found, without_effect)
        # 3. Who has finished or filled the zone, and the final layouts.
        self.ended[rows] = ended
        self._ended_now = chosen[ended].tolist()
        for index in self._ended_now:
            self.running[index].final = layouts.checked(index)
        if self._meets_vehicles:
            self._find_worst_places()
        if self._of_turns is not None:
            self._turns = {index: self._turn(index) for index in indices}

    def _stops(
        self, chosen: IntArray, wanted: IntArray, found: IntArray, before: Mapping[int, int]
    ) -> BoolArray:
        """Return which actions that place nothing end their episodes, and note illegal ones.

        Args:
            chosen: The episodes (n,).
            wanted: The actions (n,).
            found: What they do, as `_all_made` returns it (n,).
            before: The actions before them that had no effect, by episode.
        """
        stops: BoolArray = found == _FINISHES
        # Illegal actions change nothing. Repeated, or too many, they end the episode: a policy that
        # is deterministic would repeat one for ever.
        for position in (found == _ILLEGAL).nonzero()[0].tolist():
            index, action = int(chosen[position]), int(wanted[position])
            episode = self.running[index]
            episode.without_effect += 1
            repeats = self.task.illegal.moves and before.get(index) == action
            stops[position] = repeats or episode.without_effect >= self.task.illegal.limit
            self._without_effect[index] = action
        return stops

    def _place_rests(self, chosen: IntArray, wanted: IntArray) -> None:
        """Go on where an action places all the rest of a layout, until nothing of it is legal."""
        pairs = zip(chosen.tolist(), wanted.tolist(), strict=True)
        going = {index: action for index, action in pairs if self._suggests(index).is_rest(action)}
        while going:
            following = {
                index: self._suggests(index).narrowed(self._choice(index), action)
                for index, action in going.items()
            }
            found = {index: number for index, number in following.items() if number is not None}
            self.layouts.place([*found], [*found.values()])
            going = {index: going[index] for index in found}

    def _find_worst_places(self) -> None:
        """Find the worst places of vehicles against the final layouts, which have them then."""
        coming = {}
        for index in self._ended_now:
            episode = self.running[index]
            assert episode.final is not None
            coming[index] = episode.final, episode.shown.vehicles
        self.layouts.find_worst(coming)

    def _turn(self, index: int) -> Transition:
        """Return the last turn of an episode."""
        episode, before = self.running[index], int(self._before[index])
        after = self.layouts.checked(index)
        earlier = after
        if before < len(after):
            earlier = LegalLayout.of(after.scenario, after[:before])
        ends = bool(self._turns_made[index] == 1), bool(self.ended[index])
        objective = episode.site.empty.scenario.objective
        return Transition(objective, episode.initial, earlier, after, *ends)

    def _all_made(self, chosen: IntArray, wanted: IntArray) -> IntArray:
        """Return what actions do in episodes, and record choices (episodes,).

        It is the number of the element to place, `_FINISHES`, `_CHOOSES` or `_ILLEGAL`.
        """
        actions = self.running[chosen[0]].shown.actions
        found: IntArray = np.full(len(chosen), _ILLEGAL)
        if actions.are_plain:  # the usual case, without the time to make a choice
            legal, ends = self.layouts.legal, (_FINISHES, _ILLEGAL)
            if not _kernels().put_placed(chosen, wanted, legal, *ends, found):
                return found
        for position in (found == _ILLEGAL).nonzero()[0].tolist():
            found[position] = self._made(int(chosen[position]), int(wanted[position]))
        return found

    def _made(self, index: int, action: int) -> int:
        """Return the same for one action; illegal ones are counted."""
        episode = self.running[index]
        actions, choice = episode.shown.actions, self._choice(index)
        if action == actions.finish and choice.choices == 0:
            return _FINISHES
        found = actions.narrowed(choice, action)
        if found is None:
            episode.invalid_actions += 1
            nearest = actions.nearest(choice, action) if self.task.illegal.moves else None
            if nearest == actions.finish:
                return _FINISHES
            found = None if nearest is None else actions.narrowed(choice, nearest)
        if found is None:
            return _ILLEGAL
        episode.chosen = found if isinstance(found, ActionChoice) else None
        return found if isinstance(found, int) else _CHOOSES

    def blast(self) -> None:
        """Set off the charges of episodes against the layouts that the last turns need.

        The blasts of all of them run in one batch.

        Raises:
            BlastEnvError: As `BlastEvaluator.loads_of_many`.
        """
        # 1. The layouts of each episode, each once: those that a reward of turns compares, and at
        # the end the final one and the empty site.
        wanted: dict[int, dict[Layout, None]] = {}
        if self._of_turns is not None:
            for index, turn in self._turns.items():
                wanted[index] = dict.fromkeys(self._of_turns.layouts(turn))
        for index in self._ended_now:
            final = self.running[index].final
            assert final is not None
            wanted.setdefault(index, {}).update({final: None, (): None})
        # 2. Without those known: of the episode, and of the empty site from an earlier one.
        due = []
        for index, layouts in wanted.items():
            episode = self.running[index]
            if () in layouts:
                self._recall_bare(episode)
            due += [(episode, layout) for layout in layouts if layout not in episode.loads]
        if not due:
            return
        # 3. One batch of blasts, and the loads back to their episodes in the same order.
        asked = [
            (episode.site.evaluator, layout, threat)
            for episode, layout in due
            for threat in episode.case.threats
        ]
        loads = iter(loads_together(asked))
        for episode, layout in due:
            own = list(islice(loads, len(episode.case.threats)))
            episode.loads[layout] = Assessment.of(episode.case, layout, own)
            if not layout:
                if not episode.loads[()].load > 0.0:
                    _check_bare(episode, own[0].without_load)
                _keep(episode.site.bare, episode.loads_key, episode.loads[()])

    def rewards(self, indices: Sequence[int]) -> FloatArray:
        """Return the rewards of the last actions (episodes,); episodes have their terms.

        Raises:
            BlastEnvError: If the terms differ from those that the reward names, or their number.
        """
        chosen, rows = np.asarray(indices), self._rows(indices)
        self.terms[rows] = 0.0
        # A reward at the ends pays at the first and the last action alone.
        pays = self.ended[rows] | (self._turns_made[rows] == 1)
        paid = chosen if self._of_turns else chosen[pays]
        if len(paid):
            self.terms[paid, :-1] = self._paid(paid)
        # The cost of illegal actions is a term of its own.
        without_effect = self._without_effect and [i for i in indices if i in self._without_effect]
        if without_effect:
            self.terms[without_effect, -1] = -self.task.illegal.cost
        rewards: FloatArray = np.zeros(len(chosen))
        if not len(paid) and not without_effect:  # the usual case of one episode
            return rewards
        for of_term in self.terms[rows].T:  # one by one: the same sum of one row or of many
            rewards += of_term
        return rewards

    def _paid(self, chosen: IntArray) -> FloatArray:
        """Return the terms of the last actions, without that of illegal ones (n, terms)."""
        if self._at_ends is not None:
            ended, reductions = self.ended[chosen], np.zeros(len(chosen))
            reductions[ended] = [self.running[index].reduction for index in chosen[ended].tolist()]
            all_paid = self._at_ends.paid(self._turns_made[chosen] == 1, ended, reductions)
            wanted = len(chosen), len(self.term_names) - 1
            if np.shape(all_paid) != wanted:  # which NumPy may fit, and so pay one number twice
                raise BlastEnvError(
                    f"the reward pays an array of shape {np.shape(all_paid)}, must be {wanted}:"
                    " (turns, terms)"
                )
            return all_paid
        assert self._of_turns is not None
        paid = np.empty((len(chosen), len(self.term_names) - 1))
        for terms, index in zip(paid, chosen.tolist(), strict=True):
            found = self._of_turns(self._turns[index], self.running[index].loads)
            if (*found, ILLEGAL_TERM) != self.term_names:
                raise BlastEnvError(
                    f"the reward has the terms {', '.join(found)}, must have those that it names: "
                    f"{', '.join(self.term_names[:-1])}"
                )
            terms[:] = [*found.values()]
        return paid

    def observe(self, indices: Sequence[int], space: spaces.Space[Any]) -> Any:
        """Return the observations of some episodes, with a leading axis (episodes, ...).

        The choices so far for the next piece limit the cells that are shown as free.
        """
        episodes = [self.running[index] for index in indices]
        observations = [episode.shown.observation for episode in episodes]
        kind = observations[0]
        if not isinstance(kind, BatchObservation):
            own: list[Any] = [self._observed(index) for index in indices]
            empty: Any = create_empty_array(space, len(own))
            return concatenate(space, own, empty)
        # A choice made so far leaves fewer cells, and only these are shown as free.
        possible = {}
        if not episodes[0].shown.actions.are_plain:
            pairs = zip(indices, episodes, strict=True)
            possible = {index: e.chosen.possible for index, e in pairs if e.chosen is not None}
        observed = kind.observe_many(observations, self.layouts.placements(indices, possible))
        if isinstance(space, spaces.Dict):
            observed |= {MASK: self.masks(indices)}
        elif self.task.shows_suggestions:
            values = np.stack([self._suggested(index) for index in indices])
            observed = np.concatenate((observed, values), axis=1, dtype=observed.dtype)
        return observed

    def _suggested(self, index: int) -> FloatArray:
        """Return the values of the rules' suggestions in an episode, one rule after the other."""
        suggestions = self._suggests(index)
        return suggestions.values(self._choice(index), self.layouts.table[index]).ravel()

    def _suggests(self, index: int) -> Suggestions:
        suggestions = self.running[index].shown.actions
        assert isinstance(suggestions, Suggestions)
        return suggestions

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
        """Return the masks of legal actions (episodes, length), as the code of actions has them.

        When the charge has gone off, only finishing is legal.
        """
        actions = self.running[indices[0]].shown.actions
        masks = np.zeros((len(indices), actions.finish + 1), dtype=np.int8)
        rows = self._rows(indices)
        if actions.are_plain:
            legal = self.layouts.legal[rows]
            masks[:, :-1] = legal.reshape(len(legal), -1)
            masks[:, -1] = 1
        else:
            for position, index in enumerate(indices):
                of_episode = self.running[index].shown.actions
                masks[position] = of_episode.mask(self._choice(index))
        # An episode that has ended waits for `reset`: one legal action, or masked sampling would
        # fail.
        over = self.ended[rows]
        if np.count_nonzero(over):
            masks[over, :-1], masks[over, -1] = 0, 1
        return self.code.masks(masks)

    def information(self, index: int) -> dict[str, Any]:
        """Return the information after `reset` and after every action.

        Keys, shapes and types are the same throughout an episode. Until the charge has gone off,
        loads, charges and counts are 0 and levels are empty.
        """
        episode = self.running[index]
        return {
            "action_mask": self.masks([index])[0],
            "invalid_actions": episode.invalid_actions,
            "placed": int(self.layouts.placed[index]),
            "layout": self.layouts.table[index].copy(),
            "reward_terms": dict(zip(self.term_names, self.terms[index].tolist(), strict=True)),
            **episode.outcome,
            **episode.constants,
        }

    def _choice(self, index: int) -> ActionChoice:
        """Return the choices so far for the next module or piece of an episode."""
        return self.running[index].chosen or ActionChoice(self.layouts.legal[index])

    def _recall_bare(self, episode: Episode) -> None:
        """Take the loads without a barrier from an earlier episode of the same threats."""
        known = None if () in episode.loads else episode.site.bare.get(episode.loads_key)
        if known is None:
            return
        episode.loads[()] = known
        episode.site.evaluator.counts.cache_hits += episode.seeds.size

    def site_of(self, scenario: Scenario) -> _Site:
        """Return the common parts of a site; those of the last ones are kept.

        Raises:
            BlastEnvError: If the engine or the reward does not suit the scenario, or its size
                differs from that of the representative one.
        """
        key = id(scenario)
        found = self._sites.get(key)
        if found is None or found.empty.scenario is not scenario:
            found = self._sites[key] = _Site.of(self.task, scenario)
            if len(self._sites) > self._most_sites:
                self._sites.popitem(last=False)
        self._sites.move_to_end(key)
        return found
