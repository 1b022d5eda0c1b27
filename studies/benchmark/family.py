"""One MaskablePPO for all sites: it sees what the rules suggest, and nothing else of a site.

It trains once, on guesses alone, on generated sites of the seeds of training. The sites have
different sizes and rules; each rule has a place of its own among observations and actions.
"""

from collections.abc import Sequence
from functools import cached_property, lru_cache, partial
from typing import Any, Final

import gymnasium as gym
import numpy as np
import torch
from numpy.typing import NDArray
from sb3_contrib import MaskablePPO
from stable_baselines3.common.vec_env import DummyVecEnv

from blast_env.arrays import BoolArray
from blast_env.bundled import ITEM_SITES, KERB_SITES
from blast_env.envs.actions import SUGGESTION
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.rules import RULES
from blast_env.surrogate import SurrogateEngine
from studies.site_names import scenario_of, site_names

SITES: Final = 64
"""Sites of each kind in the training."""

STEPS: Final = 40_960
_ENVS: Final = 8
_ROLLOUT: Final = 2048

_TITLES: Final = tuple(row.title for row in RULES.values())
_FINISH: Final = len(_TITLES)


class SuggestionView(gym.Wrapper[Any, Any, Any, Any]):
    """An environment of a site, as the next piece of each rule there; rules it lacks are illegal.

    Args:
        env: An environment with the action space `"suggestion"` and the observation `"features"`.
    """

    def __init__(self, env: BlastBarrierEnv) -> None:
        super().__init__(env)
        self.site = env
        self.observation_space = gym.spaces.Box(0.0, 1.0, (_FINISH * len(SUGGESTION),), np.float32)
        self.action_space = gym.spaces.Discrete(_FINISH + 1)

    @cached_property
    def _places(self) -> list[int]:
        return [_TITLES.index(title) for title in self.site.suggestions if title in _TITLES]

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode."""
        seen, info = self.site.reset(seed=seed, options=options)
        return self._view(seen), info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Place the next piece of a rule, or finish."""
        own = self._places.index(int(action)) if action < _FINISH else self.site.finish
        seen, reward, ended, truncated, info = self.site.step(np.int64(own))
        return self._view(seen), reward, ended, truncated, info

    def action_masks(self) -> BoolArray:
        """Return the mask of the rules with a next piece, and of finishing."""
        mask = np.zeros(_FINISH + 1, dtype=np.bool_)
        own = self.site.action_masks()
        mask[self._places], mask[_FINISH] = own[: len(self._places)], own[-1]
        return mask

    def _view(self, seen: NDArray[np.float32]) -> NDArray[np.float32]:
        view = np.zeros((_FINISH, len(SUGGESTION)), dtype=np.float32)
        last = len(self._places) * len(SUGGESTION)
        view[self._places] = seen[-last:].reshape(-1, len(SUGGESTION))
        return view.ravel()


class ManySites(gym.Env[Any, Any]):
    """Episodes on sites of any size, drawn anew at each reset.

    Args:
        names: The sites, as in `studies.site_names`.
        engine: The engine.
    """

    def __init__(self, names: Sequence[str], engine: SurrogateEngine) -> None:
        made = (
            BlastBarrierEnv(
                scenario_of(name),
                reward="relative",
                observation="features",
                action="suggestion",
                realisations=1,
                engine=engine,
            )
            for name in names
        )
        self._sites = [SuggestionView(env) for env in made]
        self._now = self._sites[0]
        self.observation_space = self._now.observation_space
        self.action_space = self._now.action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode on a site that is drawn."""
        super().reset(seed=seed)
        self._now = self._sites[self.np_random.integers(len(self._sites))]
        return self._now.reset(seed=int(self.np_random.integers(2**31)), options=options)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Place the next piece of a rule, or finish."""
        return self._now.step(action)

    def action_masks(self) -> BoolArray:
        """Return the mask of the legal actions."""
        return self._now.action_masks()


@lru_cache(maxsize=16)
def trained(seed: int, sites: int = SITES, steps: int = STEPS) -> MaskablePPO:
    """Return the policy of a seed: one training for all sites, on item sites and along a kerb."""
    torch.set_num_threads(1)
    engine = SurrogateEngine()
    names = site_names((ITEM_SITES, KERB_SITES), 0, sites)
    envs = min(_ENVS, len(names))
    batch = DummyVecEnv([partial(ManySites, names[first::envs], engine) for first in range(envs)])
    batch.seed(seed)
    n_steps = max(_ROLLOUT // envs, 1)
    model = MaskablePPO(
        "MlpPolicy", batch, n_steps=n_steps, batch_size=64, gamma=1.0, seed=seed, device="cpu"
    )
    return model.learn(steps)
