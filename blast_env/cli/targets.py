"""The targets of a command: checked before its work, tidied up after it."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from blast_env.errors import BlastEnvError

PICTURES = (".png", ".svg", ".pdf")
"""Suffixes of pictures, equal to `rendering.figures.FIGURE_SUFFIXES`, without its extra."""


class Target(NamedTuple):
    """A file or folder that a command is to write.

    Attributes:
        option: The option that names it.
        path: Its path.
        suffixes: The allowed suffixes of a file; none for a folder.
    """

    option: str
    path: Path
    suffixes: tuple[str, ...]


@contextmanager
def checked_targets(targets: Sequence[Target]) -> Iterator[None]:
    """Refuse unusable targets before the block, and remove new empty folders after it.

    So no result is lost because it cannot be written, and a command that fails or is interrupted
    leaves no empty folders. Two options may not name one file.
    """
    known: dict[Path, str] = {}
    for option, path, suffixes in targets:
        if not suffixes:
            _check_folder(option, path)
            continue
        _check_file(option, path, suffixes)
        same = known.setdefault(path.resolve(), option)
        if same != option:
            raise BlastEnvError(f"{same} and {option} are the same file, {path}")
    folders = [each.path for each in targets if not each.suffixes]
    before = {folder: _missing_above(folder) for folder in folders}
    present = {path for folder in before for path in _folders_in(folder)}
    try:
        yield
    finally:
        for folder, missing in before.items():
            for path in (*_folders_in(folder), *missing):
                if path not in present:
                    with suppress(OSError):  # it is not empty, or was never created
                        path.rmdir()


def _check_file(option: str, path: Path, suffixes: Sequence[str]) -> None:
    if path.suffix.lower() not in suffixes:
        must_be = suffixes[0] if len(suffixes) == 1 else f"one of {', '.join(suffixes)}"
        raise BlastEnvError(f"{option} {path}: suffix is {path.suffix!r}, must be {must_be}")
    if path.is_dir():
        raise BlastEnvError(f"{option} {path}: is a folder, must be a file")
    folder = path.resolve().parent
    if not folder.is_dir():
        raise BlastEnvError(f"{option} {path}: there is no folder {str(folder)!r} to write it to")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise BlastEnvError(f"{option} {path}: the folder {str(folder)!r} cannot be written to")


def _check_folder(option: str, folder: Path) -> None:
    present = folder.resolve()
    while not present.exists():
        present = present.parent
    if not present.is_dir():
        raise BlastEnvError(f"{option} {folder}: cannot be a folder: {str(present)!r} is a file")
    if not os.access(present, os.W_OK | os.X_OK):
        raise BlastEnvError(f"{option} {folder}: the folder {str(present)!r} cannot be written to")


def _missing_above(folder: Path) -> list[Path]:
    """Return the missing folders among a folder and its parents, the lowest first."""
    path, missing = folder.resolve(), []
    while not path.exists():
        missing.append(path)
        path = path.parent
    return missing


def _folders_in(folder: Path) -> list[Path]:
    """Return a folder and all folders below it, the lowest first."""
    return [Path(place) for place, _, _ in os.walk(folder.resolve(), topdown=False)]
