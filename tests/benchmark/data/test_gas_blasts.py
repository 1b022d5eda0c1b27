"""The gas blasts as a data set: what its card promises of every row."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from blast_env.benchmark.data import COLUMNS, TABLES, PublishedBlasts, as_tensors, load, sources
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.evaluation import BlastKey
from blast_env.evaluation.engines import BlastLoads
from blast_env.geometry import Piece
from blast_env.site.scene import Charge
from studies.blast_table import scenario_of


@pytest.fixture(scope="module")
def rows() -> pd.DataFrame:
    return load("gas_blasts")


def test_columns_are_those_of_the_card_and_every_table_is_there(rows: pd.DataFrame) -> None:
    assert list(rows.columns) == [each.name for each in COLUMNS]
    assert set(rows["table"]) == set(TABLES)
    assert len(rows) > 4_000


def test_a_site_is_in_one_part_only_and_no_part_is_empty(rows: pd.DataFrame) -> None:
    parts = rows.groupby("scenario_hash")["split"].nunique()
    assert (parts == 1).all()
    assert set(rows["split"]) == {"train", "validation", "test"}


def test_without_a_barrier_a_load_is_that_without_a_barrier(rows: pd.DataFrame) -> None:
    bare = rows[rows["layout"] == "[]"]
    assert (bare["unprotected_peak_pa"] > 0.0).all()
    np.testing.assert_allclose(bare["impulse_pa_s"], bare["unprotected_impulse_pa_s"], rtol=0.01)


def test_loads_are_positive_and_layouts_can_be_read(rows: pd.DataFrame) -> None:
    assert (rows[["impulse_pa_s", "peak_pa", "tnt_kg"]] > 0.0).to_numpy().all()
    assert all(isinstance(json.loads(each), list) for each in rows["layout"].unique()[:500])


def test_tensors_leave_out_what_has_no_bare_load(rows: pd.DataFrame) -> None:
    inputs, shares = as_tensors(rows)
    known = int(rows["unprotected_impulse_pa_s"].notna().sum())
    assert inputs.shape == (known, 6)
    assert shares.shape == (known, 2)
    assert bool((shares > 0.0).all())


def test_other_names_and_other_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="gas_blasts"):
        load("gas_blast")
    other = tmp_path / "other.parquet"
    pq.write_table(pq.read_table(sources()[0]).drop_columns(["tnt_kg"]), other)
    with pytest.raises(BlastEnvError, match="tnt_kg"):
        load(paths=[other])


def test_published_blasts_are_served_for_the_same_cells_and_version(rows: pd.DataFrame) -> None:
    row = rows[rows["table"] == "many_site_blasts"].iloc[0]
    site = scenario_of(row["scenario"])
    published = PublishedBlasts({site.content_hash: site})
    charge = Charge((row["charge_x_m"], row["charge_y_m"]), row["tnt_kg"])
    layout = tuple(Piece(*each) for each in json.loads(row["layout"]))
    present = re.findall(r"gas (\d+) \(", row["engine"])[0]

    def found(cells: str, version: str = present) -> BlastLoads | None:
        engine = f"gas {version} (numba) cell_m=0.5, cells='{cells}'"
        return published.get(BlastKey(site.content_hash, layout, charge, 0, engine, "none", ""))

    assert found("coarse") is None
    assert found("uniform", version="99") is None  # another version has other loads
    loads = found("uniform")
    assert loads is not None
    (same,) = (each for each in loads.structures if each.name == row["structure"])
    assert same.impulse_pa_s == row["impulse_pa_s"]
