"""The calibrations that come with the package, and calibration files."""

import json
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from blast_env.atomic import write_atomically
from blast_env.calibration.model import Calibration, CalibrationError
from blast_env.errors import UnknownNameError
from blast_env.scenario import Scenario

SUFFIX: Final = ".json"


def stored_calibrations() -> tuple[str, ...]:
    """Return the names of the calibrations that come with the package."""
    return tuple(sorted({name for name, _ in _stored_files()}))


def calibrated_engines(name: str) -> tuple[str, ...]:
    """Return the engines for which a calibration of that name comes with the package."""
    return tuple(sorted(engine for stored, engine in _stored_files() if stored == name))


def calibration_file(name: str, engine: str) -> str:
    """Return the name of the file of a calibration: each engine has its own."""
    return f"{name}.{engine}{SUFFIX}"


def load_calibration(name_or_path: str | Path, engine: str | None = None) -> Calibration:
    """Return a calibration by its name in the package, or from a `.json` file.

    Args:
        name_or_path: The name, or the file.
        engine: With a name: the engine whose calibration it is. By default the reference
            engine, pymunk, where there is one for it.

    Raises:
        UnknownNameError: If there is none of that name.
        CalibrationError: If there is none for that engine, or the file cannot be read, was cut
            short or was edited.
    """
    path = Path(name_or_path)
    if path.suffix != SUFFIX:
        name, known = str(name_or_path), stored_calibrations()
        if name not in known:
            raise UnknownNameError("calibration", name, known)
        engines = calibrated_engines(name)
        engine = engine or ("pymunk" if "pymunk" in engines else engines[0])
        if engine not in engines:
            raise CalibrationError(
                f"calibration {name!r} was not made for engine {engine!r}, only for "
                f"{', '.join(engines)}"
            )
        entry = files("blast_env.calibration") / "stored" / calibration_file(name, engine)
        return _parse(entry.read_text(encoding="utf-8"), f"{name} for {engine}")
    try:
        return _parse(path.read_text(encoding="utf-8"), str(path))
    except (OSError, UnicodeDecodeError) as error:
        raise CalibrationError(f"{path}: cannot be read: {error}") from error


def scenario_calibration(scenario: Scenario, engine: str) -> Calibration:
    """Return the calibration that a scenario names, checked against its parameters.

    Args:
        scenario: The scenario.
        engine: Name of the engine that runs its blasts.

    Raises:
        CalibrationError: If the scenario names no calibration, or one that was made with other
            parameters or another engine.
        UnknownNameError: If there is no calibration of that name.
    """
    if scenario.calibration is None:
        raise CalibrationError(
            f"scenario {scenario.name!r} names no calibration: set calibration to one of "
            f"{', '.join(stored_calibrations())}"
        )
    calibration = load_calibration(scenario.calibration, engine)
    calibration.check(scenario.parameters, engine)
    return calibration


def save_calibration(calibration: Calibration, path: Path) -> None:
    """Write a calibration to a file, with a checksum that shows later edits.

    Raises:
        BlastEnvError: If it cannot be written.
    """
    content = calibration.model_dump(mode="json")
    document = {**content, "checksum": _checksum(content)}
    with write_atomically(path) as temporary:
        temporary.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")


def _stored_files() -> tuple[tuple[str, str], ...]:
    """Return name and engine of the calibrations that come with the package."""
    folder = files("blast_env.calibration") / "stored"
    stems = (entry.name.removesuffix(SUFFIX) for entry in folder.iterdir())
    pairs = (stem.rpartition(".") for stem in stems)
    return tuple((name, engine) for name, _, engine in pairs if name)


def _parse(text: str, source: str) -> Calibration:
    try:
        document = json.loads(text)
    except json.JSONDecodeError as error:
        raise CalibrationError(
            f"{source}: line {error.lineno}: is not JSON ({error.msg}): was it cut short?"
        ) from error
    if not isinstance(document, dict):
        raise CalibrationError(f"{source}: is not a calibration")
    checksum = document.pop("checksum", None)
    if checksum != _checksum(document):
        raise CalibrationError(
            f"{source}: the checksum does not match: the file was edited after it was made"
        )
    try:
        return Calibration.model_validate_json(json.dumps(document))
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise CalibrationError(f"{source}: {key}: {first['msg']}") from error


def _checksum(content: dict[str, Any]) -> str:
    return sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
