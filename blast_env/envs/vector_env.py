"""The vector entry point of `gymnasium.make_vec`: many barrier environments in one batch."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space, concatenate, create_empty_array
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.envs.arguments import PlainSpec, ResetOptions, check_names
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.envs.episode import Episode, total
from blast_env.envs.observable import MASK, BatchedObservation, one_of
from blast_env.errors import BlastEnvError, value_text
from blast_env.evaluation.evaluator import run_together
from blast_env.evaluation.store import BlastStore
from blast_env.layout.placement import find_legal
from blast_env.values import whole_number

_LOADS_EACH: Final = 64
"""Number of loads in memory per environment."""


class BlastBarrierVectorEnv(PlainSpec, VectorEnv[Any, IntArray, NDArray[Any]]):
    """Barrier environments that are computed together, in one process.

    Masks and observations are arrays over the environments. The blasts of all episodes that end in
    a step run together: by the surrogate in one pass of its networks, by other engines on the
    workers of `on_cluster`. Episodes are those of `BlastBarrierEnv` with the same seeds, to the
    last bit. In the final information, `blasts`, `cache_hits` and `cache_hit_rate` count those of
    all environments, which share a cache.

    Args:
        num_envs: Number of environments.
        autoreset_mode: `"NextStep"`, `"SameStep"` or `"Disabled"`, as in Gymnasium.
        max_episode_steps: Number of steps after which an episode is truncated; `None` for none.
        **arguments: Those of `BlastBarrierEnv`, except for a picture: `render_mode` is `None`.

    Raises:
        BlastEnvError: If an argument is invalid; the message names it and its bounds.
    """

    def __init__(
        self,
        num_envs: int = 1,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        **arguments: Any,
    ) -> None:
        modes = [each.value for each in AutoresetMode]
        mode = getattr(autoreset_mode, "value", autoreset_mode)
        check_names("autoreset_mode", [mode], modes)
        if arguments.get("render_mode") is not None:
            raise BlastEnvError(
                f"render_mode is {value_text(arguments['render_mode'])}, must be None:"
                " vectorization_mode 'sync' draws pictures"
            )
        self.num_envs = whole_number("num_envs", num_envs, 1, 1_000_000)
        self.autoreset_mode = AutoresetMode(mode)
        self.metadata = {"autoreset_mode": self.autoreset_mode}
        if arguments.get("cache") is None:
            arguments["cache"] = BlastStore(size=_LOADS_EACH * self.num_envs)
        self.one = BlastBarrierEnv(**arguments)
        evaluators = self.one.task.evaluators
        evaluators.most = max(evaluators.most, self.num_envs)  # a site of its own each
        self.single_action_space = self.one.action_space
        self.single_observation_space = self.one.observation_space
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self._actions = self.one.action_space.n  # type: ignore[attr-defined]
        self._most_steps = max_episode_steps or np.inf
        self._rngs: list[np.random.Generator | None] = [None] * self.num_envs
        self._seeds: list[int | None] = [None] * self.num_envs
        self._episodes: list[Episode] = []
        self._steps = np.zeros(self.num_envs, dtype=np.int64)
        self._over = np.zeros(self.num_envs, dtype=np.bool_)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode in every environment.

        Args:
            seed: Seed of the first environment, the next one has the next seed; or one of each.
            options: Those of `BlastBarrierEnv.reset`, for all environments, and `reset_mask`, the
                mask of the environments to reset (environments,).

        Raises:
            UnknownNameError: If there is no such option; the message has the nearest one.
            BlastEnvError: If an option is invalid.
        """
        count = self.num_envs
        seeds = [None] * count if seed is None else seed
        if isinstance(seeds, int | np.integer):
            seeds = range(int(seeds), int(seeds) + count)
        if len(seeds) != count:
            raise BlastEnvError(f"seed has {len(seeds)} values, must have num_envs = {count}")
        given = dict(options or {})
        mask = np.asarray(given.pop("reset_mask", np.ones(count, dtype=np.bool_)))
        if mask.shape != (count,) or mask.dtype != np.bool_ or not (mask.all() or self._episodes):
            raise BlastEnvError(
                f"reset_mask has shape {mask.shape} and type {mask.dtype}, must be ({count},) and"
                " bool, and all True at first"
            )
        chosen = _indices(mask)
        for index in chosen:
            if seeds[index] is not None:
                self._rngs[index], self._seeds[index] = seeding.np_random(seeds[index])
        self._seed_missing()
        self._begin(chosen, ResetOptions.from_mapping(given))
        return self._observe(self._episodes), self._information(chosen)

    @property
    def np_random_seed(self) -> tuple[int | None, ...]:  # type: ignore[override]
        """The seed of each environment's random numbers, as `SyncVectorEnv` has them."""
        self._seed_missing()
        return tuple(self._seeds)

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """The random numbers of each environment; `reset` seeds them, nothing sets them."""
        self._seed_missing()
        return tuple(each for each in self._rngs if each is not None)

    def _seed_missing(self) -> None:
        """Seed the random numbers of environments that have none."""
        for index, rng in enumerate(self._rngs):
            if rng is None:
                self._rngs[index], self._seeds[index] = seeding.np_random()

    def step(
        self, actions: IntArray | Sequence[int]
    ) -> tuple[Any, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Make an action in every environment; see `BlastBarrierEnv.step`.

        Raises:
            gymnasium.error.InvalidAction: If an action is not in the action space; none is made.
            gymnasium.error.ResetNeeded: If `reset` has not been called, or an episode has ended and
                the mode is `"Disabled"`.
        """
        played, begun = _indices(~self._over), _indices(self._over)
        if not self._episodes or (len(begun) and self.autoreset_mode == AutoresetMode.DISABLED):
            raise gym.error.ResetNeeded(f"call reset: no episode in environments {begun}")
        wanted = self._checked(actions, played)
        for index in played:
            self._episodes[index].move(wanted[index], self.one.illegal)
        rewards = self._pay(played)
        self._steps[played] += 1
        terminated = np.zeros(self.num_envs, dtype=np.bool_)
        terminated[played] = [self._episodes[index].ended for index in played]
        truncated = self._steps >= self._most_steps
        truncated[begun] = False
        self._begin(begun, ResetOptions())
        self._over = terminated | truncated
        final: dict[str, Any] = {}
        if self.autoreset_mode == AutoresetMode.SAME_STEP:
            final = self._begin_again(_indices(self._over))
        infos = self._information(range(self.num_envs)) | final
        return self._observe(self._episodes), rewards, terminated, truncated, infos

    def action_masks(self) -> BoolArray:
        """Return the masks of actions that are legal now, (environments, actions).

        Raises:
            gymnasium.error.ResetNeeded: If `reset` has not been called.
        """
        if not self._episodes:
            raise gym.error.ResetNeeded("there is no episode yet: call reset")
        return np.array([each.action_mask() for each in self._episodes])

    def _checked(self, actions: IntArray | Sequence[int], played: list[int]) -> list[int]:
        given = np.asarray(actions)
        if given.shape != (self.num_envs,) or not np.issubdtype(given.dtype, np.integer):
            raise gym.error.InvalidAction(
                f"actions have shape {given.shape} and type {given.dtype}, must be {self.num_envs}"
                " integers"
            )
        least, most = given[played].min(initial=0), given[played].max(initial=0)
        if not 0 <= least <= most < self._actions:
            raise gym.error.InvalidAction(
                f"actions are from {least} to {most}, must be in {self.one.action_space}"
            )
        wanted: list[int] = given.tolist()
        return wanted

    def _pay(self, played: list[int]) -> FloatArray:
        """Run the blasts; return the rewards."""
        episodes = [self._episodes[index] for index in played]
        find_legal(each.placement for each in episodes)
        run_together(blast for each in episodes for blast in each.blasts_due())
        rewards = np.zeros(self.num_envs)
        for index, episode in zip(played, episodes, strict=True):
            rewards[index] = total(episode.pay(self.one.reward_strategy, self.one.illegal))
        return rewards

    def _begin(self, chosen: list[int], options: ResetOptions) -> None:
        """Begin an episode in some environments."""
        if not self._episodes:
            self._episodes = [self._drawn(index, options) for index in range(self.num_envs)]
        else:
            for index in chosen:
                self._episodes[index] = self._drawn(index, options)
        find_legal(self._episodes[index].placement for index in chosen)
        self._steps[chosen] = 0
        self._over[chosen] = False

    def _drawn(self, index: int, options: ResetOptions) -> Episode:
        rng = self._rngs[index]
        assert rng is not None
        return self.one.task.start(rng, options, self.one.reward_strategy)

    def _begin_again(self, over: list[int]) -> dict[str, Any]:
        """Begin episodes where others have ended; return the last observation and information."""
        if not over:
            return {}
        ended = [self._episodes[index] for index in over]
        last, final = self._observe(ended), dict[str, Any]()
        for number, (index, episode) in enumerate(zip(over, ended, strict=True)):
            kept = {"final_obs": one_of(last, number), "final_info": episode.information()}
            final = self._add_info(final, kept, index)
        self._begin(over, ResetOptions())
        return final

    def _information(self, chosen: Iterable[int]) -> dict[str, Any]:
        """Return the information after every action and after `reset`, in arrays."""
        known = np.zeros(self.num_envs, dtype=bool)
        known[list(chosen)] = True
        return _stacked([episode.information() for episode in self._episodes], known)

    def _observe(self, episodes: Sequence[Episode]) -> Any:
        """Return the observations of episodes, with a leading axis."""
        shown, space = [each.shown for each in episodes], self.single_observation_space
        kind = episodes[0].observation
        if not isinstance(kind, BatchedObservation):
            empty: Any = create_empty_array(space, len(episodes))
            return concatenate(space, [each.observe() for each in episodes], empty)
        observed = kind.observe_many([each.observation for each in episodes], shown)
        if isinstance(space, spaces.Dict):
            masks = np.array([each.action_mask() for each in episodes])
            observed |= {MASK: masks.astype(np.int8)}
        return observed


def _stacked(infos: Sequence[Mapping[str, Any]], known: BoolArray) -> dict[str, Any]:
    """Return the information of all environments in arrays, as `VectorEnv._add_info` does.

    Args:
        infos: That of each environment, with the same keys.
        known: Whether an environment's information is returned; it is 0 or `None` otherwise.
    """
    stacked: dict[str, Any] = {}
    for key, first in infos[0].items():
        values = [each[key] for each in infos]
        if isinstance(first, Mapping):
            stacked[key] = _stacked(values, known)
        elif isinstance(first, np.ndarray | int | float):
            stacked[key] = np.array(values)
            stacked[key][~known] = 0
        else:
            stacked[key] = np.empty(len(infos), dtype=object)
            for index in np.flatnonzero(known):
                stacked[key][index] = values[index]
        stacked[f"_{key}"] = known.copy()
    return stacked


def _indices(mask: BoolArray) -> list[int]:
    found: list[int] = np.flatnonzero(mask).tolist()
    return found
