"""The processor time of guesses."""

import numpy as np
import typer
from typer.testing import CliRunner

from blast_env.layout import LayoutState
from blast_env.site import load_scenario
from studies import guess_speed


def test_a_batch_is_a_walk_through_legal_layouts() -> None:
    scenario = load_scenario("visitor_entrance")
    walk = guess_speed.changed(scenario, np.random.default_rng(0))
    assert len({*walk}) > guess_speed.LAYOUTS // 4
    for layout in walk[::32]:
        LayoutState.of(scenario, layout)


def test_each_scenario_has_its_times() -> None:
    app = typer.Typer()
    app.command()(guess_speed.main)
    done = CliRunner().invoke(app, ["visitor_entrance"])
    assert done.exit_code == 0
    cells = [cell.strip() for cell in done.output.strip().splitlines()[-1].strip("| ").split("|")]
    assert cells[0] == "visitor_entrance"
    assert int(cells[1]) > 0
    assert all(float(cell) > 0.0 for cell in cells[2:])
    assert CliRunner().invoke(app, ["nowhere"]).exit_code == 2
