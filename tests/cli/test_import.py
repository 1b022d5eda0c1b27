"""`blast-env import`."""

import json
from pathlib import Path

from typer.testing import CliRunner

from blast_env.cli import app
from blast_env.site import load_scenario
from tests.io.importing.maps import BLOCK


def run(*arguments: str | Path) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, ["import", *map(str, arguments)], env={"COLUMNS": "150"})
    return done.exit_code, done.stdout, done.stderr


def test_table_says_how_far_each_building_is_off(tmp_path: Path) -> None:
    out, picture = tmp_path / "block.toml", tmp_path / "block.png"
    code, text, _ = run(BLOCK, "--protect", "Town Hall", "--out", out, "--picture", picture)
    assert code == 0
    rows = [line.split() for line in text.splitlines()]
    assert ["Town_Hall", "yes", "1", "10.5", "339.2", "336.0", "0.9", "0.22"] in rows
    assert "places of charges: 4" in text
    assert f"wrote {out}" in text
    assert picture.read_bytes().startswith(b"\x89PNG")
    scenario = load_scenario(out)
    assert scenario.description.startswith("Imported from market_street.geojson (SHA-256 ")
    assert "0.33 m of its outline (Water_Tower)" in scenario.description


def test_report_as_json_has_the_same(tmp_path: Path) -> None:
    out = tmp_path / "block.toml"
    place = ("--centre", "7.5006,54.80045", "--size", "40,30", "--tnt-kg", "20")
    options = ("--protect-near", "7.5006,54.80045", "--zone-around", "5", "--zone-from", "none")
    code, _, error = run(BLOCK, *place, *options, "--out", out)
    assert code == 2
    assert "--zone-from and --zone-around exclude each other" in error
    assert not out.exists()
    code, text, _ = run(
        BLOCK, *place, *options[:-2], "--out", out, "--json", "--charge-at", "7.5,5"
    )
    assert code == 2
    code, text, _ = run(BLOCK, *place, *options[:-2], "--out", out, "--json")
    report = json.loads(text)
    assert code == 0
    (hall,) = (building for building in report["buildings"] if building["protected"])
    assert hall["title"] == "Town Hall"
    assert hall["is_cut"]
    scenario = load_scenario(out)
    assert report["scenario_hash"] == scenario.content_hash
    assert (scenario.site.width_m, scenario.site.height_m) == (40.0, 30.0)
    assert {source.tnt_kg for source in scenario.charge} == {20.0}
    assert report["georeference"]["kind"] == "map"


def test_one_wrong_option_is_one_error_however_many_buildings_it_concerns(tmp_path: Path) -> None:
    both = ("--protect", "Town Hall", "--protect", "Baker", "--out", tmp_path / "block.toml")
    code, _, error = run(BLOCK, *both, "--glazing", "window_anealed_6")
    assert code == 2
    assert error.count("window_anealed_6") == 1
    assert error.startswith(
        "error: no glazing 'window_anealed_6', did you mean 'window_annealed_6'"
    )
    code, _, error = run(BLOCK, *both, "--tnt-kg", "-5")
    assert (code, error) == (2, "error: --tnt-kg is -5, must be 0.01 to 100000\n")


def test_protected_buildings_have_the_windows_and_walls_that_are_asked_for(tmp_path: Path) -> None:
    out = tmp_path / "block.toml"
    filled = ("--glazing", "window_annealed_6", "--wall", "brick_215")
    assert run(BLOCK, "--protect", "Town Hall", *filled, "--out", out)[0] == 0
    facades = {structure.name: structure.facade for structure in load_scenario(out).structures}
    hall = facades.pop("Town_Hall")
    assert hall is not None
    assert (hall.glazing, hall.wall) == ("window_annealed_6", "brick_215")
    assert set(facades.values()) == {None}
