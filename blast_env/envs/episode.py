"""One episode of placing: its state, and what an action does to it."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import fsum
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from blast_env.envs.objective import Assessment, Evaluators, Objective
from blast_env.envs.observation import Array, EpisodeObservation, Sight
from blast_env.envs.reward import Reward, Transition
from blast_env.errors import BlastEnvError
from blast_env.scenario import Cell, Placement

ILLEGAL_TERM: Final = "illegal_actions"
"""The name of the reward term for illegal actions."""


@dataclass(frozen=True)
class IllegalActions:
    """What illegal actions lead to.

    Attributes:
        cost: What each one costs, psi*s.
        limit: After so many of them the episode ends as if finished.
    """

    cost: float
    limit: int


@dataclass
class Episode:
    """The state of an episode.

    Attributes:
        sight: What may be known before the end.
        objective: Assesses layouts.
        observation: Observes the episode.
        initial: The layout at the start.
        placement: The modules placed so far.
        illegal_actions: How many illegal actions there were.
        ended: Whether the charge has gone off.
    """

    sight: Sight
    objective: Objective
    observation: EpisodeObservation
    initial: tuple[Cell, ...]
    placement: Placement
    illegal_actions: int = 0
    ended: bool = False

    def action_mask(self) -> NDArray[np.bool_]:
        """Return which actions are legal (cells + 1,); the last one, to finish, always is."""
        return np.append(self.placement.free.ravel(), True)

    def observe(self) -> Array:
        """Return the observation."""
        return self.observation.observe(self.placement)

    def act(self, action: int, reward: Reward, illegal: IllegalActions) -> dict[str, float]:
        """Place a module or finish; return the terms of the reward.

        Args:
            action: Number of a cell, row by row, or the number of cells to finish.
            reward: Pays for the action.
            illegal: What an illegal action leads to.

        Raises:
            BlastEnvError: If the reward names a term that is taken.
        """
        before, free = self.placement, self.placement.free
        finishes = action == free.size
        cell = divmod(action, max(free.shape[1], 1))
        is_illegal = not finishes and not free[cell]
        if is_illegal:
            self.illegal_actions += 1
        elif not finishes:
            self.placement = before.place(cell)
        exhausted = self.illegal_actions >= illegal.limit
        self.ended = finishes or exhausted or self.placement.is_full
        transition = Transition(
            self.initial, before.cells, self.placement.cells, self.ended, self.objective
        )
        return _with_illegal_term(reward(transition), -illegal.cost if is_illegal else 0.0)

    def assess(self) -> tuple[Assessment, Assessment]:
        """Return what the layout is worth, and what no barrier is."""
        return self.objective.assess(self.placement.cells), self.objective.assess(())

    def information(self) -> dict[str, Any]:
        """Return what is told after every action and after `reset`."""
        return {"action_mask": self.action_mask(), "illegal_actions": self.illegal_actions}

    def final_information(self, evaluators: Evaluators) -> dict[str, Any]:
        """Return what is told when the charge has gone off.

        Args:
            evaluators: They know how many blasts there were.
        """
        protected, unprotected = self.assess()
        threats = self.objective.threats
        return {
            "impulse_sim": protected.impulse_sim,
            "impulse_psi_s": protected.impulse_psi_s,
            "impulse_pa_s": protected.impulse_pa_s,
            "unprotected_impulse_pa_s": unprotected.impulse_pa_s,
            "reduction": protected.reduction_from(unprotected),
            "layout": self.placement.cells,
            "scenario_hash": self.sight.scenario.content_hash,
            "calibration": self.objective.evaluator.calibration.name,
            "calibration_in_range": protected.in_range,
            "charges": tuple(each[0].charge for each in threats),
            "blast_seeds": tuple(tuple(threat.seed for threat in each) for each in threats),
            "blasts": evaluators.blasts,
            "cache_hits": evaluators.cache_hits,
            "cache_hit_rate": evaluators.cache_hit_rate,
        }


def _with_illegal_term(terms: Mapping[str, float], illegal: float) -> dict[str, float]:
    if ILLEGAL_TERM in terms:
        raise BlastEnvError(
            f"the reward has a term {ILLEGAL_TERM!r}, which the environment adds itself"
        )
    return {**terms, ILLEGAL_TERM: illegal}


def total(terms: Mapping[str, float]) -> float:
    """Return the sum of the terms of a reward."""
    return fsum(terms.values())
