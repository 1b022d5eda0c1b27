"""How many more blasts several threads of `simulate_many` run in the same time than one."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from importlib.util import find_spec
from math import ceil
from time import perf_counter, process_time
from typing import Any, Final, Protocol

import gymnasium as gym
import joblib
import numpy as np
from gymnasium.vector import AsyncVectorEnv, AutoresetMode
from numpy.typing import NDArray

from blast_env.engines import Blast, simulate_many
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.scenario import Scenario
from blast_env.studies.benchmark.environment import benchmark_engine, random_action

_LOT_S: Final = 1.0
"""One thread takes about this long for the blasts that are timed."""

_TRIED: Final = 4
"""Blasts that are run to see how many that is."""

_FEWEST: Final = 4
"""Blasts of each thread at least, so that a long one at the end weighs little."""


@dataclass(frozen=True)
class ThreadFigures:
    """Time by the clock of the same blasts in one thread and in several.

    Attributes:
        blasts: How many blasts.
        threads: How many threads.
        one_thread_s: The least over the repeats.
        all_threads_s: Likewise.
    """

    blasts: int
    threads: int
    one_thread_s: float
    all_threads_s: float

    @property
    def scaling(self) -> float:
        """How many times faster the threads are than one."""
        return self.one_thread_s / self.all_threads_s


def measure_threads(scenario: Scenario, threads: int, repeats: int) -> ThreadFigures:
    """Time blasts on the event engine in one thread and in several, in turn.

    By the clock, because what counts is when the last blast is done. Whatever else runs on the
    machine takes cores from the threads: as many cores as threads have to be idle, and the least
    over the repeats counts.

    Args:
        scenario: The scenario.
        threads: How many threads.
        repeats: How often each is timed.

    Raises:
        BlastEnvError: If `threads` is not a whole number of at least 1.
    """
    simulate_many([_blast(scenario, 0)], threads)  # compiles, where nothing is on disk yet
    start = process_time()
    for seed in range(_TRIED):
        _blast(scenario, seed).run()
    of_each = ceil(_LOT_S * _TRIED / (process_time() - start) / threads)
    blasts = threads * max(of_each, _FEWEST)
    pairs = [
        (_clocked(scenario, blasts, 1), _clocked(scenario, blasts, threads)) for _ in range(repeats)
    ]
    one_thread_s, all_threads_s = (min(column) for column in zip(*pairs, strict=True))
    return ThreadFigures(blasts, threads, one_thread_s, all_threads_s)


def _blast(scenario: Scenario, seed: int) -> Blast:
    return Blast(scenario, seed=seed, engine="event")


def _clocked(scenario: Scenario, blasts: int, threads: int) -> float:
    """Return how long so many blasts take by the clock; they are laid out anew each time."""
    start = perf_counter()
    simulate_many([_blast(scenario, seed) for seed in range(blasts)], threads)
    return perf_counter() - start


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
