"""Results of long work, one JSON object per line, from which interrupted work resumes."""

import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Final, Generic, TypeVar

from blast_env.documents import DocumentError, parse_json_lines, read_text
from blast_env.errors import BlastEnvError
from blast_env.files import sync

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

MOST_BYTES: Final = 100_000_000
"""Largest size of a file: some hundred thousand results."""

Result = TypeVar("Result", bound="DataclassInstance")


@dataclass(frozen=True)
class Journal(Generic[Result]):
    """A file of results.

    Attributes:
        path: The file; it need not exist.
        kind: The dataclass of a line, which pydantic can check.
    """

    path: Path
    kind: type[Result]

    def read(self) -> list[Result]:
        """Return the results; none if there is no such file.

        A last line that was cut short is left out, so that its work is done again.

        Raises:
            BlastEnvError: If a line is not of this kind; the message has file, line, key and bound.
        """
        if not self.path.exists():
            return []
        try:
            return list(parse_json_lines(read_text(self.path, MOST_BYTES), self.kind))
        except DocumentError as error:
            raise BlastEnvError(f"{self.path}: {error}") from error

    def add(self, result: Result) -> None:
        """Add a result, after cutting off a last line that was left unfinished.

        Raises:
            BlastEnvError: If the file cannot be written.
        """
        line = json.dumps(asdict(result), allow_nan=False) + "\n"
        is_new = not self.path.exists()
        try:
            with self.path.open("ab+") as file:
                _cut_unfinished_line(file)
                file.write(line.encode())
                file.flush()
                os.fsync(file.fileno())
            if is_new:
                sync(self.path.parent)
        except OSError as error:
            reason = error.strerror or error
            raise BlastEnvError(f"{self.path}: cannot be written: {reason}") from error


def _cut_unfinished_line(file: IO[bytes]) -> None:
    size = file.seek(0, os.SEEK_END)
    if size == 0:
        return
    file.seek(size - 1)
    if file.read(1) == b"\n":
        return
    file.seek(0)
    file.truncate(file.read().rfind(b"\n") + 1)
