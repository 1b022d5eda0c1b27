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


def test_heights_take_gas_and_the_papers_sites_particles() -> None:
    assert default_engine(hut()) == "gas"
    assert default_engine(load_scenario("courtyard")) == "pymunk"
    assert default_engine(load_scenario("courtyard"), particles="event") == "event"
    assert default_engine(load_scenario("courtyard"), hut()) == "gas"
    assert default_engine() == "pymunk"


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
