"""The tables of the paper, as printed."""

from importlib.resources import files
from io import StringIO
from typing import TYPE_CHECKING, Final

import numpy as np

from blast_env.tables import Column

if TYPE_CHECKING:  # takes a third of a second to import
    import pandas as pd

PAPER_UFC_LABEL: Final = "the paper's UFC column"
"""Required name of its i_ufc, which matches no curve of UFC 3-340-02 at all distances."""

PAPER_COLUMNS: Final = (
    Column("r_m", "m", "distance R"),
    Column("i_ufc_psi_s", "psi*s", "impulse i_ufc that the paper ascribes to UFC 3-340-02"),
    Column("i_sim", "sim", "impulse i_sim of the paper's simulation"),
    Column("t1_scaled", "psi*s", "Table 1, proportional law: i_scaled as printed"),
    Column("t1_abs", "psi*s", "Table 1: E_abs as printed"),
    Column("t1_pct", "%", "Table 1: E% as printed"),
    Column("t2_scaled", "psi*s", "Table 2, linear law: i_scaled as printed"),
    Column("t2_abs", "psi*s", "Table 2: E_abs as printed"),
    Column("t2_pct", "%", "Table 2: E% as printed"),
    Column("t3_scaled", "psi*s", "Table 3, power law: i_scaled as printed"),
    Column("t3_abs", "psi*s", "Table 3: E_abs as printed"),
    Column("t3_pct", "%", "Table 3: E% as printed"),
)
"""The columns of `paper_table`."""


def paper_table() -> "pd.DataFrame":
    """Return Tables 1 to 3 of the paper, one row per distance; see `PAPER_COLUMNS`.

    Every call returns a new frame.
    """
    import pandas as pd

    data = files("blast_env.particles.calibration") / "data"
    text = (data / "paper_tables.csv").read_text(encoding="utf-8")
    return pd.read_csv(StringIO(text), dtype=np.float64)


def paper_ufc_column() -> "pd.Series":
    """Return the paper's UFC column, psi*s, by the distance in metres.

    The paper ascribes it to UFC 3-340-02, but it differs from the standard: at 30 to 120 m it is
    within 8 % of Kingery and Bulmash's incident impulse of about 10 t TNT on the ground, at 15 m
    1.9 times as large. For the standard's curves use `kingery_bulmash`.
    """
    import pandas as pd

    table = paper_table()
    index = pd.Index(table["r_m"], name="distance_m")
    return pd.Series(table["i_ufc_psi_s"].to_numpy(), index=index, name=PAPER_UFC_LABEL)
