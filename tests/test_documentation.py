"""Code of the documentation and examples run, commands parse, pages that code names exist.

`make docs` runs the commands, the notebooks, and what code is dear (tests.documentation.run). Here
commands are parsed: names, options and the types and bounds of their values.
"""

import ast
import doctest
import importlib.util
import re
import runpy
import shlex
from pathlib import Path
from textwrap import dedent
from types import ModuleType

import gymnasium as gym
import pytest
import typer
from typer import Typer

from blast_env.cli import app
from blast_env.envs import barrier_env, simulator_env
from tests.documentation import exceptions
from tests.documentation.pages import (
    COMMANDS,
    OURS,
    ROOT,
    STEPS,
    TEXTS,
    Code,
    commands_in,
    indented_blocks,
    languages,
    shell_blocks,
)

CODE = {page: [step for step in STEPS[page] if isinstance(step, Code)] for page in STEPS}
WITH_CODE = [page for page in CODE if CODE[page]]


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("page", WITH_CODE)
def test_the_code_of_a_page_runs(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From top to bottom, as a reader would try it."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in CODE[page]:
        shorter = exceptions.CODE_SHORTENED.get((page, block.number), ("", ""))
        assert shorter[0] in block.source
        compiled = compile(block.source.replace(*shorter), str(block), "exec")
        known = (page, block.number) in exceptions.CODE_NOT_RUN
        if page not in exceptions.CODE_OF_THE_BUILD and not known:
            exec(compiled, names)


@pytest.mark.slow
@pytest.mark.parametrize("module", [barrier_env, simulator_env])
def test_examples_in_docstrings_of_environments(module: ModuleType) -> None:
    failures, tried = doctest.testmod(module)
    assert tried > 5
    assert failures == 0


def parse(application: Typer, words: tuple[str, ...], in_sentence: bool) -> None:
    """Parse a command line as it is parsed before the command begins."""
    command = typer.main.get_command(application)
    if words and hasattr(command, "commands"):
        if words[0].startswith("-"):  # --version, and others that would do something
            assert words[0] in {name for option in command.params for name in option.opts}
            return
        assert words[0] in command.commands, f"there is no command {words[0]!r}"
        command, words = command.commands[words[0]], words[1:]
        command = getattr(command, "loaded", command)  # ours are imported when they are called
    if in_sentence:
        options = {name for option in command.params for name in option.opts}
        options |= {name for option in command.params for name in option.secondary_opts}
        assert {word for word in words if word.startswith("--")} <= options
        return
    command.make_context("command", list(words))


def _main_of(name: str) -> str:
    """Return the module that `python -m` runs: of a package, the one inside."""
    found = importlib.util.find_spec(name)
    inside = found is not None and found.submodule_search_locations is not None
    return f"{name}.__main__" if inside else name


def parse_command(words: tuple[str, ...], in_sentence: bool = False) -> None:
    if words[0] == "blast-env":
        parse(app, words[1:], in_sentence)
        return
    package = words[2].partition(".")[0]
    if package == "blast_env" or shlex.join(words) in exceptions.NOT_RUN:
        elsewhere = package not in ("blast_env", "studies", "tests")
        assert elsewhere or importlib.util.find_spec(words[2]) is not None
        return
    module = importlib.import_module(_main_of(words[2]))
    application = getattr(module, "app", None)
    if application is None:
        application = Typer(add_completion=False)
        application.command()(module.main)
    elif len(words) == 3 or words[3].startswith("-"):
        pytest.fail("a script of several commands is named without one")
    parse(application, words[3:], in_sentence)


OUR_COMMANDS = [command for command in COMMANDS if command.words[0] in OURS]
LINES = {our_command.line for our_command in OUR_COMMANDS if not our_command.is_name}


@pytest.mark.parametrize("page", sorted({our_command.page for our_command in OUR_COMMANDS}))
def test_the_commands_of_a_page_parse(page: str) -> None:
    for command in OUR_COMMANDS:
        if command.page == page:
            print(command)
            parse_command(command.words, command.in_sentence)


def test_what_runs_in_the_place_of_commands_parses() -> None:
    for line, added in exceptions.SMALLER.items():
        print(line)
        parse_command((*shlex.split(line), *shlex.split(added)))


def test_exceptions_stand_for_commands_and_code_that_the_pages_show() -> None:
    shown = {command.line for command in COMMANDS}
    assert {*exceptions.SMALLER, *exceptions.NOT_RUN} <= LINES
    assert {*exceptions.SERVERS} <= shown
    blocks = {(case.page, case.number) for page in CODE for case in CODE[page]}
    assert {*exceptions.CODE_NOT_RUN, *exceptions.CODE_SHORTENED} <= blocks
    assert {*exceptions.CODE_OF_THE_BUILD} <= {*WITH_CODE}
    assert {*exceptions.BACKGROUND} | {
        page for block in exceptions.GIVEN for page in block.pages
    } <= {*STEPS}


def test_what_pages_take_for_granted_they_name() -> None:
    for given in exceptions.GIVEN:
        for page in given.pages:
            assert given.path in TEXTS[page], given.path


def test_no_line_of_a_block_of_commands_is_overlooked() -> None:
    for block in shell_blocks():
        for line in filter(str.strip, block.splitlines()):
            assert [*commands_in("page", line)], line


def test_code_says_its_language_so_that_it_is_not_overlooked() -> None:
    # pycon is a doctest of a docstring, yaml the settings of another package.
    known = {"python", "sh", "toml", "json", "pycon", "yaml"}
    assert {said for said in languages() if not said.startswith("{")} == known
    for page, block in indented_blocks():
        with pytest.raises(SyntaxError):
            compile(dedent(block), page, "exec")


def test_the_documentation_names_every_command_of_the_studies() -> None:
    named = {command.words[2:4] for command in COMMANDS if command.words[0] == "python"}
    for script in ("gas",):
        registered = importlib.import_module(_main_of(f"studies.{script}")).app.registered_commands
        found = {
            registered_command.name or registered_command.callback.__name__.replace("_", "-")
            for registered_command in registered
        }
        documented = {words[-1] for words in named if words[0] == f"studies.{script}"}
        assert found <= documented


def test_files_that_code_and_texts_name_exist() -> None:
    texts = dict(TEXTS)
    for folder in ("blast_env", "agents", "studies", "tests"):
        for suffix in ("*.py", "*.j2"):
            for path in (ROOT / folder).rglob(suffix):
                texts[str(path.relative_to(ROOT))] = path.read_text(encoding="utf-8")
    named = {
        (where, page)
        for where, text in texts.items()
        for page in re.findall(
            r"(?<![\w/])(?:docs/[\w/.-]+\.(?:md|png|gif|mp4|csv|toml)"
            r"|(?:tests|studies|blast_env|agents|examples)/[\w/.-]+\.py)\b",
            text,
        )
    }
    assert len(named) > 20
    assert {(where, page) for where, page in named if not (ROOT / page).exists()} == set()


def test_pages_include_tables_that_exist_and_every_table() -> None:
    included = set()
    for page, text in TEXTS.items():
        for path in re.findall(r"^(?:```\{include\}|:file:) (\S+)$", text, re.MULTILINE):
            included.add((ROOT / page).parent.joinpath(path).resolve())
    assert included == {*(ROOT / "docs" / "studies" / "tables").iterdir()}


def test_the_site_knows_the_packages_whose_names_pages_list() -> None:
    """The build stops otherwise; it has libraries that the tests do not need."""
    known = re.search(
        r"^PUBLIC: Final = (\(.*?^\))$", (ROOT / "docs/conf.py").read_text(), re.M | re.S
    )
    listed = {
        name
        for text in TEXTS.values()
        for name in re.findall(r"^<!-- names of (\S+) -->", text, re.M)
    }
    assert known is not None
    assert listed == {*ast.literal_eval(known[1])}


def test_the_page_of_the_environments_names_every_id() -> None:
    page = TEXTS["docs/researchers/environment.md"]
    ids = [name for name, spec in gym.registry.items() if "blast_env" in str(spec.entry_point)]
    assert [name for name in ids if f"`{name}`" not in page] == []


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md"])
def test_links_outside_the_site_lead_somewhere(page: str) -> None:
    links = re.findall(r"\]\((?!https?:|#)([^)#]+)", TEXTS[page])
    assert [link for link in links if not (ROOT / link).exists()] == []


# --- The examples of a newcomer run as they are, in a folder of their own.


EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))
_MOST_LINES = 40


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs_and_prints_a_result(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", [str(path), "16"])  # the budget of those that take one
    runpy.run_path(str(path), run_name="__main__")
    assert "%" in capsys.readouterr().out


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_fits_on_a_screen(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) <= _MOST_LINES
