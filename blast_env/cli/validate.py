"""`blast-env validate`: check scenario files."""

from typing import Annotated

import typer

from blast_env.cli.output import print_line, user_errors
from blast_env.evaluation.suitability import suitability
from blast_env.scenario import find_problems


def validate(
    files: Annotated[list[str], typer.Argument(help="Scenario files, or bundled names.")],
) -> None:
    """Check scenario files: everything that is wrong with each, or what it is (not) good for.

    The exit code is 0 when all files are good, 1 when one has a problem.
    """
    bad_files = 0
    with user_errors():
        for name in files:
            problems = find_problems(name)
            bad_files += bool(problems)
            if not problems:
                _print_suitability(name)
            for problem in problems:
                print_line(f"{name}: {problem}")
    if bad_files:
        raise typer.Exit(1)


def _print_suitability(name: str) -> None:
    """Print what a sound file is good for, and all that it is not good for."""
    found = suitability(name)
    print_line(f"{name}: good for {'; '.join(found.uses)}", style="green")
    for limit in found.limits:
        print_line(f"{name}: note: {limit}")
