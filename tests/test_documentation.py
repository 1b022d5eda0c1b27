"""What the documentation shows works: code runs, commands parse, pages that code names exist.

Notebooks run in `make docs`. Commands are parsed and not run: names, options and the types and
bounds of their values. Code that is dear is compiled only.
"""

import doctest
import importlib.util
import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
import typer
from typer import Typer

from blast_env.cli import app
from blast_env.envs import simulator_env

ROOT = Path(__file__).parents[1]
PAGES = (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md")))
TEXTS = {str(page.relative_to(ROOT)): page.read_text(encoding="utf-8") for page in PAGES}

_FENCED = re.compile(r"^```(.*?)\n(.*?)^```", re.MULTILINE | re.DOTALL)
_INDENTED = re.compile(r"(?:^(?: {4}|\t).*\n?)+", re.MULTILINE)
_INLINE = re.compile(r"`((?:blast-env|python\s-m)\s[^`]+)`")
_PROGRAM = re.compile(r"(?:blast-env|python -m (?:scripts|blast_env)\b)")


def code(page: str, language: str) -> list[str]:
    return [block for said, block in _FENCED.findall(TEXTS[page]) if said == language]


WITH_CODE = [page for page in TEXTS if code(page, "python")]
DEAR = {"docs/engineers/gas.md"}
"""Their code is compiled and not run: three blasts of gas dynamics on a large site."""


@pytest.mark.slow
@pytest.mark.parametrize("page", WITH_CODE)
def test_the_code_of_a_page_runs(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From top to bottom, as a reader would try it."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for number, block in enumerate(code(page, "python"), start=1):
        compiled = compile(block, f"{page}, block {number}", "exec")
        if page not in DEAR:
            exec(compiled, names)


def test_there_is_code() -> None:
    assert "README.md" in WITH_CODE
    assert len(WITH_CODE) > 5


@pytest.mark.slow
def test_examples_in_the_environment_s_docstring() -> None:
    failures, tried = doctest.testmod(simulator_env)
    assert tried > 5
    assert failures == 0


@dataclass(frozen=True)
class Command:
    """A command line of a page.

    Attributes:
        page: The page.
        words: Its words.
        in_sentence: Whether it stands in a sentence, which may name a command and an option only.
    """

    page: str
    words: tuple[str, ...]
    in_sentence: bool

    def __str__(self) -> str:
        return f"{self.page}: {' '.join(self.words)}"


def _shell_texts(text: str) -> Iterator[tuple[str, bool]]:
    """Yield what a page shows of commands: blocks, cells of notebooks, and code in sentences."""
    for said, block in _FENCED.findall(text):
        if said in ("sh", "bash") or block.startswith("%%bash\n"):
            yield block, False
    rest = _FENCED.sub("", text)
    for block in _INDENTED.findall(rest):
        yield block, False
    for inline in _INLINE.findall(_INDENTED.sub("", rest)):
        yield inline.replace("\n", " "), True


def _commands(page: str) -> Iterator[Command]:
    for text, in_sentence in _shell_texts(TEXTS[page]):
        for line in text.replace("\\\n", " ").splitlines():
            if _PROGRAM.search(line) is None:
                continue
            lexer = shlex.shlex(line, posix=True, punctuation_chars=True)
            lexer.whitespace_split = True
            words: list[str] = []
            for word in (*lexer, ";"):
                if set(word) <= set(";&|()<>"):
                    if words and words[0] in ("blast-env", "python"):
                        yield Command(page, tuple(words), in_sentence)
                    words = []
                else:
                    words.append(word)


COMMANDS = sorted({each for page in TEXTS for each in _commands(page)}, key=str)


def parse(application: Typer, words: tuple[str, ...], in_sentence: bool) -> None:
    """Parse a command line as it is parsed before the command begins."""
    command = typer.main.get_command(application)
    if words and hasattr(command, "commands"):
        if words[0].startswith("-"):  # --version, and others that would do something
            assert words[0] in {name for option in command.params for name in option.opts}
            return
        assert words[0] in command.commands, f"there is no command {words[0]!r}"
        command, words = command.commands[words[0]], words[1:]
    if in_sentence:
        options = {name for option in command.params for name in option.opts}
        options |= {name for option in command.params for name in option.secondary_opts}
        assert {word for word in words if word.startswith("--")} <= options
        return
    command.make_context("command", list(words))


@pytest.mark.parametrize("command", COMMANDS, ids=str)
def test_a_command_parses(command: Command) -> None:
    words = command.words
    if words[0] == "blast-env":
        parse(app, words[1:], command.in_sentence)
        return
    if words[2].startswith("blast_env"):
        assert importlib.util.find_spec(words[2]) is not None
        return
    module = importlib.import_module(words[2])
    application = getattr(module, "app", None)
    if application is None:
        application = Typer(add_completion=False)
        application.command()(module.main)
    elif len(words) == 3 or words[3].startswith("-"):
        pytest.fail("a script of several commands is named without one")
    parse(application, words[3:], command.in_sentence)


def test_there_are_commands() -> None:
    assert len(COMMANDS) > 60


def test_the_documentation_names_every_command_of_the_studies() -> None:
    named = {each.words[2:4] for each in COMMANDS if each.words[0] == "python"}
    for script in ("engines", "gas", "layouts", "validity", "presets"):
        registered = importlib.import_module(f"scripts.{script}").app.registered_commands
        found = {each.name or each.callback.__name__.replace("_", "-") for each in registered}
        documented = {words[-1] for words in named if words[0] == f"scripts.{script}"}
        # The others are named where their results are used, in the code.
        assert found - documented <= {"noise", "deposit"}


def test_pages_that_code_and_texts_name_exist() -> None:
    texts = dict(TEXTS)
    for folder in ("blast_env", "agents", "scripts", "tests"):
        for suffix in ("*.py", "*.j2"):
            for path in (ROOT / folder).rglob(suffix):
                texts[str(path.relative_to(ROOT))] = path.read_text(encoding="utf-8")
    named = {
        (where, page)
        for where, text in texts.items()
        for page in re.findall(r"(?<!/)docs/[\w/.-]+\.(?:md|png|gif|mp4|csv|toml)", text)
    }
    assert len(named) > 20
    assert {(where, page) for where, page in named if not (ROOT / page).exists()} == set()


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md"])
def test_links_outside_the_site_lead_somewhere(page: str) -> None:
    links = re.findall(r"\]\((?!https?:|#)([^)#]+)", TEXTS[page])
    assert [link for link in links if not (ROOT / link).exists()] == []
