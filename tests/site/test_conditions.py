"""Each condition of a build zone by itself, and the sentence that it refuses a cell with."""

import re

import numpy as np
import pytest

from blast_env.errors import LayoutError
from blast_env.geometry import Cell
from blast_env.layout import LayoutState, usable_cells
from blast_env.site import Scenario
from tests.site.documents import minimal_document
from tests.site.zones import area, structure, zone_scenario


def test_budget_can_be_spent_to_the_last_of_it() -> None:
    # Three times 0.1 is more than 0.3 in floating-point numbers.
    placement = LayoutState.of(zone_scenario(module_cost=0.1, budget=0.3), [(0, 0), (0, 1)])
    assert placement.free.sum() == 62
    full = placement.place((0, 2))
    assert full.is_full
    assert (full.budget_left, full.stock_left) == (0.0, 7)
    assert full.cost == pytest.approx(0.3)


def test_cells_too_dear_for_the_rest_of_the_budget_are_not_free() -> None:
    duct = area(0.0, 0.0, 1.0, 4.0, module_cost=3.0, reason="duct")
    placement = LayoutState.empty(zone_scenario(budget=4.5, cost_areas=[duct]))
    assert placement.free.all()
    after = placement.place((0, 0)).place((0, 7))
    assert (after.cost, after.budget_left) == (4.0, 0.5)
    assert after.is_full
    other = placement.place((0, 7)).place((1, 7))
    assert not other.free[:, :2].any()
    assert other.free[2:, 2:].all()


def test_highest_cost_counts_where_areas_overlap_and_areas_may_be_cheap() -> None:
    duct = area(0.0, 0.0, 1.0, 1.0, module_cost=3.0, reason="duct")
    slab = area(0.5, 0.5, 1.25, 1.0, module_cost=0.5, reason="foundation slab")
    costs = LayoutState.empty(zone_scenario(cost_areas=[slab, duct])).empty_zone.module_costs
    # The slab reaches half into column 3.
    assert costs[:4, :5].tolist() == [
        [3.0, 3.0, 1.0, 1.0, 1.0],
        [3.0, 3.0, 0.5, 0.5, 1.0],
        [1.0, 0.5, 0.5, 0.5, 1.0],
        [1.0, 1.0, 1.0, 1.0, 1.0],
    ]


@pytest.mark.parametrize(
    ("clearance_m", "blocked"),
    [
        (0.0, 4),  # beside the building
        (0.5, 16),  # one cell apart is exactly the bound
        (0.51, 32),
        (0.7, 32),  # still free: one cell apart along both axes, 0.707 m
        (0.71, 36),
    ],
)
def test_clearance_may_be_met_exactly(clearance_m: float, blocked: int) -> None:
    building = structure("building", 1.5, 1.5, 2, 2)
    usable = usable_cells(zone_scenario(building, clearance_m=clearance_m))
    assert (~usable).sum() == blocked


def test_clearance_is_rounded_at_corners() -> None:
    usable = usable_cells(zone_scenario(structure("building", 0.0, 0.0, 1, 1), clearance_m=2.5))
    # The nearest points are 1.5 m apart along x and 2 m along y: 2.5 m, exactly enough.
    assert usable[5, 4]
    assert not usable[4, 4]
    assert not usable[5, 3]


def test_module_moves_the_access_way_to_the_other_side() -> None:
    """Three rows, and a vehicle that is two cells wide and may change rows before and after."""
    way = {"width_m": 1.0, "between": "left_right"}
    placement = LayoutState.empty(zone_scenario(rows=3, stock=24, access_way=way))
    assert placement.free.tolist() == [[True] * 8, [False] * 8, [True] * 8]
    after = placement.place((0, 3))
    assert np.flatnonzero(after.free[0]).tolist() == [0, 1, 2, 4, 5, 6, 7]
    assert not after.free[1].any()
    assert np.flatnonzero(after.free[2]).tolist() == [0, 6, 7]


@pytest.mark.parametrize(
    ("cell", "words"),
    [
        ((-1, 0), "cell (-1, 0) is outside the build zone of 8 rows and 8 columns"),
        ((0, 8), "cell (0, 8) is outside the build zone of 8 rows and 8 columns"),
        ((7, 7), "cell (7, 7) must stay empty: hydrant"),
        ((0, 0), "cell (0, 0) overlaps the structure 'building'"),
        ((1, 3), "cell (1, 3) is closer than 1 m to the structure 'building' (0.5 m)"),
        ((3, 4), "cell (3, 4) is taken by a module"),
        ((5, 1), "cell (5, 1) costs 4, but only 2.5 of the budget of 4 is left"),
        ((6, 6), "cell (6, 6) would close the access way of 2 m from left to right"),
        ((1, 4), None),
    ],
)
def test_cell_has_its_reason(cell: Cell, words: str | None) -> None:
    scenario = zone_scenario(
        structure("building", 0.0, 0.0, 1, 2),
        clearance_m=1.0,
        keep_outs=[area(3.5, 3.5, 0.5, 0.5, reason="hydrant")],
        module_cost=1.5,
        cost_areas=[area(0.5, 2.5, 0.5, 0.5, module_cost=4, reason="duct")],
        budget=4.0,
        access_way={"width_m": 2.0, "between": "left_right"},
    )
    # Four rows are left above the module, just enough for the vehicle, and three below it.
    placement = LayoutState.of(scenario, [(3, 4)])
    assert placement.explain(cell) == words
    if words is not None:
        with pytest.raises(LayoutError, match=f"^{re.escape(words)}$"):
            placement.place(cell)


def test_used_stock_is_the_reason_wherever_the_site_allows_a_module() -> None:
    placement = LayoutState.of(zone_scenario(stock=2), [(0, 0), (1, 1)])
    assert (placement.is_full, placement.stock_left) == (True, 0)
    assert placement.explain((3, 4)) == "the stock of 2 modules is used up"
    assert placement.explain((1, 1)) == "cell (1, 1) is taken by a module"
    single = LayoutState.of(zone_scenario(stock=1), [(0, 0)])
    assert single.explain((3, 4)) == "the stock of 1 module is used up"


def test_charge_keeps_its_cells_free() -> None:
    placement = LayoutState.empty(zone_scenario(corner_m=[1.0, 1.0]))
    # The charge is at (2, 2) m, the corner of four cells, and 0.5 m in radius.
    assert (~placement.usable).sum() == 4
    assert (placement.explain((1, 1)) or "").endswith("where the charge may be (charge[0])")


def test_nothing_can_be_placed_without_a_build_zone() -> None:
    placement = LayoutState.empty(Scenario.from_document(minimal_document(), "test"))
    assert placement.free.shape == placement.usable.shape == (0, 0)
    assert (placement.is_full, placement.stock_left, placement.cost) == (True, 0, 0.0)
    assert placement.budget_left is None
    assert placement.explain((0, 0)) == (
        "cell (0, 0) is not usable: the scenario has no build zone"
    )
