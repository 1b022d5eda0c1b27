"""The vector entry point of `gymnasium.make_vec`: many barrier environments in one batch."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import gymnasium as gym
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.envs.arguments import PlainSpec, ResetOptions, check_names
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.envs.episode import Episode, Episodes
from blast_env.envs.observable import one_of
from blast_env.errors import BlastEnvError, value_text
from blast_env.evaluation.evaluator import BlastStore
from blast_env.values import MOST_SEED, whole_number

_LOADS_EACH: Final = 16
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
        max_episode_steps: Number of steps after which an episode is truncated; `None` or -1 for
            none, as in `gymnasium.make`.
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
        modes = [mode.value for mode in AutoresetMode]
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
        # One store for all of them, with room for what each would remember by itself.
        if arguments.get("cache") is None:
            arguments["cache"] = BlastStore(size=_LOADS_EACH * self.num_envs)
        self.one = BlastBarrierEnv(**arguments)
        self.episodes = Episodes(self.one.task, self.num_envs)
        self.single_action_space = self.one.action_space
        self.single_observation_space = self.one.observation_space
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        space: Any = self.single_action_space
        self._limits = np.array(getattr(space, "nvec", getattr(space, "n", 0)))
        self._most_steps = np.inf
        if max_episode_steps not in (None, -1):
            most = whole_number("max_episode_steps", max_episode_steps, 1, MOST_SEED)
            self._most_steps = float(most)
        self._rngs: list[np.random.Generator | None] = [None] * self.num_envs
        self._seeds: list[int | None] = [None] * self.num_envs
        self._steps = np.zeros(self.num_envs, dtype=np.int64)
        self._over = np.zeros(self.num_envs, dtype=np.bool_)
        self._noted: dict[str, NDArray[Any]] = {}

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | Sequence[Mapping[str, Any]] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode in every environment.

        Args:
            seed: Seed of the first environment, the next one has the next seed; or one of each.
            options: Those of `BlastBarrierEnv.reset`, for all environments, and `reset_mask`, the
                mask of the environments to reset (environments,). Or a list of those of each.

        Raises:
            UnknownNameError: If there is no such option; the message has the nearest one.
            BlastEnvError: If the seed or an option is invalid; all episodes, and the seeds of the
                next ones, are as they were then.
        """
        seeds = self._given_seeds(seed)
        given, mask = self._given_options(options)
        chosen = _indices(mask)
        before = self._rngs[:], self._seeds[:]
        try:
            for index in chosen:
                if seeds[index] is not None:
                    self._rngs[index], self._seeds[index] = seeding.np_random(seeds[index])
            self._seed_missing()
            self._begin(chosen, given)
        except Exception:  # whatever refuses it, also an engine or a source of one's own
            self._rngs, self._seeds = before
            raise
        self._over[chosen] = False
        return self._observe(self._all), self._information(chosen)

    def _given_seeds(self, seed: Any) -> list[int | None]:
        """Return the seed of each environment; integers of NumPy are integers, too."""
        count = self.num_envs
        seeds = [None] * count if seed is None else seed
        if isinstance(seeds, int | np.integer):
            seeds = range(int(seeds), int(seeds) + count)
        if not isinstance(seeds, Sequence | np.ndarray):
            raise BlastEnvError(
                f"seed is {value_text(seed)}, must be an integer or {count} of them"
            )
        if len(seeds) != count:
            raise BlastEnvError(f"seed has {len(seeds)} values, must have num_envs = {count}")
        return [int(own) if isinstance(own, np.integer) else own for own in seeds]

    def _given_options(self, options: Any) -> tuple[list[ResetOptions], BoolArray]:
        """Return the options of each environment, and the mask of those to reset."""
        count = self.num_envs
        everyone = np.ones(count, dtype=np.bool_)
        if isinstance(options, list | tuple):
            if len(options) != count:
                raise BlastEnvError(
                    f"options has {len(options)} values, must have {count}, of each"
                )
            return [ResetOptions.from_mapping(own) for own in options], everyone
        if not isinstance(options, Mapping | None):
            raise BlastEnvError(f"options is {value_text(options)}, must be a mapping")
        given = dict(options or {})
        mask = np.asarray(given.pop("reset_mask", everyone))
        if mask.shape != (count,) or mask.dtype != np.bool_ or not (mask.all() or self._running):
            raise BlastEnvError(
                f"reset_mask has shape {mask.shape} and type {mask.dtype}, must be ({count},) and"
                " bool, and all True at first"
            )
        return [ResetOptions.from_mapping(given)] * count, mask

    @property
    def np_random_seed(self) -> tuple[int | None, ...]:  # type: ignore[override]
        """The seed of each environment's random numbers, as `SyncVectorEnv` has them."""
        self._seed_missing()
        return tuple(self._seeds)

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """The random numbers of each environment; `reset` seeds them, nothing sets them."""
        self._seed_missing()
        return tuple(rng for rng in self._rngs if rng is not None)

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
        if not self._running or (len(begun) and self.autoreset_mode == AutoresetMode.DISABLED):
            raise gym.error.ResetNeeded(f"call reset: no episode in environments {begun}")
        wanted = self.episodes.code.numbers(self._checked(actions))
        rewards = np.zeros(self.num_envs)
        terminated = np.zeros(self.num_envs, dtype=np.bool_)
        # 1. All place, then all blasts run in one batch.
        if played:
            self.episodes.place(played, wanted[played])
            self.episodes.blast()
            rewards[played] = self.episodes.rewards(played)
            terminated[played] = self.episodes.ended[played]
            ended = _indices(terminated)
            self._note(ended, [self._running[index].outcome for index in ended])
        # 2. Ends of episodes. Those that had ended before begin anew by this step.
        self._steps[played] += 1
        truncated = self._steps >= self._most_steps
        truncated[begun] = False
        self._over = terminated | truncated
        self._begin(begun)
        self._over[begun] = False
        final: dict[str, Any] = {}
        if self.autoreset_mode == AutoresetMode.SAME_STEP:
            final = self._begin_again(_indices(self._over))
        infos = self._information(self._all) | final
        return self._observe(self._all), rewards, terminated, truncated, infos

    @property
    def finish(self) -> Any:
        """The action that finishes one of them."""
        return self.one.finish

    @property
    def suggestions(self) -> tuple[str, ...]:
        """What the actions of `"suggestion"` place, as of `BlastBarrierEnv`."""
        return self.one.suggestions

    def action_masks(self) -> BoolArray:
        """Return the masks of actions that are legal now, (environments, actions).

        Raises:
            gymnasium.error.ResetNeeded: If `reset` has not been called.
        """
        if not self._running:
            raise gym.error.ResetNeeded("there is no episode yet: call reset")
        return self.episodes.masks(self._all).astype(np.bool_)

    @property
    def _running(self) -> Sequence[Episode]:
        return self.episodes.running

    @property
    def _all(self) -> range:
        return range(self.num_envs)

    def _checked(self, actions: IntArray | Sequence[int]) -> IntArray:
        given = np.asarray(actions)
        shape = self.num_envs, *self._limits.shape
        if given.shape != shape or not np.issubdtype(given.dtype, np.integer):
            raise gym.error.InvalidAction(
                f"actions have shape {given.shape} and type {given.dtype}, must be {shape} integers"
            )
        beyond = (given < 0) | (given >= self._limits)
        are_wrong = np.any(beyond.reshape(self.num_envs, -1), axis=1)
        wrong = [index for index in _indices(are_wrong) if not self._over[index]]
        if wrong:
            raise gym.error.InvalidAction(
                f"actions[{wrong[0]}] is {given[wrong[0]]}, must be in {self.one.action_space}"
            )
        return given

    def _begin(self, chosen: Sequence[int], options: Sequence[ResetOptions] = ()) -> None:
        """Begin an episode in some environments, with the options of each; at first in all."""
        if not chosen:
            return
        chosen = chosen if self._running else self._all
        rngs = [rng for index in chosen if (rng := self._rngs[index]) is not None]
        own = [options[index] for index in chosen] if options else [ResetOptions()] * len(chosen)
        self.episodes.begin(chosen, rngs, own)
        self._steps[chosen] = 0
        episodes = [self._running[index] for index in chosen]
        self._note(chosen, [episode.constants for episode in episodes])
        self._note(chosen, [episode.outcome for episode in episodes])

    def _note(self, indices: Sequence[int], values: Sequence[Mapping[str, Any]]) -> None:
        """Note values of the information of environments until others take their place."""
        if not values:
            return
        is_one = all(of_one is values[0] for of_one in values)
        for name, first in values[0].items():
            noted = self._noted.get(name)
            if noted is None:
                noted = self._noted[name] = _like(first, self.num_envs)
            if noted.dtype != object:
                noted[indices] = first if is_one else [of_one[name] for of_one in values]
                continue
            for index, of_one in zip(indices, values, strict=True):
                noted[index] = of_one[name]

    def _begin_again(self, over: Sequence[int]) -> dict[str, Any]:
        """Begin episodes where others have ended; return the last observation and information."""
        if not over:
            return {}
        last, final = self._observe(over), dict[str, Any]()
        for position, index in enumerate(over):
            kept = {
                "final_obs": one_of(last, position),
                "final_info": self.episodes.information(index),
            }
            final = self._add_info(final, kept, index)
        self._begin(over)
        self._over[over] = False
        return final

    def _observe(self, chosen: Sequence[int]) -> Any:
        return self.episodes.observe(chosen, self.single_observation_space)

    def _information(self, chosen: Sequence[int]) -> dict[str, Any]:
        """Return the information after every action and after `reset`, in arrays.

        They are those that Gymnasium makes of the information of single environments.
        """
        known = np.zeros(self.num_envs, dtype=bool)
        known[chosen] = True
        layouts, running = self.episodes.layouts, self._running
        arrays: dict[str, Any] = {
            "action_mask": self.episodes.masks(self._all),
            "invalid_actions": np.array([item.invalid_actions for item in running]),
            "placed": layouts.placed.copy(),
            "layout": layouts.table.copy(),
        } | {name: value.copy() for name, value in self._noted.items()}
        terms = dict(zip(self.episodes.term_names, self.episodes.terms.T.copy(), strict=True))
        if not known.all():
            for values in (*arrays.values(), *terms.values()):
                values[~known] = None if values.dtype == object else 0
        arrays["reward_terms"] = terms | {f"_{name}": known.copy() for name in terms}
        return arrays | {f"_{name}": known.copy() for name in arrays}


_NUMBERS: Final = (bool, int, float)


def _like(value: Any, count: int) -> NDArray[Any]:
    """Return an array for values like one: of numbers, else of objects."""
    if isinstance(value, _NUMBERS):
        return np.zeros(count, dtype=type(value))
    return np.empty(count, dtype=object)


def _indices(mask: BoolArray) -> list[int]:
    found: list[int] = np.flatnonzero(mask).tolist()
    return found
