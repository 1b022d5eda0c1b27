"""How fast environments are in one process, and in vectors with a process for each."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from importlib.util import find_spec
from time import perf_counter
from typing import Any, Final, Protocol

import gymnasium as gym
import joblib
import numpy as np
from gymnasium.vector import AsyncVectorEnv, AutoresetMode
from numpy.typing import NDArray

from blast_env.benchmark_env import benchmark_engine, random_action
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.scenario import Scenario

ENV_ID: Final = "blast_env:BlastBarrier-v0"
"""With the module, so that a spawned process registers it."""

Masks = Sequence[NDArray[np.bool_]]


class Fleet(Protocol):
    """Environments that step together."""

    def masks(self) -> Masks:
        """Return which actions are legal in each environment."""

    def step(self, actions: NDArray[np.int64]) -> Mapping[int, int]:
        """Act in every environment.

        Returns:
            By the numbers of the environments whose episode has ended: the blasts that they have
            run so far. They have been reset.
        """

    def close(self) -> None:
        """End the processes."""


@dataclass
class OneEnvironment:
    """A single environment in this process."""

    scenario: Scenario
    env: BlastBarrierEnv = field(init=False)

    def __post_init__(self) -> None:
        """Make the environment."""
        self.env = BlastBarrierEnv(self.scenario, engine=benchmark_engine(self.scenario))
        self.env.reset(seed=0)

    def masks(self) -> Masks:
        """Return which actions are legal."""
        return [self.env.action_masks()]

    def step(self, actions: NDArray[np.int64]) -> Mapping[int, int]:
        """Act; see `Fleet`."""
        _, _, ended, _, info = self.env.step(actions[0])
        if not ended:
            return {}
        self.env.reset()
        return {0: info["blasts"]}

    def close(self) -> None:
        """Do nothing: there are no processes."""
        self.env.close()


class AsyncFleet:
    """Gymnasium's `AsyncVectorEnv`."""

    def __init__(self, scenario: Scenario, count: int) -> None:
        self._envs = AsyncVectorEnv(
            [_factory(scenario)] * count, context="spawn", autoreset_mode=AutoresetMode.SAME_STEP
        )
        self._envs.reset(seed=0)

    def masks(self) -> Masks:
        """Return which actions are legal in each environment."""
        masks: Masks = self._envs.call("action_masks")
        return masks

    def step(self, actions: NDArray[np.int64]) -> Mapping[int, int]:
        """Act in every environment; see `Fleet`."""
        _, _, ended, _, info = self._envs.step(actions)
        return {int(i): int(info["final_info"]["blasts"][i]) for i in np.flatnonzero(ended)}

    def close(self) -> None:
        """End the processes."""
        self._envs.close()


class SubprocFleet:
    """Stable-Baselines3's `SubprocVecEnv`; it needs the extra `agents`."""

    def __init__(self, scenario: Scenario, count: int) -> None:
        from stable_baselines3.common.vec_env import SubprocVecEnv

        self._envs = SubprocVecEnv([_factory(scenario)] * count, start_method="spawn")
        self._envs.seed(0)
        self._envs.reset()

    def masks(self) -> Masks:
        """Return which actions are legal in each environment."""
        masks: Masks = self._envs.env_method("action_masks")
        return masks

    def step(self, actions: NDArray[np.int64]) -> Mapping[int, int]:
        """Act in every environment; see `Fleet`."""
        _, _, ended, infos = self._envs.step(actions)
        return {int(i): int(infos[i]["blasts"]) for i in np.flatnonzero(ended)}

    def close(self) -> None:
        """End the processes."""
        self._envs.close()


def _factory(scenario: Scenario) -> Callable[[], gym.Env[Any, Any]]:
    return partial(gym.make, ENV_ID, scenario=scenario, engine=benchmark_engine(scenario))


@dataclass(frozen=True)
class FleetFigures:
    """Speed of environments that step together, by the clock.

    Attributes:
        name: What holds them together.
        processes: Number of environments, each in a process of its own.
        steps_per_s: Steps of all environments together, a second.
        blasts_per_s: Blasts of all environments together, a second.
    """

    name: str
    processes: int
    steps_per_s: float
    blasts_per_s: float


def measure_fleets(scenario: Scenario, episodes: int) -> tuple[FleetFigures, ...]:
    """Time one process, and vectors with as many processes as there are cores.

    `SubprocVecEnv` only where Stable-Baselines3 is there.

    Args:
        scenario: The scenario; it needs a build zone and a calibration.
        episodes: Episodes of each environment that are timed; one more comes before them.

    Raises:
        BlastEnvError: If the scenario has no build zone or no calibration.
    """
    count = joblib.cpu_count()
    fleets: dict[str, Callable[[], Fleet]] = {
        "AsyncVectorEnv": partial(AsyncFleet, scenario, count)
    }
    if find_spec("stable_baselines3") is not None:
        fleets["SubprocVecEnv"] = partial(SubprocFleet, scenario, count)
    alone = measure_fleet("one process", 1, OneEnvironment(scenario), episodes)
    return alone, *(measure_fleet(name, count, make(), episodes) for name, make in fleets.items())


def measure_fleet(name: str, count: int, fleet: Fleet, episodes: int) -> FleetFigures:
    """Time environments that place modules on random legal cells, and close them.

    Args:
        name: What holds them together.
        count: Number of environments.
        fleet: The environments, reset.
        episodes: Episodes of each that are timed; one more comes before them.
    """
    rng = np.random.default_rng(0)
    try:
        _, before = _play_episodes(fleet, rng, count, 1)
        start = perf_counter()
        steps, after = _play_episodes(fleet, rng, count, episodes)
        passed_s = perf_counter() - start
    finally:
        fleet.close()
    blasts = int(after.sum() - before.sum())
    return FleetFigures(name, count, steps / passed_s, blasts / passed_s)


def _play_episodes(
    fleet: Fleet, rng: np.random.Generator, count: int, episodes: int
) -> tuple[int, NDArray[np.int64]]:
    """Return the steps until every environment has ended so many episodes, and their blasts."""
    ended, blasts = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    steps = 0
    while ended.min() < episodes:
        actions = np.array([random_action(mask, rng) for mask in fleet.masks()])
        for number, so_far in fleet.step(actions).items():
            ended[number] += 1
            blasts[number] = so_far
        steps += count
    return steps, blasts
