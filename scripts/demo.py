"""`make demo`: simulate the default scenario and write what a person would look at.

Writes the collision workbook, the heat map, the film and the other figures under `out/`.
"""

from pathlib import Path

from blast_env import Blast, BlastResult, load_scenario
from blast_env.cli.output import print_line, progress_bar, user_errors
from blast_env.cli.simulate import print_summary
from blast_env.rendering.figures import (
    heat_map,
    impulse_over_time,
    initial_velocities,
    model_scheme,
    save_figure,
)
from blast_env.rendering.film import write_film

OUT = Path("out")
SCENARIO = "courtyard"
LINE_OF_SIGHT_WALL = tuple((row, 0) for row in range(8, 18)) + ((22, 0), (23, 0), (24, 0))
"""Cells at the road's side of the build zone, on both sides of the path that stays open."""


def main() -> None:
    """Run the demonstration."""
    scenario = load_scenario(SCENARIO)
    with user_errors():
        OUT.mkdir(exist_ok=True)
        bare = show(Blast(scenario, seed=0), SCENARIO)
        workbook = bare.to_excel(OUT / f"{SCENARIO}_collisions.xlsx")
        behind = show(Blast(scenario, LINE_OF_SIGHT_WALL, seed=0), f"{SCENARIO}_barrier")
        schemes = [
            save_figure(initial_velocities(scenario.parameters), OUT / "initial_velocities.png"),
            save_figure(model_scheme(behind.blast.scene), OUT / "model_scheme.png"),
        ]
    for path in (workbook, *schemes):
        print_line(f"wrote {path}")
    share = behind.impulse_sim("building") / bare.impulse_sim("building")
    print_line(
        f"\nbehind the barrier the building took {100 * share:.0f} % of the impulse that it took "
        "without it, in this one blast (seed 0)"
    )


def show(blast: Blast, name: str) -> BlastResult:
    """Run a blast; write its film, heat map and history, and print its table."""
    with progress_bar(f"{name}: blast and film") as progress:
        result = write_film(blast, OUT / f"{name}.mp4", progress=progress)
    written = [
        OUT / f"{name}.mp4",
        save_figure(heat_map(result), OUT / f"{name}_heat_map.png"),
        save_figure(impulse_over_time(result), OUT / f"{name}_history.png"),
    ]
    print_summary(result, written)
    return result


if __name__ == "__main__":
    main()
