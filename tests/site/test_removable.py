"""Structures that may be taken away: part of layouts, gone for blasts and vehicles."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import blast_env
from blast_env.answers import Table
from blast_env.answers.report import Limit, StudyOptions, report_document, run_report
from blast_env.design.search import DesignProblem, RandomSearch
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.errors import LayoutError
from blast_env.evaluation import BlastEvaluator, LoadCase, LoadCaseSet, evaluate_layout
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.geometry import Piece, Removal, layout_words, standing
from blast_env.io.export import LayoutPlan, bill_of_quantities
from blast_env.layout import (
    LayoutState,
    build_site,
    load_layout,
    load_relevant,
    worst_places,
    write_layout,
)
from blast_env.plots import Kinds, site_features
from blast_env.site import Scenario, ScenarioError
from tests.builders import block
from tests.catalogue_sites import WALL, yard_document

FENCE = block("fence", 3.0, 4.0, 8, 1, height_m=2.0)
AWAY = Removal.named("no_fence")
SHORT = GasEngine(border_m=0.0)


def document(**zone: Any) -> dict[str, Any]:
    removable = [{"name": "no_fence", "structures": ["fence"], "cost": 3.0}]
    found = yard_document(**{"removable": removable, **zone})
    found["structures"].append(FENCE)
    return found


def fenced(**zone: Any) -> Scenario:
    return Scenario.from_document(document(**zone), "yard")


def test_a_blast_is_that_of_the_site_without_it() -> None:
    scenario = fenced()
    never = Scenario.from_document(yard_document(), "yard")
    there, away, unprotected = (
        blast_env.simulate(site, layout, engine=SHORT)
        for site, layout in ((scenario, WALL), (scenario, (*WALL, AWAY)), (never, WALL))
    )
    assert away.digest == unprotected.digest
    assert there.impulse("hut").pa_s < away.impulse("hut").pa_s
    names = [structure.name for structure in build_site(scenario, (AWAY,)).structures]
    assert names == ["hut"]


@pytest.mark.parametrize("first", ["hut", "fence"])
def test_a_layout_that_takes_it_away_is_judged_like_others(first: str, tmp_path: Path) -> None:
    """Records, tables and the store had wanted a load on it; tables went by the order of loads."""
    found = document()
    found["structures"].sort(key=lambda structure: structure["name"] != first)
    site = Scenario.from_document(found, "yard")
    threat = LoadCase(site.sample_charge(np.random.default_rng(0)))
    judged = evaluate_layout(site, (*WALL, AWAY), threats=[threat], engine=SHORT, cache=tmp_path)
    known = BlastEvaluator(site, SHORT, cache=tmp_path)
    whole, _ = known.loads((), threat), known.loads((*WALL, AWAY), threat)
    assert known.counts.blasts == 0
    (hut,) = (load for load in whole.structures if load.name == "hut")
    for table in (judged.table, judged.building_table):
        (row,) = table.to_dict("records")
        assert row["structure"] == "hut"
        assert row["unprotected_impulse_pa_s"] == hut.impulse_pa_s
        assert row["impulse_pa_s"] != hut.impulse_pa_s
    modules = judged.module_table
    assert set(modules["structure"]) == {"hut"}
    start = 0 if first == "hut" else 8  # modules of the fence
    own = whole.module_impulse_n_s[start : start + len(modules)]
    np.testing.assert_array_equal(modules["unprotected_impulse_n_s"], own)


def test_a_report_on_a_layout_that_takes_it_away_is_of_what_is_left() -> None:
    limits = (Limit("hut", impulse_pa_s=1.0), Limit("fence", impulse_pa_s=1.0))
    options = StudyOptions(cells=(0.5, 0.5), items=False, places=1, limits=limits)
    found = run_report(fenced(), (*WALL, AWAY), options)
    assert found.study.buildings(protected=False) == ()
    words = [own.limit.building for own in found.study.verdicts[1].limited]
    assert words == ["hut"] * len(found.study.threats)
    titles = [part.title for part in report_document(found).parts if isinstance(part, Table)]
    assert "Limits of loads" in titles


def test_it_is_a_part_of_layouts_that_blasts_meet_and_that_covers_no_cell(tmp_path: Path) -> None:
    scenario = fenced()
    placement = LayoutState.of(scenario, (*WALL, AWAY))
    assert placement.cost == pytest.approx(13.0 + 3.0)
    assert placement.cells == LayoutState.of(scenario, WALL).cells
    assert standing(placement.layout) == WALL
    assert load_relevant(placement.layout) == (*WALL, AWAY)
    with pytest.raises(LayoutError, match="the stock of 1 'no_fence' is used up"):
        placement.place(AWAY)
    action = placement.catalogue.action(AWAY)
    assert isinstance(placement.catalogue.element(action), Removal)
    assert isinstance(LayoutState.of(scenario, [Piece(0, 0, "no_fence")]).layout[0], Removal)
    path = write_layout(tmp_path / "layout.json", scenario, (*WALL, AWAY))
    content = json.loads(path.read_text())
    assert content["taken_away"] == ["no_fence"]
    assert "hardening" not in content
    assert load_layout(path, scenario) == (*WALL, AWAY)
    bill = bill_of_quantities(LayoutPlan(scenario, (*WALL, AWAY))).set_index("item")
    assert (bill.loc["no_fence", "cost"], bill.loc["total", "cost"]) == (3.0, 16.0)
    assert layout_words((AWAY,)) == "no_fence"
    assert layout_words((*WALL, AWAY)) == "3 pieces (2 wall, 1 post), no_fence"


def test_pictures_show_what_is_taken_away_apart() -> None:
    scenario = fenced()
    kinds = {
        bool(layout): {
            site_feature.name: site_feature.kind for site_feature in site_features(scenario, layout)
        }
        for layout in ((), (AWAY,))
    }
    assert kinds[False]["fence"] is Kinds.STRUCTURE
    assert kinds[True]["fence"] is Kinds.TAKEN_AWAY


def test_a_vehicle_drives_where_it_stood() -> None:
    """A fence right across the site keeps it away; without it, the vehicle gets to the hut."""
    found = document()
    entry = {"start_m": [0.0, 5.0], "end_m": [0.0, 7.0]}
    found["charge"] = [{"kind": "vehicle", "tnt_kg": 5.0, "width_m": 2.0, "entries": [entry]}]
    found["structures"][1] |= {"rows": 24, "corner_m": [5.5, 0.0]}
    scenario = Scenario.from_document(found, "yard")
    (vehicle,) = scenario.vehicles
    near = [worst_places(scenario, vehicle, layout).stand_off_m for layout in ((), (AWAY,))]
    assert near[0] == pytest.approx(7.5 - 5.5 + 1.0)  # half its width
    assert near[1] == pytest.approx(1.0)
    assert "as near as 1.0 m" in LayoutState.of(scenario, [AWAY]).explain_vehicles()[0]


def test_environment_and_search_take_it_where_it_pays() -> None:
    """Behind a fence that a wall of the same height replaces, nothing is left to gain by it."""
    scenario = fenced(budget=3.0, items=[{**_ITEM, "cost": 3.0}])
    environment = BlastBarrierEnv(scenario, action="place", engine=SHORT)
    _, info = environment.reset(seed=0)
    action = LayoutState.empty(scenario).catalogue.action(AWAY)
    assert info["action_mask"][action]
    _, reward, ended, _, info = environment.step(action)
    assert ended  # nothing more can be paid for
    assert environment.placement.layout == (AWAY,)
    assert reward < 0.0
    evaluator = BlastEvaluator(scenario, SHORT)
    charge = scenario.sample_charge(np.random.default_rng(0))
    case = LoadCaseSet(scenario, (LoadCase(charge),), charge=charge)
    found = RandomSearch().propose(DesignProblem(evaluator, case), 12, 0)
    assert found.layout
    assert AWAY not in found.layout


_ITEM = {"name": "wall", "length_modules": 3, "thickness_modules": 1, "height_m": 2.0, "stock": 1}


@pytest.mark.parametrize(
    ("removable", "place", "message"),
    [
        ({"structures": ["fense"]}, ".structures[0]", "did you mean 'fence'"),
        ({"structures": ["hut"]}, ".structures[0]", "is protected: it cannot be removed"),
        ({"structures": ["fence", "fence"]}, ".structures[1]", "removes already"),
        ({"structures": []}, ".structures", "should have at least 1"),
        ({"name": "wall"}, ".name", "already the name of build_zone.items[0]"),
        ({"cost": 0.0}, ".cost", "greater than or equal to 0.000001"),
    ],
)
def test_what_cannot_be_taken_away_is_refused(
    removable: dict[str, Any], place: str, message: str
) -> None:
    one = {"name": "no_fence", "structures": ["fence"], "cost": 3.0}
    with pytest.raises(ScenarioError) as caught:
        fenced(removable=[{**one, **removable}])
    assert f"build_zone.removable[0]{place}: " in str(caught.value)
    assert message in str(caught.value)


def test_without_items_it_is_refused_and_names_do_not_count_for_the_hash() -> None:
    with pytest.raises(ScenarioError, match="removable: must be left out"):
        fenced(items=[], height_m=2.0, stock=3)
    changed = document()
    changed["build_zone"]["removable"][0]["description"] = "the old fence"
    assert Scenario.from_document(changed, "yard").content_hash == fenced().content_hash
    assert fenced().content_hash != fenced(removable=[]).content_hash
