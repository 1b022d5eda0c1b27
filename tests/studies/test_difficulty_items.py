"""The study of scenarios with a catalogue: what is compared, the criteria, table and figure."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from blast_env import load_scenario
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.layout import Placement
from blast_env.site import Scenario, VehicleCharge
from studies.difficulty.__main__ import elsewhere_text, item_rows, joint_rows, with_items
from studies.difficulty.figure import items_figure
from studies.difficulty.items import (
    ItemEffort,
    ItemResult,
    ItemStudy,
    Purchase,
    every_place,
    pieces_text,
    rules_of,
)
from studies.difficulty.study import TaskResult, WayOutcome
from studies.difficulty.verdict import item_criteria, joint_criteria
from tests.catalogue_sites import yard_document
from tests.vehicle_sites import gate_site

SMALL = ItemEffort(layouts=2, budget=14, tried=1, finalists=2, place_budget=10)
PLACES = 3
BARE = np.array([100.0, 120.0, 80.0])


def two_places() -> Scenario:
    """Return the yard with a second place of the charge."""
    document = yard_document()
    document["charge"].append({**document["charge"][0], "position_m": [2.0, 9.0]})
    return Scenario.from_document(document, "yard")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("blasts")


def study(folder: Path) -> ItemStudy:
    """Return a study whose blasts end after 15 ms, before all has arrived."""
    return ItemStudy(two_places(), SMALL, GasEngine(until=0.015), processes=1, cache=folder)


@pytest.fixture(scope="module")
def result(folder: Path) -> ItemResult:
    made = study(folder)
    found = made.result()
    assert made.evaluator.blasts <= SMALL.blasts(two_places())
    return found


def test_all_is_judged_at_every_place(result: ItemResult) -> None:
    task = result.task
    assert [row.name for row in task.rules] == list(rules_of(result.scenario))
    assert task.random.impulse_pa_s.shape == (SMALL.layouts, 2)
    assert len(result.of_places.layouts) == 2
    for row in (*task.rows, result.finalists, result.of_places):
        assert row.impulse_pa_s.shape == (len(row.layouts), 2)
        for layout in row.layouts:
            Placement.of(result.scenario, layout)  # refuses one that is not legal
    assert task.bare.reduction.value == 0.0


def test_the_search_is_no_worse_than_the_rules_that_it_begins_with(result: ItemResult) -> None:
    """At the place that it met; it is judged at the others too."""
    searched = result.finalists.impulse_pa_s[:, 0].min()
    assert searched <= min(rule.impulse_pa_s[0, 0] for rule in result.task.rules)
    assert result.over_rules >= 0.0
    assert result.searched_blasts <= SMALL.budget


def test_an_interrupted_study_goes_on_from_the_folder(result: ItemResult, folder: Path) -> None:
    again = study(folder)
    found = again.result()
    assert again.evaluator.blasts == 0
    assert found.best.layouts == result.best.layouts
    assert (found.elsewhere == result.elsewhere).all()


def test_layouts_for_one_place_are_the_best_there(result: ItemResult) -> None:
    assert (np.diag(result.elsewhere) >= result.elsewhere.max(axis=0) - 1e-12).all()
    assert result.loss_elsewhere >= 0.0
    text = elsewhere_text(result)
    assert text.count("best for place") == 2


def test_the_table_and_the_figure_have_every_layout(result: ItemResult) -> None:
    rows = item_rows(result)
    assert [row[0] for row in rows] == [row.name for row in result.task.rows]
    assert rows[0][3:] == (f"{result.task.bare.mean_pa_s.value:,.0f}", "-", "-")
    figure = items_figure(result)
    names = [label.get_text() for label in figure.axes[1].get_yticklabels()]
    assert {
        *rules_of(result.scenario),
        "no barrier",
        "random layouts",
        result.task.searched.name,
    } == set(names)


def test_places_of_vehicles_are_their_worst_ones() -> None:
    scenario = gate_site()
    charges = [place.charge for place in every_place(scenario)]
    assert all(isinstance(charge, VehicleCharge) for charge in charges)
    assert [charge.rank for charge in charges if isinstance(charge, VehicleCharge)] == [0, 1, 2, 3]
    more = set(rules_of(scenario)) - set(rules_of(two_places()))
    assert more == {"line of posts", "posts and a wall"}


def test_places_must_be_listed_and_as_likely() -> None:
    with pytest.raises(BlastEnvError, match="kind 'segment' has no end of places"):
        every_place(load_scenario("courtyard"))
    document = yard_document()
    document["charge"].append({**document["charge"][0], "weight": 3.0})
    with pytest.raises(BlastEnvError, match="weights from 1 to 3, must all be as likely"):
        every_place(Scenario.from_document(document, "yard"))


def test_every_bundled_scenario_with_items_can_be_studied() -> None:
    for name in with_items():
        scenario = load_scenario(name)
        assert len(every_place(scenario)) > 1
        assert scenario.zone.budget is not None  # or random layouts would not cost the same


def row(name: str, *left: float, shift: float = 0.0) -> WayOutcome:
    """Return layouts that leave such shares of the impulse, at the last place more by `shift`."""
    shares = np.array(left)[:, None] + np.array([0.0, 0.0, shift])
    return WayOutcome(name, ((),) * len(left), shares * BARE, BARE)


def made_up(
    name: str = "yard",
    rules: tuple[float, float, float] = (0.6, 0.7, 0.65),
    searched: float = 0.5,
    random: tuple[float, ...] = (0.95, 0.9, 0.8, 0.75),
    elsewhere: float = 0.2,
) -> ItemResult:
    """Return a result with a rule that buys height, one that buys length and one for both."""
    document = yard_document() | {"name": name}
    of_places = WayOutcome(
        "best for a place",
        ((),) * PLACES,
        BARE * (searched - 0.1 + elsewhere * (1.0 - np.eye(PLACES))),
        BARE,
    )
    return ItemResult(
        scenario=Scenario.from_document(document, name),
        effort=SMALL,
        places=(),
        task=TaskResult(
            bare=row("no barrier", 1.0),
            random=row("random", *random),
            rules=tuple(row(f"rule {k}", share) for k, share in enumerate(rules)),
            searched=row("search", searched),
        ),
        finalists=row("finalists", searched),
        of_places=of_places,
        buys=(Purchase.HEIGHT, Purchase.LENGTH, None),
        searched_blasts=0,
    )


@pytest.mark.parametrize(
    ("changes", "unmet"),
    [
        ({}, []),
        ({"rules": (0.7, 0.7, 0.7), "searched": 0.66, "random": (1.0, 1.0, 0.9, 0.8)}, [0]),
        ({"random": (0.7, 0.65, 0.6, 0.55)}, [1]),
        ({"random": (0.85, 0.85, 0.84, 0.86)}, [2]),
    ],
)
def test_what_a_scenario_needs_by_itself(changes: dict, unmet: list[int]) -> None:
    criteria = item_criteria(made_up(**changes))
    assert [number for number, each in enumerate(criteria) if not each.met] == unmet


LENGTH = {"rules": (0.7, 0.6, 0.65)}


@pytest.mark.parametrize(
    ("results", "unmet"),
    [
        ([{}, {}, LENGTH], []),
        ([{"rules": (0.52, 0.7, 0.65)}] * 2 + [{"rules": (0.54, 0.53, 0.65)}], [0, 1]),
        ([{}, {"rules": (0.5, 0.7, 0.65)}, LENGTH | {"rules": (0.7, 0.5, 0.6)}], [1]),
        ([{}, {"elsewhere": 0.0}, LENGTH], [2]),
        ([{}, {}, {}], [3]),
    ],
)
def test_what_the_scenarios_need_together(results: list[dict], unmet: list[int]) -> None:
    made = [made_up(f"yard_{k}", **changes) for k, changes in enumerate(results)]
    criteria = joint_criteria(made)
    assert [number for number, each in enumerate(criteria) if not each.met] == unmet


def test_rules_are_compared_with_the_best_found() -> None:
    made = [made_up("one"), made_up("two", rules=(0.45, 0.7, 0.65))]
    assert joint_rows(made)[0] == ("rule 0", "10.0", "0.0")
    assert made[1].best.name == "rule 0"
    assert made[0].rule_loss("no such rule") is None
    other = replace(made[0], buys=(Purchase.HEIGHT, Purchase.DISTANCE, None))
    assert (made[0].better_buy, other.better_buy) == (Purchase.HEIGHT, Purchase.HEIGHT)
    assert set(other.purchases) == {Purchase.HEIGHT, Purchase.DISTANCE}


def test_pieces_are_counted_by_item() -> None:
    scenario = load_scenario("visitor_entrance")
    layout = rules_of(scenario)["wall in the middle"].rule(
        scenario, every_place(scenario)[1].charge
    )
    assert pieces_text(layout) == "4 t_wall_3_6, 2 t_wall_2_0"
    assert pieces_text(()) == "-"
