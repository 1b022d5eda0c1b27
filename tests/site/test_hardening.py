"""Measures that harden facades are part of layouts: files, masks, costs, and what is refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blast_env.design.search import ProposerKind, proposers
from blast_env.errors import LayoutError
from blast_env.geometry import Measure, Piece, layout_counts, layout_words, standing
from blast_env.io.export import LayoutPlan, bill_of_quantities, element_table
from blast_env.layout import LayoutState, load_layout, write_layout
from blast_env.plots import barrier_features
from blast_env.rules import hardening_alone, hardening_and_sight_lines
from blast_env.site import Scenario, ScenarioError
from tests.catalogue_sites import WALL, yard_document

FACADE = {"storey_m": 2.5, "bay_m": 1.5, "glazing": "pane", "wall": "brick_215"}
PANE = {"kind": "glazing", "title": "small window", "source": "made up", "thickness_mm": 3.78}
PANE |= {"width_m": 1.0, "height_m": 0.8}
GLASS = {"name": "glass", "glazing": "window_laminated_6", "cost": 5.0}
PANELS = {"name": "panels", "wall": "concrete_150", "cost": 4.0, "walls": ["west", "east"]}
TAKEN = Measure.named("glass")


def document(*hardening: dict[str, Any], **objective: Any) -> dict[str, Any]:
    found = yard_document(hardening=list(hardening or (GLASS, PANELS)))
    found["structures"][0]["facade"] = FACADE
    found["components"] = {"pane": PANE}
    if objective:
        found["objective"] = {"kind": "response", **objective}
    return found


def glazed_yard(*hardening: dict[str, Any], **objective: Any) -> Scenario:
    return Scenario.from_document(document(*hardening, **objective), "yard")


def test_a_measure_covers_no_cell_and_can_be_taken_once() -> None:
    placement = LayoutState.empty(glazed_yard())
    numbers = [variant.is_measure for variant in placement.catalogue.variants]
    legal = placement.legal[np.array(numbers)]
    assert legal.shape[0] == 2
    assert legal.sum() == 2
    taken = placement.place(TAKEN)
    assert taken.cells == ()
    assert taken.cost == 5.0
    assert (taken.legal == placement.legal).sum() == placement.legal.size - 1
    action = taken.catalogue.action(TAKEN)
    assert taken.catalogue.element(action) == TAKEN
    assert isinstance(taken.catalogue.element(action), Measure)
    with pytest.raises(LayoutError, match="the stock of 1 'glass' is used up"):
        taken.place(TAKEN)
    with pytest.raises(LayoutError, match="row and column must be 0"):
        placement.place(Piece(1, 0, "glass"))
    with pytest.raises(LayoutError, match="it is not turned"):
        placement.place(Piece(0, 0, "glass", True))


def test_a_measure_is_no_piece_in_words() -> None:
    assert layout_counts((*WALL[:2], TAKEN), "barrier") == "2 barrier pieces (2 wall), glass"
    assert layout_counts((*WALL[:1], TAKEN), of=9) == "1 of 9 pieces (1 wall), glass"
    assert layout_counts((TAKEN,)) == layout_words((TAKEN,)) == "glass"
    assert layout_words(()) == "nothing"


def test_measures_take_from_the_budget() -> None:
    scenario = Scenario.from_document(document({**GLASS, "cost": 16.0}, PANELS), "yard")
    placement = LayoutState.of(scenario, [TAKEN])
    assert placement.budget_left == pytest.approx(4.0)
    with pytest.raises(LayoutError, match="only 4 of the budget of 20 is left"):
        placement.place(WALL[0])


def test_bays_get_what_measures_put_there() -> None:
    scenario = glazed_yard()
    unprotected, glazed = scenario.bays, scenario.bays_with([TAKEN, *WALL[:1]])
    assert [bay.bay for bay in unprotected] == [bay.bay for bay in glazed]
    for before, after in zip(unprotected, glazed, strict=True):
        assert before.glazing is not None
        assert after.glazing is not None
        assert after.glazing.interlayer is not None
        assert (after.glazing.width_m, after.glazing.sill_m) == (1.0, before.glazing.sill_m)
        assert after.wall == before.wall
    panels = scenario.bays_with([Measure.named("panels")])
    changed = {
        panel.bay.wall for panel, old in zip(panels, unprotected, strict=True) if panel != old
    }
    assert changed == {"west", "east"}


def test_of_two_measures_on_a_bay_the_later_one_counts() -> None:
    better = {"name": "better", "glazing": "window_laminated_12", "cost": 6.0}
    scenario = glazed_yard(GLASS, better)
    both = [Measure.named("better"), TAKEN]
    assert scenario.bays_with(both) == scenario.bays_with(both[:1]) != scenario.bays_with(both[1:])


def test_a_rule_takes_the_dearest_glass_and_then_what_cuts_lines_of_sight() -> None:
    """Both kinds of glass are for the same windows; panels change other components."""
    better = {"name": "better", "glazing": "window_laminated_12", "cost": 6.0}
    scenario = glazed_yard(GLASS, better, PANELS)
    alone, both = hardening_alone(scenario), hardening_and_sight_lines(scenario)
    assert {case[2:3] for case in alone} == {("better",), ("panels",)}
    assert both[: len(alone)] == alone
    assert len(both) > len(alone)
    assert LayoutState.of(scenario, both).cost <= scenario.zone.cost_limit
    needing = set(proposers(ProposerKind.RULE)) - set(
        proposers(ProposerKind.RULE, suiting=[Scenario.from_document(yard_document(), "yard")])
    )
    assert {"hardening_alone", "hardening_and_sight_lines"} <= needing


def test_layout_file_has_measures(tmp_path: Path) -> None:
    scenario = glazed_yard()
    path = tmp_path / "layout.json"
    layout = (*WALL, TAKEN)
    write_layout(path, scenario, layout)
    content = json.loads(path.read_text())
    assert content["hardening"] == ["glass"]
    read = load_layout(path, scenario)
    assert read == layout
    assert standing(read) == WALL
    write_layout(path, scenario, WALL)
    content = json.loads(path.read_text())
    assert "hardening" not in content


def test_the_bill_has_measures_and_plans_have_not() -> None:
    plan = LayoutPlan(glazed_yard(), (*WALL, TAKEN))
    bill = bill_of_quantities(plan).set_index("item")
    assert bill.loc["glass", "cost"] == 5.0
    assert bill.loc["total", "cost"] == bill["cost"].drop("total").sum()
    assert set(element_table(plan)["item"]) == {"wall", "post"}
    assert len(list(barrier_features(plan.scenario, plan.layout))) == len(WALL)


def test_hash_is_as_ever_where_nothing_of_it_is_used() -> None:
    unprotected = document()
    del unprotected["build_zone"]["hardening"]
    with_facade = Scenario.from_document(unprotected, "yard")
    plain = Scenario.from_document(yard_document(), "yard")
    assert with_facade.content_hash == plain.content_hash
    assert glazed_yard().content_hash != plain.content_hash  # there is more to be built


@pytest.mark.parametrize(
    ("hardening", "message"),
    [
        (
            {"glazing": "brick_215"},
            "hardening[0].glazing: is 'brick_215', there is no such component",
        ),
        (
            {"wall": "window_film_6"},
            "hardening[0].wall: is 'window_film_6', there is no such component",
        ),
        ({"glazing": "window_laminated_7"}, "did you mean 'window_laminated_6'"),
        ({"glazing": "window_film_6", "cost": -1.0}, "hardening[0].cost: is -1.0: Input should be"),
        ({}, "hardening[0].glazing: missing: glazing, wall or both must be given"),
        ({"glazing": "window_film_6", "storeys": [7]}, "'better' covers no bay with windows"),
        ({"glazing": "window_film_6", "structures": ["hat"]}, "hardening[0].structures[0]: "),
        ({"glazing": "window_film_6", "name": "wall"}, "already the name of build_zone.items[0]"),
    ],
)
def test_unsound_measures_get_the_errors_of_the_file(
    hardening: dict[str, Any], message: str
) -> None:
    with pytest.raises(ScenarioError) as error:
        glazed_yard({"name": "better", "cost": 3.0, **hardening})
    assert message in str(error.value)
    assert len(error.value.problems) == 1


def test_measures_need_items() -> None:
    found = document()
    found["build_zone"] |= {"stock": 3}
    del found["build_zone"]["items"]
    with pytest.raises(ScenarioError, match=r"build_zone.hardening: must be left out"):
        Scenario.from_document(found, "yard")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"quantity": "peak"}, "objective.quantity: must be left out: kind is 'response'"),
        ({"kind": "load", "target": "low"}, "objective.target: must be left out: kind is 'load'"),
        (
            {"target_probability": 0.95},
            "objective.target_probability: must be left out: there is no target",
        ),
        ({"target": "good"}, "objective.target: is 'good': Input should be"),
    ],
)
def test_unsound_objectives_get_the_errors_of_the_file(
    change: dict[str, Any], message: str
) -> None:
    found = document(charges="mean")
    found["objective"] |= change
    with pytest.raises(ScenarioError) as error:
        Scenario.from_document(found, "yard")
    assert message in str(error.value)


def test_a_target_needs_facade_and_budget() -> None:
    found = document(target="medium")
    del found["structures"][0]["facade"], found["build_zone"]["hardening"]
    with pytest.raises(ScenarioError, match="no protected structure has a facade"):
        Scenario.from_document(found, "yard")
    found = document(target="medium")
    del found["build_zone"]["budget"]
    with pytest.raises(ScenarioError, match=r"build_zone.budget: missing: objective.target"):
        Scenario.from_document(found, "yard")
    found = document(measure="glazing")
    found["structures"][0]["facade"] = {"wall": "brick_215"}
    found["build_zone"]["hardening"] = [PANELS]
    with pytest.raises(ScenarioError, match="no protected structure has a facade with glazing"):
        Scenario.from_document(found, "yard")
