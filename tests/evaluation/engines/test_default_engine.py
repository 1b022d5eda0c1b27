"""Which engine a site takes where nobody names one, and where its name stands."""

from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

import blast_env
from blast_env.cli import app
from blast_env.evaluation.engines import default_engine
from blast_env.site import load_scenario, save_scenario
from tests.gas_sites import hut


@pytest.fixture
def site(tmp_path: Path) -> Path:
    path = tmp_path / "hut.toml"
    save_scenario(hut(), path)
    return path


def run(*arguments: str | Path) -> Result:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == 0, result.output
    return result


def test_gas_runs_except_in_the_ids_and_commands_of_the_paper_s_model() -> None:
    flat = load_scenario("courtyard")
    for use in ("simulate", "evaluate", "search", "BlastBarrierGas-v0"):
        assert default_engine(use, flat) == "gas"
    assert default_engine("BlastBarrier-v0", flat) == default_engine("train", flat) == "event"
    assert default_engine("BlastSimulator-v0", flat) == "pymunk"
    assert default_engine("calibrate") == "pymunk"
    assert default_engine("BlastBarrier-v0", flat, hut()) == "gas"


def test_a_flat_site_is_simulated_by_gas_too() -> None:
    result = run("simulate", "courtyard", "--until", "0.001")
    assert result.stdout.startswith("engine gas")


def test_a_site_with_heights_is_simulated_by_gas_and_says_so_first(site: Path) -> None:
    result = run("simulate", site)
    assert result.stdout.startswith("engine gas")
    expected = blast_env.simulate(hut())
    assert expected.engine_name == "gas"
    assert f"digest {expected.digest}" in result.stdout


def test_particles_that_are_asked_for_say_what_they_leave_aside(site: Path) -> None:
    result = run("simulate", site, "--engine", "event")
    assert result.stdout.startswith("engine event")
    for note in hut().height_notes:
        assert note in " ".join(result.stdout.split())
