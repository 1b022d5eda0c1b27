"""`blast-env bench`: how fast blasts are on this machine."""

from importlib.util import find_spec
from math import log
from pathlib import Path
from typing import Annotated, Final

import typer
from rich.table import Table

from blast_env.cli.output import make_table, print_line, result_console, user_errors
from blast_env.physics.gas.benchmark import measure
from blast_env.scenario import Scenario, load_scenario
from blast_env.scenario.build_scene import build_scene
from blast_env.studies.benchmark.engines import (
    BenchmarkScene,
    benchmark_scenes,
    hardware,
    measure_engines,
    measure_memory_mb,
    measure_speed,
)
from blast_env.studies.benchmark.environment import (
    FRAME_BALLS,
    measure_environment,
    measure_frame_ms,
)
from blast_env.studies.benchmark.gas import (
    beside_foam,
    beside_pyclaw,
    gas_blasts,
    measure_crowd,
)
from blast_env.studies.benchmark.parallel import measure_fleets, measure_threads

_MANY_BALLS: Final = {
    "air": {"spacing_units": 1.38, "radius_units": 0.5},
    "stepping": {"time_limit_s": 0.005},
}
_ENGINE_HEADERS: Final = (
    "scenario",
    "balls",
    "pymunk (ms)",
    "5 % step",
    "pymunk at it (ms)",
    "event (ms)",
    "ratio",
    "at the 5 % step",
    "target",
)
_THREAD_HEADERS: Final = (
    "scenario",
    "blasts",
    "1 thread (blasts/s)",
    "threads (blasts/s)",
    "ratio",
)
_PYMUNK_HEADERS: Final = (
    "scenario",
    "balls",
    "steps",
    "blasts/s",
    "ns per ball and step",
    "time / pymunk alone",
    "time / pymunk alone, same balls",
)
_ENVIRONMENT_HEADERS: Final = (
    "scenario",
    "engine",
    "episode (ms)",
    "outside engine",
    "outside physics",
    "reset (ms)",
    "mask (ms)",
    "observation (ms)",
)
_GAS_HEADERS: Final = (
    "cell (m)",
    "cells",
    "steps",
    "CPU s",
    "blasts per CPU s",
    "million cell updates per CPU s",
)
_FLEET_HEADERS: Final = ("environments", "processes", "steps/s", "blasts/s")


def bench(
    repeats: Annotated[int, typer.Option(min=1, help="Runs of each; medians are shown.")] = 5,
    scenario: Annotated[
        str | None, typer.Option(help="Time only this scenario: bundled name, or a file.")
    ] = None,
    threads: Annotated[
        int, typer.Option(min=1, help="Threads of `simulate_many`; 1: do not measure them.")
    ] = 2,
    memory: Annotated[bool, typer.Option(help="Also measure the memory of a large blast.")] = True,
    environment: Annotated[bool, typer.Option(help="Also time `BlastBarrier-v0`.")] = True,
    particles: Annotated[bool, typer.Option(help="Time the particle engines.")] = True,
    gas: Annotated[bool, typer.Option(help="Time gas dynamics.")] = True,
    pyclaw_python: Annotated[
        Path | None, typer.Option(help="An interpreter that has clawpack, to time it beside gas.")
    ] = None,
) -> None:
    """Time blasts on all engines and against other codes, and measure the memory."""
    with user_errors():
        scenes = benchmark_scenes()
        if scenario is not None:
            scenes = (BenchmarkScene(scenario, load_scenario(scenario)),)
        print_line(hardware())
        if gas:
            _print_gas(threads, pyclaw_python)
        if not particles:
            return
        result_console().print(_engine_table(scenes, repeats))
        print_line(
            "5 % step: the longest at which pymunk's loads are within 5 % of those of the event "
            "engine, as `python -m studies.engines` finds.\nRatio: time of pymunk over "
            "time of the event engine.\n"
        )
        if threads > 1:
            result_console().print(_thread_table(scenes, threads, repeats))
            print_line("by the clock: needs as many idle cores as threads.\n")
        result_console().print(_pymunk_table(scenes, repeats))
        print_line(
            "pymunk alone: no handler, no recording, no shrinking; every ball stays and is "
            "stepped to the end.\nSame balls: the balls that leave our blast leave there too."
        )
        if memory:
            many = load_scenario("free_field").at_stand_off(60.0)
            many = many.with_simulation(overrides=_MANY_BALLS)
            balls = len(build_scene(many).balls)
            print_line(f"peak memory with {balls:,} balls: {measure_memory_mb(many):.0f} MB")
        if environment and find_spec("pygame") is not None:
            frame_ms = measure_frame_ms(load_scenario(scenario or "courtyard"), repeats)
            print_line(f"a frame with {FRAME_BALLS:,} balls: {frame_ms:.1f} ms; target 20 ms")
        if environment:
            _print_environment(load_scenario(scenario or "courtyard"), repeats)


def _print_gas(threads: int, pyclaw_python: Path | None) -> None:
    """Time a blast of gas dynamics by cells, threads and processes, and beside other codes."""
    blasts = gas_blasts()
    table = make_table("gas dynamics: 40 x 30 x 12 m, 60 ms, one thread", _GAS_HEADERS)
    for cell_m, cost in blasts.items():
        table.add_row(
            f"{cell_m:g}",
            f"{cost.cells:,}",
            f"{cost.steps:,}",
            f"{cost.cpu_s:.2f}",
            f"{1.0 / cost.cpu_s:.2f}",
            f"{1e-6 * cost.updates_per_cpu_s:.1f}",
        )
    result_console().print(table)
    coarse, fine = blasts.values()
    power = log(fine.cpu_s / coarse.cpu_s) / log(fine.cells / coarse.cells)
    print_line(f"CPU time grows with the power {power:.2f} of the number of cells")
    if threads > 1:
        one_s, more_s = (measure(threads=count).clock_s for count in (1, threads))
        crowd = measure_crowd(threads)
        print_line(
            f"by the clock, which needs as many idle cores: {threads} threads {one_s / more_s:.2f} "
            f"times as fast as one, {threads} processes {crowd.ratio:.2f} times the blasts of one"
        )
        print_line(f"memory of a process: {crowd.process_bytes / 2**20:.0f} MiB")
    others = {
        "PyClaw": None if pyclaw_python is None else beside_pyclaw(pyclaw_python),
        "rhoCentralFoam": beside_foam(),
    }
    for name, found in others.items():
        if found is None:
            hint = " (--pyclaw-python)" if name == "PyClaw" else ""
            print_line(f"{name}: not installed{hint}")
        else:
            print_line(
                f"{name}, {found.scene}: {1e-6 * found.theirs_per_s:.2f} million cell updates a "
                f"CPU second, gas {1e-6 * found.ours_per_s:.1f}"
            )
    print_line("")


def _engine_table(scenes: tuple[BenchmarkScene, ...], repeats: int) -> Table:
    """Time both engines on the scenes."""
    table = make_table(
        f"both engines: processor time of a blast, medians of {repeats} seeds", _ENGINE_HEADERS
    )
    for scene in scenes:
        figures = measure_engines(scene, repeats)
        close_s, close_ratio = figures.close_pymunk_s, figures.close_ratio
        table.add_row(
            scene.name,
            f"{figures.balls:,}",
            f"{1e3 * figures.pymunk_s:.0f}",
            "-" if close_s is None else f"{scene.close_step_radii:g} radii",
            "-" if close_s is None else f"{1e3 * close_s:.0f}",
            f"{1e3 * figures.event_s:.1f}",
            f"{figures.ratio:.1f}",
            "-" if close_ratio is None else f"{close_ratio:.1f}",
            "-" if scene.least_ratio is None else f"{scene.least_ratio:g}",
        )
    return table


def _thread_table(scenes: tuple[BenchmarkScene, ...], threads: int, repeats: int) -> Table:
    """Time the event engine in one thread and in several."""
    title = f"event engine, simulate_many in {threads} threads: the fastest of {repeats} runs"
    table = make_table(title, _THREAD_HEADERS)
    for scene in scenes:
        figures = measure_threads(scene.scenario, threads, repeats)
        table.add_row(
            scene.name,
            f"{figures.blasts:,}",
            f"{figures.blasts / figures.one_thread_s:.1f}",
            f"{figures.blasts / figures.all_threads_s:.1f}",
            f"{figures.scaling:.2f}",
        )
    return table


def _pymunk_table(scenes: tuple[BenchmarkScene, ...], repeats: int) -> Table:
    """Time pymunk with our rules against pymunk alone on the scenes."""
    table = make_table(
        f"pymunk: processor time, medians of {repeats} runs, building the space included",
        _PYMUNK_HEADERS,
    )
    for scene in scenes:
        speed = measure_speed(scene.scenario, scene.name, repeats)
        table.add_row(
            speed.name,
            f"{speed.balls:,}",
            f"{speed.steps:,}",
            f"{1.0 / speed.blast_s:.2f}",
            f"{speed.per_particle_step_ns:.0f}",
            f"{speed.ratio_all_balls:.2f}",
            f"{speed.ratio_same_balls:.2f}",
        )
    return table


def _print_environment(scenario: Scenario, repeats: int) -> None:
    """Time the environment on a scenario: its parts, and in several processes."""
    name = scenario.name
    if scenario.build_zone is None or scenario.calibration is None:
        print_line(f"BlastBarrier-v0: needs a build zone and a calibration, {name} lacks one")
        return
    figures = measure_environment(scenario, repeats)
    table = make_table(
        f"BlastBarrier-v0: processor time, medians of {repeats} episodes of random placements",
        _ENVIRONMENT_HEADERS,
        text_columns=2,
    )
    table.add_row(
        name,
        figures.engine,
        f"{figures.episode_ms:.1f}",
        f"{100.0 * figures.outside_engine:.1f} %",
        f"{100.0 * figures.outside_physics:.1f} %",
        *(f"{ms:.3f}" for ms in (figures.reset_ms, figures.mask_ms, figures.observation_ms)),
    )
    result_console().print(table)
    print_line("physics: the engine, and laying out the scenes of the blasts.\n")
    fleets = make_table(f"{name}: by the clock, {repeats} episodes each", _FLEET_HEADERS)
    for fleet in measure_fleets(scenario, repeats):
        fleets.add_row(
            fleet.name,
            str(fleet.processes),
            f"{fleet.steps_per_s:,.0f}",
            f"{fleet.blasts_per_s:,.1f}",
        )
    result_console().print(fleets)
