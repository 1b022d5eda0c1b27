"""`--layout`: a layout for another scenario is not used by mistake."""

from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from blast_env import load_scenario, write_layout
from blast_env.cli import app

CELLS = [(9, 0), (10, 0), (11, 0)]


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture
def layout(tmp_path: Path) -> Path:
    return write_layout(tmp_path / "layout.json", load_scenario("courtyard"), CELLS)


@pytest.mark.parametrize("command", ["simulate", "evaluate"])
def test_a_layout_of_another_scenario_is_one_clear_message(command: str, layout: Path) -> None:
    """Street junction has all of these cells."""
    chosen = ("street_junction",) if command == "simulate" else ("--scenario", "street_junction")
    result = run(command, *chosen, "--layout", layout, "--engine", "event")
    assert result.exit_code == 2
    assert f"{layout}: the layout was saved for 'courtyard'" in result.stderr
    assert "not for 'street_junction'" in result.stderr
    assert "Traceback" not in result.output


def test_a_layout_is_for_its_site_also_with_another_preset(layout: Path) -> None:
    """What `simulate` itself changes of a scenario does not make it another site."""
    for preset in ("ballistic", "collisional"):
        options = ("--preset", preset, "--engine", "event")
        result = run("simulate", "courtyard", "--layout", layout, *options)
        assert result.exit_code == 0, result.output
        assert "3 barrier modules" in result.stdout
