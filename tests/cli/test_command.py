"""Commands that are made of dataclasses: what their fields become on the command line."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner, Result

from blast_env.cli import app
from blast_env.cli.command import Command, function_of, options_of
from blast_env.cli.targets import Target
from blast_env.option_fields import FOLDER, argument, option

made: list[Any] = []


@dataclass(frozen=True, kw_only=True)
class SharedOptions(Command):
    """What commands have in common."""

    processes: int = option(1, "Worker processes.", min=1)


@dataclass(frozen=True, kw_only=True)
class ShowCommand(SharedOptions):
    """Keep what the command line says."""

    file: Path = argument("A file.")
    cell_m: float = option(0.5, "Side of the cells, m.")
    corner: str = option("west", "Corner.", flag="--from")
    items: bool = option(True, "Rank items.")
    repair: bool = option(False, "Put right.")
    names: tuple[str, ...] = option((), "A name.", flag="--name")
    places: tuple[tuple[float, float], ...] = option((), "A place.", flag="--at", metavar="X,Y")
    out: Path | None = option(None, "A folder.", writes=FOLDER)
    picture: Path | None = option(None, "A picture.", writes=(".png", ".svg"))

    def __call__(self) -> None:
        """Keep it."""
        made.append(self)


def run(*words: str) -> Result:
    application = typer.Typer()
    application.command()(function_of(ShowCommand))
    made.clear()
    return CliRunner().invoke(application, words, env={"COLUMNS": "150"})


def test_what_is_not_given_has_the_default_of_the_dataclass() -> None:
    assert run("a.toml").exit_code == 0
    assert made == [ShowCommand(file=Path("a.toml"))]


def test_names_are_those_of_the_fields_without_units_unless_they_say_another() -> None:
    words = ("--cell", "0.25", "--from", "east", "--no-items", "--repair", "--processes", "2")
    run("a.toml", *words, "--name", "a", "--name", "b", "--at", "1,2.5", "--at", "-3,4")
    assert made == [
        ShowCommand(
            file=Path("a.toml"),
            cell_m=0.25,
            corner="east",
            items=False,
            repair=True,
            names=("a", "b"),
            places=((1.0, 2.5), (-3.0, 4.0)),
            processes=2,
        )
    ]


def test_shared_options_come_last_and_all_say_what_they_are() -> None:
    shown = run("--help").stdout
    assert "Keep what the command line says." in shown
    assert [each.name for each in options_of(ShowCommand)][-1] == "processes"
    assert all(each.text.help in shown for each in options_of(ShowCommand))
    assert "--no-repair" not in shown


@pytest.mark.parametrize("text", ["1", "1,2,3", "a,b", ""])
def test_numbers_with_commas_that_are_none(text: str) -> None:
    result = run("a.toml", "--at", text)
    assert result.exit_code == 2
    assert f"--at is {text!r}, must be two numbers as X,Y" in result.stderr
    assert made == []


def test_bounds_are_checked_before_the_command_is_made() -> None:
    assert run("a.toml", "--processes", "0").exit_code == 2
    assert made == []


def test_where_a_command_writes_is_known_from_its_options() -> None:
    command = ShowCommand(file=Path("a"), out=Path("b"), picture=Path("c.png"))
    assert command.targets() == [
        Target("--out", Path("b"), FOLDER),
        Target("--picture", Path("c.png"), (".png", ".svg")),
    ]


@pytest.mark.parametrize(
    "words",
    [
        *(("--tnt-kg", "1_000"), ("--tnt-kg", "nan"), ("--tnt-kg", "1,5"), ("--seed", "1_0")),
        *(("--cell", "inf"), ("--tnt-kg", "\uff11")),
    ],
)
def test_a_number_that_python_reads_and_nobody_means_is_refused(words: tuple[str, ...]) -> None:
    result = CliRunner().invoke(app, ["simulate", "courtyard", *words])
    assert result.exit_code == 2
    assert "is no number such as 1000 or 0.5" in result.output
