"""Wherever a scenario is asked for, its bundled name or the path of its file will do."""

from collections.abc import Callable
from dataclasses import FrozenInstanceError, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import blast_env
from blast_env.design.search import layouts_by_rule
from blast_env.evaluation import BlastEvaluator, Evaluators, LoadCase, LoadCaseSet, draw_threats
from blast_env.io.export import LayoutPlan
from blast_env.layout import LayoutFile, LayoutState, check_layout, usable_cells
from blast_env.rules import random_layout, wall_near_charge
from blast_env.site import Charge
from blast_env.sites import SiteMeasures, turned

NAME = "courtyard"
COURTYARD = blast_env.load_scenario(NAME)
CHARGE = Charge((5.0, 15.0), 100.0)
THREAT = LoadCase(CHARGE, 0)

PUBLIC = (
    "blast_env",
    "blast_env.site",
    "blast_env.evaluation.engines",
    "blast_env.evaluation",
    "blast_env.io.export",
    "blast_env.sites",
    "blast_env.rules.walls",
    "blast_env.design.proposal",
    "blast_env.design.search",
    "blast_agents.training",
)


@pytest.mark.parametrize(
    "call",
    [
        lambda it: blast_env.site.scenario_hash(it),
        lambda it: LayoutState.of(it, [(0, 0)]).cells,
        lambda it: LayoutState.empty(it).free.tolist(),
        lambda it: usable_cells(it).tolist(),
        lambda it: check_layout(it, [(1, 1)]),
        lambda it: LayoutFile.of(it, [(1, 1)]),
        lambda it: LayoutFile.of(COURTYARD, [(1, 1)]).layout_for(it),
        lambda it: draw_threats(it, range(3)),
        lambda it: BlastEvaluator(it, "event").scenario,
        lambda it: Evaluators("event").of(it).scenario,
        lambda it: LoadCaseSet(it, (THREAT,)).scenario,
        lambda it: LayoutPlan(it, ((1, 1),)).scenario,
        lambda it: blast_env.Blast(it, seed=3).scenario,
        lambda it: wall_near_charge(it, CHARGE),
        lambda it: random_layout(it, np.random.default_rng(0)),
        lambda it: layouts_by_rule(it, CHARGE),
        lambda it: SiteMeasures.of(it),
        lambda it: turned(it, 1),
    ],
)
def test_name_path_and_scenario_mean_the_same(call: Callable[[Any], Any], tmp_path: Path) -> None:
    path = tmp_path / "courtyard.toml"
    blast_env.save_scenario(NAME, path)
    plain = COURTYARD.model_dump(mode="json", exclude_none=True)
    assert call(NAME) == call(str(path)) == call(path) == call(plain) == call(COURTYARD)


def test_a_blast_stays_as_it_was_made() -> None:
    blast = blast_env.Blast(COURTYARD)
    assert replace(blast, seed=2).scenario is blast.scenario
    with pytest.raises(FrozenInstanceError):
        blast.scenario = COURTYARD  # type: ignore[misc]
