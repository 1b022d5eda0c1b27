"""The warm start: imitation of the best layout by rule of each training case.

All rules propose for every case, a charge or a site, and blasts on the case's threats find the best
proposal. The policy learns to place it before its first step of PPO, which would have to find by
chance the walls that the rules know.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from blast_agents.training.agent import Policy, as_tensor
from blast_agents.training.cases import training_cases
from blast_agents.training.environments import training_store
from blast_agents.training.hyperparameters import Hyperparameters, schedule
from blast_agents.training.run_folder import RunConfiguration
from blast_env.design.search import layouts_by_rule
from blast_env.envs.observable import EpisodeObservation, Observable
from blast_env.envs.observations import OBSERVATIONS
from blast_env.envs.strategies import ScenarioSource
from blast_env.evaluation import Evaluators, LoadCaseSet
from blast_env.evaluation.evaluator import loads_together
from blast_env.geometry import Layout
from blast_env.layout import LayoutState
from blast_env.site.sources import source_of
from blast_env.statistics import reductions

_LOADS: Final = 50_000
"""Number of loads in memory, so that no blast of the warm start runs twice."""


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
    hyperparameters: Hyperparameters,
    rng: np.random.Generator,
) -> float:
    """Train a policy on demonstrations, with the policy's optimiser; the critic learns reductions.

    Args:
        policy: The policy.
        demonstrations: At least one.
        hyperparameters: Minibatches and their size, learning rate, weight of the critic's error,
            and bound on the gradient.
        rng: Draws demonstrations and steps.

    Returns:
        Mean loss of the imitation over the last tenth of the minibatches; NaN without any.
    """
    updates = hyperparameters.imitation_updates
    rate = schedule(hyperparameters.learning_rate)
    policy.set_training_mode(True)
    losses = []
    for update in range(updates):
        for group in policy.optimizer.param_groups:
            group["lr"] = rate(1.0 - update / updates) if callable(rate) else rate
        chosen = rng.integers(len(demonstrations), size=hyperparameters.batch_size).tolist()
        steps = [demonstrations[index].draw(rng) for index in sorted(chosen)]
        observations = as_tensor(policy, np.stack([step.observation for step in steps]))
        legal = torch.as_tensor(np.stack([step.legal for step in steps]))
        wanted = torch.as_tensor(np.stack([step.wanted for step in steps]))
        worth = torch.tensor([step.value for step in steps], dtype=torch.float32)
        logits, values = logits_and_values(policy, observations)
        loss = imitation_loss(logits, legal, wanted)
        of_critic = torch.nn.functional.mse_loss(values, worth)
        whole = loss + hyperparameters.vf_coef * of_critic
        policy.optimizer.zero_grad()
        whole.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(policy.parameters(), hyperparameters.max_grad_norm)
        policy.optimizer.step()
        losses.append(loss.item())
    policy.set_training_mode(False)
    last = losses[-max(len(losses) // 10, 1) :]
    return float(np.mean(last)) if last else float("nan")


def best_by_rule(
    evaluators: Evaluators, cases: Sequence[LoadCaseSet], processes: int = 1
) -> list[tuple[Layout, float]]:
    """Return the best layout by rule of each case, sorted, with its relative reduction.

    It is empty, with the reduction 0, if no rule has a layout that is better than no barrier. One
    that hides a building, whose load is no number, is the worst.

    Args:
        evaluators: Run the blasts.
        cases: The cases.
        processes: Worker processes for the blasts.
    """
    tried = []
    for case in cases:
        by_rule = layouts_by_rule(case.scenario, case.charge).values()
        tried.append([*dict.fromkeys([(), *(tuple(sorted(layout)) for layout in by_rule)])])
    blasts = [
        (evaluators.of(case.scenario), layout, threat)
        for case, layouts in zip(cases, tried, strict=True)
        for layout in layouts
        for threat in case.threats
    ]
    loads, found = iter(loads_together(blasts, processes)), []
    for case, layouts in zip(cases, tried, strict=True):
        own = islice(loads, len(layouts) * len(case.threats))
        of_layouts = np.array([load.load(case.scenario.objective) for load in own])
        values = [
            case.objective_value(of_layout, layout)
            for of_layout, layout in zip(of_layouts.reshape(len(layouts), -1), layouts, strict=True)
        ]
        best = int(np.argmin(np.where(np.isnan(values), np.inf, values)))
        # If nothing arrives without a barrier, no layout reduces it.
        share = float(np.nan_to_num(reductions(values[best], values[0])))
        found.append((layouts[best], share))
    return found


def imitate_rules(
    policy: Policy, configuration: RunConfiguration, source: ScenarioSource, blasts: Path
) -> tuple[bool, int]:
    """Train a policy to place the best layout by rule of each training case.

    Args:
        policy: The policy.
        configuration: Configuration of the run, with the number of cases and minibatches.
        source: Source of the scenarios of the cases.
        blasts: Folder for blasts that may recur.

    Returns:
        Whether it has learnt anything (not without minibatches, nor if no rule helps in any case),
        and the number of blasts spent.
    """
    settings, hyperparameters = configuration.settings, configuration.hyperparameters
    if not hyperparameters.imitation_updates:
        return False, 0
    cases = training_cases(settings, source, hyperparameters.imitation_cases)
    scenarios = {case.scenario.content_hash for case in cases}
    store = training_store(settings, blasts, _LOADS)
    evaluators = Evaluators(settings.blast_engine, store, most=len(scenarios))
    shown = [
        Demonstration(
            case, layout, reduction, settings.observation, bool(source.representative.vehicles)
        )
        for case, (layout, reduction) in zip(
            cases, best_by_rule(evaluators, cases, hyperparameters.n_envs), strict=True
        )
        if reduction > 0.0
    ]
    if shown:
        imitate(policy, shown, hyperparameters, np.random.default_rng(settings.seed))
    return bool(shown), evaluators.counts.blasts
