"""The environments of a training run."""

from dataclasses import dataclass
from multiprocessing import get_all_start_methods, get_context
from typing import Any, Final

import gymnasium as gym
import numpy as np
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecEnv

from agents.training.hyperparameters import DEFAULT_SECTION
from agents.training.settings import SITES, RunConfiguration, TrainingSettings
from agents.training.wrappers import RelativeReward, ThreatPool
from blast_env.envs.registration import WITHOUT_BUILD_ZONE, barrier_id
from blast_env.envs.scenario_source import ScenarioSource, SingleScenario, scenario_source
from blast_env.evaluation.cache import LoadsCache
from blast_env.scenario import Scenario, bundled_scenarios
from blast_env.sites import HELD_OUT_SITES, SiteSource

SITES_ID: Final = "BlastBarrierSites-v0"

_LOADS: Final = 8192
"""Loads that an environment remembers, so that a site that comes again costs no blast twice."""

_FORK_SERVER: Final = "forkserver"
"""How stable-baselines3 starts processes where the system can."""


def environment_id(scenario: str) -> str:
    """Return the section of the hyperparameters for a scenario's name or path."""
    if scenario == SITES:
        return SITES_ID
    if scenario in bundled_scenarios() and scenario not in WITHOUT_BUILD_ZONE:
        return barrier_id(scenario)
    return DEFAULT_SECTION


def training_source(scenario: str) -> ScenarioSource:
    """Return where the episodes of training get their scenario from.

    Args:
        scenario: Bundled name, path of a scenario file, or `"sites"`.

    Raises:
        ScenarioError: If there is no such scenario, or anything is wrong with it.
        BlastEnvError: If it has no build zone.
    """
    return SiteSource.training() if scenario == SITES else scenario_source(scenario)


def held_out_scenarios(source: ScenarioSource, count: int) -> tuple[Scenario, ...]:
    """Return scenarios to evaluate on: of sites, the last of those that training never sees."""
    if isinstance(source, SingleScenario):
        return (source.scenario,) * count
    return tuple(SiteSource(HELD_OUT_SITES - count, count))


@dataclass(frozen=True)
class EnvironmentMaker:
    """Makes one of the parallel environments; can be sent to another process.

    Attributes:
        configuration: Of the run.
        source: Gives the episodes their scenario.
        index: Which one it is.
    """

    configuration: RunConfiguration
    source: ScenarioSource
    index: int

    def __call__(self) -> gym.Env[Any, Any]:
        """Return the environment with its wrappers."""
        settings = self.configuration.settings
        env: gym.Env[Any, Any] = gym.make(
            "blast_env:BlastBarrier-v0",
            disable_env_checker=True,
            scenario=self.source,
            realisations=1,
            engine=settings.engine,
            cache=LoadsCache(_LOADS),
            **_threat_arguments(settings),
        )
        for name, arguments in self.configuration.hyperparameters.wrappers():
            if name.endswith(RelativeReward.__name__):
                env = RelativeReward(env, **arguments)
            else:
                env = ThreatPool(env, **{"seed": self._pool_seed, **arguments})
        return Monitor(env)

    @property
    def _pool_seed(self) -> int:
        sequence = np.random.SeedSequence((self.configuration.settings.seed, self.index))
        return int(sequence.generate_state(1)[0])


def make_environments(configuration: RunConfiguration, source: ScenarioSource) -> VecEnv:
    """Return the parallel environments, each in a process of its own unless there is but one."""
    count = configuration.hyperparameters.n_envs
    makers = [EnvironmentMaker(configuration, source, index) for index in range(count)]
    if count == 1:
        return DummyVecEnv([*makers])
    if _FORK_SERVER in get_all_start_methods():
        # The processes are forks of one that has imported all this: once, not once each.
        get_context(_FORK_SERVER).set_forkserver_preload([__name__])
    return SubprocVecEnv([*makers])


def _threat_arguments(settings: TrainingSettings) -> dict[str, Any]:
    if settings.threat == "visible":
        return {"threat": "visible"}
    return {"threat": "hidden", "threats": settings.hidden_threats}
