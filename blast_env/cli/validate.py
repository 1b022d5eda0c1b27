"""`blast-env validate`: check scenario files."""

from typing import Annotated

import typer

from blast_env.cli.output import print_line, user_errors
from blast_env.scenario import find_problems


def validate(
    files: Annotated[list[str], typer.Argument(help="Scenario files, or bundled names.")],
) -> None:
    """Check scenario files and report everything that is wrong with each.

    The exit code is 0 when all files are good, 1 when one has a problem.
    """
    bad_files = 0
    with user_errors():
        for name in files:
            problems = find_problems(name)
            bad_files += bool(problems)
            if not problems:
                print_line(f"{name}: good", style="green")
            for problem in problems:
                print_line(f"{name}: {problem}")
    if bad_files:
        raise typer.Exit(1)
