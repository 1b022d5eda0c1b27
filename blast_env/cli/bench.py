"""`blast-env bench`: how fast blasts are on this machine."""

from typing import Annotated, Final

import typer

from blast_env.benchmark import hardware, measure_memory_mb, measure_speed
from blast_env.cli.output import make_table, print_line, result_console, user_errors
from blast_env.scenario import Scenario, load_scenario
from blast_env.scene import build_scene

_MANY_BALLS: Final = {
    "air": {"spacing_units": 1.38, "radius_units": 0.5},
    "stepping": {"time_limit_s": 0.005},
}
_HEADERS: Final = (
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
    """Time blasts against pymunk alone on the same scenes, and measure the memory."""
    with user_errors():
        chosen = None if scenario is None else {scenario: load_scenario(scenario)}
        print_line(hardware())
        table = make_table(
            f"speed of blasts, medians of {repeats} runs, building the space included", _HEADERS
        )
        for name, each in (chosen or _default_scenarios()).items():
            speed = measure_speed(each, name, repeats)
            table.add_row(
                speed.name,
                f"{speed.balls:,}",
                f"{speed.steps:,}",
                f"{1.0 / speed.blast_s:.2f}",
                f"{speed.per_particle_step_ns:.0f}",
                f"{speed.ratio_all_balls:.2f}",
                f"{speed.ratio_same_balls:.2f}",
            )
        result_console().print(table)
        print_line(
            "pymunk alone: no handler, no recording, no shrinking; every ball stays and is "
            "stepped to the end.\nSame balls: the balls that leave our blast leave there too."
        )
        if memory:
            many = load_scenario("free_field").at_stand_off(60.0)
            many = many.with_simulation(overrides=_MANY_BALLS)
            balls = len(build_scene(many).balls)
            print_line(f"peak memory with {balls:,} balls: {measure_memory_mb(many):.0f} MB")


def _default_scenarios() -> dict[str, Scenario]:
    return {
        "courtyard": load_scenario("courtyard"),
        "free_field at 60 m": load_scenario("free_field").at_stand_off(60.0),
    }
