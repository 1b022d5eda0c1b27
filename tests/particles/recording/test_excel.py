from pathlib import Path
from typing import Any

import pytest

from blast_env.evaluation.engines import BlastResult, simulate
from blast_env.particles.tables import (
    COLLISION_COLUMNS,
    MODULE_COLUMNS,
    STRUCTURE_COLUMNS,
)
from blast_env.particles.workbook import (
    EXCEL_ROWS,
    record_cells,
    write_workbook,
)
from tests.design.search_cases import small_scenario
from tests.particles.recording import workbooks
from tests.particles.recording.conftest import SEED

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
    path = write_workbook(blast, tmp_path / "long.xlsx", max_rows_per_sheet=per_sheet + 1)
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
        write_workbook(blast, tmp_path / "blast.xlsx", limit)


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
