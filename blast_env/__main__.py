"""`python -m blast_env`: the command line, where `blast-env` is not on the path."""

from blast_env.cli import app

app(prog_name="blast-env")
