"""The paper's table."""

import numpy as np
import pytest

from blast_env.calibration import (
    PAPER_COLUMNS,
    PAPER_UFC_LABEL,
    kingery_bulmash,
    paper_table,
    paper_ufc_column,
)
from blast_env.units import PA_PER_PSI


def test_the_paper_s_table_is_what_its_documentation_says() -> None:
    table = paper_table()
    assert table.columns.tolist() == [column.name for column in PAPER_COLUMNS]
    assert table["r_m"].tolist() == [15.0, 30.0, 45.0, 60.0, 75.0, 90.0, 105.0, 120.0]
    assert table["i_sim"].iloc[[0, -1]].tolist() == [22267.44, 2842.02]
    table.loc[0, "i_sim"] = 0.0
    assert paper_table()["i_sim"].iloc[0] == 22267.44


def test_the_paper_s_ufc_column_goes_by_that_name_and_is_not_the_standard() -> None:
    """Near ten tonnes on the ground at 30 to 120 m (8 %), 1.9 times as large at 15 m."""
    column = paper_ufc_column()
    assert column.name == PAPER_UFC_LABEL == "the paper's UFC column"
    assert column[15.0] == 1.1008
    curve = kingery_bulmash("incident_impulse", column.index.to_numpy(), 1e4) / PA_PER_PSI
    ratio = column.to_numpy() / curve
    assert ratio[0] == pytest.approx(1.93, abs=0.01)
    assert ratio[1:] == pytest.approx(np.ones(7), abs=0.081)
