"""The environments of a training, with their wrappers."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import repeat
from pathlib import Path
from typing import Any, Final, cast

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecEnv, VecMonitor
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn

from blast_agents.training.run_folder import RunConfiguration, TrainingSettings
from blast_env.envs.observable import Array
from blast_env.envs.strategies import ScenarioSource
from blast_env.envs.vector_env import BlastBarrierVectorEnv
from blast_env.errors import BlastEnvError
from blast_env.evaluation.evaluator import BlastStore
from blast_env.processes import start_fork_server
from blast_env.runner import configured_workers
from blast_env.values import checked_seed, whole_number

_Env = gym.Env[Array, np.int64]


class _MaskWrapper(gym.Wrapper[Array, np.int64, Array, np.int64]):
    """A wrapper that forwards the mask of legal actions."""

    def action_masks(self) -> NDArray[np.bool_]:
        """Return the mask of the actions that are legal now (actions,)."""
        masks: NDArray[np.bool_] = self.env.get_wrapper_attr("action_masks")()
        return masks


class _Pool:
    """A fixed set of seeds of episodes, drawn with replacement; arguments as for `ThreatPool`."""

    def __init__(self, size: int, seed: int) -> None:
        sequence = np.random.SeedSequence(checked_seed(seed))
        self.seeds = sequence.generate_state(whole_number("size", size, 1, 100_000)).tolist()
        self._rng = np.random.default_rng(sequence)

    def draw(self, seed: int | None = None) -> int:
        """Return the seed of the next episode; `seed` determines the order from here on."""
        if seed is not None:
            self._rng = np.random.default_rng(seed)
        drawn: int = self.seeds[self._rng.integers(len(self.seeds))]
        return drawn


class ThreatPool(_MaskWrapper):
    """Draws the episodes, with their sites and charges, from a fixed set.

    Its numbers of 32 bits are seeds of `reset`, which no held-out threat shares (`SeedRange`). The
    blasts without a barrier recur and are cached, so that an episode costs half the blasts. By
    default an environment caches a thousand loads for each of four sites; a `cache` raises both
    limits.

    Args:
        env: A `BlastBarrier` environment.
        size: Number of episodes in the set.
        seed: Seed of the set; different for each of several parallel environments.

    Raises:
        BlastEnvError: If the size or the seed is out of bounds.
    """

    def __init__(self, env: _Env, size: int, seed: int = 0) -> None:
        super().__init__(env)
        self._pool = _Pool(size, seed)
        self.seeds = self._pool.seeds

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin an episode of the set; the seed determines their order."""
        return self.env.reset(seed=self._pool.draw(seed), options=options)


_LOADS: Final = 8192
"""Number of loads that an environment caches, so that recurring sites repeat no blast."""

_MOST_BYTES: Final = 2_000_000_000
"""Bound on the size of a run's blasts on disk; a blast takes some kilobytes."""

REDUCTION: Final = ("reduction",)
"""Values of an episode's final information that the table of episodes has, too."""


class BatchVecEnv(VecEnv):
    """A `BlastBarrierVectorEnv` for algorithms of stable-baselines3, masked ones included.

    It suits engines that compute many blasts at once, and workers of `on_cluster`, to which the
    blasts of all episodes that end in a step are sent together. Observations, rewards and masks are
    those of any other vector of the same environments.

    Args:
        envs: The environments, with the autoreset mode `"Disabled"`.
        pools: Sizes and seeds of a `ThreatPool` of each environment; empty for none.

    Raises:
        BlastEnvError: If the autoreset mode is another one.
    """

    def __init__(
        self, envs: BlastBarrierVectorEnv, pools: Sequence[Mapping[str, int]] = ()
    ) -> None:
        if envs.autoreset_mode != AutoresetMode.DISABLED:
            raise BlastEnvError(
                f"autoreset_mode is {envs.autoreset_mode.value!r}, must be 'Disabled'"
            )
        self.envs = envs
        self._pools = [_Pool(pool["size"], pool.get("seed", 0)) for pool in pools]
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)

    def reset(self) -> VecEnvObs:
        """Begin an episode in every environment."""
        seeds = self._drawn(self._seeds)
        observations, infos = self.envs.reset(seed=seeds, options=self._options)
        self.reset_infos = [_of_one(infos, index) for index in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        return cast("VecEnvObs", observations)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Set the actions of `step_wait`."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Make the actions, and begin other episodes where one ends."""
        observations, rewards, terminated, truncated, infos = self.envs.step(self._actions)
        ended, own_infos = terminated | truncated, []
        for index in range(self.num_envs):
            own_infos.append(_of_one(infos, index))
            cut = bool(truncated[index] and not terminated[index])
            own_infos[index]["TimeLimit.truncated"] = cut
            if ended[index]:
                own_infos[index]["terminal_observation"] = _of_one(observations, index)
        if ended.any():
            seeds = self._drawn([None] * self.num_envs, ended)
            observations, infos = self.envs.reset(seed=seeds, options={"reset_mask": ended})
            for index in ended.nonzero()[0].tolist():
                self.reset_infos[index] = _of_one(infos, index)
        return cast("VecEnvObs", observations), rewards.astype(np.float32), ended, own_infos

    def _drawn(
        self, seeds: Sequence[int | None], chosen: Iterable[bool] = repeat(True)
    ) -> list[int | None]:
        """Return the seeds of the next episodes of the environments, from their pools if any."""
        if not self._pools:
            return [*seeds]
        drawn = zip(self._pools, seeds, chosen, strict=False)
        return [pool.draw(seed) if begins else None for pool, seed, begins in drawn]

    def close(self) -> None:
        """Close the environments."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute, the same for all environments."""
        return [getattr(self.envs, attr_name) for _ in self._get_indices(indices)]

    def set_attr(
        self,
        attr_name: str,
        value: Any,
        indices: VecEnvIndices = None,  # noqa: ARG002
    ) -> None:
        """Set an attribute for all environments."""
        setattr(self.envs, attr_name, value)

    def env_method(
        self,
        method_name: str,
        *method_args: Any,
        indices: VecEnvIndices = None,
        **method_kwargs: Any,
    ) -> list[Any]:
        """Return the results of a method of the vector for environments, as `action_masks` does."""
        found = getattr(self.envs, method_name)(*method_args, **method_kwargs)
        return [found[index] for index in self._get_indices(indices)]

    def env_is_wrapped(
        self,
        wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]],  # noqa: ARG002
        indices: VecEnvIndices = None,
    ) -> list[bool]:
        """Return that no environment has a wrapper."""
        return [False for _ in self._get_indices(indices)]


def _of_one(values: Any, index: int) -> Any:
    """Return the values of one environment from arrays over all, with masks as in Gymnasium."""
    if not isinstance(values, dict):
        return values[index]
    everyone = {index: True}
    return {
        key: _of_one(value, index)
        for key, value in values.items()
        if not key.startswith("_") and values.get(f"_{key}", everyone)[index]
    }


@dataclass(frozen=True)
class EnvironmentMaker:
    """Creates one of the parallel environments, or a batch of them; can be pickled.

    Attributes:
        configuration: Configuration of the run.
        source: Source of the episodes' scenarios.
        index: Index of the environment.
        blasts: Folder of a store for blasts that may recur; `None` to keep them in memory only.
    """

    configuration: RunConfiguration
    source: ScenarioSource
    index: int
    blasts: Path | None = None

    def __call__(self) -> gym.Env[Any, Any]:
        """Return the environment with its wrappers."""
        env: gym.Env[Any, Any] = gym.make(
            "blast_env:BlastBarrier-v0", disable_env_checker=True, **self._arguments(1)
        )
        for pool in self._pools([self.index]):
            env = ThreatPool(env, **pool)
        return env

    def batch(self) -> VecEnv:
        """Return the environments from this one on in one batch, with their wrappers."""
        count = self.configuration.hyperparameters.n_envs - self.index
        envs = BlastBarrierVectorEnv(count, AutoresetMode.DISABLED, **self._arguments(count))
        pools = self._pools(range(self.index, self.index + count))
        return BatchVecEnv(envs, pools)

    def _arguments(self, count: int) -> dict[str, Any]:
        settings = self.configuration.settings
        threats = {"threats": settings.hidden_threats} if settings.threat == "hidden" else {}
        return {
            "scenario": self.source,
            "action": "place",  # the networks of `blast_agents.policies` rate every placement
            "reward": "relative",
            "realisations": 1,
            "engine": settings.blast_engine,
            "observation": settings.observation,
            "cache": training_store(settings, self.blasts, _LOADS * count),
            "threat": settings.threat,
            **threats,
        }

    def _pools(self, indices: Iterable[int]) -> list[dict[str, int]]:
        """Return the arguments of the pools of some environments; none without a pool."""
        found: list[dict[str, int]] = []
        for _, arguments in self.configuration.hyperparameters.wrappers():
            for index in indices:
                sequence = np.random.SeedSequence((self.configuration.settings.seed, index))
                found.append({"seed": int(sequence.generate_state(1)[0]), **arguments})
        return found


def training_store(settings: TrainingSettings, folder: Path | None, size: int) -> BlastStore:
    """Return a store of loads for a training.

    Loads are also in the folder if a further training may repeat their blasts, so not with noise:
    its seeds are other ones. Predictions take less time than reading them from a file.

    Args:
        settings: Settings of the run.
        folder: Folder for loads that may recur; `None` for none.
        size: Number of loads in memory.
    """
    is_kept = not (settings.guesses or settings.blast_engine.has_noise)
    return BlastStore(folder if is_kept else None, size, _MOST_BYTES)


def make_environments(
    configuration: RunConfiguration,
    source: ScenarioSource,
    monitor: Path | None = None,
    blasts: Path | None = None,
) -> VecEnv:
    """Return the parallel environments, each in a separate process if there are several.

    They are a batch in this process where the engine computes many blasts at once, and within
    `on_cluster`, whose workers run their blasts.

    Args:
        configuration: Configuration of the run.
        source: Source of the episodes' scenarios.
        monitor: Table of the episodes; `None` for none.
        blasts: Folder for blasts that may recur; `None` to keep them in memory only.
    """
    envs = _parallel(configuration, source, blasts)
    return VecMonitor(envs, None if monitor is None else str(monitor), info_keywords=REDUCTION)


def _parallel(
    configuration: RunConfiguration, source: ScenarioSource, blasts: Path | None
) -> VecEnv:
    count = configuration.hyperparameters.n_envs
    engine = configuration.settings.blast_engine
    if configured_workers() > 1 or (count > 1 and engine.at_once > 1):
        return EnvironmentMaker(configuration, source, 0, blasts).batch()
    makers = [EnvironmentMaker(configuration, source, index, blasts) for index in range(count)]
    if count == 1:
        return DummyVecEnv([*makers])
    # The processes are forks of a server that has imported this module, once for all.
    start_fork_server([__name__])
    return SubprocVecEnv([*makers])
