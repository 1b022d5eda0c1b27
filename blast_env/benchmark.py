"""How fast a blast is, next to pymunk alone on the same scene."""

import multiprocessing
import os
import platform
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from time import perf_counter

import numpy as np
import pymunk

from blast_env.physics.pymunk_engine import PymunkEngine
from blast_env.physics.pymunk_space import build_space
from blast_env.scenario import Scenario
from blast_env.scene import Scene, build_scene
from blast_env.simulation import Blast

Departures = Mapping[int, list[int]]
"""Balls that leave the space after a step, by the number of the step."""

_BYTES_PER_MAXRSS_UNIT = 1 if platform.system() == "Darwin" else 1024


@dataclass(frozen=True)
class SpeedFigures:
    """Speed of the blasts of one scenario; medians over repeats.

    Attributes:
        name: What was run.
        balls: Balls at the start.
        steps: Steps of the engine.
        blast_s: Wall time of a blast, from scenario to result.
        per_particle_step_ns: Wall time per ball and step, counting the balls present.
        ratio_all_balls: Our time over that of pymunk alone: the same scene and steps without
            handler, recording and shrinking. Nothing leaves there, so it steps more balls.
        ratio_same_balls: Our time over that of pymunk alone when the balls that leave our run
            are taken out of it at the same steps: what our rules and recording cost.
    """

    name: str
    balls: int
    steps: int
    blast_s: float
    per_particle_step_ns: float
    ratio_all_balls: float
    ratio_same_balls: float


def measure_speed(scenario: Scenario, name: str, repeats: int) -> SpeedFigures:
    """Time blasts of a scenario against pymunk alone, in turn.

    Args:
        scenario: The scenario.
        name: Name for the table.
        repeats: How often each is run.
    """
    scene = build_scene(scenario)
    departures, steps, particle_steps = _watch_departures(scene)
    ours, ratios_all, ratios_same = [], [], []
    for _ in range(repeats):
        blast_s = _timed(lambda: Blast(scenario).run())
        ours.append(blast_s)
        ratios_all.append(blast_s / _timed(lambda: pymunk_alone(scenario, steps, {})))
        ratios_same.append(blast_s / _timed(lambda: pymunk_alone(scenario, steps, departures)))
    return SpeedFigures(
        name=name,
        balls=len(scene.balls),
        steps=steps,
        blast_s=median(ours),
        per_particle_step_ns=1e9 * median(ours) / particle_steps,
        ratio_all_balls=median(ratios_all),
        ratio_same_balls=median(ratios_same),
    )


def pymunk_alone(scenario: Scenario, steps: int, departures: Departures) -> None:
    """Step a scene with pymunk and nothing else, building it included.

    Args:
        scenario: The scenario.
        steps: How many steps.
        departures: Balls to take out.
    """
    scene = build_scene(scenario)
    built = build_space(scene, scene.obstacles())
    for step in range(1, steps + 1):
        built.space.step(built.time_step_s)
        for ball in departures.get(step, ()):
            built.space.remove(built.ball_bodies[ball], built.ball_shapes[ball])


def _watch_departures(scene: Scene) -> tuple[Departures, int, int]:
    """Return who leaves when, the number of steps, and the sum of the balls over the steps."""
    run = PymunkEngine().start(scene)
    present, departures, particle_steps = run.balls().index, {}, 0
    while run.end_reason is None:
        run.advance(np.nextafter(run.time_s, np.inf))
        left = run.balls().index
        if len(left) < len(present):
            departures[run.steps] = np.setdiff1d(present, left).tolist()
        particle_steps += len(present)
        present = left
    return departures, run.steps, particle_steps


def _timed(call: Callable[[], object]) -> float:
    start = perf_counter()
    call()
    return perf_counter() - start


def measure_memory_mb(scenario: Scenario) -> float:
    """Return the peak memory, MB, of a fresh process that runs a blast of the scenario."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(_peak_memory_mb, (scenario,))


def _peak_memory_mb(scenario: Scenario) -> float:
    Blast(scenario).run()
    try:
        # Linux hands the maximum of getrusage on from the process that started this one.
        status = Path("/proc/self/status").read_text(encoding="utf-8")
        return 1024.0 * int(status.split("VmHWM:")[1].split()[0]) / 1e6
    except (OSError, IndexError):
        import resource  # not on Windows

        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return peak * _BYTES_PER_MAXRSS_UNIT / 1e6


def hardware() -> str:
    """Return the processor, the number of cores and the versions that decide the speed."""
    return (
        f"{_processor()}, {os.cpu_count()} cores, Python {platform.python_version()}, "
        f"pymunk {pymunk.version} (Chipmunk {pymunk.chipmunk_version})"
    )


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    models = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    return next(models, platform.processor() or platform.machine())
