"""Reading small text files that people write."""

from pathlib import Path
from typing import Final

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
