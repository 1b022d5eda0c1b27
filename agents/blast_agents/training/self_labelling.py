"""Self-labelling: imitation of the rules, then of the best layouts found so far.

Each case, a charge or a site, has a label: its best known layout. In the first round that is the
best of the layouts of all rules, which the policy learns to imitate. In each further round some
cases get new layouts: the policy's layout and samples, small changes of the label, and the labels
of the nearest charges. They race by blasts on the case's threats; the winner is the new label, on
which the policy is trained further.

The run folder stores blasts, but not predictions of a surrogate. Each round has separate seeds and
ends with a checkpoint, so that an interrupted run has the same result as an uninterrupted one, and
repeats none of its blasts.
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

from blast_agents.training.agent import Policy, TrainedAgent, as_tensor, policy_for
from blast_agents.training.cases import Selection, training_cases
from blast_agents.training.checkpoint import CaseLabel, Checkpoint
from blast_agents.training.hyperparameters import schedule
from blast_agents.training.recorder import evaluate
from blast_agents.training.run_folder import RolloutRow, RunConfiguration, RunFolder
from blast_env.design.search import layouts_by_rule
from blast_env.design.search.moves import Moves, legal_part
from blast_env.envs.observations import OBSERVATIONS, EpisodeObservation, Observable
from blast_env.envs.strategies import ScenarioSource
from blast_env.evaluation import Evaluators, LoadCaseSet
from blast_env.evaluation.evaluator import run_together
from blast_env.evaluation.store import BlastStore
from blast_env.geometry import Layout
from blast_env.layout import LayoutState
from blast_env.site.scene import Charge
from blast_env.site.vehicles import source_of
from blast_env.statistics import reductions


@dataclass(frozen=True)
class Step:
    """A state in the placement of a layout, with the actions to imitate.

    Attributes:
        observation: Observation of the agent.
        legal: Mask of the legal actions (actions,); the last one finishes.
        wanted: Mask of those that lead to the layout (actions,); at least one.
        value: Target of the critic: the reduction of the load by the layout.
    """

    observation: NDArray[np.uint8] | NDArray[np.float32]
    legal: NDArray[np.bool_]
    wanted: NDArray[np.bool_]
    value: float


@dataclass(frozen=True, eq=False)
class Demonstration:
    """A layout to imitate.

    A layout has no order: after any part of it, all remaining modules or pieces are equally good
    next ones. The policy therefore learns from random parts, with all remaining elements as
    targets.

    Attributes:
        case: The case of the layout.
        layout: The layout; it satisfies all conditions of the build zone.
        reduction: Relative reduction of the load.
        observation: Name of the observation.
        among_vehicles: Whether the training includes scenarios with vehicles, so that the
            observation has the planes for them.
    """

    case: LoadCaseSet
    layout: Layout
    reduction: float
    observation: str = "grid"
    among_vehicles: bool = False

    def draw(self, rng: np.random.Generator) -> Step:
        """Return a random state in its placement, from the empty to the complete layout.

        The complete layout is excluded if nothing more could be placed: it leaves no decision.
        """
        elements = len(self.layout)
        standing = int(rng.integers(elements + (0 if self._is_full else 1))) if elements else 0
        order = rng.permutation(elements)
        part = tuple(self.layout[index] for index in sorted(order[:standing].tolist()))
        placement = LayoutState(self.case.scenario, part)
        catalogue = placement.catalogue
        legal = np.append(placement.legal.ravel(), True)
        wanted = np.zeros_like(legal)
        rest = [catalogue.action(self.layout[index]) for index in order[standing:].tolist()]
        wanted[rest or [catalogue.finish]] = True
        return Step(self._episode.observe(placement), legal, wanted, self.reduction)

    @cached_property
    def _is_full(self) -> bool:
        return LayoutState(self.case.scenario, self.layout).is_full

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
    """Return the cross-entropy of the policy to the uniform distribution over wanted actions.

    It is restricted to legal actions, and is the mean over a batch.

    Args:
        logits: Logits of the policy (batch, actions).
        legal: Mask of the legal actions (batch, actions).
        wanted: Mask of the wanted ones among them, at least one per row (batch, actions).
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
    """Train a policy on demonstrations, with the policy's optimiser.

    Args:
        policy: The policy.
        demonstrations: At least one.
        updates: Number of minibatches.
        batch_size: Steps per minibatch.
        learning_rate: Learning rate of the optimiser.
        vf_coef: Weight of the critic's error: it learns the reductions of the layouts.
        max_grad_norm: Bound on the norm of the gradient.
        rng: Draws demonstrations and steps.

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
"""Bound on the size of a run's blasts on disk; a blast takes some kilobytes."""

_GUESSES: Final = 50_000
"""Number of cached predictions, so that none of a round is repeated."""


@dataclass(eq=False)
class Judge:
    """Runs the blasts of a training, several at a time.

    Attributes:
        evaluators: Run the blasts and cache their loads.
        processes: Worker processes; results do not depend on their number.
        asked: Number of loads requested so far, cached or not.
    """

    evaluators: Evaluators
    processes: int = 1
    asked: int = 0

    def loads(
        self, asked: Sequence[tuple[LoadCaseSet, Layout]], threats: slice
    ) -> list[tuple[float, ...]]:
        """Return the loads of each pair, one per threat, in the unit of the objective.

        Args:
            asked: Layouts with their cases.
            threats: Slice of the threats of each case.
        """
        blasts = [
            (self.evaluators.of(case.scenario), layout, threat)
            for case, layout in asked
            for threat in case.threats[threats]
        ]
        self.asked += len(blasts)
        run_together(blasts, self.processes)
        of_pairs = []
        for case, layout in asked:
            evaluator = self.evaluators.of(case.scenario)
            pairs = [(layout, threat) for threat in case.threats[threats]]
            loads = evaluator.loads_of_many(pairs)
            of_pairs.append(tuple(each.load(case.scenario.objective) for each in loads))
        return of_pairs


Loads = Mapping[Layout, tuple[float, ...]]
"""Layouts and their loads, one per threat simulated so far, in the objective's unit."""


def race(
    judge: Judge, cases: Sequence[LoadCaseSet], layouts: Sequence[Sequence[Layout]]
) -> list[Loads]:
    """Compare the layouts of each case on its threats, by successive halving.

    All are simulated under the first threat, the better half under the second, the better quarter
    under the next two, and so on; the blasts of all cases run in parallel.

    Args:
        judge: Runs the blasts.
        cases: The cases, all with the same number of threats.
        layouts: Distinct layouts of each case.

    Returns:
        For each case, the loads of every layout; the finalists have a load for every threat.
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
            alive[number].sort(key=lambda each: case.objective_value(own[each], each))
            alive[number] = alive[number][: ceil(len(alive[number]) / 2)]
        met = upto
    return [*known]


@dataclass(eq=False)
class Lessons:
    """The cases of a training and their labels.

    Attributes:
        cases: The cases, all with the same number of threats.
        labels: One label per case; none before the first round.
    """

    cases: tuple[LoadCaseSet, ...]
    labels: list[CaseLabel] = field(default_factory=list)

    def reduction(self, index: int) -> float:
        """Return the relative reduction by a case's label; 0 if nothing arrives unprotected."""
        label, case = self.labels[index], self.cases[index]
        return _reduction(case, label.layout, label.load, label.unprotected)

    @property
    def demonstrations(self) -> list[int]:
        """Indices of the cases to imitate: those whose label reduces the load."""
        return [index for index in range(len(self.labels)) if self.reduction(index) > 0.0]

    def begin(self, judge: Judge) -> list[float]:
        """Label each case with the best layout by rule; return the reductions of all tried."""
        by_rule = [
            [*dict.fromkeys(layouts_by_rule(case.scenario, case.charge).values())]
            for case in self.cases
        ]
        whole = slice(None)
        unprotected = judge.loads([(case, ()) for case in self.cases], whole)
        self.labels = [CaseLabel((), each, each) for each in unprotected]
        return self.improve(judge, range(len(self.cases)), by_rule)

    def improve(
        self, judge: Judge, indices: Sequence[int], layouts: Sequence[Sequence[Layout]]
    ) -> list[float]:
        """Race layouts, update the labels of some cases, and return the reductions of the layouts.

        Args:
            judge: Runs the blasts.
            indices: Indices of the cases.
            layouts: Layouts of each of these cases; the present label is skipped.
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
                unprotected = label.unprotected[: len(load)]
                tried.append(_reduction(case, layout, load, unprotected))
                whole = len(load) == len(case.threats)
                best = case.objective_value(self.labels[index].load, self.labels[index].layout)
                if whole and case.objective_value(load, layout) < best:
                    self.labels[index] = replace(label, layout=layout, load=load)
        return tried

    def nearest(self, index: int, count: int) -> list[Layout]:
        """Return the legal parts of the labels of the charges nearest to that of a case.

        The charges are of the same scenario; the list is empty for a hidden charge or a vehicle's.
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
        folder: The run folder.
        configuration: Configuration of the run.
        agent: The agent, whose policy is trained.
        lessons: The cases with their labels.
        judge: Runs the blasts of the races.
        selection: Cases that select the best weights.
        progress: State of the run.
        logger: Writes for TensorBoard.
        uncounted: Blasts in the run folder that no round has counted, from an interrupted round.
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
        """Return the training in the state of a checkpoint.

        Args:
            folder: The run folder.
            configuration: Configuration of the run.
            source: Source of the scenarios of the cases.
            selection: Cases that select the best weights.
            progress: The checkpoint, which training continues.

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
        # Predictions take less time than reading them from a file.
        store = (
            BlastStore(size=_GUESSES)
            if settings.guesses
            else BlastStore(folder.blasts, most_bytes=_MOST_BYTES)
        )
        scenarios = {case.scenario.content_hash for case in cases}
        evaluators = Evaluators(settings.blast_engine, store, most=len(scenarios))
        judge = Judge(evaluators, hyperparameters.n_envs, progress.counters.steps)
        return cls(
            folder=folder,
            configuration=configuration,
            agent=TrainedAgent(policy, scenario, settings.observation),
            lessons=Lessons(cases, progress.labels),
            judge=judge,
            selection=selection,
            progress=progress,
            logger=configure(str(folder.tensorboard), ["tensorboard"]),
            uncounted=0 if settings.guesses else max(len(store) - progress.counters.blasts, 0),
        )

    def do_round(self) -> None:
        """Race layouts, train the policy, and record the round."""
        began, before = perf_counter(), self.progress.counters
        counts = self.judge.evaluators.counts
        blasts, hits = counts.blasts, counts.cache_hits
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
        self.judge.asked = max(self.judge.asked, before.steps + 1)  # so that training ends
        loss = self._imitate(updates, rng)
        simulated = counts.blasts - blasts + self.uncounted
        counters = replace(
            before,
            steps=self.judge.asked,
            rollouts=number + 1,
            updates=before.updates + updates,
            episodes=before.episodes + len(tried),
            blasts=before.blasts + simulated,
            # Each blast is run ahead, and then found in the cache.
            cache_hits=before.cache_hits + counts.cache_hits - hits - simulated,
            seconds=before.seconds + perf_counter() - began,
        )
        self.progress.counters, self.uncounted = counters, 0
        self._write_down(tried, loss)

    def _turn(self, number: int) -> list[int]:
        """Return the cases with new layouts in a round after the first, in cyclic order."""
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
            for _ in range(1 + each % 2):  # every second one by two moves
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
        """Record a round, evaluate if due, and write first the checkpoint, then the tables."""
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
    case: LoadCaseSet, layout: Layout, load: tuple[float, ...], unprotected: tuple[float, ...]
) -> float:
    """Return a relative reduction; 0 if nothing arrives without a barrier."""
    share = reductions(case.objective_value(load, layout), case.objective_value(unprotected))
    return float(np.nan_to_num(share))
