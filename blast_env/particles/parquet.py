"""The collision table as Parquet, with the run record, the units and the meanings in the file."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from blast_env.documents import parse_json
from blast_env.errors import BlastEnvError, shortened
from blast_env.files import write_atomically
from blast_env.particles.tables import COLLISION_COLUMNS, RecordedBlast, RunRecord
from blast_env.tables import Column
from blast_env.values import path_of

METADATA_KEY: Final = b"blast_env"
"""Key of the run record, as JSON, in the metadata of the file."""

SUFFIX: Final = ".parquet"


def write_parquet(blast: RecordedBlast, path: str | Path) -> Path:
    """Write the collision table, exact to the last bit, with the run record in the metadata.

    The metadata of each field has its `unit` and its `meaning`. The file is written whole or not
    at all.

    Args:
        blast: The blast.
        path: The file, with the suffix `.parquet`; an existing one is replaced.

    Returns:
        The path.

    Raises:
        BlastEnvError: If the suffix is wrong or the file cannot be written there.
    """
    return write_table(blast.collisions, COLLISION_COLUMNS, blast.run_record, path)


def write_table(
    frame: pd.DataFrame, columns: Sequence[Column], record: RunRecord, path: str | Path
) -> Path:
    """Write a table as `write_parquet` writes the collisions.

    Args:
        frame: The table.
        columns: Its columns.
        record: The run record.
        path: The file, with the suffix `.parquet`; an existing one is replaced.

    Returns:
        The path.

    Raises:
        BlastEnvError: If the suffix is wrong or the file cannot be written there.
    """
    path = path_of(path)
    if path.suffix.lower() != SUFFIX:
        raise BlastEnvError(f"{path}: has the suffix {path.suffix!r}, must have {SUFFIX!r}")
    table = _arrow_table(frame, columns, record)
    with write_atomically(path) as temporary:
        try:
            pq.write_table(table, temporary)
        except (OSError, pa.ArrowException) as error:
            raise BlastEnvError(f"{path}: cannot be written: {error}") from error
    return path


def read_parquet(path: str | Path) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Read a file of `write_parquet`.

    Args:
        path: The file.

    Returns:
        The collision table and the run record.

    Raises:
        BlastEnvError: If the file is missing, damaged or no Parquet, or has no run record.
    """
    path = path_of(path)
    frame, metadata = _read(path)
    return frame, _run_record(path, metadata)


def read_frame(path: Path, columns: Sequence[str]) -> pd.DataFrame:
    """Read a Parquet file without a run record.

    Args:
        path: The file.
        columns: The names of its columns.

    Raises:
        BlastEnvError: If the file is missing, damaged or no Parquet, or holds another table.
    """
    frame, _ = _read(path)
    if list(frame.columns) != list(columns):
        found = shortened(", ".join(map(str, frame.columns)))
        raise BlastEnvError(f"{path}: has the columns {found}, must have {', '.join(columns)}")
    return frame


def _read(path: Path) -> tuple[pd.DataFrame, dict[bytes, bytes]]:
    if not path.is_file():
        raise BlastEnvError(f"{path}: there is no such file")
    try:
        # Not read_table: it reads a folder named "seed=3" as a partition, and adds a column.
        with pq.ParquetFile(path) as file:
            table = file.read()
        # The metadata of pandas in the file are not needed, and would not be checked.
        return table.to_pandas(ignore_metadata=True), table.schema.metadata or {}
    except (OSError, ValueError, pa.ArrowException) as error:
        reason = shortened(str(error), 300)
        raise BlastEnvError(f"{path}: damaged or not a Parquet file: {reason}") from error


def _arrow_table(frame: pd.DataFrame, columns: Sequence[Column], record: RunRecord) -> pa.Table:
    table = pa.Table.from_pandas(frame, preserve_index=False)
    by_name = {column.name: column for column in columns}
    fields = [
        field.with_metadata(
            {"unit": by_name[field.name].unit, "meaning": by_name[field.name].meaning}
        )
        for field in table.schema
    ]
    content = json.dumps(record, ensure_ascii=False).encode()
    metadata = {**table.schema.metadata, METADATA_KEY: content}
    return table.cast(pa.schema(fields, metadata=metadata))


def _run_record(path: Path, metadata: dict[bytes, bytes]) -> dict[str, Any]:
    if METADATA_KEY not in metadata:
        raise BlastEnvError(
            f"{path}: has no run record, so it is not a collision table that blast_env wrote"
        )
    try:
        record = parse_json(metadata[METADATA_KEY].decode())
    except ValueError as error:
        raise BlastEnvError(f"{path}: its run record is damaged: {error}") from error
    if not isinstance(record, dict):
        raise BlastEnvError(f"{path}: its run record is damaged: not a JSON object")
    return record
