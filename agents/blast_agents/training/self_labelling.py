"""Begin where the rules end, then learn from one's own best.

Each case, a charge or a site, has a label: the best layout for it that is known. In the first round
that is the best of the layouts of all rules, which the policy then learns to imitate. In every
further round some of the cases get new layouts: what the policy proposes and draws, the label
a little changed, the labels of the nearest charges. They race by blasts on the case's threats; the
winner is the new label, from which the policy learns on.

Blasts are kept in the run folder, guesses of a surrogate are not. A round has seeds of its own and
ends with a checkpoint, so that a run that was interrupted ends as if it had not been, and repeats
none of its blasts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import ceil, log2
from statistics import fmean
from time import perf_counter
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.logger import Logger, configure
from stable_baselines3.common.utils import set_random_seed
from torch import Tensor

from blast_agents.search import layouts_by_rule
from blast_agents.search.moves import Moves, legal_part
from blast_agents.training.agent import Policy, TrainedAgent, as_tensor, policy_for
from blast_agents.training.cases import Selection, training_cases
from blast_agents.training.checkpoint import CaseLabel, Checkpoint
from blast_agents.training.hyperparameters import schedule
from blast_agents.training.recorder import evaluate
from blast_agents.training.run_folder import RolloutRow, RunConfiguration, RunFolder
from blast_env.envs.observations import OBSERVATIONS, EpisodeObservation, Observable
from blast_env.envs.strategies import ScenarioSource
from blast_env.evaluation import Case, Evaluators
from blast_env.evaluation.evaluator import BlastAsked
from blast_env.evaluation.store import DiskCache, LoadsCache
from blast_env.geometry import Layout
from blast_env.physics.scene import Charge
from blast_env.scenario import Placement
from blast_env.scenario.vehicles import source_of
from blast_env.statistics import reductions


@dataclass(frozen=True)
class Step:
    """A moment in the placing of a layout, and what may come next.

    Attributes:
        observation: What the agent sees.
        legal: Which actions are legal (actions,); the last one finishes.
        wanted: Which of them lead to the layout (actions,); at least one.
        value: What the layout is worth: the reduction of the impulse.
    """

    observation: NDArray[np.uint8] | NDArray[np.float32]
    legal: NDArray[np.bool_]
    wanted: NDArray[np.bool_]
    value: float


@dataclass(frozen=True, eq=False)
class Demonstration:
    """A layout that is worth being imitated.

    A layout has no order: whatever part of it stands, each of its other modules or pieces is as
    good a next one. So the policy learns from random parts of it, and from all the others at once.

    Attributes:
        case: The case that it is for.
        layout: The layout; it keeps every condition of the build zone.
        reduction: By which share it lowers the impulse.
        observation: Name of what the agent sees.
        among_vehicles: Whether other scenarios of the training have vehicles, so that this one
            shows that it has none.
    """

    case: Case
    layout: Layout
    reduction: float
    observation: str = "grid"
    among_vehicles: bool = False

    def draw(self, rng: np.random.Generator) -> Step:
        """Return a random moment in its placing, from nothing to all of it.

        The moment when all of it stands is left out where nothing more could be placed: there is
        nothing to decide then.
        """
        elements = len(self.layout)
        standing = int(rng.integers(elements + (0 if self._is_full else 1))) if elements else 0
        order = rng.permutation(elements)
        part = tuple(self.layout[index] for index in sorted(order[:standing].tolist()))
        placement = Placement(self.case.scenario, part)
        catalogue = placement.catalogue
        legal = np.append(placement.legal.ravel(), True)
        wanted = np.zeros_like(legal)
        rest = [catalogue.action(self.layout[index]) for index in order[standing:].tolist()]
        wanted[rest or [catalogue.finish]] = True
        return Step(self._episode.observe(placement), legal, wanted, self.reduction)

    @cached_property
    def _is_full(self) -> bool:
        return Placement(self.case.scenario, self.layout).is_full

    @cached_property
    def _episode(self) -> EpisodeObservation:
        scenario, charge = self.case.scenario, self.case.charge
        sources = scenario.charge if charge is None else (source_of(charge),)
        observable = Observable(scenario, sources, among_vehicles=self.among_vehicles)
        return OBSERVATIONS[self.observation].episode(observable)


def logits_and_values(policy: Policy, observations: Tensor) -> tuple[Tensor, Tensor]:
    """Return the logit of each action, legal or not (batch, actions), and the value (batch,)."""
    features = policy.extract_features(observations)
    if not isinstance(features, Tensor):
        raise TypeError("actor and critic share their features in the policies that are trained")
    for_actor, for_critic = policy.mlp_extractor(features)
    logits: Tensor = policy.action_net(for_actor)
    values: Tensor = policy.value_net(for_critic)[:, 0]
    return logits, values


def imitation_loss(logits: Tensor, legal: Tensor, wanted: Tensor) -> Tensor:
    """Return how unlikely the policy finds what is wanted, mean over a batch.

    The cross-entropy to the distribution in which every wanted action is as likely, among the
    legal ones.

    Args:
        logits: (batch, actions).
        legal: Which actions are legal (batch, actions).
        wanted: Which of them are wanted, at least one in a row (batch, actions).
    """
    likely = logits.masked_fill(~legal, -torch.inf).log_softmax(dim=1)
    shares = wanted / wanted.sum(dim=1, keepdim=True)
    return -(likely.masked_fill(~wanted, 0.0) * shares).sum(dim=1).mean()


def imitate(
    policy: Policy,
    demonstrations: Sequence[Demonstration],
    updates: int,
    batch_size: int,
    learning_rate: float,
    vf_coef: float,
    max_grad_norm: float,
    rng: np.random.Generator,
) -> float:
    """Let a policy learn from demonstrations, with its own optimiser.

    Args:
        policy: The policy.
        demonstrations: At least one.
        updates: Minibatches.
        batch_size: Moments in each of them.
        learning_rate: Of the optimiser.
        vf_coef: Weight of the critic's error: it learns what the layouts are worth.
        max_grad_norm: Largest gradient.
        rng: Draws demonstrations and moments.

    Returns:
        Mean loss of the imitation over the last tenth of the minibatches; NaN without any.
    """
    for group in policy.optimizer.param_groups:
        group["lr"] = learning_rate
    policy.set_training_mode(True)
    losses = []
    for _ in range(updates):
        chosen = rng.integers(len(demonstrations), size=batch_size).tolist()
        steps = [demonstrations[index].draw(rng) for index in sorted(chosen)]
        observations = as_tensor(policy, np.stack([step.observation for step in steps]))
        legal = torch.as_tensor(np.stack([step.legal for step in steps]))
        wanted = torch.as_tensor(np.stack([step.wanted for step in steps]))
        worth = torch.tensor([step.value for step in steps], dtype=torch.float32)
        logits, values = logits_and_values(policy, observations)
        loss = imitation_loss(logits, legal, wanted)
        of_critic = torch.nn.functional.mse_loss(values, worth)
        policy.optimizer.zero_grad()
        (loss + vf_coef * of_critic).backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(policy.parameters(), max_grad_norm)
        policy.optimizer.step()
        losses.append(loss.item())
    policy.set_training_mode(False)
    last = losses[-max(len(losses) // 10, 1) :]
    return float(np.mean(last)) if last else float("nan")


_MOST_BYTES: Final = 2_000_000_000
"""Most that the blasts of a run take on the disk; one takes some kilobytes."""

_GUESSES: Final = 50_000
"""Guesses that are remembered, so that none of a round is made twice."""


@dataclass(eq=False)
class Judge:
    """Runs the blasts of a training, several at a time.

    Attributes:
        evaluators: Run the blasts and remember them.
        processes: Worker processes; they change nothing but the time.
        asked: How often a layout met a threat so far, known or not.
    """

    evaluators: Evaluators
    processes: int = 1
    asked: int = 0

    def loads(
        self, asked: Sequence[tuple[Case, Layout]], threats: slice
    ) -> list[tuple[float, ...]]:
        """Return the loads that count, one a threat, for each pair.

        Args:
            asked: Layouts with their cases.
            threats: Which threats of each case they meet.
        """
        blasts = [
            BlastAsked(case.scenario, layout, threat)
            for case, layout in asked
            for threat in case.threats[threats]
        ]
        self.asked += len(blasts)
        self.evaluators.run_ahead(blasts, self.processes)
        of_pairs = []
        for case, layout in asked:
            evaluator = self.evaluators.of(case.scenario)
            pairs = [(layout, threat) for threat in case.threats[threats]]
            loads = evaluator.loads_of_many(pairs)
            of_pairs.append(tuple(each.load(case.scenario.objective) for each in loads))
        return of_pairs


Loads = Mapping[Layout, tuple[float, ...]]
"""Layouts and the loads under the threats that they have met, in the objective's unit."""


def race(judge: Judge, cases: Sequence[Case], layouts: Sequence[Sequence[Layout]]) -> list[Loads]:
    """Let the layouts of each case race on its threats, by successive halving.

    All meet the first threat, the better half of them the second, the better quarter the next two,
    and so on; the blasts of all cases run side by side.

    Args:
        judge: Runs the blasts.
        cases: The cases, each with as many threats.
        layouts: Of each case, none twice.

    Returns:
        For each case, what every layout met; those that met all threats are the last ones left.
    """
    known: list[dict[Layout, tuple[float, ...]]] = [dict.fromkeys(each, ()) for each in layouts]
    alive = [list(each) for each in layouts]
    met, most = 0, len(cases[0].threats)
    for upto in [min(2**index, most) for index in range(ceil(log2(most)) + 1)]:
        asked = [(number, each) for number, own in enumerate(alive) for each in own]
        pairs = [(cases[number], each) for number, each in asked]
        blasts = judge.loads(pairs, slice(met, upto))
        for (number, layout), of_layout in zip(asked, blasts, strict=True):
            known[number][layout] += of_layout
        for number, case in enumerate(cases):
            own = known[number]
            alive[number].sort(key=lambda each: case.counted(own[each], each))
            alive[number] = alive[number][: ceil(len(alive[number]) / 2)]
        met = upto
    return [*known]


@dataclass(eq=False)
class Lessons:
    """The cases of a training and their labels.

    Attributes:
        cases: The cases, each with as many threats.
        labels: A label a case; none before the first round.
    """

    cases: tuple[Case, ...]
    labels: list[CaseLabel] = field(default_factory=list)

    def reduction(self, index: int) -> float:
        """Return by which share a case's label lowers the load; 0 where nothing arrives."""
        label, case = self.labels[index], self.cases[index]
        return _reduction(case, label.layout, label.load, label.unprotected)

    @property
    def demonstrations(self) -> list[int]:
        """Which cases there is something to learn from: those with a layout that helps."""
        return [index for index in range(len(self.labels)) if self.reduction(index) > 0.0]

    def begin(self, judge: Judge) -> list[float]:
        """Make the best layouts by rule the labels; return the reduction of each one tried."""
        by_rule = [
            [*dict.fromkeys(layouts_by_rule(case.scenario, case.charge).values())]
            for case in self.cases
        ]
        whole = slice(None)
        bare = judge.loads([(case, ()) for case in self.cases], whole)
        self.labels = [CaseLabel((), each, each) for each in bare]
        return self.improve(judge, range(len(self.cases)), by_rule)

    def improve(
        self, judge: Judge, indices: Sequence[int], layouts: Sequence[Sequence[Layout]]
    ) -> list[float]:
        """Let layouts race against the labels of some cases; return the reduction of each.

        Args:
            judge: Runs the blasts.
            indices: The cases.
            layouts: Of each of them; those that are the label already are left out.
        """
        fresh = [
            [each for each in dict.fromkeys(own) if each != self.labels[index].layout]
            for index, own in zip(indices, layouts, strict=True)
        ]
        tried = []
        raced = race(judge, [self.cases[index] for index in indices], fresh)
        for index, met in zip(indices, raced, strict=True):
            case, label = self.cases[index], self.labels[index]
            for layout, load in met.items():
                bare = label.unprotected[: len(load)]
                tried.append(_reduction(case, layout, load, bare))
                whole = len(load) == len(case.threats)
                best = case.counted(self.labels[index].load, self.labels[index].layout)
                if whole and case.counted(load, layout) < best:
                    self.labels[index] = replace(label, layout=layout, load=load)
        return tried

    def nearest(self, index: int, count: int) -> list[Layout]:
        """Return the labels of the charges nearest to that of a case, as far as they may stand.

        Of the same scenario; none where the charge is hidden, or a vehicle's.
        """
        case = self.cases[index]
        if not isinstance(case.charge, Charge):
            return []
        x_m, y_m = case.charge.position_m
        away_m = {}
        for other, each in enumerate(self.cases):
            if isinstance(each.charge, Charge) and each.scenario is case.scenario:
                other_x_m, other_y_m = each.charge.position_m
                away_m[other] = np.hypot(other_x_m - x_m, other_y_m - y_m)
        others = sorted(away_m.keys() - {index}, key=lambda other: (away_m[other], other))
        nearest = [self.labels[other].layout for other in others[:count]]
        return [_sorted(legal_part(case.scenario, layout).layout) for layout in nearest]


@dataclass(eq=False)
class SelfLabelling:
    """A training between two rounds.

    Attributes:
        folder: Of the run.
        configuration: Of the run.
        agent: The agent, whose policy learns.
        lessons: What it learns from.
        judge: Runs the blasts of the races.
        selection: What the best weights are chosen by.
        progress: What the run has come to so far.
        logger: Writes for TensorBoard.
        uncounted: Blasts in the run folder that no round has counted: of one that was interrupted.
    """

    folder: RunFolder
    configuration: RunConfiguration
    agent: TrainedAgent
    lessons: Lessons
    judge: Judge
    selection: Selection
    progress: Checkpoint
    logger: Logger
    uncounted: int = 0

    @classmethod
    def of(
        cls,
        folder: RunFolder,
        configuration: RunConfiguration,
        source: ScenarioSource,
        selection: Selection,
        progress: Checkpoint,
    ) -> "SelfLabelling":
        """Return the training as it was at a checkpoint.

        Args:
            folder: Of the run.
            configuration: Of the run.
            source: Gives the cases their scenario.
            selection: What the best weights are chosen by.
            progress: What the run has come to by then; goes on from there.

        Raises:
            BlastEnvError: If the checkpoint does not fit.
        """
        settings, hyperparameters = configuration.settings, configuration.self_labelling
        set_random_seed(settings.seed % 2**32)
        scenario = source.representative
        policy = policy_for(configuration, scenario)
        progress.load_into(policy, folder.checkpoint)
        policy.set_training_mode(False)
        cases = training_cases(settings, source, hyperparameters.cases)
        # Guesses cost less than to read them from a file.
        cache = LoadsCache(_GUESSES) if settings.guesses else DiskCache(folder.blasts, _MOST_BYTES)
        scenarios = {case.scenario.content_hash for case in cases}
        evaluators = Evaluators(settings.blast_engine, cache, most=len(scenarios))
        judge = Judge(evaluators, hyperparameters.n_envs, progress.counters.steps)
        return cls(
            folder=folder,
            configuration=configuration,
            agent=TrainedAgent(policy, scenario, settings.observation, settings.real_engine),
            lessons=Lessons(cases, progress.labels),
            judge=judge,
            selection=selection,
            progress=progress,
            logger=configure(str(folder.tensorboard), ["tensorboard"]),
            uncounted=0 if settings.guesses else max(len(cache) - progress.counters.blasts, 0),
        )

    def do_round(self) -> None:
        """Let layouts race, let the policy learn, and write it all down."""
        began, before = perf_counter(), self.progress.counters
        blasts, hits = self.judge.evaluators.blasts, self.judge.evaluators.cache_hits
        hyperparameters, number = self.configuration.self_labelling, before.rollouts
        rng = np.random.default_rng((self.configuration.settings.seed, number))
        if number == 0:
            tried = self.lessons.begin(self.judge)
            updates = hyperparameters.first_updates
        else:
            indices = self._turn(number)
            layouts = [self._candidates(index, rng) for index in indices]
            tried = self.lessons.improve(self.judge, indices, layouts)
            updates = hyperparameters.updates
        self.judge.asked = max(self.judge.asked, before.steps + 1)  # every round ends some time
        loss = self._imitate(updates, rng)
        simulated = self.judge.evaluators.blasts - blasts + self.uncounted
        counters = replace(
            before,
            steps=self.judge.asked,
            rollouts=number + 1,
            updates=before.updates + updates,
            episodes=before.episodes + len(tried),
            blasts=before.blasts + simulated,
            # Each blast is run ahead, and then found.
            cache_hits=before.cache_hits + self.judge.evaluators.cache_hits - hits - simulated,
            seconds=before.seconds + perf_counter() - began,
        )
        self.progress.counters, self.uncounted = counters, 0
        self._write_down(tried, loss)

    def _turn(self, number: int) -> list[int]:
        """Return the cases that get new layouts in a round after the first: one after another."""
        count = len(self.lessons.cases)
        size = min(self.configuration.self_labelling.cases_per_round, count)
        first = (number - 1) * size
        return sorted({index % count for index in range(first, first + size)})

    def _candidates(self, index: int, rng: np.random.Generator) -> list[Layout]:
        """Return new layouts for a case."""
        hyperparameters, case = self.configuration.self_labelling, self.lessons.cases[index]
        layouts = [_sorted(self.agent.propose(case.scenario, case.charge))]
        if hyperparameters.samples:
            seed = int(rng.integers(2**62))
            drawn = self.agent.sample(case.scenario, case.charge, hyperparameters.samples, seed)
            layouts += map(_sorted, drawn)
        moves, best = Moves(case.scenario), self.lessons.labels[index].layout
        for each in range(hyperparameters.neighbours):
            layout = best
            for _ in range(1 + each % 2):  # every other one by two moves
                layout = moves.neighbour(layout, rng)
            layouts.append(_sorted(layout))
        return layouts + self.lessons.nearest(index, hyperparameters.borrowed)

    def _imitate(self, updates: int, rng: np.random.Generator) -> float:
        settings, hyperparameters = self.configuration.settings, self.configuration.self_labelling
        demonstrations = [
            Demonstration(
                self.lessons.cases[index],
                self.lessons.labels[index].layout,
                self.lessons.reduction(index),
                settings.observation,
                bool(self.agent.representative.vehicles),
            )
            for index in self.lessons.demonstrations
        ]
        if not demonstrations:
            return float("nan")
        left = 1.0 - self.progress.counters.steps / settings.steps
        rate = schedule(hyperparameters.learning_rate)
        return imitate(
            self.agent.policy,
            demonstrations,
            updates,
            hyperparameters.batch_size,
            rate(left) if callable(rate) else rate,
            hyperparameters.vf_coef,
            hyperparameters.max_grad_norm,
            rng,
        )

    def _write_down(self, tried: Sequence[float], loss: float) -> None:
        """Add a row, evaluate if it is time for it; the checkpoint decides, the tables follow."""
        progress, lessons, settings = self.progress, self.lessons, self.configuration.settings
        counters = progress.counters
        row = RolloutRow(
            steps=counters.steps,
            episodes=len(tried),
            reward=fmean(map(lessons.reduction, range(len(lessons.cases)))),
            reduction=fmean(tried) if tried else float("nan"),
            modules=fmean(len(label.layout) for label in lessons.labels),
            blasts=counters.blasts,
            cache_hits=counters.cache_hits,
            seconds=counters.seconds,
        )
        progress.rollouts.append(row)
        self.logger.record("round/best_reduction", row.reward)
        self.logger.record("round/tried_reduction", row.reduction)
        self.logger.record("round/loss", loss)
        self.logger.record("blasts/simulated", row.blasts)
        is_last = counters.steps >= settings.steps
        if is_last or counters.rollouts % settings.evaluation_interval == 0:
            evaluation = evaluate(progress, self.agent, self.selection)
            self.logger.record("evaluation/reduction", evaluation.reduction)
        self.logger.dump(counters.steps)
        progress.labels = lessons.labels
        progress.save(self.folder.checkpoint, self.agent.policy)
        progress.write_tables(self.folder)


def _sorted(layout: Layout) -> Layout:
    return tuple(sorted(layout))


def _reduction(
    case: Case, layout: Layout, load: tuple[float, ...], unprotected: tuple[float, ...]
) -> float:
    """Return a reduction; 0 where nothing arrives without a barrier."""
    share = reductions(case.counted(load, layout), case.counted(unprotected))
    return float(np.nan_to_num(share))
