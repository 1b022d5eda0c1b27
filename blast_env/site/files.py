"""Scenario files."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import tomli_w

from blast_env.bundled import SCENARIO_SUFFIX, bundled_scenarios, scenario_folder
from blast_env.documents import DocumentError, parse_toml, read_text
from blast_env.errors import BlastEnvError
from blast_env.files import write_text
from blast_env.problems import Problem, ScenarioError, unknown_name
from blast_env.site.models import Scenario
from blast_env.values import path_of

SUFFIX: Final = SCENARIO_SUFFIX


def load_scenario(name_or_path: str | Path) -> Scenario:
    """Return a scenario.

    Args:
        name_or_path: The name of a bundled scenario, or the path of a `.toml` file. A text with
            neither a suffix nor a folder is a name.

    Raises:
        ScenarioError: If there is no such scenario, or it is invalid; the error has all problems.
    """
    path = _located(name_or_path)
    try:
        text = read_text(path)
    except DocumentError as error:
        raise ScenarioError(str(path), [Problem(error.place, error.message)]) from error
    return parse_scenario(text, str(path))


AnyScenario = Scenario | str | Path | Mapping[str, Any]
"""A scenario, its bundled name, the path of its file, or the file's content as plain data."""


def find_scenario(scenario: AnyScenario) -> Scenario:
    """Return a scenario from any of its forms.

    Args:
        scenario: A scenario, which is returned unchanged, an argument of `load_scenario`, or plain
            data of the form of `Scenario.model_dump(mode="json", exclude_none=True)`.

    Raises:
        ScenarioError: If there is no such scenario, or it is invalid.
        BlastEnvError: If the argument has another type.
    """
    if isinstance(scenario, Scenario):
        return scenario
    if isinstance(scenario, Mapping):
        return Scenario.from_document(scenario, str(scenario.get("name", "scenario")))
    if not isinstance(scenario, str | Path):
        raise BlastEnvError(f"scenario is {scenario!r}, must be a name, a path or a Scenario")
    return load_scenario(scenario)


def parse_scenario(text: str, source: str) -> Scenario:
    """Return the scenario of the text of a file.

    Args:
        text: TOML.
        source: Name of the file, for the error.

    Raises:
        ScenarioError: If it is invalid; the error has all problems.
    """
    try:
        document = parse_toml(text)
    except DocumentError as error:
        raise ScenarioError(source, [Problem(error.place, error.message)]) from error
    return Scenario.from_document(document, source)


def find_problems(name_or_path: str | Path) -> tuple[Problem, ...]:
    """Return the problems of a scenario; none if it is valid.

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

    An existing file is replaced as a whole, and stays unchanged if there is an error.

    Args:
        scenario: The scenario, or its bundled name or path, for a copy as a starting point.
        path: The `.toml` file.

    Raises:
        ScenarioError: If there is no such scenario, or it could not be read back: it is invalid
            after `model_copy`, or the path has another suffix.
        BlastEnvError: If the file cannot be written.
    """
    if path_of(path).suffix != SUFFIX:
        raise ScenarioError(str(path), [Problem("", f"must be a {SUFFIX} file")])
    document = find_scenario(scenario).model_dump(mode="json", exclude_none=True)
    Scenario.from_document(document, str(path))
    write_text(path, tomli_w.dumps(document))


def scenario_hash(scenario: AnyScenario) -> str:
    """Return the SHA-256 of all parts of a scenario that affect results.

    Args:
        scenario: The scenario, or its bundled name or path.
    """
    return find_scenario(scenario).content_hash


def _located(name_or_path: str | Path) -> Path:
    """Return the path of the file of a name or path."""
    try:
        path = path_of(name_or_path)
    except BlastEnvError as error:
        raise ScenarioError("scenario", [Problem("", str(error))]) from error
    is_folder = os.path.isdir(path)
    if path.name == str(name_or_path) and not path.suffix:
        bundled = scenario_folder() / f"{path.name}{SUFFIX}"
        if os.path.isfile(bundled):
            return bundled
        if not is_folder:
            message = unknown_name("bundled scenario", path.name, bundled_scenarios())
            raise ScenarioError(path.name, [Problem("", message)])
    if path.suffix != SUFFIX and not is_folder:
        raise ScenarioError(str(path), [Problem("", f"must be a {SUFFIX} file")])
    return path
