"""The command line, `blast-env`: one module a command."""

import typer

from blast_env.cli.bench import bench
from blast_env.cli.calibrate import calibrate
from blast_env.cli.evaluate import evaluate
from blast_env.cli.league import league
from blast_env.cli.search import search
from blast_env.cli.simulate import simulate
from blast_env.cli.train import train
from blast_env.cli.validate import validate

app = typer.Typer(
    name="blast-env",
    help="Blast loads on structures, and layouts of barriers that lower them.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.command()(simulate)
app.command()(validate)
app.command()(calibrate)
app.command()(evaluate)
app.command()(search)
app.command()(bench)
app.command()(train)
app.command()(league)
