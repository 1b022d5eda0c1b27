"""`--engine gas` on the command line: loads without a calibration, and what it cannot draw."""

import json
from functools import partial
from pathlib import Path

import matplotlib
import pytest

import blast_env
from blast_env.layout import write_layout
from blast_env.plots import film
from blast_env.site import Scenario, save_scenario
from tests.cli.running import run
from tests.gas_sites import WALL, hut, site_document


def test_a_blast_prints_what_the_library_finds(site: Path, tmp_path: Path) -> None:
    expected = blast_env.simulate(hut(), engine="gas")
    options = ("--engine", "gas", "--excel", tmp_path / "a.xlsx")
    result = run("simulate", site, *options)
    assert result.exit_code == 0, result.output
    assert f"{expected.impulse('hut').pa_s:,.0f}" in result.stdout
    assert "front" in result.stdout
    assert "20 x 16" not in result.stdout
    shape = " x ".join(map(str, expected.run.grid.shape))
    assert f" {shape} cells" in " ".join(result.stdout.split())
    assert (tmp_path / "a.xlsx").exists()


def test_a_layout_is_evaluated_by_gas_unless_told_otherwise(site: Path, tmp_path: Path) -> None:
    layout = write_layout(tmp_path / "wall.json", hut(), WALL, {"made by": "hand"})
    options = ("--layout", layout, "--scenario", site, "--seeds", 1)
    content = json.loads(run("evaluate", *options, "--json").stdout)
    assert content["engine"] == "gas"
    assert 0.05 < content["result"]["reduction"]["value"] < 0.6
    assert content["cache"] == {"blasts": 4, "hits": 0, "hit_rate": 0.0}
    assert content["result"]["grid_error"]["reduction"] > 0.0
    coarse = run("evaluate", *options, "--cell", 0.5).stdout
    assert "up to 2 blasts of gas" in coarse
    assert "(cells): the grid error is not known" in coarse
    assert "+- " not in coarse


def test_a_cause_of_doubt_has_one_line(tmp_path: Path) -> None:
    """A load at 8.63 m/kg^(1/3) on cells too large for its charge, and one not captured."""
    document = site_document(site={"width_m": 30.0, "height_m": 8.0, "air_height_m": 5.0})
    document["charge"][0]["tnt_kg"] = 5.0
    document["structures"][0]["corner_m"] = [2.0 + 8.63 * 5.0 ** (1 / 3), 3.0]
    path = tmp_path / "far.toml"
    save_scenario(Scenario.from_document(document, "far"), path)
    shown = run("simulate", path, "--engine", "gas").stdout.splitlines()
    (distance,) = (line for line in shown if "scaled distance" in line)
    assert distance.startswith("validation of the load, hut: outside (scaled distance 8.63 m")
    (cells,) = (line for line in shown if "cells per m/kg^(1/3)" in line)
    assert cells.startswith("outside the validated range (marked ~): 3.4 cells")
    assert sum("outside" in line for line in shown) == 3  # these two, and the table
    early = run("simulate", path, "--engine", "gas", "--until", 0.001).stdout
    assert early.count("not yet captured") == 1


@pytest.mark.usefixtures("drawn")
def test_a_layout_and_the_empty_site_are_shown_in_every_picture(
    site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(matplotlib.rcParams, "svg.fonttype", "none")  # text stays text
    monkeypatch.setattr(film, "write_film", partial(film.write_film, frames_per_s=0.5))
    layout = write_layout(tmp_path / "wall.json", hut(), WALL, {"made by": "hand"})
    names = ("heat-map", "history", "impulse-map")
    options = [text for name in names for text in (f"--{name}", tmp_path / f"{name}.svg")]
    moving = ("--film", tmp_path / "film.gif")
    chosen = ("--gauge", "behind", "--quantity", "peak", "--side-by-side", *moving)
    result = run("simulate", site, "--engine", "gas", "--layout", layout, *options, *chosen)
    assert result.exit_code == 0, result.output
    for name in names:
        words = (tmp_path / f"{name}.svg").read_text("utf-8")
        assert "no barrier" in words
        assert "barrier of 6 modules" in words
    assert "Kingery-Bulmash" in (tmp_path / "history.svg").read_text("utf-8")
    assert "peak overpressure" in (tmp_path / "heat-map.svg").read_text("utf-8")
    assert (tmp_path / "film.gif").stat().st_size > 1000


def test_parts_of_a_building_are_one_row(tmp_path: Path) -> None:
    document = hut().model_dump(exclude_none=True)
    (whole,) = document["structures"]
    left, bottom = whole["corner_m"]
    part = {**whole, "rows": 2, "building": "town_hall"}
    north = {**part, "name": "north_half", "corner_m": (left, bottom + 1.0)}
    document["structures"] = [{**part, "name": "south_half"}, north]
    path = tmp_path / "halves.toml"
    save_scenario(Scenario.from_document(document, "halves"), path)
    shown = run("simulate", path, "--engine", "gas", "--until", 0.01).stdout
    assert shown.count("town_hall") == 2  # its row, and the validation of its load
    assert "south_half" not in shown
    rows = run("simulate", path, "--engine", "event").stdout.splitlines()
    (row,) = (line.split() for line in rows if "half" in line or "town_hall" in line)
    assert row[:3] == ["town_hall", "yes", "16"]
    printed = json.loads(run("simulate", path, "--engine", "event", "--json").stdout)
    (hall,) = (building for building in printed["buildings"] if building["building"] == "town_hall")
    halves = [
        structure for structure in printed["structures"] if structure["structure"].endswith("half")
    ]
    assert len(halves) == 2
    for name in ("modules", "hits"):
        assert hall[name] == sum(half[name] for half in halves)
    assert hall["impulse_sim"] == pytest.approx(sum(half["impulse_sim"] for half in halves))
    printed = json.loads(run("simulate", path, "--engine", "gas", "--until", 0.01, "--json").stdout)
    assert [building["parts"] for building in printed["buildings"]] == ["south_half north_half"]
    assert set(printed["impulse"]) == {"south_half", "north_half"}
