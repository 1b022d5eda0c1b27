"""Wrappers of the environment for training, also for RL Zoo's `env_wrapper`."""

from typing import Any, SupportsFloat

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from blast_env.envs.arguments import real_number, whole_number
from blast_env.envs.episode import ILLEGAL_TERM
from blast_env.envs.observation import Array

_Env = gym.Env[Array, np.int64]
_Wrapper = gym.Wrapper[Array, np.int64, Array, np.int64]


class RelativeReward(_Wrapper):
    """Pays the reduction when the charge goes off: the share of the impulse that is gone.

    Minus the impulse, the environment's own reward, depends most of all on where the charge is.
    The reduction compares with the same blast without a barrier, so that what remains is due to
    the layout; it is of the order of 1 in every scenario.

    Args:
        env: A `BlastBarrier` environment with `reward="terminal"`.
        illegal_action_cost: What an illegal action costs.

    Raises:
        BlastEnvError: If the cost is out of bounds.
    """

    def __init__(self, env: _Env, illegal_action_cost: float = 0.01) -> None:
        super().__init__(env)
        self.illegal_action_cost = real_number("illegal_action_cost", illegal_action_cost, 0.0, 1.0)

    def step(self, action: np.int64) -> tuple[Array, SupportsFloat, bool, bool, dict[str, Any]]:
        """Place a module or finish."""
        observation, _, ended, truncated, info = self.env.step(action)
        reward = info["reduction"] if ended else 0.0
        if info["reward_terms"][ILLEGAL_TERM] < 0.0:
            reward -= self.illegal_action_cost
        return observation, reward, ended, truncated, info

    def action_masks(self) -> NDArray[np.bool_]:
        """Return which actions are legal now, (actions,)."""
        masks: NDArray[np.bool_] = self.env.get_wrapper_attr("action_masks")()
        return masks


class ThreatPool(_Wrapper):
    """Draws the episodes, with their sites and charges, from a set that is fixed once for all.

    The blast without a barrier is then the same again and again, and the environment remembers
    it: an episode costs half the blasts. By itself an environment remembers a thousand loads of
    each of four sites; for more of either give it a `cache`.

    Args:
        env: A `BlastBarrier` environment.
        size: Number of episodes in the set.
        seed: Decides which; another one for each of parallel environments.

    Raises:
        BlastEnvError: If the size or the seed is out of bounds.
    """

    def __init__(self, env: _Env, size: int, seed: int = 0) -> None:
        super().__init__(env)
        sequence = np.random.SeedSequence(whole_number("seed", seed, 0, 2**63))
        self.seeds = sequence.generate_state(whole_number("size", size, 1, 100_000)).tolist()
        self._rng = np.random.default_rng(sequence)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin an episode of the set; the seed decides which ones follow each other."""
        if seed is not None:
            self._rng = np.random.default_rng(seed)
        return self.env.reset(seed=self.seeds[self._rng.integers(len(self.seeds))], options=options)

    def action_masks(self) -> NDArray[np.bool_]:
        """Return which actions are legal now, (actions,)."""
        masks: NDArray[np.bool_] = self.env.get_wrapper_attr("action_masks")()
        return masks
