"""The command line, `blast-env`: one module a command."""

from typing import Annotated

import typer

from blast_env.cli.bench import bench
from blast_env.cli.calibrate import calibrate
from blast_env.cli.draw import draw
from blast_env.cli.evaluate import evaluate
from blast_env.cli.import_map import import_map
from blast_env.cli.league import league
from blast_env.cli.output import print_line
from blast_env.cli.page import app as page
from blast_env.cli.play import play
from blast_env.cli.report import report
from blast_env.cli.search import search
from blast_env.cli.simulate import simulate
from blast_env.cli.train import train
from blast_env.cli.validate import validate
from blast_env.provenance import package_version

app = typer.Typer(
    name="blast-env",
    no_args_is_help=True,
    rich_markup_mode="markdown",  # its own markup takes [row, column] for a style
    pretty_exceptions_enable=False,
)
_COMMANDS = (
    simulate,
    validate,
    draw,
    calibrate,
    evaluate,
    search,
    bench,
    train,
    league,
    report,
    play,
)
for _command in _COMMANDS:
    app.command()(_command)
app.command("import")(import_map)  # a word that Python keeps for itself
app.command("app")(page)


def _show_version(asked: bool) -> None:
    if asked:
        print_line(f"blast-env {package_version()}")
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
