"""`blast-env assess --capacity`: a row for each layout and place."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

import blast_env
from blast_env.cli import app
from blast_env.evaluation import BlastEvaluator, capacity
from blast_env.evaluation.consequences import Consequences
from blast_env.evaluation.probability import scaled_to
from blast_env.evaluation.shared import consequences
from blast_env.geometry import Layout
from blast_env.site import AnyCharge, Charge
from tests.gas_sites import WALL, glazed_hut


def test_a_row_for_each_layout_and_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the hut; all blasts but the first are scaled from it."""
    site = tmp_path / "glazed.toml"
    blast_env.save_scenario(glazed_hut(), site)
    layout = blast_env.write_layout(tmp_path / "wall.json", glazed_hut(), WALL)
    first: list[Consequences] = []

    def scaled(evaluator: BlastEvaluator, layout: Layout, charges: list[AnyCharge]) -> Consequences:
        (charge,) = charges
        assert isinstance(charge, Charge)
        first[1:] = first[:1] or [consequences(evaluator, layout, charges)]
        return scaled_to(first[-1], charge)

    monkeypatch.setattr(capacity, "consequences", scaled)
    options = ("--tnt-kg", "0.1", "--cell", "0.5", "--layout", layout)
    done = CliRunner().invoke(app, ["assess", "--capacity", *map(str, (site, *options))])
    assert done.exit_code == 0, done.output
    rows = [line.split() for line in done.output.splitlines() if "2.0, 4.0" in line]
    assert len(rows) == 4
    assert "largest charge (kg TNT) that keeps each level of protection" in done.output
