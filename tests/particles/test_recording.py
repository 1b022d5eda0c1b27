"""The record of a blast: tables, workbooks, Parquet files."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import BlastResult, simulate
from blast_env.parquet import METADATA_KEY, read_parquet, write_table
from blast_env.particles import (
    COLLISION_COLUMNS,
    COLLISION_DTYPE,
    MODULE_COLUMNS,
    STRUCTURE_COLUMNS,
    CollisionArray,
    CollisionType,
    ModularObstacle,
    collision_table,
    module_table,
    structure_table,
    write_blast,
)
from blast_env.site import Scenario
from blast_env.tables import Column
from blast_env.workbook import EXCEL_ROWS, record_cells
from tests.builders import block, point, site, square, zone
from tests.design.search_cases import small_scenario
from tests.particles import workbooks


def write_collisions(blast: BlastResult, path: Path) -> Path:
    return write_table(blast.collisions, COLLISION_COLUMNS, blast.run_record, path)


SEED = 2**60 + 1
"""Greater than what Excel can hold as a number."""


def make_scenario(**overrides: dict[str, Any]) -> Scenario:
    return site(
        "small_yard",
        (20.0, 20.0),
        point(4.0, 10.0),
        square("building", 11.0, 8.5, 6, protected=True, module_capacity=2500.0),
        block("facade", 16.0, 1.0, 36, 1, protected=True),
        block("shed", 2.0, 15.0, 2, 4),
        build_zone=zone(8.0, 8.0, 8, 2, stock=16),
        simulation={"overrides": {"explosive": {"ball_count": 480}} | overrides},
    )


@pytest.fixture(scope="module")
def blast() -> BlastResult:
    """Two protected structures, a shed and a barrier, all of them hit."""
    return simulate(make_scenario(), layout=[(3, 0), (4, 0), (5, 1)], seed=SEED, engine="pymunk")


@pytest.fixture(scope="module")
def quiet_blast() -> BlastResult:
    """A run that ends before anything is hit."""
    return simulate(make_scenario(stepping={"time_limit_s": 1e-4}), engine="pymunk")


# ---


def record(**values: object) -> CollisionArray:
    """Return one collision: a unit mass that flies to the right, head-on, into module 0."""
    defaults: dict[str, object] = {
        "kind": CollisionType.ExplosionBall,
        "mass": 1.0,
        "vx": 1.0,
        "normal_x": -1.0,
    }
    array = np.zeros(1, dtype=COLLISION_DTYPE)
    for name, value in (defaults | values).items():
        array[name] = value
    return array


def two_obstacles() -> tuple[ModularObstacle, ModularObstacle]:
    """Return obstacles of two modules and of one module."""
    return (
        ModularObstacle("wall", corner=(40.0, 8.0), rows=2, columns=1, protected=True),
        ModularObstacle("post", corner=(80.0, 8.0), rows=1, columns=1, weight=2.0, capacity=5.0),
    )


@pytest.mark.parametrize(
    ("frame", "columns"),
    [
        ("collisions", COLLISION_COLUMNS),
        ("modules", MODULE_COLUMNS),
        ("structures", STRUCTURE_COLUMNS),
    ],
)
def test_a_table_has_exactly_the_columns_that_are_explained(
    blast: BlastResult, quiet_blast: BlastResult, frame: str, columns: Sequence[Column]
) -> None:
    names = [column.name for column in columns]
    assert list(getattr(blast, frame).columns) == names
    assert list(getattr(quiet_blast, frame).columns) == names
    assert len(set(names)) == len(names)
    assert all(column.meaning for column in columns)


@pytest.mark.parametrize(
    ("velocity", "normal", "angle_deg"),
    [
        ((2.0, 0.0), (-1.0, 0.0), 0.0),
        ((1.0, 1.0), (-1.0, 0.0), 45.0),
        ((1.0, -1.0), (-1.0, 0.0), 45.0),
        ((0.0, 3.0), (-1.0, 0.0), 90.0),
        ((0.0, -7.0), (0.0, 1.0), 0.0),
    ],
)
def test_angle_of_incidence_is_0_head_on_and_90_grazing(
    velocity: tuple[float, float], normal: tuple[float, float], angle_deg: float
) -> None:
    of_ball = {"impulse": 2.5, "vx": velocity[0], "vy": velocity[1]}
    collision = record(**of_ball, normal_x=normal[0], normal_y=normal[1])
    row = collision_table(collision, two_obstacles()).iloc[0]
    assert (row["speed"], row["impulse_sim"]) == (np.hypot(*velocity), 2.5)
    assert row["angle_deg"] == pytest.approx(angle_deg)
    assert row["angle_rad"] == pytest.approx(np.radians(angle_deg))


def test_modules_are_counted_through_all_obstacles() -> None:
    collisions = np.concatenate([record(module=index) for index in range(3)])
    collisions["kind"][0] = CollisionType.AirBall
    table = collision_table(collisions, two_obstacles())
    assert table["particle_type"].tolist() == ["AirBall", "ExplosionBall", "ExplosionBall"]
    assert table["structure"].tolist() == ["wall", "wall", "post"]
    assert table["module_id"].tolist() == ["x10.250_y2.250", "x10.250_y2.750", "x20.250_y2.250"]


def test_modules_are_placed_in_metres_and_unhit_ones_have_no_time() -> None:
    obstacles = two_obstacles()
    obstacles[0].parts[1].register(0.25, 3.0, 0.0)
    table = module_table(obstacles)
    assert table[["x_m", "y_m"]].to_numpy().tolist() == [
        [10.25, 2.25],
        [10.25, 2.75],
        [20.25, 2.25],
    ]
    assert table["row"].tolist() == [0, 1, 0]
    np.testing.assert_array_equal(table["first_hit_s"], [np.nan, 0.25, np.nan])


def test_structures_sum_their_modules_and_keep_the_first_time() -> None:
    obstacles = two_obstacles()
    for part, time_s in zip(obstacles[0].parts, (0.5, 0.25), strict=True):
        part.register(time_s, 3.0, 0.0)
    wall, post = structure_table(obstacles).to_dict("records")
    assert (wall["modules"], wall["hits"], wall["impulse_sim"]) == (2, 2, 6.0)
    assert wall["first_hit_s"] == 0.25
    assert (wall["protected"], post["protected"], post["weight"]) == (True, False, 2.0)
    assert np.isnan(post["first_hit_s"])


def test_a_module_is_destroyed_beyond_its_capacity_not_at_it() -> None:
    obstacles = two_obstacles()
    post = obstacles[1].parts[0]
    post.register(0.1, 5.0, 0.0)
    assert structure_table(obstacles)["modules_destroyed"].tolist() == [0, 0]
    post.register(0.2, 0.5, 0.0)
    assert structure_table(obstacles)["modules_destroyed"].tolist() == [0, 1]
    assert module_table(obstacles)["destroyed"].tolist() == [False, False, True]


# ---


@pytest.mark.parametrize("fixture", ["blast", "quiet_blast"])
def test_table_and_record_come_back_exactly(
    request: pytest.FixtureRequest, tmp_path: Path, fixture: str
) -> None:
    result: BlastResult = request.getfixturevalue(fixture)
    table, record = read_parquet(
        write_table(
            result.collisions, COLLISION_COLUMNS, result.run_record, tmp_path / "run.parquet"
        )
    )
    pd.testing.assert_frame_equal(table, result.collisions, check_exact=True)
    assert record == result.run_record


@pytest.mark.usefixtures("apart")
def test_a_folder_that_looks_like_a_partition_adds_no_column(
    blast: BlastResult, tmp_path: Path
) -> None:
    folder = tmp_path / "seed=3"
    folder.mkdir()
    table, _ = read_parquet(write_collisions(blast, folder / "run.parquet"))
    assert list(table.columns) == [column.name for column in COLLISION_COLUMNS]


def test_every_field_has_its_unit_and_meaning(blast: BlastResult, tmp_path: Path) -> None:
    schema = pq.read_schema(write_collisions(blast, tmp_path / "run.parquet"))
    for column in COLLISION_COLUMNS:
        metadata = schema.field(column.name).metadata
        assert metadata[b"unit"].decode() == column.unit
        assert metadata[b"meaning"].decode() == column.meaning


def test_the_same_result_gives_the_same_bytes(blast: BlastResult, tmp_path: Path) -> None:
    first, second = (
        write_table(
            blast.collisions, COLLISION_COLUMNS, blast.run_record, tmp_path / f"{name}.parquet"
        )
        for name in "ab"
    )
    assert first.read_bytes() == second.read_bytes()


def test_reading_a_truncated_file(blast: BlastResult, tmp_path: Path) -> None:
    path = write_table(
        blast.collisions, COLLISION_COLUMNS, blast.run_record, tmp_path / "run.parquet"
    )
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


# ---


TABLES = (("Structures", "structures"), ("Modules", "modules"), ("Collisions", "collisions"))


@pytest.fixture(scope="module")
def workbook(blast: BlastResult, tmp_path_factory: pytest.TempPathFactory) -> Any:
    path = tmp_path_factory.mktemp("workbook") / "blast.xlsx"
    assert blast.to_excel(path) == path
    return workbooks.load(path)


def run_record(sheet: Any) -> dict[str, Any]:
    return dict(workbooks.rows(sheet)[1:])


@pytest.mark.parametrize(("sheet", "attribute"), TABLES)
def test_a_sheet_has_the_values_of_its_table(
    workbook: Any, blast: BlastResult, sheet: str, attribute: str
) -> None:
    written = workbooks.rows(workbook[sheet])[1:]
    assert written == workbooks.expected(getattr(blast, attribute))


@pytest.mark.parametrize(
    ("sheet", "columns"),
    [
        ("Structures", STRUCTURE_COLUMNS),
        ("Modules", MODULE_COLUMNS),
        ("Collisions", COLLISION_COLUMNS),
    ],
)
def test_every_column_is_explained_in_a_note_and_on_a_sheet(
    workbook: Any, sheet: str, columns: Any
) -> None:
    meanings = [column.meaning for column in columns]
    assert [cell.comment.text for cell in workbook[sheet][1]] == meanings
    explained = [row for row in workbooks.rows(workbook["Columns"]) if row[0] == sheet]
    assert [row[1] for row in explained] == workbooks.rows(workbook[sheet])[0]
    assert [row[3] for row in explained] == meanings


def test_the_run_sheet_has_the_run_record(workbook: Any, blast: BlastResult) -> None:
    written, record = run_record(workbook["Run"]), blast.run_record
    assert list(written) == list(record)
    for name in ("scenario", "layout (row, column)", "digest", "engine version", "steps"):
        assert written[name] == record[name]
    assert written["parameter explosive.ball_count"] == 480
    assert written["parameter explosive.collide_within_charge"] == "no"


def test_a_seed_that_excel_would_round_is_kept_as_text(workbook: Any) -> None:
    assert run_record(workbook["Run"])["seed"] == str(SEED)


def test_a_blast_without_a_hit_has_empty_tables(quiet_blast: BlastResult, tmp_path: Path) -> None:
    workbook = workbooks.load(quiet_blast.to_excel(tmp_path / "quiet.xlsx"))
    assert workbook["Collisions"].max_row == 1
    assert workbook["Modules"].max_row == 1 + len(quiet_blast.modules)


@pytest.mark.parametrize("sheets", [1, 3])
def test_a_long_table_goes_on_in_further_sheets(
    blast: BlastResult, tmp_path: Path, sheets: int
) -> None:
    per_sheet = -(-len(blast.collisions) // sheets)
    path = write_blast(blast, tmp_path / "long.xlsx", max_rows_per_sheet=per_sheet + 1)
    workbook = workbooks.load(path)
    names = ["Collisions", "Collisions 2", "Collisions 3"][:sheets]
    assert [name for name in workbook.sheetnames if "Collisions" in name] == names
    parts = [workbooks.rows(workbook[name]) for name in names]
    assert all(part[0] == parts[0][0] for part in parts)
    assert max(len(part) for part in parts) == per_sheet + 1
    times = [row[0] for part in parts for row in part[1:]]
    assert times == pytest.approx(blast.collisions["time_s"].tolist(), rel=1e-15)


def test_a_long_layout_is_not_cut(blast: BlastResult) -> None:
    layout = " ".join(f"{row},{column}" for row in range(100) for column in range(100))
    lines = record_cells(layout)
    assert max(len(str(line)) for line in lines) < 32_767  # what a cell can hold
    assert " ".join(map(str, lines)) == layout


@pytest.mark.parametrize("limit", [1, EXCEL_ROWS + 1])
def test_a_limit_that_excel_cannot_have_is_refused(
    blast: BlastResult, tmp_path: Path, limit: int
) -> None:
    with pytest.raises(ValueError, match=f"is {limit}, must be between 2 and {EXCEL_ROWS}"):
        write_blast(blast, tmp_path / "blast.xlsx", limit)


@pytest.fixture(scope="module")
def calibrated() -> BlastResult:
    """A charge that stands nearer than the calibration was made for."""
    return simulate(small_scenario(), seed=0, engine="event")


def test_a_calibrated_blast_has_pa_s_beside_simulation_units(
    calibrated: BlastResult, tmp_path: Path
) -> None:
    workbook = workbooks.load(calibrated.to_excel(tmp_path / "blast.xlsx"))
    structures = workbooks.table(workbook["Structures"])
    building = next(row for row in structures if row["structure"] == "building")
    scaled = calibrated.impulse("building")
    assert building["impulse (Pa s)"] == pytest.approx(scaled.pa_s)
    assert building["calibration in range"] == ("; ".join(scaled.notes) or "yes")
    unit = calibrated.load_unit
    for row in workbooks.table(workbook["Modules"]):
        assert row["impulse (Pa s)"] == pytest.approx(unit.factor * row["impulse, m|v| (sim)"])
