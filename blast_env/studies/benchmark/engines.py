"""How fast a blast is: on each engine, and next to pymunk alone on the same scene."""

import multiprocessing
import os
import platform
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from statistics import median
from time import process_time

import numpy as np
import pymunk

from blast_env.engines import Blast
from blast_env.engines.particles import PymunkEngine
from blast_env.physics.pymunk.space import build_space
from blast_env.physics.scene import Scene
from blast_env.scenario import Scenario, load_scenario
from blast_env.scenario.build_scene import build_scene

Departures = Mapping[int, list[int]]
"""Balls that leave the space after a step, by the number of the step."""

_DENSE_AIR = {
    "air": {"spacing_units": 3.0, "mass": 0.1, "elasticity": 1.0},
    "explosive": {"elasticity": 1.0},
}

_BYTES_PER_MAXRSS_UNIT = 1 if platform.system() == "Darwin" else 1024


@dataclass(frozen=True)
class SpeedFigures:
    """Speed of the blasts of one scenario on pymunk; medians over repeats.

    Attributes:
        name: What was run.
        balls: Balls at the start.
        steps: Steps of the engine.
        blast_s: Processor time of a blast, from scenario to result.
        per_particle_step_ns: Processor time per ball and step, counting the balls present.
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
    """Return the processor time that a call takes: whatever else runs here counts little."""
    start = process_time()
    call()
    return process_time() - start


@dataclass(frozen=True)
class BenchmarkScene:
    """A scenario on which the engines are timed.

    Attributes:
        name: Name for the table.
        scenario: The scenario.
        close_step_radii: Longest step at which the loads of pymunk are within 5 % of those of the
            event engine, as `python -m studies.engines` finds; None if not known.
        least_ratio: How many times faster than that the event engine is to be; None: not said.
    """

    name: str
    scenario: Scenario
    close_step_radii: float | None = None
    least_ratio: float | None = None

    def at_close_step(self) -> Scenario | None:
        """Return the scenario at that step; None if it is not known."""
        step_radii = self.close_step_radii
        if step_radii is None:
            return None
        if step_radii == self.scenario.parameters.stepping.step_radii:
            return self.scenario
        return self.scenario.with_simulation(overrides={"stepping": {"step_radii": step_radii}})


def benchmark_scenes() -> tuple[BenchmarkScene, ...]:
    """Return the scenes that `blast-env bench` times."""
    return (
        BenchmarkScene("courtyard", _ballistic_courtyard(), 0.25, 10.0),
        BenchmarkScene(
            "free_field at 60 m", load_scenario("free_field").at_stand_off(60.0), 0.5, 10.0
        ),
        BenchmarkScene("dense courtyard", dense_courtyard(), 0.05, 5.0),
    )


def dense_courtyard() -> Scenario:
    """Return the courtyard full of light, elastic air, three radii apart."""
    return load_scenario("courtyard").with_simulation("ballistic", _DENSE_AIR)


def _ballistic_courtyard() -> Scenario:
    return load_scenario("courtyard").with_simulation("ballistic")


@dataclass(frozen=True)
class EngineFigures:
    """Processor time of one blast on each engine; medians over seeds.

    Attributes:
        balls: Balls at the start.
        pymunk_s: On pymunk at the scenario's step.
        close_pymunk_s: On pymunk at a step where it is within 5 %; None if that is not known.
        event_s: On the event engine.
        ratio: How many times faster the event engine is than pymunk at the scenario's step.
        close_ratio: Likewise at the step where it is within 5 %.
    """

    balls: int
    pymunk_s: float
    close_pymunk_s: float | None
    event_s: float
    ratio: float
    close_ratio: float | None


def measure_engines(scene: BenchmarkScene, repeats: int) -> EngineFigures:
    """Time blasts on both engines, in turn, from scenario to result.

    Args:
        scene: The scene.
        repeats: Number of blasts on each; their seeds are 0 and up.
    """
    for engine in ("event", "pymunk"):  # imports it, and compiles what is not on disk yet
        Blast(scene.scenario, engine=engine).run()
    close = scene.at_close_step()
    event, pymunk, close_pymunk = [], [], []
    for seed in range(repeats):
        event.append(_timed(Blast(scene.scenario, seed=seed, engine="event").run))
        pymunk.append(_timed(Blast(scene.scenario, seed=seed).run))
        if close == scene.scenario:
            close_pymunk.append(pymunk[-1])
        elif close is not None:
            close_pymunk.append(_timed(Blast(close, seed=seed).run))
    return EngineFigures(
        balls=len(build_scene(scene.scenario).balls),
        pymunk_s=median(pymunk),
        close_pymunk_s=median(close_pymunk) if close_pymunk else None,
        event_s=median(event),
        ratio=_median_ratio(pymunk, event),
        close_ratio=_median_ratio(close_pymunk, event) if close_pymunk else None,
    )


def _median_ratio(ones: list[float], others: list[float]) -> float:
    return median(one / other for one, other in zip(ones, others, strict=True))


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
        f"pymunk {pymunk.version} (Chipmunk {pymunk.chipmunk_version}), numba {version('numba')}"
    )


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    models = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    return next(models, platform.processor() or platform.machine())
