"""`blast-env bench`: how fast blasts are on this machine."""

from typing import Annotated, Final

import typer
from rich.table import Table

from blast_env.benchmark import (
    BenchmarkScene,
    benchmark_scenes,
    hardware,
    measure_engines,
    measure_memory_mb,
    measure_speed,
)
from blast_env.cli.output import make_table, print_line, result_console, user_errors
from blast_env.scenario import load_scenario
from blast_env.scene import build_scene

_MANY_BALLS: Final = {
    "air": {"spacing_units": 1.38, "radius_units": 0.5},
    "stepping": {"time_limit_s": 0.005},
}
_ENGINE_HEADERS: Final = (
    "scenario",
    "balls",
    "pymunk (ms)",
    "within 5 % (ms)",
    "event (ms)",
    "pymunk / event",
    "within 5 % / event",
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


def bench(
    repeats: Annotated[int, typer.Option(min=1, help="Runs of each; medians are shown.")] = 5,
    scenario: Annotated[
        str | None, typer.Option(help="Time only this scenario: bundled name, or a file.")
    ] = None,
    memory: Annotated[bool, typer.Option(help="Also measure the memory of a large blast.")] = True,
) -> None:
    """Time blasts on both engines and against pymunk alone, and measure the memory."""
    with user_errors():
        scenes = benchmark_scenes()
        if scenario is not None:
            scenes = (BenchmarkScene(scenario, load_scenario(scenario)),)
        print_line(hardware())
        result_console().print(_engine_table(scenes, repeats))
        print_line(
            "within 5 %: the step at which pymunk's loads are within 5 % of those of the event "
            "engine, as `python -m scripts.compare_engines` finds.\n"
        )
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
            "-" if close_s is None else f"{1e3 * close_s:.0f} at {scene.close_step_radii:g} radii",
            f"{1e3 * figures.event_s:.1f}",
            f"{figures.ratio:.1f}",
            "-" if close_ratio is None else f"{close_ratio:.1f}",
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
