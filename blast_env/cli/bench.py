"""`blast-env bench`: how fast blasts are on this machine."""

from typing import Annotated, Final

import typer

from blast_env.benchmark import hardware, measure_memory_mb, measure_speed
from blast_env.cli.output import make_table, result_console, user_errors
from blast_env.scenario import Scenario, load_scenario

_MANY_BALLS: Final = {
    "air": {"spacing_units": 1.38, "radius_units": 0.5},
    "stepping": {"time_limit_s": 0.005},
}


def bench(
    repeats: Annotated[int, typer.Option(min=1, help="Runs of each; medians are shown.")] = 5,
) -> None:
    """Time blasts against pymunk alone on the same scenes, and measure the memory."""
    console = result_console()
    console.print(hardware())
    table = make_table(
        f"speed of blasts, medians of {repeats} runs, building the space included",
        (
            "scenario",
            "balls",
            "steps",
            "blasts/s",
            "ns per ball and step",
            "time / pymunk alone",
            "time / pymunk alone, same balls",
        ),
    )
    with user_errors():
        for name, scenario in _scenarios().items():
            speed = measure_speed(scenario, name, repeats)
            table.add_row(
                speed.name,
                f"{speed.balls:,}",
                f"{speed.steps:,}",
                f"{1.0 / speed.blast_s:.2f}",
                f"{speed.per_particle_step_ns:.0f}",
                f"{speed.ratio_all_balls:.2f}",
                f"{speed.ratio_same_balls:.2f}",
            )
        console.print(table)
        console.print(
            "pymunk alone: no handler, no recording, no shrinking; every ball stays and is "
            "stepped to the end.\nSame balls: the balls that leave our blast leave there too."
        )
        many = load_scenario("free_field").at_stand_off(60.0).with_simulation(overrides=_MANY_BALLS)
        balls = _ball_count(many)
        console.print(f"peak memory with {balls:,} balls: {measure_memory_mb(many):.0f} MB")


def _scenarios() -> dict[str, Scenario]:
    return {
        "courtyard": load_scenario("courtyard"),
        "free_field at 60 m": load_scenario("free_field").at_stand_off(60.0),
    }


def _ball_count(scenario: Scenario) -> int:
    from blast_env.scene import build_scene

    return len(build_scene(scenario).balls)
