"""`blast-env assess --screen`: tables, the verdict by the requirement, and the picture."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

import blast_env
from blast_env.cli import app
from tests.gas_sites import glazed_hut


def run(*words: object, code: int = 0) -> str:
    done = CliRunner().invoke(app, ["assess", "--screen", *map(str, words)])
    assert done.exit_code == code, done.output
    return done.output


def test_threats_stand_offs_and_rings(tmp_path: Path) -> None:
    site, picture = tmp_path / "glazed.toml", tmp_path / "rings.png"
    blast_env.save_scenario(glazed_hut(), site)
    masses = ("--mass", "vest", "--mass", "bag=2,c4")
    output = run(site, *masses, "--require", "iso D", "--picture", picture)
    assert "required: ISO 16933 rating D" in output
    assert output.count("glass: small_window *") == 2
    assert "left out: surroundings outside the range of the atlas" in output
    assert "left out: shielding" in run(site, *masses, "--no-shielding")
    assert picture.stat().st_size > 1000


@pytest.mark.slow
def test_gas_stands_beside_the_curves(tmp_path: Path) -> None:
    site = tmp_path / "glazed.toml"
    blast_env.save_scenario(glazed_hut(), site)
    assert run(site, "--mass", "bag=2", "--gas", "--cell", "0.5").count("by gas") == 1
