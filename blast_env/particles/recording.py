"""The workbook of a blast by particles."""

from pathlib import Path
from typing import Final

from blast_env.particles.tables import (
    COLLISION_COLUMNS,
    BlastTables,
    modules_in_pa_s,
    structures_in_pa_s,
)
from blast_env.workbook import EXCEL_ROWS, SheetTable, write_workbook

_UNITS: Final = (
    ("sim", "simulation unit of impulse: sim mass x sim unit / s"),
    ("sim mass", "simulation unit of mass"),
    ("sim units/s", "simulation units of length per second; 4 units are 1 m"),
)


def write_blast(blast: BlastTables, path: str | Path, max_rows_per_sheet: int = EXCEL_ROWS) -> Path:
    """Write a workbook with the sheets `Run`, `Structures`, `Modules`, `Collisions`, `Columns`.

    Args:
        path: The file, with the suffix `.xlsx`; an existing one is replaced.
        max_rows_per_sheet: The most rows of a table on one sheet, its header included.

    Returns:
        The path.

    Raises:
        BlastEnvError: If the suffix is wrong or the file cannot be written there.
        ValueError: If `max_rows_per_sheet` is less than 2 or more than Excel allows.
    """
    tables = (
        SheetTable("Structures", *structures_in_pa_s(blast.structures, blast.load_unit)),
        SheetTable("Modules", *modules_in_pa_s(blast.modules, blast.load_unit)),
        SheetTable("Collisions", blast.collisions, COLLISION_COLUMNS),
    )
    return write_workbook(
        blast.run_record, tables, path, units=_UNITS, max_rows_per_sheet=max_rows_per_sheet
    )
