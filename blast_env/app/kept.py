"""What the page keeps in files of its own: whole, or not at all."""

import re
from pathlib import Path
from typing import Final, TypeVar

from pydantic import BaseModel, ConfigDict

from blast_env.documents import check_values, read_text
from blast_env.errors import BlastEnvError
from blast_env.files import write_atomically
from blast_env.gas.settings import Cells

MOST_BYTES: Final = 50_000_000
"""Largest size of a file of the work folder."""


class FileRecord(BaseModel):
    """Base of the records in files: frozen; missing numbers are NaN."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        ser_json_inf_nan="constants",
        ser_json_bytes="base64",
        val_json_bytes="base64",
    )


AnyKept = TypeVar("AnyKept", bound=FileRecord)


class DesignSettings(FileRecord):
    """The settings of a design's page, which its history does not have.

    Attributes:
        cells: The cells of new blasts.
        threats: Names of the chosen threats.
        view: The view opened last.
    """

    cells: Cells
    threats: tuple[str, ...] = ()
    view: str = "Plan"


def write_kept(record: FileRecord, path: Path) -> None:
    """Write a record, the whole file or none."""
    with write_atomically(path) as temporary:
        temporary.write_text(record.model_dump_json(), encoding="utf-8")


def read_kept(kind: type[AnyKept], path: Path) -> AnyKept | None:
    """Return the record in a file, or `None` if it is missing or damaged."""
    try:
        return kind.model_validate_json(check_values(read_text(path, MOST_BYTES)))
    except ValueError:
        return None


def check_key(key: str) -> str:
    """Return the name of a folder from outside, once it is checked."""
    if re.fullmatch(r"[A-Za-z0-9_-]{1,100}", key) is None:  # longer ones are no names of folders
        raise BlastEnvError(f"{key[:100]!r} is no name of a design or a blast")
    return key
