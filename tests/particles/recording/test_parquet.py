import json
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import BlastResult
from blast_env.particles.parquet import METADATA_KEY, read_parquet, write_parquet
from blast_env.particles.tables import COLLISION_COLUMNS


@pytest.mark.parametrize("fixture", ["blast", "quiet_blast"])
def test_table_and_record_come_back_exactly(
    request: pytest.FixtureRequest, tmp_path: Path, fixture: str
) -> None:
    result: BlastResult = request.getfixturevalue(fixture)
    table, record = read_parquet(write_parquet(result, tmp_path / "run.parquet"))
    pd.testing.assert_frame_equal(table, result.collisions, check_exact=True)
    assert record == result.run_record


@pytest.mark.usefixtures("apart")
def test_a_folder_that_looks_like_a_partition_adds_no_column(
    blast: BlastResult, tmp_path: Path
) -> None:
    folder = tmp_path / "seed=3"
    folder.mkdir()
    table, _ = read_parquet(write_parquet(blast, folder / "run.parquet"))
    assert list(table.columns) == [column.name for column in COLLISION_COLUMNS]


def test_every_field_has_its_unit_and_meaning(blast: BlastResult, tmp_path: Path) -> None:
    schema = pq.read_schema(blast.to_parquet(tmp_path / "run.parquet"))
    for column in COLLISION_COLUMNS:
        metadata = schema.field(column.name).metadata
        assert metadata[b"unit"].decode() == column.unit
        assert metadata[b"meaning"].decode() == column.meaning


def test_the_same_result_gives_the_same_bytes(blast: BlastResult, tmp_path: Path) -> None:
    first, second = (blast.to_parquet(tmp_path / f"{name}.parquet") for name in "ab")
    assert first.read_bytes() == second.read_bytes()


def test_reading_a_truncated_file(blast: BlastResult, tmp_path: Path) -> None:
    path = blast.to_parquet(tmp_path / "run.parquet")
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(BlastEnvError, match=r"run\.parquet: damaged or not a Parquet file"):
        read_parquet(path)


def test_reading_a_file_of_another_program(tmp_path: Path) -> None:
    path = tmp_path / "foreign.parquet"
    pd.DataFrame({"time_s": [0.0]}).to_parquet(path)
    with pytest.raises(BlastEnvError, match=r"foreign\.parquet: has no run record"):
        read_parquet(path)


@pytest.mark.parametrize("record", ['{"seed": 0', json.dumps([1, 2]), b"\xff\xfe"])
def test_reading_a_damaged_run_record(tmp_path: Path, record: Any) -> None:
    path = tmp_path / "run.parquet"
    table = pa.table({"time_s": [0.0]}).replace_schema_metadata({METADATA_KEY: record})
    pq.write_table(table, path)
    with pytest.raises(BlastEnvError, match=r"run\.parquet: its run record is damaged"):
        read_parquet(path)
