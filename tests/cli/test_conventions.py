"""What users of command lines rely on, item by item."""

import json
from io import StringIO
from pathlib import Path

import pytest
import typer
from blast_agents.training.callbacks import ValidationCallback
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console
from typer.core import TyperGroup
from typer.testing import CliRunner, Result

from blast_env import save_scenario
from blast_env.answers import Table
from blast_env.answers.terminal import TableView
from blast_env.cli import app
from blast_env.cli.command import LazyCommand
from blast_env.evaluation.engines import ENGINE_NAMES, find_engine
from blast_env.gas import GasRun
from blast_env.layout import LayoutFile
from blast_env.particles.event import EventRun
from tests.agents.training_runs import scenario_file
from tests.design.search_cases import small_scenario
from tests.gas_sites import hut

NARROW = 80
WORDS = ("structure", "protected", "first", "impulse", "(Pa", "s)", "perimeter_south", "12", "a")


def run(*arguments: object, columns: int = NARROW) -> Result:
    words = [str(argument) for argument in arguments]
    return CliRunner().invoke(app, words, env={"COLUMNS": str(columns)})


def commands() -> dict[str, LazyCommand]:
    group = typer.main.get_command(app)
    assert isinstance(group, TyperGroup)
    return {
        name: command
        for name, command in group.commands.items()
        if isinstance(command, LazyCommand)
    }


def words_of(text: str) -> set[str]:
    """Return the words of a text, without frames and code marks."""
    return set(text.replace("│", " ").replace("`", "").split())


# Help.


@pytest.mark.parametrize("name", sorted(commands()))
def test_every_word_of_the_help_is_shown(name: str) -> None:
    """Rich takes `[row, column]` for a style of its own, and leaves it out."""
    shown, command = words_of(run(name, "--help").stdout), commands()[name].loaded
    helps = [str(getattr(parameter, "help", None) or "") for parameter in command.params]
    for text in [command.help or "", *helps]:
        assert words_of(text) <= shown


@pytest.mark.parametrize("name", sorted(commands()))
def test_the_list_of_commands_says_what_each_says_first_of_itself(name: str) -> None:
    """The list is shown without importing the commands, and so keeps their first sentences."""
    command = commands()[name]
    assert (command.loaded.help or "").partition("\n\n")[0].replace("\n", " ") == command.help


def test_there_are_at_most_thirteen_commands() -> None:
    assert len(commands()) <= 13


@pytest.mark.parametrize("name", ["simulate", "evaluate", "train"])
def test_help_names_every_engine_and_what_each_can_be_told(name: str) -> None:
    """Both come from the engines: a new one, or a new setting of one, is seen."""
    options = commands()[name].loaded.params
    helps = {option.name: str(getattr(option, "help", "")) for option in options}
    for engine in ENGINE_NAMES:
        assert engine in helps["engine"]
        for setting in find_engine(engine).options:
            if name != "simulate" and setting == "until":
                continue  # elsewhere only the assessed walls are waited for
            assert helps[setting]


# Tables.


@given(
    st.lists(st.lists(st.sampled_from(WORDS), min_size=1, max_size=3), min_size=1, max_size=9),
    st.integers(40, 130),
    st.integers(1, 3),
)
def test_no_word_of_a_table_is_cut(headers: list[list[str]], width: int, text_columns: int) -> None:
    rows = [[" ".join(words[number:]) or "1,234.5" for words in headers] for number in range(3)]
    table = Table.of("title", [" ".join(words) for words in headers], rows, text_columns)
    console = Console(width=width, file=StringIO(), color_system=None)
    console.print(TableView(table))
    lines = console.file.getvalue().splitlines()  # type: ignore[attr-defined]
    assert max(len(line.rstrip()) for line in lines) <= width
    shown = {word for line in lines for word in line.split()}
    assert {word for words in headers for word in words} <= shown


@pytest.mark.parametrize("engine", ["event", "gas"])
def test_the_loads_of_a_blast_are_readable_in_80_columns(engine: str, hut_file: Path) -> None:
    shown = run("simulate", hut_file, "--engine", engine).stdout
    assert shown.startswith(f"engine {engine} ")
    table = shown[: shown.index("ended because")].splitlines()[:-1]
    assert max(map(len, table)) <= NARROW
    assert {"building", "protected", "hut"} <= set(shown.split())
    assert "…" not in shown


# The charge, and what is said of engine and preset.


@pytest.fixture(scope="module")
def hut_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("hut") / "hut.toml"
    save_scenario(hut(), path)
    return path


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scenario with a build zone and a calibration, of which a blast takes a few ms."""
    path = tmp_path_factory.mktemp("site") / "site.toml"
    save_scenario(small_scenario(), path)
    return path


@pytest.fixture(scope="module")
def layout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("layout") / "layout.json"
    path.write_text("[[1, 0], [2, 0]]")
    return path


CHARGE = ("--charge", "5,19,60")


def test_the_charge_is_named_alike_everywhere(site: Path, layout: Path, tmp_path: Path) -> None:
    place = "60 kg TNT at (5.00, 19.00) m"
    shown = run("simulate", site, "--engine", "event", *CHARGE).stdout
    assert place in shown
    given = ("--scenario", site, "--layout", layout, "--seeds", 2, "--engine", "event")
    shown = run("evaluate", *given, *CHARGE).stdout
    assert place in shown
    assert "means over 2 threats" in shown
    options = ("--method", "random", "--budget", 4, "--held-out", 2, "--out", tmp_path / "out")
    result = run("search", "--scenario", site, *options, *CHARGE, "--engine", "event")
    assert result.exit_code == 0, result.output
    threats = LayoutFile.load(tmp_path / "out" / "layout.json").provenance["threats"]
    assert {(*threat["charge_position_m"], threat["tnt_kg"]) for threat in threats} == {
        (5.0, 19.0, 60.0)
    }
    assert {"--charge", "--tnt-kg"} <= words_of(run("search", "--help").stdout)


def test_all_commands_take_a_charge_in_one_form() -> None:
    forms = {
        name: getattr(parameter, "metavar", None)
        for name, command in commands().items()
        for parameter in command.loaded.params
        if "--charge" in parameter.opts
    }
    assert {"simulate", "evaluate", "search", "assess", "advise", "report"} <= {*forms}
    assert {*forms.values()} == {"X,Y[,KG]"}


def test_each_command_says_engine_and_preset(site: Path, layout: Path) -> None:
    given = ("--scenario", site)
    for arguments in (
        ("simulate", site, "--engine", "event"),
        ("evaluate", *given, "--layout", layout, "--seeds", 1, "--engine", "event"),
        ("search", *given, "--method", "wall_near_charge", "--held-out", 1, "--engine", "event"),
    ):
        assert "engine event 1 (numba" in run(*arguments).stdout
        assert "preset ballistic" in " ".join(run(*arguments).stdout.split())


# JSON.


def test_json_is_short_and_the_file_is_complete(site: Path, layout: Path, tmp_path: Path) -> None:
    evaluate = ("evaluate", "--scenario", site, "--layout", layout, "--engine", "event")
    for arguments in (("simulate", site, "--engine", "event"), (*evaluate, "--out", tmp_path)):
        short = json.loads(run(*arguments, "--json").stdout)
        assert "modules" not in short
        assert len(json.dumps(short)) < 5000
    full = json.loads((tmp_path / "evaluation.json").read_text())
    assert {name: full[name] for name in short if name in full} == {
        name: value for name, value in short.items() if name in full
    }
    assert "modules" in full


@pytest.fixture
def interrupted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C at the first blast."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    for run in (EventRun, GasRun):
        monkeypatch.setattr(run, "advance", interrupt)


SEARCH = ("search", "--engine", "event")
EVALUATE = ("evaluate", "--layout", "LAYOUT", "--engine", "event")


@pytest.mark.usefixtures("interrupted")
@pytest.mark.parametrize(
    ("arguments", "resume"),
    [
        ((*SEARCH, "--out", "a/b"), "with --cache FOLDER the blasts would have been kept"),
        ((*SEARCH, "--out", "a", "--cache", "c/d"), "the same command resumes with the blasts"),
        ((*EVALUATE, "--out", "a/b"), "with --cache FOLDER the blasts"),
        ((*EVALUATE, "--cache", "c"), "the same command resumes"),
        (("judge", "--out", "a", "--method", "random"), "the same command resumes"),
        (
            ("calibrate", "--name", "a", "--reference", "paper_ufc", "--engine", "event"),
            "the same command resumes after the finished blasts",
        ),
    ],
)
def test_an_interruption_says_how_to_go_on_and_leaves_no_empty_folder(
    arguments: tuple[str, ...],
    resume: str,
    site: Path,
    layout: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Nor a layout, since a search without a blast has found none: only the store, still empty."""
    monkeypatch.chdir(tmp_path)
    given = () if arguments[0] == "calibrate" else ("--scenario", site)
    result = run(*(layout if argument == "LAYOUT" else argument for argument in arguments), *given)
    assert result.exit_code == 130, result.output
    assert f"interrupted: no file was left half-written; {resume}" in " ".join(
        result.stderr.split()
    )
    left = [*tmp_path.rglob("*")]
    assert all(any(path.iterdir()) for path in left if path.is_dir())
    assert all(path.suffix.startswith(".sqlite") for path in left if path.is_file())


# Runs that were interrupted.


def test_an_interrupted_training_says_how_to_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before the first evaluation there are no weights to evaluate."""
    site, folder = scenario_file(tmp_path), tmp_path / "run"

    def interrupt(self: ValidationCallback) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(ValidationCallback, "_record", interrupt)
    changes = ("n_steps=8", "batch_size=8", "evaluation_interval=1", "evaluation_cases=2")
    options = [text for change in changes for text in ("--set", change)]
    result = run("train", "--scenario", site, "--run", folder, "--envs", 1, *options)
    assert result.exit_code == 130, result.output
    assert f"blast-env train --resume {folder} continues the run" in result.stderr
    monkeypatch.undo()
    result = run("judge", "--run", folder, "--scenario", site)
    assert result.exit_code == 2
    assert "has no weights yet, before its first evaluation" in " ".join(result.stderr.split())
