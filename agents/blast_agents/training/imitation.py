"""Learning from layouts: the policy learns to place what stands in them, in whatever order."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from blast_agents.training.agent import Policy, as_tensor
from blast_env.envs.observations import OBSERVATIONS, EpisodeObservation, Observable
from blast_env.errors import BlastEnvError
from blast_env.evaluation import Case
from blast_env.geometry import Layout
from blast_env.scenario import Placement
from blast_env.scenario.vehicles import source_of


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


def check_observation(observation: str) -> None:
    """Refuse an observation that demonstrations cannot show.

    Raises:
        BlastEnvError: For one with loads, which would take blasts of its own.
    """
    if observation == "grid_with_load":
        raise BlastEnvError(
            "observation is 'grid_with_load', must be 'grid', 'image' or 'features' for "
            "self_labelling"
        )


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
        legal: Which actions are legal, likewise.
        wanted: Which of them are wanted, at least one of each, likewise.
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
