"""`blast-env assess --capacity`: a row for each layout and place."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

import blast_env
from blast_env.cli import app
from blast_env.evaluation import LoadCaseSet
from blast_env.evaluation.blasts import Blasts
from blast_env.evaluation.campaign import Campaign
from blast_env.evaluation.questions import capacity
from blast_env.evaluation.questions.probability import scaled_to
from blast_env.evaluation.questions.verdict import Consequences, consequences_of
from blast_env.site import Charge
from tests.gas_sites import WALL, glazed_hut


def test_a_row_for_each_layout_and_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the hut; all blasts but the first are scaled from it."""
    site = tmp_path / "glazed.toml"
    blast_env.save_scenario(glazed_hut(), site)
    layout = blast_env.write_layout(tmp_path / "wall.json", glazed_hut(), WALL)
    first: list[Blasts] = []
    run = Campaign.run

    def once(campaign: Campaign) -> LoadCaseSet:
        first[:] = first or [run(campaign)]
        return campaign.case

    def scaled(case: LoadCaseSet) -> Consequences:
        (charge,) = case.charges
        assert isinstance(charge, Charge)
        return scaled_to(consequences_of(first[0]), charge)

    monkeypatch.setattr(Campaign, "run", once)
    monkeypatch.setattr(capacity, "consequences_of", scaled)
    options = ("--tnt-kg", "0.1", "--cell", "0.5", "--layout", layout)
    done = CliRunner().invoke(app, ["assess", "--capacity", *map(str, (site, *options))])
    assert done.exit_code == 0, done.output
    rows = [line.split() for line in done.output.splitlines() if "2.0, 4.0" in line]
    assert len(rows) == 4
    assert "largest charge (kg TNT) that keeps each level of protection" in done.output
