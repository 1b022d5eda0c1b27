"""The command line, `blast-env`: one module a command, imported when it is called."""

from typing import Annotated

import typer

from blast_env.cli.command import MARKUP, LazyGroup


class _Commands(LazyGroup):
    """All commands, in the order in which help lists them."""

    places = {  # noqa: RUF012  # annotated in the base class
        "simulate": (
            "blast_env.cli.simulate:SimulateCommand",
            "Run one blast and print what each structure took.",
        ),
        "validate": (
            "blast_env.cli.validate:ValidateCommand",
            "Check scenario files: what is wrong with each, or what it is (not) good for.",
        ),
        "draw": (
            "blast_env.cli.draw:DrawCommand",
            "Draw the plan and the oblique view of a site, with a layout if one is given.",
        ),
        "calibrate": (
            "blast_env.cli.calibrate:CalibrateCommand",
            "Run blasts at many distances, fit the three laws, and store one as a calibration.",
        ),
        "evaluate": (
            "blast_env.cli.evaluate:EvaluateCommand",
            "Compare layouts with no barrier, both exposed to the same threats.",
        ),
        "assess": (
            "blast_env.cli.assess:AssessCommand",
            "Say what charges do to the buildings: panes, panels, level of protection.",
        ),
        "advise": (
            "blast_env.cli.advise:AdviseCommand",
            "Say what a budget buys by keeping the charge away, shielding, hardening, and all "
            "together.",
        ),
        "search": (
            "blast_env.cli.search:SearchCommand",
            "Search for the layout with the least load on the protected structures.",
        ),
        "bench": (
            "blast_env.cli.bench:BenchCommand",
            "Time blasts and the environment on this machine, and measure the memory.",
        ),
        "train": (
            "blast_env.cli.train:TrainCommand",
            "Train an agent that proposes layouts, or go on with a training that was interrupted.",
        ),
        "league": (
            "blast_env.cli.league:LeagueCommand",
            "Compare searches, rules and trained agents on the same held-out cases and seeds.",
        ),
        "judge": (
            "blast_env.cli.judge:JudgeCommand",
            "Play submissions to the benchmark again by gas dynamics, and show the standings.",
        ),
        "propose": (
            "blast_env.cli.propose:ProposeCommand",
            "Propose a layout for any site in a second or a few; no blast is run for it.",
        ),
        "report": (
            "blast_env.cli.report:ReportCommand",
            "Report on a layout by gas dynamics: HTML that needs nothing else, and PDF.",
        ),
        "play": (
            "blast_env.cli.play:PlayCommand",
            "Place barriers by hand, with mouse and keyboard, and see what the blast makes of "
            "them.",
        ),
        "paper": (
            "blast_env.cli.paper:PaperCommand",
            "Work out the paper's Tables 1 to 4 and Figure 5 again, from its own columns.",
        ),
        "import": (
            "blast_env.cli.import_map:ImportCommand",
            "Make a scenario of a map or drawing: GeoJSON, OpenStreetMap, DXF.",
        ),
        "app": (
            "blast_env.cli.page:AppCommand",
            "Open a local web page to design on: draw a site, place barriers, blast, compare, "
            "search.",
        ),
    }


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
