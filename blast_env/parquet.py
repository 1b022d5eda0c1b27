"""Tables as Parquet, with the run record, the units and the meanings in the file."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from blast_env.documents import parse_json
from blast_env.errors import BlastEnvError, shortened, value_text
from blast_env.files import read_regular, write_atomically
from blast_env.reading import read_apart
from blast_env.tables import Column, RunRecord
from blast_env.values import path_of

METADATA_KEY: Final = b"blast_env"
"""Key of the run record, as JSON, in the metadata of the file."""

SUFFIX: Final = ".parquet"

MOST_BYTES: Final = 200_000_000
"""Largest file that is read."""

MOST_VALUES: Final = 20_000_000
"""Most values of a table that is read: a million collisions."""

_LEVEL: Final = 19
"""Level of Zstandard: tables of loads are half as large as with the writer's own choice."""


def write_table(
    frame: pd.DataFrame, columns: Sequence[Column], record: RunRecord, path: str | Path
) -> Path:
    """Write a table, exact to the last bit, with the run record in the metadata.

    The metadata of each field has its `unit` and its `meaning`. The file is written whole or not
    at all.

    Args:
        path: The file, with the suffix `.parquet`; an existing one is replaced.

    Returns:
        The path.
    """
    path = path_of(path)
    if path.suffix.lower() != SUFFIX:
        raise BlastEnvError(f"{path}: has the suffix {path.suffix!r}, must have {SUFFIX!r}")
    table = _arrow_table(frame, columns, record)
    with write_atomically(path) as temporary:
        try:
            pq.write_table(table, temporary, compression="zstd", compression_level=_LEVEL)
        except (OSError, pa.ArrowException) as error:
            raise BlastEnvError(f"{path}: cannot be written: {error}") from error
    return path


def read_parquet(
    path: str | Path, columns: Sequence[Column] = ()
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Read a file of `write_table`, in a separate process with limits on time and memory.

    Args:
        columns: Columns that it must have, among others.

    Returns:
        The table and the run record.
    """
    path = path_of(path)
    table = read_apart(str(path), checked_table, path, tuple(columns))
    return table.to_pandas(ignore_metadata=True), _run_record(path, table.schema.metadata or {})


def read_frame(path: Path, columns: Sequence[Column]) -> pd.DataFrame:
    """Read a Parquet file without a run record, as `read_parquet` does."""
    table = read_apart(str(path), checked_table, path, tuple(columns))
    names = [column.name for column in columns]
    if table.column_names != names:
        found = shortened(", ".join(table.column_names))
        raise BlastEnvError(f"{path}: has the columns {found}, must have {', '.join(names)}")
    frame: pd.DataFrame = table.to_pandas(ignore_metadata=True)
    return frame


def checked_table(path: Path, columns: Sequence[Column] = ()) -> pa.Table:
    """Return the content of a Parquet file; it may take much memory, see `read_parquet`.

    Args:
        columns: Columns that it must have, among others.
    """
    try:
        content = read_regular(path, MOST_BYTES)
    except BlastEnvError as error:
        raise BlastEnvError(f"{path}: {error}") from error
    try:
        # Not read_table: it reads a folder named "seed=3" as a partition, and adds a column.
        with pq.ParquetFile(pa.BufferReader(content), pre_buffer=False) as file:
            _check_schema(path, file, columns)
            table = file.read(use_threads=False)
        table.validate(full=True)
        _check_texts(path, table)
    except (BlastEnvError, MemoryError):
        raise
    except (OSError, ValueError, pa.ArrowException) as error:
        reason = shortened(str(error), 300)
        raise BlastEnvError(f"{path}: damaged or not a Parquet file: {reason}") from error
    return table


def _check_schema(path: Path, file: pq.ParquetFile, columns: Sequence[Column]) -> None:
    """Refuse too many values, missing columns, and columns of the wrong kind, before reading."""
    values = file.metadata.num_rows * file.metadata.num_columns
    if values > MOST_VALUES:
        raise BlastEnvError(f"{path}: has {values:,} values, must have at most {MOST_VALUES:,}")
    known = {column.name: column for column in columns}
    kinds = {column.name: column.type for column in file.schema_arrow}
    missing = [column.name for column in columns if column.name not in kinds]
    if missing:
        raise BlastEnvError(f"{path}: has no column {', '.join(missing)}")
    for name, kind in kinds.items():
        is_text = pa.types.is_string(kind) or pa.types.is_large_string(kind)
        is_number = any(
            check(kind)
            for check in (pa.types.is_integer, pa.types.is_floating, pa.types.is_boolean)
        )
        wanted = known[name].is_text if name in known else is_text
        if not (is_text if wanted else is_number):
            what = "texts" if wanted else "numbers or truth values"
            where = f"column {value_text(name)}"
            raise BlastEnvError(f"{path}: {where} holds {shortened(str(kind))}, must hold {what}")


def _check_texts(path: Path, table: pa.Table) -> None:
    """Refuse texts that are missing; a missing number is NaN."""
    for name, column in zip(table.column_names, table.columns, strict=True):
        if column.null_count and not pa.types.is_floating(column.type):
            where = f"column {value_text(name)}"
            raise BlastEnvError(f"{path}: {where} has {column.null_count} missing values")


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
