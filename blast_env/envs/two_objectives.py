"""The environment with two objectives, the load taken off and the cost of the barriers."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces

from blast_env.arrays import FloatArray, IntArray
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.errors import BlastEnvError
from blast_env.layout import LayoutState


class BlastBarrierTwoObjectivesEnv(BlastBarrierEnv):
    """`BlastBarrierEnv` with a vector as reward, by the convention of MO-Gymnasium.

    The rewards of an episode add up to the share of the load that the layout takes off
    (`info["reduction"]`, paid at the end), and to minus its cost as a share of the budget, paid by
    each piece. Without a budget, the share is that of the modules in stock. The product with
    weights, as of MO-Gymnasium's `LinearReward`, is the score of a layout for one price of load.

    Args:
        keywords: As for `BlastBarrierEnv`, without `reward`.

    Attributes:
        reward_space: `Box` of the rewards of a step (2,).

    Raises:
        BlastEnvError: As `BlastBarrierEnv`, or if there is a `reward`.
    """

    def __init__(self, **keywords: Any) -> None:
        if "reward" in keywords:
            raise BlastEnvError(
                f"reward is {keywords['reward']!r}, must be left out: the two objectives are it"
            )
        super().__init__(reward="relative", **keywords)
        low, high = np.array([-np.inf, -1.0]), np.array([1.0, 0.0])
        self.reward_space = spaces.Box(low.astype(np.float32), high.astype(np.float32))

    def step(
        self, action: np.int64 | int | Sequence[int] | IntArray
    ) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Make a step, as `BlastBarrierEnv.step`, with the rewards of both objectives (2,)."""
        before = _spent_share(self.placement)
        observation, _, terminated, truncated, info = super().step(action)
        cost = before - _spent_share(self.placement)
        rewards: FloatArray = np.array([info["reward_terms"]["reduction"], cost], np.float32)
        return observation, rewards, terminated, truncated, info


def _spent_share(placement: LayoutState) -> float:
    """Return the cost of a layout as a share of the budget or of the stock, 0 to 1."""
    zone = placement.scenario.zone
    if zone.budget is None:
        return len(placement.layout) / zone.stock
    return placement.cost / zone.budget
