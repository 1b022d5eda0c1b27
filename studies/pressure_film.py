"""Film the overpressure of a blast without a barrier and with a wall: the README's animation.

`python -m studies.pressure_film FILM` films the site of docs/data/depot.toml with the wall that a
rule places near the building, by gas dynamics in cells of 0.5 m.
"""

from pathlib import Path
from typing import Annotated, Final

import typer

from blast_env.answers.terminal import print_line
from blast_env.cli.output import progress_bar, user_errors
from blast_env.evaluation.engines.gas import GasBlast
from blast_env.plots.film import write_film
from blast_env.plots.pressure_frames import VerticalSection
from blast_env.rules import wall_near_building
from blast_env.site import Charge, load_scenario

SITE: Final = Path(__file__).parents[1] / "docs" / "data" / "depot.toml"
CHARGE: Final = Charge((4.0, 11.0), 100.0)
SECTION: Final = VerticalSection("y", 9.25)
"""Section through the wall, beside the path that must stay open and is level with the charge."""


def main(
    film: Annotated[Path, typer.Argument(help="The film to write: .gif or .mp4.")],
    frames_per_s: Annotated[float, typer.Option(help="Frames in a second of the film.")] = 10.0,
    slow_motion: Annotated[
        float, typer.Option(help="Seconds of the film for a second of the blast.")
    ] = 100.0,
) -> None:
    """Write the film, and print the impulse on the control room with and without the wall."""
    with user_errors():
        scenario = load_scenario(SITE)
        wall = wall_near_building(scenario, CHARGE)
        with progress_bar("film") as progress:
            results = write_film(
                GasBlast(scenario, wall, charge=CHARGE),
                film,
                beside=GasBlast(scenario, charge=CHARGE),
                section=SECTION,
                frames_per_s=frames_per_s,
                slow_motion=slow_motion,
                progress=progress,
            )
        without, behind = (result.impulse("control_room").pa_s for result in results)
    print_line(f"wrote {film}: {without:.0f} Pa s without a barrier, {behind:.0f} Pa s behind it")


if __name__ == "__main__":
    typer.run(main)
