"""Tables for spreadsheets: a text that begins like a formula stays a text."""

import csv
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from blast_env.tables import cell_text, write_csv


@pytest.mark.parametrize("text", ["=1+1", "+1 wall", "-wall", "@SUM(A1)", "\t=1", "\r=1", "-1+1"])
def test_a_text_that_a_spreadsheet_would_calculate_is_marked_as_a_text(text: str) -> None:
    assert cell_text(text) == f"'{text}"


@pytest.mark.parametrize("value", ["wall = 1", "", "-1.5", "+3", "-1e-3", -1.5, 3, None, True])
def test_numbers_and_other_texts_stay(value: object) -> None:
    assert cell_text(value) is value


def test_a_table_keeps_its_numbers(tmp_path: Path) -> None:
    table = pd.DataFrame(
        {"item": ["=HYPERLINK(1)", None], "x_m": [-1.5, np.nan], "n": [-1, 2], "own": [True, False]}
    )
    path = write_csv(table, tmp_path / "table.csv")
    with path.open(newline="") as file:
        rows = [*csv.reader(file)]
    assert rows == [
        ["item", "x_m", "n", "own"],
        ["'=HYPERLINK(1)", "-1.5", "-1", "True"],
        ["", "", "2", "False"],
    ]
    assert table["item"][0] == "=HYPERLINK(1)"
