"""Placing modules one by one: what may be placed, why not, and that both always agree."""

import copy
import pickle
import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env.errors import LayoutError
from blast_env.geometry import Cell
from blast_env.layout import LayoutState, check_layout, usable_cells
from blast_env.rules import random_element
from tests.site.documents import Document
from tests.site.zones import (
    area,
    available,
    buildable,
    filled,
    may_stand,
    zone_documents,
    zone_scenario,
)


def assert_free_explain_and_place_agree(placement: LayoutState, cells: list[Cell]) -> None:
    for cell in cells:
        reason = placement.explain(cell)
        assert (reason is None) == placement.free[cell], cell
        if reason is None:
            after = placement.place(cell)
            assert after.cells == (*placement.cells, cell)
            assert after.stock_left == placement.stock_left - 1
        else:
            with pytest.raises(LayoutError, match=f"^{re.escape(reason)}$"):
                placement.place(cell)


# --- Random zones against the rules written out the slow way.


@pytest.mark.slow
@given(zone_documents(), st.integers(0, 10**6))
def test_free_cells_are_those_that_the_rules_allow(document: Document, seed: int) -> None:
    scenario = buildable(document)
    zone = scenario.zone
    rng = np.random.default_rng(seed)
    placement = LayoutState.empty(scenario)
    # The checks of a scenario promise this.
    assert not placement.is_full
    while True:
        for cell in zone.cells():
            allowed = cell not in placement.cells and may_stand(scenario, {*placement.cells, cell})
            assert placement.free[cell] == allowed, (placement.cells, cell)
        assert_free_explain_and_place_agree(placement, list(zone.cells()))
        if placement.is_full:
            return
        cells = available(placement)
        placement = placement.place(cells[rng.integers(len(cells))])


@given(zone_documents(), st.integers(0, 10**6), st.data())
def test_order_does_not_matter_and_fewer_modules_are_no_worse(
    document: Document, seed: int, data: st.DataObject
) -> None:
    scenario = buildable(document)
    full = filled(scenario, np.random.default_rng(seed))
    shuffled = LayoutState.of(scenario, data.draw(st.permutations(full.cells)))
    assert (shuffled.free == full.free).all()
    assert shuffled.cost == full.cost
    some = data.draw(st.lists(st.sampled_from(full.cells), unique=True))
    fewer = LayoutState.of(scenario, some)
    assert all(fewer.free[cell] for cell in set(full.cells) - set(some))
    assert (fewer.free >= full.free).all()


@pytest.mark.parametrize("name", ["car_park", "hotel_forecourt", "school_wing", "perimeter_gate"])
def test_the_legal_places_are_those_of_the_same_layout_at_once(name: str) -> None:
    rng, placement = np.random.default_rng(0), LayoutState.empty(name)
    while not placement.is_full:
        placement = placement.place(random_element(placement, rng))
        at_once = LayoutState(placement.scenario, placement.layout)
        assert (placement.legal == at_once.legal).all(), placement.layout


# --- Whole layouts.


def test_layout_that_closes_the_way_is_refused_by_the_cell_that_closes_it() -> None:
    scenario = zone_scenario(access_way={"width_m": 0.5, "between": "left_right"})
    wall = [(row, 3) for row in range(8)]
    assert LayoutState.of(scenario, wall[:-1]).cells == tuple(wall[:-1])
    with pytest.raises(LayoutError, match=r"cell \(7, 3\) would close the access way of 0.5 m"):
        LayoutState.of(scenario, wall)
    with pytest.raises(LayoutError, match=r"cell \(0, 3\) would close the access way of 0.5 m"):
        check_layout(scenario, wall[::-1])
    # A diagonal wall: the vehicle does not fit between corners that touch.
    with pytest.raises(LayoutError, match=r"cell \(7, 7\) would close"):
        LayoutState.of(scenario, [(i, i) for i in range(8)])


@pytest.mark.parametrize("cell", [(np.int64(3), np.uint8(1)), np.array([3, 1]), [3, 1]])
def test_numpy_cells_become_plain_integers(cell: Any) -> None:
    placement = LayoutState.empty(zone_scenario()).place(cell)
    assert placement.cells == ((3, 1),)
    assert all(type(number) is int for number in placement.cells[0])
    assert placement.explain(cell) == "cell (3, 1) is taken by a module"


# --- A value like any other.


def test_placing_leaves_the_placement_as_it_was() -> None:
    before = LayoutState.empty(zone_scenario())
    free = before.free.copy()
    before.place((0, 0)).place((5, 5))
    assert (before.cells, before.stock_left, before.cost) == ((), 10, 0.0)
    assert (before.free == free).all()


@pytest.mark.parametrize("name", ["free", "usable", "open_ground"])
def test_arrays_are_read_only(name: str) -> None:
    placement = LayoutState.of(zone_scenario(), [(0, 0)])
    for case in (placement, pickle.loads(pickle.dumps(placement))):
        with pytest.raises(ValueError, match="read-only"):
            getattr(case, name)[0, 0] = 1


def test_placement_survives_pickling_and_copying() -> None:
    placement = LayoutState.of(zone_scenario(budget=5.0, module_cost=0.5), [(1, 2), (0, 0)])
    assert placement.free.any()
    for again in (pickle.loads(pickle.dumps(placement)), copy.deepcopy(placement)):
        assert again == placement
        assert (again.free == placement.free).all()
        assert again.place((3, 3)).cost == 1.5


def test_changed_copy_of_a_scenario_has_its_own_cells() -> None:
    """What holds for the cells is kept from call to call, but not for another scenario."""
    scenario = zone_scenario()
    assert usable_cells(scenario).all()
    assert scenario.build_zone is not None
    path = zone_scenario(keep_outs=[area(0.0, 0.0, 4.0, 0.5, reason="path")]).build_zone
    changed = scenario.model_copy(update={"build_zone": path})
    assert usable_cells(changed).sum() == 56
    assert usable_cells(scenario).all()
