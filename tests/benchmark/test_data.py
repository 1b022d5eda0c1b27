"""The gas blasts as a data set: what its card promises of every row."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from blast_env.benchmark.data import COLUMNS, TABLES, as_tensors, load, remember_published, sources
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.evaluation import BlastEvaluator, BlastStore, LoadCase
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.geometry import Piece
from blast_env.site import Charge
from studies.site_names import scenario_of


@pytest.fixture(scope="module")
def rows() -> pd.DataFrame:
    return load("gas_blasts")


def test_every_row_is_what_the_card_says(rows: pd.DataFrame) -> None:
    assert list(rows.columns) == [column.name for column in COLUMNS]
    assert set(rows["table"]) == set(TABLES)
    assert len(rows) > 4_000
    assert set(rows["split"]) == {"train", "validation", "test"}
    assert (rows.groupby("scenario_hash")["split"].nunique() == 1).all()
    loads = rows[["impulse_pa_s", "peak_pa"]].to_numpy()
    assert (loads[rows["protected"]] > 0.0).all()
    assert (loads >= 0.0).all()  # a run may end before the blast is at what does not count
    assert (rows["tnt_kg"] > 0.0).all()
    assert all(isinstance(json.loads(value), list) for value in rows["layout"].unique()[:500])
    bare = rows[rows["layout"] == "[]"]
    np.testing.assert_allclose(bare["impulse_pa_s"], bare["unprotected_impulse_pa_s"], rtol=0.01)


def test_loads_at_points_are_beside_those_of_structures(rows: pd.DataFrame) -> None:
    own = rows[rows["point_impulses_pa_s"] != "[]"].iloc[::50]
    assert len(own) > 100
    assert own["protected"].all()
    for row in own.to_dict("records"):
        impulses, peaks = (
            [load for load in json.loads(row[name]) if load is not None]
            for name in ("point_impulses_pa_s", "point_peaks_pa")
        )
        # They have three digits, some after four.
        rounded = 1.0 + 5.5e-3
        assert min(impulses) / rounded <= row["impulse_pa_s"] <= max(impulses) * rounded
        assert max(peaks) == pytest.approx(row["peak_pa"], rel=rounded - 1.0)


def test_tensors_leave_out_what_has_no_bare_load(rows: pd.DataFrame) -> None:
    inputs, shares = as_tensors(rows)
    known = int(rows["unprotected_impulse_pa_s"].notna().sum())
    assert inputs.shape == (known, 6)
    assert shares.shape == (known, 2)
    # A run ends when protected structures have their loads: others may have none yet.
    assert bool((shares >= 0.0).all())
    of_protected = as_tensors(rows[rows["protected"]])[1]
    assert len(of_protected)
    assert bool((of_protected > 0.0).all())


def test_other_names_and_other_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="gas_blasts"):
        load("gas_blast")
    other = tmp_path / "other.parquet"
    pq.write_table(pq.read_table(sources()[0]).drop_columns(["tnt_kg"]), other)
    with pytest.raises(BlastEnvError, match="tnt_kg"):
        load(paths=[other])


def test_published_blasts_are_served_for_the_same_cells_and_version(
    rows: pd.DataFrame, monkeypatch: pytest.MonkeyPatch
) -> None:
    # They are read once for all tests here.
    monkeypatch.setattr("blast_env.benchmark.data.published.load", lambda: rows)
    row = rows[rows["table"] == "many_site_blasts"].iloc[0]
    site, store = scenario_of(row["scenario"]), BlastStore(size=100)
    # The tables may be older than the engine.
    made_by = row["engine"].split("version='")[1].split("'")[0]
    monkeypatch.setattr(
        "blast_env.benchmark.data.published.find_engine", lambda *_: GasEngine(version=made_by)
    )
    assert remember_published(store, [site]) == len(store) > 0
    charge = Charge((row["charge_x_m"], row["charge_y_m"]), row["tnt_kg"])
    layout = tuple(Piece(*load) for load in json.loads(row["layout"]))
    fine, same = (
        BlastEvaluator(site, GasEngine(cell_m=value, version=made_by), cache=store)
        for value in (0.25, 0.5)
    )
    assert store.get(fine.key(layout, LoadCase(charge, 0))) is None
    (load,) = (
        structure
        for structure in same.loads(layout, LoadCase(charge, 0)).structures
        if structure.name == row["structure"]
    )
    assert load.impulse_pa_s == row["impulse_pa_s"]
    assert same.counts.blasts == 0
    # Another version has other loads.
    monkeypatch.setattr(
        "blast_env.benchmark.data.published.find_engine", lambda *_: GasEngine(version="gas 99 (x)")
    )
    assert remember_published(BlastStore(), [site]) == 0
