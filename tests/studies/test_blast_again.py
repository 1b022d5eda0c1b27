"""The blasts of a table, run again with the present engine."""

from pathlib import Path

import pandas as pd
import pytest

from blast_env import load_scenario
from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.particles.parquet import read_frame, write_table
from blast_env.site.scene import Charge
from studies import blast_again
from studies.blast_table import COLUMNS

NAMES = [column.name for column in COLUMNS]
SITE = "hotel_forecourt"
WALL = '[[2, 2, "planter", false]]'


def rows(layouts: list[str]) -> pd.DataFrame:
    """Return rows of an older engine, each layout twice."""
    values = {
        "scenario": SITE,
        "scenario_hash": "old",
        "charge_x_m": 10.0,
        "charge_y_m": 3.0,
        "charge_height_m": 0.0,
        "tnt_kg": 20.0,
        "seed": 0,
        "engine": "gas 3",
        "structure": "hotel",
        "protected": True,
        "impulse_pa_s": 1.0,
        "peak_pa": 1.0,
    }
    return pd.DataFrame([values | {"layout": each} for each in layouts * 2])[NAMES]


def test_each_blast_is_asked_for_once_the_empty_site_first() -> None:
    (asked,) = blast_again.asked_in(rows([WALL, "[]"]), None)
    assert asked.name == SITE
    assert [len(layout) for layout, _ in asked.blasts] == [0, 1]
    assert {charge for _, charge in asked.blasts} == {Charge((10.0, 3.0), 20.0)}
    (fewer,) = blast_again.asked_in(rows([WALL, "[]"]), 1)
    assert fewer.blasts == asked.blasts[:1]


def test_the_new_table_has_the_loads_of_the_present_engine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And a second call runs nothing."""
    table = tmp_path / "old_blasts.parquet"
    write_table(rows(["[]"]), COLUMNS, {}, table)
    blast_again.main([table], tmp_path / "again", cells="coarse", processes=1)
    found = read_frame(tmp_path / "again" / table.name, COLUMNS)
    engine = GasEngine(cells="coarse")
    blast = GasBlast(load_scenario(SITE), engine=engine, charge=Charge((10.0, 3.0), 20.0))
    loads = {each.name: each.impulse_pa_s for each in blast.run().loads().structures}
    assert dict(zip(found["structure"], found["impulse_pa_s"], strict=True)) == loads
    assert set(found["scenario"]) == {SITE}
    monkeypatch.setattr(GasBlast, "run", None)
    blast_again.main([table], tmp_path / "again", cells="coarse", processes=1)
