"""Speed of blasts and of the environment on this machine, as `blast-env bench` measures it.

Processor times are of one core and do not depend on other processes; wall times need idle cores.
"""

import os
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from math import ceil
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from time import perf_counter, process_time
from typing import TYPE_CHECKING, Any, Final

import gymnasium as gym
import numpy as np
from gymnasium.vector import AsyncVectorEnv, AutoresetMode
from numpy.typing import NDArray

from blast_env.arrays import FloatArray
from blast_env.evaluation.engines import simulate
from blast_env.runner import run_all
from blast_env.site import Scenario
from blast_env.units import MODULE_SIDE_M

if TYPE_CHECKING:  # Numba takes half a second to import
    from blast_env.evaluation.engines.gas import GasEngine
    from blast_env.gas.cost import CostGuess

ENV_ID: Final = "BlastBarrier-v0"

_LOT_S: Final = 3.0
"""Least work per process, in seconds of processor time: shorter lots measure the start-up."""

_SHORTEST_M: Final = 20.0
_PACKAGES: Final = ("numpy", "numba", "pymunk")


@dataclass(frozen=True)
class BlastCost:
    """The cost of one blast, from scenario to result.

    Attributes:
        scenario: Name of the scenario.
        engine: Name of the engine.
        simulated_s: Simulated time at the end of the blast.
        steps: Number of steps, or events, of the engine.
        cpu_s: Processor time per blast, median over the seeds.
        cell_updates: Cells times steps; None for engines without cells.
        memory_mb: Peak memory of a fresh process that runs one blast; None if not measured.
    """

    scenario: str
    engine: str
    simulated_s: float
    steps: int
    cpu_s: float
    cell_updates: int | None
    memory_mb: float | None = None


def blast_cost(scenario: Scenario, engine: str, repeats: int, *, memory: bool = True) -> BlastCost:
    """Time blasts of a scenario without a barrier.

    Args:
        scenario: The scenario.
        engine: Name of the engine.
        repeats: Number of blasts; their seeds are 0 and up.
        memory: Whether to measure the peak memory, too, in a separate process.
    """
    run = partial(simulate, scenario, engine=engine)
    result: Any = run(seed=0)  # compiles code that is not on disk yet
    times_s = []
    for seed in range(repeats):
        began = process_time()
        run(seed=seed)
        times_s.append(process_time() - began)
    return BlastCost(
        scenario=scenario.name,
        engine=engine,
        simulated_s=result.time_s,
        steps=result.steps,
        cpu_s=median(times_s),
        cell_updates=result.run_record.get("cell updates"),
        memory_mb=peak_memory_mb(scenario, engine) if memory else None,
    )


def peak_memory_mb(scenario: Scenario, engine: str) -> float:
    """Return the peak memory, MB, of a fresh process that runs a blast."""
    with get_context("spawn").Pool(1) as pool:
        return pool.apply(_peak_memory_mb, (scenario, engine))


def _peak_memory_mb(scenario: Scenario, engine: str) -> float:
    simulate(scenario, engine=engine)
    return own_memory_mb()


def own_memory_mb() -> float:
    """Return the peak memory, MB, of this process."""
    try:
        # On Linux, the maximum of getrusage is inherited from the parent process.
        status = Path("/proc/self/status").read_text(encoding="utf-8")
        return 1024.0 * int(status.split("VmHWM:")[1].split()[0]) / 1e6
    except (OSError, IndexError):
        import resource  # not on Windows

        kilobytes = 1 if platform.system() == "Darwin" else 1024
        return kilobytes * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def street(length_m: float) -> Scenario:
    """Return a street between an office and a school, for measuring the cost of large sites.

    At 100 m: an L-shaped office of four storeys, 25 m from a van of 500 kg at the kerb, and a
    school behind a perimeter wall. Other lengths scale all of it, rounded to whole modules; the
    charge scales with the cube of the length.

    Args:
        length_m: Length of the site; at least 20 m.
    """
    share = length_m / 100.0

    def whole_m(at_100_m: float) -> float:
        return max(round(at_100_m * share / MODULE_SIDE_M), 1) * MODULE_SIDE_M

    def solid(
        name: str, box_m: tuple[float, float, float, float], height_m: float, *, protected: bool
    ) -> dict[str, Any]:
        left_m, bottom_m, width_m, depth_m = (whole_m(each) for each in box_m)
        return {
            "kind": "ModularObstacle",
            "name": name,
            "corner_m": (left_m, bottom_m),
            "rows": round(depth_m / MODULE_SIDE_M),
            "columns": round(width_m / MODULE_SIDE_M),
            "height_m": whole_m(height_m),
            "protected": protected,
        }

    name = f"street_{length_m:g}_m"
    document = {
        "schema_version": 2,
        "name": name,
        "site": {
            "width_m": whole_m(100.0),
            "height_m": whole_m(80.0),
            "air_height_m": whole_m(19.0),
        },
        "charge": [
            {
                "kind": "point",
                "position_m": (whole_m(45.0), whole_m(28.0)),
                "tnt_kg": 500.0 * share**3,
            }
        ],
        "structures": [
            solid("office_front", (22.0, 55.0, 56.0, 14.0), 13.0, protected=True),
            solid("office_wing", (64.0, 69.0, 14.0, 10.0), 13.0, protected=True),
            solid("school", (16.0, 4.0, 44.0, 10.0), 7.5, protected=True),
            solid("school_wall", (10.0, 18.0, 65.0, 0.5), 2.0, protected=False),
        ],
        "build_zone": {
            "corner_m": (whole_m(22.0), whole_m(31.0)),
            "rows": round(whole_m(23.0) / MODULE_SIDE_M),
            "columns": round(whole_m(56.0) / MODULE_SIDE_M),
            "stock": 40,
            "height_m": whole_m(3.0),
        },
    }
    return Scenario.from_document(document, name)


@dataclass(frozen=True)
class SiteCost:
    """The cost of a blast by gas dynamics without a barrier, and its estimate before the run.

    Attributes:
        site: Name of the scenario.
        cells: Growth of its cells; see `GasSettings`.
        told: Estimate of the cost before the run.
        steps: Number of steps.
        cell_updates: Cell updates; a step counts as two.
        cpu_s: Processor time, from scenario to loads.
        memory_mb: Peak memory of the process.
    """

    site: str
    cells: str
    told: "CostGuess"
    steps: int
    cell_updates: int
    cpu_s: float
    memory_mb: float


def site_cost(scenario: Scenario, engine: "GasEngine") -> SiteCost:
    """Run a blast on a site, in a separate process."""
    with get_context("spawn").Pool(1) as pool:
        return pool.apply(_site_cost, (scenario, engine))


def _site_cost(scenario: Scenario, engine: "GasEngine") -> SiteCost:
    engine.blast(street(_SHORTEST_M)).run()  # compiles code that is not on disk yet
    began = process_time()
    result = engine.blast(scenario).run()
    cpu_s = process_time() - began
    return SiteCost(
        site=scenario.name,
        cells=engine.cells,
        told=result.run.cost,
        steps=result.steps,
        cell_updates=result.run.solver.cell_updates,
        cpu_s=cpu_s,
        memory_mb=own_memory_mb(),
    )


@dataclass(frozen=True)
class Crowd:
    """Rates of the same blasts in one process and in several at once, by wall time.

    Attributes:
        processes: Number of processes.
        alone_per_s: Blasts per second of one process.
        together_per_s: Blasts per second of all processes together.
    """

    processes: int
    alone_per_s: float
    together_per_s: float

    @property
    def ratio(self) -> float:
        """The rate of all processes as a multiple of that of one."""
        return self.together_per_s / self.alone_per_s


def crowd(scenario: Scenario, engine: str, cpu_s: float, processes: int) -> Crowd:
    """Run lots of blasts in one worker process, then in several at once.

    Args:
        scenario: The scenario.
        engine: Name of the engine.
        cpu_s: Approximate processor time of one blast.
        processes: Number of processes at once.
    """
    lot = max(2, ceil(_LOT_S / cpu_s))
    rates = []
    for count in (1, processes):
        run_all(partial(_blasts, scenario, engine, 1), range(count), processes)  # load the code
        began = perf_counter()
        run_all(partial(_blasts, scenario, engine, lot), range(count), processes)
        rates.append(count * lot / (perf_counter() - began))
    return Crowd(processes, *rates)


def _blasts(scenario: Scenario, engine: str, count: int, first_seed: int) -> None:
    for seed in range(count):
        simulate(scenario, seed=count * first_seed + seed, engine=engine)


@dataclass(frozen=True)
class EnvironmentCost:
    """The cost of an episode of random legal placements; medians of processor times.

    Attributes:
        engine: Name of the engine.
        episode_s: Time of the whole episode.
        blast_s: Time of its last step, with the blasts and the reward.
        steps: Number of steps per episode.
        vector_steps_per_s: Steps per second, by wall time, of all environments of the vector.
        environments: Number of environments in the vector, each in its process.
    """

    engine: str
    episode_s: float
    blast_s: float
    steps: int
    vector_steps_per_s: float
    environments: int

    @property
    def placing_s(self) -> float:
        """Time of `reset`, masks, observations and placements: all but the last step."""
        return self.episode_s - self.blast_s


def environment_cost(
    scenario: Scenario, engine: str, episodes: int, environments: int
) -> EnvironmentCost:
    """Time the environment in one process, and in a vector of processes.

    Args:
        scenario: The scenario; it needs a build zone, and a calibration where the engine does.
        engine: Name of the engine.
        episodes: Number of timed episodes, after one to warm up.
        environments: Number of processes of the vector.

    Raises:
        BlastEnvError: If the environment cannot be made of the scenario.
    """
    env = gym.make(ENV_ID, scenario=scenario, engine=engine)
    rng = np.random.default_rng(0)
    _episode(env, rng, 0)
    played = [_episode(env, rng, seed) for seed in range(1, episodes + 1)]
    env.close()
    whole_s, blast_s, steps = zip(*played, strict=True)
    return EnvironmentCost(
        engine=engine,
        episode_s=median(whole_s),
        blast_s=median(blast_s),
        steps=round(median(steps)),
        vector_steps_per_s=_vector_steps_per_s(scenario, engine, episodes, environments),
        environments=environments,
    )


def _episode(
    env: gym.Env[Any, Any], rng: np.random.Generator, seed: int
) -> tuple[float, float, int]:
    """Return the processor times of an episode and of its last step, and its number of steps."""
    began, steps, ended = process_time(), 0, False
    _, info = env.reset(seed=seed)
    last_s = began
    while not ended:
        action = random_action(info["action_mask"], rng)
        last_s = process_time()
        _, _, ended, _, info = env.step(action)
        steps += 1
    now_s = process_time()
    return now_s - began, now_s - last_s, steps


def random_action(mask: FloatArray | NDArray[Any], rng: np.random.Generator) -> int:
    """Return a random legal placement, or the last action, which finishes, if there is none."""
    free = np.flatnonzero(mask[:-1])
    return int(rng.choice(free)) if len(free) else len(mask) - 1


def _vector_steps_per_s(scenario: Scenario, engine: str, episodes: int, count: int) -> float:
    make = partial(gym.make, ENV_ID, scenario=scenario, engine=engine)
    mode = AutoresetMode.SAME_STEP
    envs = AsyncVectorEnv([make] * count, context="spawn", autoreset_mode=mode)
    rng = np.random.default_rng(0)
    try:
        envs.reset(seed=0)
        _play(envs, rng, 1)
        began = perf_counter()
        return _play(envs, rng, episodes) / (perf_counter() - began)
    finally:
        envs.close()


def _play(envs: AsyncVectorEnv, rng: np.random.Generator, episodes: int) -> int:
    """Return the steps of all environments until each has ended the given number of episodes."""
    ended, steps = np.zeros(envs.num_envs, dtype=np.int64), 0
    while ended.min() < episodes:
        masks: Sequence[NDArray[Any]] = envs.call("action_masks")
        _, _, over, _, _ = envs.step(np.array([random_action(mask, rng) for mask in masks]))
        ended += over
        steps += envs.num_envs
    return steps


def hardware() -> str:
    """Return the processor, the number of cores and the versions on which the speed depends."""
    packages = ", ".join(f"{name} {version(name)}" for name in _PACKAGES)
    return f"{_processor()}, {os.cpu_count()} cores, Python {platform.python_version()}, {packages}"


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    models = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    return next(models, platform.processor() or platform.machine())
