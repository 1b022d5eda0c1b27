"""What a league says of an agent goes with its weights."""

from dataclasses import replace
from pathlib import Path

import pytest
from blast_agents.league.report import write_league

from blast_env.errors import BlastEnvError
from studies.pack_agent import league_result
from tests.agents.league_cases import TRAINING, result, standings

BARE = [[100.0], [200.0]]


def test_the_agent_s_row_the_best_rule_and_the_judge_are_read(tmp_path: Path) -> None:
    it = standings(
        BARE,
        result("wall near the charge", [[80.0], [160.0]], is_rule=True),
        result("most sight lines cut", [[70.0], [140.0]], is_rule=True),
        result("MaskablePPO (own)", [[60.0], [100.0]], training=TRAINING),
        result("MaskablePPO (own), ranked by the surrogate", BARE, training=TRAINING),
    )
    write_league(
        [replace(it, engine="gas, cells of 0.5 m")], tmp_path, "blast-env league --run own"
    )
    found = league_result(tmp_path, it.track.name, "own")
    assert (found.engine, found.command) == ("gas, cells of 0.5 m", "blast-env league --run own")
    assert (found.track, found.cases) == (it.track.name, 2)
    assert found.reduction == pytest.approx(0.45)
    assert found.low < found.reduction < found.high
    assert found.best_rule == "most sight lines cut"
    assert found.best_rule_reduction == pytest.approx(0.3)
    with pytest.raises(BlastEnvError, match="'other' did not enter"):
        league_result(tmp_path, it.track.name, "other")
