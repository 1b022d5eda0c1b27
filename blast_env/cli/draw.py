"""`blast-env draw`: a site and a layout, before any blast."""

from pathlib import Path
from typing import Annotated

import typer

from blast_env.cli.output import print_line, user_errors
from blast_env.cli.targets import PICTURES, FileTarget, checked_targets
from blast_env.scenario import load_layout, load_scenario


def draw(
    scenario: Annotated[str, typer.Argument(help="Bundled name, or a scenario file.")],
    layout: Annotated[
        Path | None, typer.Option(help="Layout file; without it, the empty site.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Picture to write: .png, .svg, .pdf.", show_default="the scenario's name, .png"
        ),
    ] = None,
    view: Annotated[str, typer.Option(help="both, plan or oblique.")] = "both",
    corner: Annotated[
        str | None,
        typer.Option(
            "--from",
            help="Corner over which one looks: southwest, southeast, northeast, northwest.",
            show_default="on the side of the charges",
        ),
    ] = None,
) -> None:
    """Draw the plan and the oblique view of a site, with a layout if one is given.

    Heights are to scale. No blast is run.
    """
    with user_errors(), checked_targets({"--out": FileTarget(out, PICTURES)}):
        found = load_scenario(scenario)
        elements = () if layout is None else load_layout(layout, found)
        # Here, because pictures need the extra `render`.
        from blast_env.rendering.figures import save_figure
        from blast_env.rendering.site_picture import site_picture

        figure = site_picture(found, elements, view, corner)
        path = save_figure(figure, Path(f"{found.name}.png") if out is None else out)
    print_line(f"wrote {path}")
