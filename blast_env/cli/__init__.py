"""The command line, `blast-env`: one module per command, imported when it is called."""

from typing import Annotated

import typer

from blast_env.cli.command import MARKUP, LazyGroup


class _Commands(LazyGroup):
    """All commands, in the order in which help lists them."""

    summaries = {  # noqa: RUF012  # annotated in the base class
        "simulate": "Run one blast and print the load on each structure.",
        "draw": "Check scenario files, and draw the plan of each site.",
        "calibrate": (
            "Run blasts at many distances, fit the three laws, and store one as a calibration."
        ),
        "evaluate": "Compare a layout with no barrier, both exposed to the same threats.",
        "assess": "Assess the damage of buildings by charges: panes, panels, level of protection.",
        "advise": (
            "Compare the protection for a budget: stand-off, shielding, hardening, and all "
            "combined."
        ),
        "search": "Search for the layout with the least load on the protected structures.",
        "train": ("Train an agent that proposes layouts, or resume an interrupted training."),
        "judge": "Run submissions to the benchmark again by gas dynamics, and show the standings.",
        "report": "Report on a layout by gas dynamics, as one self-contained HTML page and as PDF.",
        "import": "Make a scenario from a map, drawing or model: GeoJSON, IFC and others.",
        "app": (
            "Open a local web page to design on: draw a site, place barriers, blast, compare, "
            "search."
        ),
        "serve": "Serve problems to agents as tools, by MCP or OpenEnv.",
    }
    modules = {"import": "import_map", "app": "page"}  # noqa: RUF012


app = typer.Typer(
    name="blast-env",
    cls=_Commands,
    no_args_is_help=True,
    rich_markup_mode=MARKUP,
    pretty_exceptions_enable=False,
)


def _show_version(asked: bool) -> None:
    if asked:
        # Here, because help is shown without it.
        from blast_env.provenance import package_version

        typer.echo(f"blast-env {package_version()}")
        raise typer.Exit


@app.callback()
def main(
    _version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_show_version, is_eager=True, help="Show the version and exit."
        ),
    ] = False,
) -> None:
    """Blast loads on structures, and layouts of barriers that lower them."""
