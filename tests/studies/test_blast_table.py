"""The tables of the blasts that studies have kept, and those blasts run again."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import typer
from typer.testing import CliRunner

from blast_env import load_scenario
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, draw_threats
from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.geometry import Piece
from blast_env.parquet import read_frame, write_table
from blast_env.site import Charge
from blast_env.surrogate import WallPoints
from studies import blast_again, blast_table
from studies.blast_table import COLUMNS
from studies.site_names import scenario_of, site_names
from tests.evaluation.cases import COURTYARD

PIECES = (Piece(0, 0, "wall"),)
FAST = GasEngine(border_m=0.0, until=0.005)


def run(*arguments: object) -> tuple[int, str]:
    app = typer.Typer()
    app.command()(blast_table.main)
    result = CliRunner().invoke(app, [*map(str, arguments)])
    return result.exit_code, " ".join(result.output.split())


def test_each_blast_is_there_once_with_what_was_asked(tmp_path: Path) -> None:
    scenario, out = COURTYARD, tmp_path / "blasts.parquet"
    evaluator = BlastEvaluator(scenario, "event", cache=tmp_path / "blasts")
    threats = draw_threats(scenario, range(2))
    found = [evaluator.loads((), threat) for threat in threats]
    code, words = run(tmp_path / "blasts", tmp_path / "blasts", "--out", out)
    assert (code, words.split(";")[0]) == (0, "2 blasts")
    table = pd.read_parquet(out).sort_values("seed")
    assert table["impulse_pa_s"].tolist() == [case.structures[0].impulse_pa_s for case in found]
    assert set(table["scenario_hash"]) == {scenario.content_hash}
    assert table["seed"].tolist() == [threat.seed for threat in threats]
    assert [json.loads(case) for case in table["layout"]] == [[], []]


def test_generated_sites_of_all_kinds_are_named(tmp_path: Path) -> None:
    out, kinds = tmp_path / "blasts.parquet", ("item_sites", "kerb_sites", "close_sites/16")
    names = site_names(kinds, 0, 1)
    assert names == ["item_sites/10000", "kerb_sites/10000", "close_sites/16/10000"]
    for name in names:
        site = scenario_of(name)
        BlastEvaluator(site, FAST, cache=tmp_path / "blasts").loads((), *draw_threats(site, [0]))
    options = [word for kind in kinds for word in ("--kind", kind)]
    assert run(tmp_path / "blasts", "--sites", 1, *options, "--out", out)[0] == 0
    assert set(pd.read_parquet(out)["scenario"]) == {*names}


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("item_sites/16/3", "kind of sites is 'item_sites/16', must be one of sites, item_sites"),
        ("close_sites/3", "kind of sites is 'close_sites'"),
        ("front_sites/wide/3", "'wide' is no side in m"),
        ("close_sites/30/3", "side_m is 30, must be 16 to 24"),
    ],
)
def test_a_name_without_a_site_is_an_error(name: str, says: str) -> None:
    with pytest.raises(BlastEnvError, match=re.escape(says)):
        scenario_of(name)


@pytest.mark.parametrize("seed", [10_004, 10_077])
def test_walls_of_front_sites_see_the_charge(seed: int) -> None:
    site, whole = scenario_of(f"front_sites/18/{seed}"), scenario_of(f"close_sites/18/{seed}")
    (threat,) = draw_threats(site, [0])
    x_m, y_m = threat.charge_against(site, ()).position_m
    for structure in site.structures:
        left, bottom, right, top = structure.rectangle_m
        farther_m = {"west": left - x_m, "east": x_m - right, "south": bottom - y_m}
        seen_m = farther_m | {"north": y_m - top}
        assert 1 <= len(structure.faces) <= 2 - seed % 2
        assert max(seen_m, key=lambda face: seen_m[face]) in structure.faces
        assert all(seen_m[face] > 0.0 for face in structure.faces)
    (case,) = draw_threats(whole, [0])
    assert case == threat  # nothing but what counts is another


# --- The blasts of a table, run again with the present engine.


NAMES = [column.name for column in COLUMNS]
SITE = "hotel_forecourt"
WALL = '[[2, 2, "planter", false]]'


def old_rows(layouts: list[str]) -> pd.DataFrame:
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
        "point_impulses_pa_s": "[]",
        "point_peaks_pa": "[]",
    }
    return pd.DataFrame([values | {"layout": layout} for layout in layouts * 2])[NAMES]


def test_each_blast_is_asked_for_once_the_empty_site_first() -> None:
    (asked,) = blast_again.asked_in(old_rows([WALL, "[]"]), None)
    assert asked.name == SITE
    assert [len(layout) for layout, _ in asked.blasts] == [0, 1]
    assert {threat.charge for _, threat in asked.blasts} == {Charge((10.0, 3.0), 20.0)}
    (fewer,) = blast_again.asked_in(old_rows([WALL, "[]"]), 1)
    assert fewer.blasts == asked.blasts[:1]


def test_the_new_table_has_the_loads_of_the_present_engine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And a second call runs nothing."""
    table = tmp_path / "old_blasts.parquet"
    write_table(old_rows(["[]"]), COLUMNS, {}, table)
    blast_again.main([table], tmp_path / "again", cells="coarse", processes=1)
    found = read_frame(tmp_path / "again" / table.name, COLUMNS)
    engine = GasEngine(cells="coarse")
    blast = GasBlast(load_scenario(SITE), engine=engine, charge=Charge((10.0, 3.0), 20.0))
    loads = {structure.name: structure.impulse_pa_s for structure in blast.run().loads().structures}
    assert dict(zip(found["structure"], found["impulse_pa_s"], strict=True)) == loads
    assert set(found["scenario"]) == {SITE}
    (hotel,) = found[found["structure"] == "hotel"].to_dict("records")
    points = WallPoints.on([load_scenario(SITE).structures[0]], load_scenario(SITE).air_height_m)
    impulses, peaks = (json.loads(hotel[f"point_{name}"]) for name in ("impulses_pa_s", "peaks_pa"))
    assert len(impulses) == len(peaks) == len(points.area_m2)
    # Their mean by area is the load on the structure, but for faces that are halved by a border.
    assert np.average(impulses, weights=points.area_m2) == pytest.approx(loads["hotel"], rel=0.02)
    assert max(peaks) == pytest.approx(hotel["peak_pa"], rel=5e-3)
    other = found[found["structure"] != "hotel"]
    assert set(other["point_impulses_pa_s"]) <= {"[]"}
    monkeypatch.setattr(GasBlast, "run", None)
    blast_again.main([table], tmp_path / "again", cells="coarse", processes=1)


def test_tables_are_joined_and_rows_with_loads_at_points_win(tmp_path: Path) -> None:
    known = old_rows([WALL, "[]"]).assign(point_impulses_pa_s="[1.0,1234.5,0.0345678,null]")
    tables, folder = [old_rows([WALL]), known], tmp_path / "sites"
    folder.mkdir()
    for number, table in enumerate(tables):
        write_table(table, COLUMNS, {}, folder / f"site-{number}.parquet")
    out = tmp_path / "all.parquet"
    code, words = run(folder, folder / "site-0.parquet", "--out", out)
    assert (code, words.split(";")[0]) == (0, "2 blasts")
    found = read_frame(out, COLUMNS)
    assert found["layout"].tolist() == [WALL, "[]"]
    # Loads at points are kept with three digits.
    assert set(found["point_impulses_pa_s"]) == {"[1,1230,0.0346,null]"}
    assert run(tmp_path / "none", "--out", out)[0] == 2
    assert blast_table.joined([table.iloc[:0] for table in tables]).empty
