"""A layout as CSV: one row a barrier module, all lengths in metres."""

from pathlib import Path
from typing import Final

import pandas as pd

from blast_env.atomic import write_atomically
from blast_env.export.plan import LayoutPlan
from blast_env.units import MODULE_SIDE_M, UNITS_PER_M

COLUMNS: Final = (
    "module_id",
    "row",
    "column",
    "corner_x_m",
    "corner_y_m",
    "centre_x_m",
    "centre_y_m",
    "side_m",
)
"""`corner` is a module's lower left corner; rows count upwards, columns to the right, from 0."""

_DIGITS: Final = 9


def module_table(plan: LayoutPlan) -> pd.DataFrame:
    """Return one row a module in the order of the layout; see `COLUMNS`."""
    rows = []
    for part in plan.modules:
        corner_m = (part.rectangle.left / UNITS_PER_M, part.rectangle.bottom / UNITS_PER_M)
        centre_m = (part.x / UNITS_PER_M, part.y / UNITS_PER_M)
        places_m = (round(value, _DIGITS) for value in (*corner_m, *centre_m))
        rows.append((part.module_id, part.row, part.column, *places_m, MODULE_SIDE_M))
    return pd.DataFrame(rows, columns=list(COLUMNS))


def write_csv(plan: LayoutPlan, path: Path) -> None:
    """Write the modules.

    Raises:
        BlastEnvError: If the file cannot be written.
    """
    with write_atomically(path) as temporary:
        module_table(plan).to_csv(temporary, index=False)
