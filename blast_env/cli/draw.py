"""`blast-env draw`: checks of scenario files, and pictures of their sites before any blast."""

from pathlib import Path

import typer

from blast_env.answers.terminal import print_line
from blast_env.cli.command import PICTURES, writes
from blast_env.cli.options import LayoutOption
from blast_env.cli.suitability import suitability
from blast_env.errors import BlastEnvError
from blast_env.layout import LayoutState, load_layout
from blast_env.site import find_problems, load_scenario


def draw(
    scenarios: list[str] = typer.Argument(help="Bundled names, or scenario files."),
    layout: LayoutOption = None,
    out: Path | None = writes("Picture to write, else NAME.png of the scenario", *PICTURES),
    check_only: bool = typer.Option(
        False, "--check-only", help="Check the files, and draw nothing."
    ),
) -> None:
    """Check scenario files, and draw the plan of each site.

    The command prints the uses and limits of each file, or its errors; the exit code is 1 if one
    has any. No blast is run.
    """
    for option, path in (("--layout", layout), ("--out", out)):
        if path is not None and len(scenarios) > 1:
            raise BlastEnvError(f"{option} is for one scenario: there are {len(scenarios)}")
    if [name for name in scenarios if not _is_sound(name)]:
        raise typer.Exit(1)
    if not check_only:
        for name in scenarios:
            _draw(name, layout, out)


def _is_sound(name: str) -> bool:
    """Print the problems of a file, or its uses and limits; return whether it has none."""
    problems = find_problems(name)
    for problem in problems:
        print_line(f"{name}: {problem}")
    if problems:
        return False
    uses, limits = suitability(name)
    print_line(f"{name}: good for {'; '.join(uses)}", style="green")
    for limit in limits:
        print_line(f"{name}: note: {limit}")
    return True


def _draw(name: str, layout: Path | None, out: Path | None) -> None:
    scenario = load_scenario(name)
    elements = () if layout is None else load_layout(layout, scenario)
    # Here, because pictures need the extra `render`.
    from blast_env.plots.figures import save_figure
    from blast_env.plots.site_picture import site_picture

    for sentence in LayoutState.of(scenario, elements).explain_vehicles():
        print_line(sentence)
    figure = site_picture(scenario, elements)
    print_line(f"wrote {save_figure(figure, out or Path(f'{scenario.name}.png'))}")
