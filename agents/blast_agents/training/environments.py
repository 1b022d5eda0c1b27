"""The environments of a training, with their wrappers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing import get_all_start_methods, get_context
from typing import Any, Final

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn

from blast_agents.training.hyperparameters import DEFAULT_SECTION
from blast_agents.training.run_folder import RunConfiguration
from blast_env.envs.observations import Array
from blast_env.envs.strategies import ScenarioSource
from blast_env.evaluation import Evaluators
from blast_env.evaluation.engines import Engine
from blast_env.evaluation.store import BlastStore
from blast_env.runner import workers_told
from blast_env.sites import FAMILIES
from blast_env.values import checked_seed, whole_number

_Env = gym.Env[Array, np.int64]


class _Masked(gym.Wrapper[Array, np.int64, Array, np.int64]):
    """A wrapper that forwards the mask of legal actions."""

    def action_masks(self) -> NDArray[np.bool_]:
        """Return the mask of the actions that are legal now (actions,)."""
        masks: NDArray[np.bool_] = self.env.get_wrapper_attr("action_masks")()
        return masks


class ThreatPool(_Masked):
    """Draws the episodes, with their sites and charges, from a fixed set.

    The blasts without a barrier then recur and are cached, so that an episode costs half the
    blasts. By default an environment caches a thousand loads for each of four sites; a `cache`
    raises both limits.

    Args:
        env: A `BlastBarrier` environment.
        size: Number of episodes in the set.
        seed: Seed of the set; different for each of several parallel environments.

    Raises:
        BlastEnvError: If the size or the seed is out of bounds.
    """

    def __init__(self, env: _Env, size: int, seed: int = 0) -> None:
        super().__init__(env)
        sequence = np.random.SeedSequence(checked_seed(seed))
        self.seeds = sequence.generate_state(whole_number("size", size, 1, 100_000)).tolist()
        self._rng = np.random.default_rng(sequence)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin an episode of the set; the seed determines their order."""
        if seed is not None:
            self._rng = np.random.default_rng(seed)
        return self.env.reset(seed=self.seeds[self._rng.integers(len(self.seeds))], options=options)


SITES_ID: Final = "BlastBarrierSites-v0"

_LOADS: Final = 8192
"""Number of loads that an environment caches, so that recurring sites repeat no blast."""

_FORK_SERVER: Final = "forkserver"
"""Start method of stable-baselines3's processes on systems that support it."""


def environment_id(scenario: str) -> str:
    """Return the section of the hyperparameters for a scenario's name or path."""
    if scenario in FAMILIES:
        return SITES_ID
    return DEFAULT_SECTION


class SharedBlastsVecEnv(DummyVecEnv):
    """Environments in this process whose blasts run on other workers, all those of a step at once.

    It suits blasts that dominate the time of a step, and more workers than one machine has: the
    runner sends the blasts to the workers of `on_cluster`. The number of parallel blasts is that of
    the episodes that end in a step, so there should be several environments per worker; they begin
    together, and those that use up the stock end together.

    Observations, rewards and masks are those of any other vector of the same environments.

    Args:
        makers: Create the `BlastBarrier` environments, which share `cache`.
        engine: The engine of all environments.
        cache: Store of the loads.
    """

    def __init__(
        self,
        makers: Sequence[Callable[[], gym.Env[Any, Any]]],
        engine: str | Engine,
        cache: BlastStore,
    ) -> None:
        super().__init__([*makers])
        self._evaluators = Evaluators(engine, cache)
        self._blasts = np.zeros(len(makers), dtype=np.int64)

    def step_wait(self) -> VecEnvStepReturn:
        """Run the blasts that the actions require, then step the environments."""
        due = [env.get_wrapper_attr("blasts_due") for env in self.envs]
        blasts_due = [of(action) for of, action in zip(due, self.actions, strict=True)]
        owners = [index for index, blasts in enumerate(blasts_due) for _ in blasts]
        was_run = self._evaluators.run_ahead([blast for blasts in blasts_due for blast in blasts])
        np.add.at(self._blasts, owners, was_run)
        observations, rewards, ended, infos = super().step_wait()
        for blasts, info in zip(self._blasts.tolist(), infos, strict=True):
            if "blasts" in info:  # the environment that requested a blast counts it
                info["blasts"] += blasts
                info["cache_hits"] -= blasts
                asked = info["blasts"] + info["cache_hits"]
                info["cache_hit_rate"] = info["cache_hits"] / asked
        return observations, rewards, ended, infos


@dataclass(frozen=True)
class EnvironmentMaker:
    """Creates one of the parallel environments; can be pickled.

    Attributes:
        configuration: Configuration of the run.
        source: Source of the episodes' scenarios.
        index: Index of the environment.
        cache: Store of the loads; by default a separate one in memory.
    """

    configuration: RunConfiguration
    source: ScenarioSource
    index: int
    cache: BlastStore | None = None

    def __call__(self) -> gym.Env[Any, Any]:
        """Return the environment with its wrappers."""
        settings = self.configuration.settings
        threats = {"threats": settings.hidden_threats} if settings.threat == "hidden" else {}
        env: gym.Env[Any, Any] = gym.make(
            "blast_env:BlastBarrier-v0",
            disable_env_checker=True,
            scenario=self.source,
            reward="relative",
            realisations=1,
            engine=settings.blast_engine,
            observation=settings.observation,
            cache=BlastStore(size=_LOADS) if self.cache is None else self.cache,
            threat=settings.threat,
            **threats,
        )
        for _, arguments in self.configuration.ppo.wrappers():
            sequence = np.random.SeedSequence((settings.seed, self.index))
            own_seed = {"seed": int(sequence.generate_state(1)[0])}
            env = ThreatPool(env, **(own_seed | arguments))
        return Monitor(env)


def make_environments(configuration: RunConfiguration, source: ScenarioSource) -> VecEnv:
    """Return the parallel environments, each in a separate process if there are several.

    Within `on_cluster` they are in this process, and their blasts run on the cluster.
    """
    count = configuration.ppo.n_envs
    if workers_told() > 1:
        shared = BlastStore(size=_LOADS * count)
        actors = [EnvironmentMaker(configuration, source, index, shared) for index in range(count)]
        return SharedBlastsVecEnv(actors, configuration.settings.blast_engine, shared)
    makers = [EnvironmentMaker(configuration, source, index) for index in range(count)]
    if count == 1:
        return DummyVecEnv([*makers])
    if _FORK_SERVER in get_all_start_methods():
        # The processes are forks of a server that has imported this module, once for all.
        get_context(_FORK_SERVER).set_forkserver_preload([__name__])
    return SubprocVecEnv([*makers])
