"""Rules, moves, searches and proposals in a zone with a catalogue speak pieces."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blast_env.design.search import (
    DesignProblem,
    Layout,
    Moves,
    ProposerKind,
    cut,
    find_proposer,
    individual,
    layout_of,
    layouts_by_rule,
    mixed,
    proposers,
    random_part,
    random_walls,
    repaired,
)
from blast_env.evaluation import BlastEvaluator, LoadCase, LoadCaseSet
from blast_env.geometry import Piece
from blast_env.layout import LayoutState
from blast_env.rules import (
    line_of_sight_wall,
    random_layout,
    ring_around_building,
    ring_around_charge,
    wall_near_building,
    wall_near_charge,
)
from blast_env.site import Charge, Scenario
from tests.agents.sites import site
from tests.catalogue_sites import ITEMS, item, yard
from tests.design.search_cases import CALIBRATION

CHARGE = Charge((2.0, 6.0), 5.0)

YARDS = {
    "as it is": yard(),
    "with conditions": yard(
        clearance_m=1.0,
        access_way={"width_m": 1.0, "between": "left_right"},
        cost_areas=[
            {"corner_m": (3.5, 2.5), "size_m": (1.0, 3.0), "cost_factor": 2.0, "reason": "duct"}
        ],
    ),
    "without a budget": yard(budget=None),
}


def heights_m(scenario: Scenario, layout: Layout) -> list[float | None]:
    return [module.height_m for module in scenario.zone.modules(layout)]


# --- Rules.


@pytest.mark.parametrize("name", YARDS)
def test_every_rule_gives_a_legal_layout_of_pieces(name: str) -> None:
    layouts = layouts_by_rule(YARDS[name], CHARGE)
    assert len(layouts) == 9
    for layout in layouts.values():
        assert layout
        assert LayoutState.of(YARDS[name], layout).layout == layout
    assert layouts_by_rule(YARDS[name], CHARGE) == layouts


def test_without_a_catalogue_there_are_three_walls() -> None:
    few, all_of_them = (proposers(ProposerKind.RULE, suiting=[case]) for case in (site(), yard()))
    walls = [f"wall_{place}" for place in ("near_charge", "in_middle", "near_building")]
    assert list(few) == [*walls, "sight_lines"]
    assert len(all_of_them) == 9
    assert set(few) < set(all_of_them)


def test_walls_lie_across_the_line_of_sight() -> None:
    """Turned where the charge is in the west, not turned where it is in the south."""
    for rule in (wall_near_charge, wall_near_building):
        layout = rule(yard(), CHARGE)
        assert [element for element in layout if isinstance(element, Piece) and element.turned] == [
            *layout
        ]
        rows = sorted(row for row, _ in LayoutState.of(yard(), layout).cells)
        assert rows == list(range(rows[0], rows[0] + 9))
    south = line_of_sight_wall(yard(), Charge((9.0, 0.7), 5.0), 0.0)
    assert not any(isinstance(variant, Piece) and variant.turned for variant in south)


def test_high_walls_take_the_highest_item_and_long_ones_the_cheapest_length() -> None:
    scenario = yard(
        items=[
            item("high", 2, 1, 3.0, cost=8.0, stock=9),
            item("low", 4, 1, 1.0, cost=2.0, stock=9),
            item("post", 1, 1, 1.0, cost=0.1, stock=9),
        ],
        budget=16.0,
    )
    high, long = (line_of_sight_wall(scenario, CHARGE, 0.0, kind) for kind in ("high", "long"))
    assert set(heights_m(scenario, high)) == {3.0}
    assert heights_m(scenario, long).count(1.0) >= 12
    assert "post" not in {piece.item for piece in (*high, *long) if isinstance(piece, Piece)}


def test_what_is_left_goes_into_the_next_item() -> None:
    """Two of the dear walls, then baskets for what is left of the budget."""
    scenario = yard(items=[{**ITEMS[0], "stock": 2}, *ITEMS[1:]])
    layout = line_of_sight_wall(scenario, CHARGE, 0.0, "high")
    items = [element.item for element in layout if isinstance(element, Piece)]
    assert items == ["wall", "wall", "basket", "basket"]


def test_a_ring_bends_around_the_building() -> None:
    """With more wall than one side takes, it goes on along the next ones."""
    scenario = yard(
        corner_m=(4.0, 2.0),
        rows=16,
        columns=14,
        items=[item("wall", 3, 1, 2.0, stock=12)],
        clearance_m=0.5,
        budget=None,
    )
    layout = ring_around_building(scenario, CHARGE)
    turned = [element.turned for element in layout if isinstance(element, Piece)]
    assert turned[:2] == [True, True]
    assert turned.count(False) >= 2
    hut = scenario.structures[0].rectangle_m
    for element in layout:
        left, bottom, right, top = scenario.zone.element_rectangle_m(element)
        gap_m = max(left - hut.right, hut.left - right, bottom - hut.top, hut.bottom - top)
        assert 0.5 <= gap_m < 1.0


def test_a_ring_of_single_modules_stands_around_the_charge() -> None:
    scenario = site(charge_m=(20.0, 20.0), stock=12)
    layout = ring_around_charge(scenario, scenario.sample_charge(RNG()))
    rectangles = [scenario.zone.element_rectangle_m(element) for element in layout]
    away_m = [
        max(abs(x - 20.0), abs(y - 20.0)) for x, y in (rectangle.centre for rectangle in rectangles)
    ]
    assert len(away_m) == 12
    assert max(away_m) - min(away_m) < 0.5


def RNG() -> np.random.Generator:  # noqa: N802
    return np.random.default_rng(0)


# --- Draws, moves and crossings.


@given(name=st.sampled_from(sorted(YARDS)), seed=st.integers(0, 10_000))
def test_draws_and_neighbours_are_legal(name: str, seed: int) -> None:
    scenario, rng = YARDS[name], np.random.default_rng(seed)
    for draw in (random_layout, random_walls):
        layout = draw(scenario, rng)
        assert LayoutState.of(scenario, layout).is_full
    moves, layout = Moves(scenario, count_share=0.3), random_part(scenario, rng)
    for _ in range(15):
        layout = moves.neighbour(layout, rng)
        assert LayoutState.of(scenario, layout).layout == layout


def test_random_layouts_draw_every_item_and_orientation() -> None:
    rng = RNG()
    drawn = {
        (variant.item, variant.turned)
        for _ in range(20)
        for variant in random_layout(yard(), rng)
        if isinstance(variant, Piece)
    }
    assert drawn == {("wall", False), ("wall", True), ("basket", False), ("post", False)}


def test_moves_reach_every_layout() -> None:
    """On 2 x 2 cells: nothing, four places of a beam, two of two beams, four posts in any way."""
    scenario = yard(
        rows=2,
        columns=2,
        items=[item("beam", 2, 1, 1.0, stock=2), item("post", 1, 1, 1.0, stock=1)],
        budget=None,
    )
    rng, moves = RNG(), Moves(scenario)
    layout: Layout = ()
    met = {layout}
    for _ in range(1500):
        layout = moves.neighbour(layout, rng)
        met.add(tuple(sorted(layout)))
    # (), beams 4, pairs 2, posts 4, a beam and a post beside it 4 x 2.
    assert len(met) == 1 + 4 + 2 + 4 + 8


def test_a_dear_piece_becomes_several_cheap_ones_and_back() -> None:
    """At the end of the budget: height for length, which neither adding nor moving could do."""
    scenario = yard(
        items=[
            item("high", 2, 1, 3.0, cost=4.0, stock=2),
            item("low", 2, 1, 1.0, cost=2.0, stock=4),
        ],
        budget=8.0,
    )
    rng, moves = RNG(), Moves(scenario)
    layout: Layout = random_walls(scenario, rng)
    kinds = set()
    for _ in range(400):
        layout = moves.neighbour(layout, rng)
        kinds.add(tuple(sorted(element.item for element in layout if isinstance(element, Piece))))
    assert {("high", "high"), ("low",) * 4, ("high", "low", "low")} <= kinds


@given(name=st.sampled_from(sorted(YARDS)), seed=st.integers(0, 10_000))
@settings(max_examples=10)
def test_individuals_and_their_children_are_layouts(name: str, seed: int) -> None:
    scenario, rng = YARDS[name], np.random.default_rng(seed)
    first, second = random_layout(scenario, rng), random_walls(scenario, rng)
    assert layout_of(scenario, individual(scenario, first)) == tuple(sorted(first))
    for cross in (cut, mixed):
        child = cross(first, second, rng)
        assert set(child) <= {*first, *second}
        legal = repaired(scenario, child, rng)
        assert LayoutState.of(scenario, legal).layout == legal


# --- Searches.


@pytest.fixture(scope="module")
def problem() -> DesignProblem:
    """The yard for particles, in which a blast takes milliseconds, with few places for pieces."""
    scenario = yard(
        corner_m=(4.0, 4.5),
        rows=6,
        columns=2,
        items=[item("wall", 3, 1, 2.0, cost=3.0, stock=2), item("post", 1, 1, 1.0, stock=2)],
        budget=7.0,
    ).model_copy(update={"calibration": CALIBRATION})
    case = LoadCaseSet(scenario, (LoadCase(CHARGE, 1),), charge=CHARGE)
    return DesignProblem(BlastEvaluator(scenario, "event"), case)


@pytest.mark.parametrize("method", ["random", "population_annealing", "genetic", "nsga2"])
def test_searches_find_layouts_of_pieces(problem: DesignProblem, method: str) -> None:
    result = find_proposer(method).propose(problem, 60, 0)
    assert LayoutState.of(problem.scenario, result.layout).layout == result.layout
    assert any(isinstance(element, Piece) and element.item == "wall" for element in result.layout)
    assert result.blasts <= 60
    assert result.load is not None
    assert result.load < 0.8 * problem.load(())
    assert find_proposer(method).propose(problem, 60, 0).layout == result.layout


def test_the_front_is_over_the_cost(problem: DesignProblem) -> None:
    result = find_proposer("nsga2").propose(problem, 80, 1)
    costs = [candidate.cost for candidate in result.front]
    assert costs == sorted(set(costs))
    assert costs[0] == 0.0
    assert len(costs) >= 3
    assert result.front_table()["cost"].tolist() == costs
    impulses = [candidate.load for candidate in result.front]
    assert impulses == sorted(impulses, reverse=True)
