"""`blast-env validate`: check scenario files."""

from dataclasses import dataclass

import typer

from blast_env.cli.command import Command, argument
from blast_env.cli.output import print_line
from blast_env.evaluation.suitability import suitability
from blast_env.site import find_problems


@dataclass(frozen=True, kw_only=True)
class ValidateCommand(Command):
    """Check scenario files for errors, and print the uses and limits of each.

    The exit code is 0 if all files are valid, 1 if one has a problem.
    """

    files: tuple[str, ...] = argument("Scenario files, or bundled names.")

    def __call__(self) -> None:
        """Print the problems of each file, or its uses and limits."""
        bad_files = 0
        for name in self.files:
            problems = find_problems(name)
            bad_files += bool(problems)
            if not problems:
                _print_suitability(name)
            for problem in problems:
                print_line(f"{name}: {problem}")
        if bad_files:
            raise typer.Exit(1)


def _print_suitability(name: str) -> None:
    """Print the uses of a valid file, and its limits."""
    found = suitability(name)
    print_line(f"{name}: good for {'; '.join(found.uses)}", style="green")
    for limit in found.limits:
        print_line(f"{name}: note: {limit}")
