"""Commands and code of the pages, in the order in which a reader meets them."""

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[2]
_FILES: Final = (
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").rglob("*.md")),
)
TEXTS: Final = {str(page.relative_to(ROOT)): page.read_text(encoding="utf-8") for page in _FILES}

OURS: Final = ("blast-env", "python")
"""Programs whose command lines are parsed, and run unless an exception says otherwise."""

OTHERS: Final = {
    "pip": "needs an index of packages",
    "make": "sets up, tests or builds the documentation itself",
    "source": "changes the shell that it is given to",
    "mkdir": "belongs to docker",
    "docker": "no container tool here",
    "dask": "runs until it is stopped; tests/test_cluster.py has a cluster",
    "sbatch": "needs Slurm",
    "tensorboard": "runs until it is stopped",
}
"""Other programs that pages show, and why their lines are not run."""

_PROGRAM: Final = re.compile(r"(?:blast-env|python -m)\b")
_CELL_OF_COMMANDS: Final = "%%bash\n"
_PIECE: Final = re.compile(
    r"^```(?P<language>[^\n]*)\n(?P<fenced>.*?)^```"
    r"|(?P<indented>(?:^(?: {4}|\t)[^\n]*\n?)+)"
    r"|`(?P<inline>(?:blast-env|python\s-m)\s[^`]+)`",
    re.MULTILINE | re.DOTALL,
)


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
    in_sentence: bool = False

    @property
    def line(self) -> str:
        """The command line, spaced as a shell would have it."""
        return shlex.join(self.words)

    @property
    def is_name(self) -> bool:
        """Whether a sentence names a command, and perhaps an option, that it does not give."""
        if not self.in_sentence:
            return False
        if self.words[0] == "python":
            return self.words[1:] == ("-m", "blast_env")
        if len(self.words) == 2:
            return not self.words[1].startswith("-")
        named = ("--run", "--export", "--cluster", "--screen", "--capacity")
        return self.words[2:] in [(name,) for name in named]

    def __str__(self) -> str:
        return f"{self.page}: {' '.join(self.words)}"


@dataclass(frozen=True)
class Code:
    """A block of Python code of a page.

    Attributes:
        page: The page.
        number: Which of its blocks, from 1.
        source: The code.
    """

    page: str
    number: int
    source: str

    def __str__(self) -> str:
        return f"{self.page}: Python, block {self.number}"


@dataclass(frozen=True)
class Cell:
    """A cell of commands of a notebook, which runs as a whole.

    Attributes:
        page: The page.
        source: Its commands.
    """

    page: str
    source: str

    def __str__(self) -> str:
        return f"{self.page}: {self.source.splitlines()[0]} ..."


Step = Command | Code | Cell


def steps(page: str, text: str) -> Iterator[Step]:
    """Yield what a page shows to be run, from top to bottom.

    Python code of notebooks is left out: the documentation's build runs it.
    """
    number = 0
    for piece in _PIECE.finditer(text):
        fenced, language = piece["fenced"], piece["language"]
        if language == "python":
            number += 1
            yield Code(page, number, fenced)
        elif fenced is not None and fenced.startswith(_CELL_OF_COMMANDS):
            yield Cell(page, fenced.removeprefix(_CELL_OF_COMMANDS))
        elif language in ("sh", "bash"):
            yield from commands_in(page, fenced)
        elif piece["indented"] and _begins_as_command(piece["indented"]):
            yield from commands_in(page, piece["indented"])
        elif piece["inline"]:
            yield from commands_in(page, piece["inline"].replace("\n", " "), in_sentence=True)


def shell_blocks() -> Iterator[str]:
    """Yield the blocks of commands of all pages, without comments and continued lines."""
    for text in TEXTS.values():
        for piece in _PIECE.finditer(text):
            shell = piece["fenced"] if piece["language"] in ("sh", "bash") else piece["indented"]
            if shell and (piece["fenced"] or _begins_as_command(shell)):
                yield re.sub(r"(^|\s)#.*", "", shell.replace("\\\n", " "))


def _begins_as_command(text: str) -> bool:
    return text.split(maxsplit=1)[:1] in [[program] for program in (*OURS, *OTHERS)]


def commands_in(page: str, text: str, in_sentence: bool = False) -> Iterator[Command]:
    """Yield the command lines of a text that a shell would read."""
    for line in text.replace("\\\n", " ").splitlines():
        if _PROGRAM.search(line) is None and not _begins_as_command(line):
            continue
        lexer = shlex.shlex(line, posix=True, punctuation_chars=True)
        lexer.whitespace_split = True
        words: list[str] = []
        for word in (*lexer, ";"):
            if set(word) <= set(";&|()<>"):
                if words and words[0] in (*OURS, *OTHERS):
                    yield Command(page, tuple(words), in_sentence)
                words = []
            else:
                words.append(word)


def commands(page: str, text: str) -> Iterator[Command]:
    """Yield the command lines of a page, those in cells of notebooks too."""
    for step in steps(page, text):
        if isinstance(step, Command):
            yield step
        elif isinstance(step, Cell):
            yield from commands_in(page, step.source)


def languages() -> set[str]:
    """Return what fenced blocks say of their language."""
    found = (piece["language"] for text in TEXTS.values() for piece in _PIECE.finditer(text))
    return {said.split()[0] if said else said for said in found if said is not None}


def indented_blocks() -> Iterator[tuple[str, str]]:
    """Yield the indented blocks that are no commands, with their pages."""
    for page, text in TEXTS.items():
        for piece in _PIECE.finditer(text):
            if piece["indented"] and not _begins_as_command(piece["indented"]):
                yield page, piece["indented"]


STEPS: Final[dict[str, tuple[Step, ...]]] = {
    page: tuple(steps(page, text)) for page, text in TEXTS.items()
}
COMMANDS: Final = sorted(
    {command for page, text in TEXTS.items() for command in commands(page, text)}, key=str
)
