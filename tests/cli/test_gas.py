"""`--engine gas` on the command line: loads without a calibration, and what it cannot draw."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

import blast_env
from blast_env.cli import app
from blast_env.scenario import save_scenario, write_layout
from tests.gas_sites import WALL, hut


@pytest.fixture
def site(tmp_path: Path) -> Path:
    path = tmp_path / "hut.toml"
    save_scenario(hut(), path)
    return path


def run(*arguments: str | Path | float) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_a_blast_prints_what_the_library_finds(site: Path, tmp_path: Path) -> None:
    expected = blast_env.simulate(hut(), engine="gas")
    options = (
        "--engine",
        "gas",
        "--excel",
        tmp_path / "a.xlsx",
        "--parquet",
        tmp_path / "a.parquet",
    )
    result = run("simulate", site, *options)
    assert result.exit_code == 0, result.output
    assert f"{expected.impulse('hut').pa_s:,.0f}" in result.stdout
    assert "front" in result.stdout
    assert "20 x 16" not in result.stdout
    assert "36 x 32 x 10 cells of 0.5 m" in " ".join(result.stdout.split())
    assert (tmp_path / "a.xlsx").exists()
    assert (tmp_path / "a.parquet").exists()


def test_json_has_the_loads_and_the_cell(site: Path) -> None:
    result = run("simulate", site, "--engine", "gas", "--cell", 0.25, "--json")
    content = json.loads(result.stdout)
    assert content["run"]["cell (m)"] == 0.25
    assert content["impulse"]["hut"]["pa_s"] > 0.0
    assert [each["name"] for each in content["gauges"]] == ["front", "behind"]


def test_a_layout_is_evaluated_by_gas(site: Path, tmp_path: Path) -> None:
    layout = write_layout(tmp_path / "wall.json", hut(), WALL, {"made by": "hand"})
    options = ("--layout", layout, "--scenario", site, "--engine", "gas", "--seeds", 1, "--json")
    content = json.loads(run("evaluate", *options).stdout)
    assert content["engine"] == "gas"
    assert 0.05 < content["result"]["reduction"]["value"] < 0.6
    assert content["cache"]["blasts"] == 2


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--film", "a.mp4"), "--film draws particles: engine 'gas' has none"),
        (("--cell", "0.2"), "cell_m is 0.2, must be 0.5 m"),
    ],
)
def test_what_gas_has_not_is_said(site: Path, arguments: tuple[str, str], words: str) -> None:
    result = run("simulate", site, "--engine", "gas", *arguments)
    assert result.exit_code == 2
    assert words in " ".join(result.stderr.split())


def test_a_cell_is_for_gas_alone(site: Path) -> None:
    result = run("simulate", site, "--engine", "event", "--cell", 0.5)
    assert result.exit_code == 2
    assert "engine 'event' has no cells" in " ".join(result.stderr.split())
