"""Reading small text files that people write."""

import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, Self, overload

import tomli_w

from blast_env.errors import BlastEnvError
from blast_env.files import write_atomically
from blast_env.scenario.models import Scenario
from blast_env.scenario.problems import Problem, ScenarioError, shortened, unknown_name

MAX_BYTES: Final = 1_000_000
"""Larger files are refused: they are something else that was named by mistake."""


def read_text(path: Path) -> str:
    """Return the text of a UTF-8 file; a byte order mark is dropped.

    Raises:
        ValueError: If it cannot be read; the message says why, without the name of the file.
    """
    try:
        if path.is_dir():
            raise ValueError("is a folder, must be a file")
        if not path.exists():
            raise ValueError("there is no such file")
        if not path.is_file():
            raise ValueError("is not a regular file")
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror or error}") from error
    if len(content) > MAX_BYTES:
        raise ValueError(f"has {path.stat().st_size} bytes, must have at most {MAX_BYTES}")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        byte = content[error.start]
        raise ValueError(f"line {line}: is not UTF-8 text: byte 0x{byte:02x}") from error


SUFFIX: Final = ".toml"


def bundled_scenarios() -> tuple[str, ...]:
    """Return the names of the scenarios that come with the package."""
    return tuple(sorted(path.stem for path in _bundled_folder().glob(f"*{SUFFIX}")))


def load_scenario(name_or_path: str | Path) -> Scenario:
    """Return a scenario.

    Args:
        name_or_path: The name of a bundled scenario, or the path of a `.toml` file. What has
            neither a suffix nor a folder is a name.

    Raises:
        ScenarioError: If there is no such scenario, or if anything is wrong with it; all its
            problems are in the error.
    """
    path = _located(name_or_path)
    try:
        text = read_text(path)
    except ValueError as error:
        raise ScenarioError(str(path), [Problem("", str(error))]) from error
    return parse_scenario(text, str(path))


AnyScenario = Scenario | str | Path | Mapping[str, Any]
"""What a user may call a scenario: itself, its bundled name, the path of its file, or what such a
file says as plain data."""


def find_scenario(scenario: AnyScenario) -> Scenario:
    """Return the scenario that a user means.

    Args:
        scenario: A scenario, which is returned as it is, what `load_scenario` takes, or plain data
            as `Scenario.model_dump(mode="json", exclude_none=True)` gives it.

    Raises:
        ScenarioError: If there is no such scenario, or anything is wrong with it.
        BlastEnvError: If it is anything else.
    """
    if isinstance(scenario, Scenario):
        return scenario
    if isinstance(scenario, Mapping):
        return Scenario.from_document(scenario, str(scenario.get("name", "scenario")))
    if not isinstance(scenario, str | Path):
        raise BlastEnvError(f"scenario is {scenario!r}, must be a name, a path or a Scenario")
    return load_scenario(scenario)


class ScenarioField:
    """A field of a dataclass that is set to whatever a user calls a scenario, and is a scenario.

    It raises what `find_scenario` raises when the dataclass is made.
    """

    def __set_name__(self, owner: type, name: str) -> None:
        """Take the name of the field."""
        self._name = name

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...

    @overload
    def __get__(self, instance: object, owner: type) -> Scenario: ...

    def __get__(self, instance: object | None, owner: type) -> "Scenario | Self":
        """Return the scenario; to the class itself there is none, so that the field is required."""
        if instance is None:
            raise AttributeError(self._name)
        found: Scenario = instance.__dict__[self._name]
        return found

    def __set__(self, instance: object, scenario: AnyScenario) -> None:
        """Load the scenario, if it is a name or a path."""
        instance.__dict__[self._name] = find_scenario(scenario)


def parse_scenario(text: str, source: str) -> Scenario:
    """Return the scenario that the text of a file describes.

    Args:
        text: TOML.
        source: Name of the file, for the error.

    Raises:
        ScenarioError: If anything is wrong; all problems are in the error.
    """
    try:
        document = tomllib.loads(text)
    except RecursionError as error:
        problem = Problem(f"line {_deepest_line(text)}", "is nested too deeply")
        raise ScenarioError(source, [problem]) from error
    except ValueError as error:
        raise ScenarioError(source, [_syntax_problem(str(error), text)]) from error
    return Scenario.from_document(document, source)


def find_problems(name_or_path: str | Path) -> tuple[Problem, ...]:
    """Return everything that is wrong with a scenario; nothing if it can be used.

    Args:
        name_or_path: As for `load_scenario`.
    """
    try:
        load_scenario(name_or_path)
    except ScenarioError as error:
        return error.problems
    return ()


def save_scenario(scenario: AnyScenario, path: str | Path) -> None:
    """Write a scenario to a file that `load_scenario` reads back as an equal scenario.

    The file is replaced as a whole: after an error the old one is untouched.

    Args:
        scenario: The scenario, or its bundled name or path: a copy to begin one's own with.
        path: The file; a `.toml` file.

    Raises:
        ScenarioError: If there is no such scenario, or it could not be read back: one that
            `model_copy` made unsound, or a name that is not a `.toml` file's.
        BlastEnvError: If the file cannot be written.
    """
    if Path(path).suffix != SUFFIX:
        raise ScenarioError(str(path), [Problem("", f"must be a {SUFFIX} file")])
    document = find_scenario(scenario).model_dump(mode="json", exclude_none=True)
    Scenario.from_document(document, str(path))
    content = tomli_w.dumps(document)
    with write_atomically(path) as temporary:
        temporary.write_text(content, encoding="utf-8", newline="\n")


def scenario_hash(scenario: AnyScenario) -> str:
    """Return the SHA-256 of everything in a scenario that affects a result.

    Args:
        scenario: The scenario, or its bundled name or path.
    """
    return find_scenario(scenario).content_hash


def _bundled_folder() -> Path:
    """Return the folder of the bundled scenarios: inside the package, or beside it."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "scenarios"
    return installed if installed.is_dir() else package.parent / "scenarios"


def _located(name_or_path: str | Path) -> Path:
    """Return the path of the file that a name or path stands for."""
    path = Path(name_or_path)
    is_folder = os.path.isdir(path)
    if path.name == str(name_or_path) and not path.suffix:
        known = bundled_scenarios()
        if path.name in known:
            return _bundled_folder() / f"{path.name}{SUFFIX}"
        if not is_folder:
            message = unknown_name("bundled scenario", path.name, known)
            raise ScenarioError(path.name, [Problem("", message)])
    if path.suffix != SUFFIX and not is_folder:
        raise ScenarioError(str(path), [Problem("", f"must be a {SUFFIX} file")])
    return path


def _deepest_line(text: str) -> int:
    """Return the number of the line with the most open brackets."""
    depth = 0
    depths = [0]
    for line in text.split("\n"):
        depth += sum(line.count(bracket) for bracket in "[{")
        depths.append(depth)
        depth -= sum(line.count(bracket) for bracket in "]}")
    return depths.index(max(depths))


def _syntax_problem(message: str, text: str) -> Problem:
    """Return the problem for a message of the TOML parser, with its place as the key."""
    match = re.fullmatch(r"(.*) \(at (?:line (\d+), column (\d+)|end of document)\)", message, re.S)
    if match is None:
        # The only error without a place: an integer that Python refuses to read.
        digits = re.search(r"[0-9_]{1000,}", text)
        number = text.count("\n", 0, digits.start() if digits else len(text)) + 1
        what = shortened(message.split(";")[0], 200)
        return Problem(f"line {number}", f"is not usable: {what}")
    what, line, column = match.groups()
    if line is None:
        lines = text.split("\n")
        line, column = str(len(lines)), str(len(lines[-1]) + 1)
    place = f"line {line}, column {column}"
    return Problem(place, f"is not TOML: {shortened(what, 200)}")
