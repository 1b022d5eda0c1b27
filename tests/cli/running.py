"""Commands, run in this process."""

from typer.testing import CliRunner, Result

from blast_env.cli import app


def run(*words: object) -> Result:
    return CliRunner().invoke(app, [*map(str, words)])
