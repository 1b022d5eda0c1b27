"""Rules: walls across the line of sight, lines of posts, random layouts; always legal."""

import re
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from blast_env.design.by_atlas import WORSE
from blast_env.design.proposal import problem_of
from blast_env.design.search import find_proposer, layouts_by_rule
from blast_env.errors import BlastEnvError
from blast_env.evaluation import draw_threats
from blast_env.geometry import Layout, Piece
from blast_env.layout import LayoutState, check_layout, worst_places
from blast_env.rules import (
    NEAR_BUILDING,
    NEAR_CHARGE,
    expected_charge,
    line_of_posts,
    line_of_sight_wall,
    posts_and_wall,
    random_layout,
    wall_near_building,
    wall_near_charge,
    why_no_wall,
)
from blast_env.site import Charge, PointSource, RectangleSource, Scenario, load_scenario
from blast_env.sites import close_ranges, generate_site
from tests.agents.sites import site
from tests.vehicle_sites import POSTS, gate_site, site_document, vehicle_document, vehicle_of

WEST = Charge((5.0, 20.0), 100.0)
BUILDING_M = (32.0, 20.0)


def centres_m(scenario: Scenario, layout: Layout) -> np.ndarray:
    """Return the centres of modules (n, 2)."""
    zone = scenario.zone
    return np.array([zone.element_rectangle_m(element).centre for element in layout])


def covered_m(scenario: Scenario, layout: Layout, charge: Charge) -> list[tuple[float, float]]:
    """Return from where to where each module reaches across the line of sight, in order."""
    across = sight(charge)[::-1] * (-1.0, 1.0)
    half_m = 0.25 * float(np.abs(across).sum())
    aside_m = np.sort((centres_m(scenario, layout) - charge.position_m) @ across)
    return [(float(distance_m) - half_m, float(distance_m) + half_m) for distance_m in aside_m]


def sight(charge: Charge) -> np.ndarray:
    """Return the direction in which the building is seen from the charge (2,)."""
    along = np.subtract(BUILDING_M, charge.position_m)
    return np.asarray(along / np.hypot(*along))


@pytest.mark.parametrize(("share", "column"), [(0.0, 0), (0.5, 9), (1.0, 19)])
def test_wall_stands_upright_where_it_is_asked_for(share: float, column: int) -> None:
    """The line of sight runs along a row: twelve modules in one column, six on either side."""
    wall = line_of_sight_wall(site(), WEST, share)
    assert {cell[1] for cell in wall} <= {column, column + 1}
    assert sorted(cell[0] for cell in wall) == list(range(4, 16))


@given(
    angle=st.floats(-1.3, 1.3),
    distance_m=st.floats(22.0, 26.0),
    share=st.floats(0.0, 1.0),
    stock=st.integers(1, 24),
)
def test_a_wall_on_open_ground_has_no_hole_and_is_centred(
    angle: float, distance_m: float, share: float, stock: int
) -> None:
    """Seen along the line of sight, whatever its direction, module touches module.

    Where the two sides begin they may leave less than a module open.
    """
    charge_m = (
        BUILDING_M[0] - distance_m * np.cos(angle),
        BUILDING_M[1] - distance_m * np.sin(angle),
    )
    assume(all(1.0 < coordinate_m < 39.0 for coordinate_m in charge_m))
    charge = Charge(charge_m, 100.0)
    scenario = site(stock=stock, corner_m=(1.0, 1.0), rows=76, columns=56, keep_outs=())
    scenario = scenario.model_copy(
        update={"charge": (PointSource(position_m=charge_m, tnt_kg=1.0),)}
    )
    wall = line_of_sight_wall(scenario, charge, share)
    intervals = covered_m(scenario, wall, charge)
    width_m = 0.5 * float(np.abs(sight(charge)).sum())
    for (_, end), (begin, _) in pairwise(intervals):
        assert begin <= end + 1e-6 or (begin <= width_m and begin - end < width_m)
    if len(wall) == stock:
        assert abs(intervals[0][0] + intervals[-1][1]) <= 3.0 * width_m


@given(
    charge_y_m=st.floats(2.0, 38.0),
    share=st.floats(0.0, 1.0),
    blocked=st.tuples(st.integers(0, 15), st.integers(0, 15), st.integers(1, 8), st.integers(1, 8)),
    budget=st.floats(4.0, 20.0),
    way_m=st.sampled_from([1.0, 2.5, 4.0]),
)
def test_a_wall_keeps_every_condition(
    charge_y_m: float, share: float, blocked: tuple[int, int, int, int], budget: float, way_m: float
) -> None:
    row, column, rows, columns = blocked
    scenario = site(
        charge_m=(5.0, charge_y_m),
        keep_outs=[
            {
                "corner_m": (15.0 + 0.5 * column, 15.0 + 0.5 * row),
                "size_m": (0.5 * columns, 0.5 * rows),
                "reason": "a tree",
            }
        ],
        clearance_m=1.0,
        budget=budget,
        cost_areas=[
            {"corner_m": (20.0, 15.0), "size_m": (5.0, 10.0), "module_cost": 2.0, "reason": "rock"}
        ],
        access_way={"width_m": way_m, "between": "left_right"},
    )
    charge = Charge((5.0, charge_y_m), 100.0)
    wall = line_of_sight_wall(scenario, charge, share)
    assert len(wall) > 1
    assert LayoutState.of(scenario, wall).cells == wall
    assert line_of_sight_wall(scenario, charge, share) == wall


def test_a_greater_share_is_farther_from_the_charge() -> None:
    for name in ("courtyard", "perimeter_gate", "street_junction"):
        scenario = load_scenario(name)
        charge = expected_charge(scenario.charge)
        walls = [line_of_sight_wall(scenario, charge, share) for share in (0.0, 0.5, 1.0)]
        away_m = [
            np.hypot(*(centres_m(scenario, wall) - charge.position_m).T).min() for wall in walls
        ]
        assert away_m[0] < away_m[1] < away_m[2]


def test_the_wall_goes_round_a_corner() -> None:
    """At the street junction the pavement, and with it the wall, turns round the block."""
    scenario = load_scenario("street_junction")
    wall = line_of_sight_wall(scenario, Charge((20.0, 20.0), 100.0), NEAR_CHARGE)
    x_m, y_m = centres_m(scenario, wall).T
    assert (x_m > 25.0).any()
    assert (y_m > 25.0).any()


def test_the_budget_buys_less_where_modules_cost_more() -> None:
    scenario = load_scenario("street_junction")
    charge = expected_charge(scenario.charge)
    near_kerb, near_facade = (
        wall_near_charge(scenario, charge),
        wall_near_building(scenario, charge),
    )
    assert len(near_facade) < len(near_kerb) == 12


def test_a_path_leaves_a_gap_and_the_wall_goes_on_behind_it() -> None:
    """It does not jump to the end of the path, and the gap is as wide as the path."""
    path = {"corner_m": (15.0, 21.5), "size_m": (8.0, 1.0), "reason": "a path"}
    wall = line_of_sight_wall(site(keep_outs=[path]), WEST, NEAR_CHARGE)
    assert {cell[1] for cell in wall} == {0}
    assert sorted(cell[0] for cell in wall) == [*range(3, 13), 15, 16]


def test_the_wall_bends_round_a_tree() -> None:
    """A small obstacle on its line is no reason for a gap."""
    tree = {"corner_m": (15.0, 21.0), "size_m": (0.5, 0.5), "reason": "a tree"}
    wall = line_of_sight_wall(site(keep_outs=[tree]), WEST, NEAR_CHARGE)
    assert (12, 1) in wall
    assert sorted(cell[0] for cell in wall) == list(range(4, 16))


def test_no_module_goes_where_the_building_hides_the_charge() -> None:
    """From below to the left, a wall across the line of sight would reach behind a long row."""
    scenario = site(charge_m=(5.0, 10.0), corner_m=(10.0, 11.0), rows=30, columns=40, stock=30)
    houses = tuple(
        scenario.structures[0].model_copy(
            update={"name": f"house_{number}", "corner_m": (15.0 + number, 20.0), "side_modules": 2}
        )
        for number in range(20)
    )
    row = scenario.model_copy(update={"structures": houses})
    places_m = centres_m(row, line_of_sight_wall(row, Charge((5.0, 10.0), 100.0), NEAR_BUILDING))
    beyond_m = places_m[places_m[:, 1] > 20.0]
    assert len(places_m) - len(beyond_m) > 5
    # Their lines of sight pass the houses' end at x = 15 m above the roofs at y = 21 m.
    assert (11.0 * (beyond_m[:, 0] - 5.0) <= 10.0 * (beyond_m[:, 1] - 10.0)).all()


def test_between_two_buildings_the_wall_stays_on_the_side_of_the_charge() -> None:
    """The line of sight ends in the open, between them; the zone goes on behind it."""
    scenario = site(building_m=(20.0, 28.0), rows=20, columns=30)
    building = scenario.structures[0]
    other = building.model_copy(update={"name": "other", "corner_m": (20.0, 8.0)})
    both = scenario.model_copy(update={"structures": (building, other)})
    wall = line_of_sight_wall(both, WEST, NEAR_BUILDING)
    assert wall
    assert centres_m(both, wall)[:, 0].max() < 22.0


def test_behind_the_building_there_is_no_wall() -> None:
    scenario = site(charge_m=(38.0, 20.0))
    charge = Charge((38.0, 20.0), 100.0)
    assert line_of_sight_wall(scenario, charge) == ()
    way = "between the charge, (38.0, 20.0) m, and the protected structures"
    assert why_no_wall(scenario, charge) == f"the build zone has no cell {way}"
    both = [PointSource(position_m=(x_m, 21.0), tnt_kg=1.0) for x_m in (22.0, 40.0)]
    reason = why_no_wall(scenario.model_copy(update={"charge": tuple(both)}), None)
    assert "the mean place of the charges, (31.0, 21.0) m" in reason
    assert reason.endswith("lies within the bounds of building: choose one charge")


def test_the_reason_for_no_wall_names_what_takes_its_place() -> None:
    assert why_no_wall(site(), WEST) == ""
    trees = {"corner_m": [0.0, 0.0], "size_m": [32.0, 40.0], "reason": "trees"}
    reason = why_no_wall(site(keep_outs=[trees], columns=40), WEST)
    numbers = re.findall(r"of (\d+) cells .*, (\d+) are not usable \((\d+): each", reason)
    assert len(set(*numbers)) == 1
    assert reason.endswith("must stay empty: trees)")
    rock = trees | {"reason": "rock", "module_cost": 2.0}
    dear = why_no_wall(site(budget=1.0, cost_areas=[rock], columns=40), WEST)
    assert "0 are not usable; on" in dear
    assert "costs 2, but only 1 of the budget" in dear


def test_the_wall_turns_to_the_building_that_counts_most() -> None:
    scenario = site(rows=30)
    building = scenario.structures[0]

    def height_m(weight: float) -> float:
        other = building.model_copy(
            update={"name": "other", "corner_m": (30.0, 30.0), "weight": weight}
        )
        both = scenario.model_copy(update={"structures": (building, other)})
        return float(centres_m(both, line_of_sight_wall(both, WEST))[:, 1].mean())

    assert height_m(0.1) + 1.0 < height_m(1.0) < height_m(9.0) - 1.0


def test_the_expected_charge_is_the_mean_by_weight() -> None:
    point = PointSource(position_m=(10.0, 0.0), tnt_kg=100.0, weight=3.0)
    area = RectangleSource(
        kind="rectangle", corner_m=(0.0, 2.0), size_m=(4.0, 4.0), tnt_kg=20.0, weight=1.0
    )
    assert expected_charge((point, area)) == Charge((8.0, 1.0), 80.0)


def test_what_makes_no_sense_is_an_error() -> None:
    with pytest.raises(BlastEnvError, match=r"share is 1\.5, must be from 0 to 1"):
        line_of_sight_wall(site(), WEST, 1.5)
    with pytest.raises(BlastEnvError, match="'free_field' has no build zone"):
        line_of_sight_wall(load_scenario("free_field"), WEST)
    with pytest.raises(BlastEnvError, match="there is no line of sight"):
        line_of_sight_wall(site(), Charge(BUILDING_M, 100.0))
    with pytest.raises(BlastEnvError, match=r"charge: position_m\[0\] is -5"):
        line_of_sight_wall(site(), Charge((-5.0, 20.5), 100.0))
    with pytest.raises(BlastEnvError, match=r"charge is \(5, 12\), must be .* kg of TNT"):
        line_of_sight_wall(site(), (5, 12))  # type: ignore[arg-type]


# ---


@pytest.mark.parametrize("name", ["courtyard", "perimeter_gate", "street_junction"])
def test_random_layouts_are_legal_and_use_what_there_is(name: str) -> None:
    """Full stock, or nothing left that could be afforded or would leave the way open."""
    scenario = load_scenario(name)
    drawn = [random_layout(scenario, np.random.default_rng(seed)) for seed in (0, 1, 2, 3, 3)]
    assert all(LayoutState.of(scenario, draw).is_full for draw in drawn)
    assert drawn[3] == drawn[4]
    assert set(drawn[2]) != set(drawn[3])


def test_every_usable_cell_is_as_likely() -> None:
    """Chi-square over 3 x 4 cells of which two are kept out: 99.99 % of such sums are below 34."""
    scenario = site(
        rows=3,
        columns=4,
        stock=1,
        keep_outs=[{"corner_m": (15.0, 15.0), "size_m": (1.0, 0.5), "reason": "a tree"}],
    )
    rng, counts = np.random.default_rng(0), np.zeros((3, 4))
    for _ in range(1000):
        ((row, column, *_),) = random_layout(scenario, rng)
        counts[row, column] += 1
    assert counts[0, :2].sum() == 0
    tried = counts.ravel()[2:]
    assert float(((tried - 100.0) ** 2 / 100.0).sum()) < 34.0


# --- The rules against vehicles: where the line of posts stands, and what the wall adds.


def stand_off_m(scenario: Scenario, layout: Layout) -> float:
    return worst_places(scenario, vehicle_of(scenario), layout).stand_off_m


def with_zone(**changes: Any) -> Scenario:
    return gate_site(build_zone=site_document()["build_zone"] | changes)


def open_site(stock: int) -> Scenario:
    """A hut in the middle of a site on which the vehicle can drive all around it."""
    hut = site_document()["structures"][0] | {"corner_m": [10.0, 9.0], "rows": 6}
    return gate_site(
        vehicle_document(
            entries=[{"start_m": [x_m, 2.0], "end_m": [x_m, 18.0]} for x_m in (0.0, 22.0)]
        ),
        site={"width_m": 22.0, "height_m": 20.0},
        build_zone={"corner_m": [3.0, 1.0], "rows": 36, "columns": 36, "stock": stock},
        structures=[hut],
    )


def test_across_a_strip_it_is_the_column_next_to_the_entry_with_gaps_that_just_hold() -> None:
    scenario = gate_site()
    posts = line_of_posts(scenario)
    # Four posts make five gaps of at most 1.5 m on 8 m; three would leave 1.6 m or more in one.
    assert posts == ((3, 0), (7, 0), (11, 0), (15, 0))
    assert stand_off_m(scenario, posts) == stand_off_m(scenario, POSTS) == pytest.approx(7.0)
    for post in posts:
        fewer = tuple(cell for cell in posts if cell != post)
        assert stand_off_m(scenario, fewer) < 7.0


def test_a_line_that_the_stock_does_not_close_is_not_begun() -> None:
    assert line_of_posts(with_zone(stock=3)) == ()
    assert len(line_of_posts(with_zone(stock=4))) == 4


def test_around_a_building_the_ring_is_as_far_out_as_the_stock_reaches() -> None:
    stand_offs_m = []
    for stock in (12, 20, 28, 36):
        scenario = open_site(stock)
        posts = line_of_posts(scenario)
        assert len(posts) <= stock
        assert LayoutState.of(scenario, posts)
        stand_offs_m.append(stand_off_m(scenario, posts))
    assert stand_offs_m == sorted(stand_offs_m)
    assert stand_offs_m[0] < stand_offs_m[-1] - 2.0


def test_an_access_way_without_a_gate_leaves_no_line_and_one_with_a_gate_does() -> None:
    way: dict[str, Any] = {"width_m": 2.0, "between": "left_right"}
    assert line_of_posts(with_zone(access_way=way)) == ()
    gate = {"corner_m": [4.0, 3.0], "size_m": [0.5, 2.0]}
    gated = with_zone(access_way=way | {"gate": gate})
    posts = line_of_posts(gated)
    assert stand_off_m(gated, posts) == pytest.approx(7.0)
    assert not any(6 <= row < 10 for row, column, *_ in posts if column == 0)


def test_with_a_catalogue_the_posts_are_the_cheapest_item_that_closes_the_line() -> None:
    hedge = {"name": "hedge", "length_modules": 4, "height_m": 2.0, "cost": 0.1, "stock": 9}
    post = {"name": "post", "length_modules": 1, "height_m": 1.0, "cost": 2.0, "stock": 4}
    zone = {"corner_m": [4.0, 0.0], "rows": 16, "columns": 4}

    def posts_of(kerb_cost: float) -> Layout:
        kerb = {"name": "kerb", "length_modules": 4, "height_m": 0.5, "stock": 9}
        items = [hedge | {"stops_vehicles": False}, kerb | {"cost": kerb_cost}, post]
        scenario = gate_site(build_zone=zone | {"items": items})
        layout = line_of_posts(scenario)
        assert stand_off_m(scenario, layout) == pytest.approx(7.0)
        return layout

    # Two kerbs of 2 m leave gaps of 1.5 m, 1.5 m and 1 m; posts leave as narrow ones between four.
    assert posts_of(3.0) == (Piece(3, 0, "kerb", True), Piece(10, 0, "kerb", True))
    assert posts_of(5.0) == tuple(Piece(row, 0, "post") for row in (3, 7, 11, 15))


def test_the_wall_is_added_to_the_posts_and_keeps_the_stand_off() -> None:
    scenario = with_zone(stock=9)
    posts, both = line_of_posts(scenario), posts_and_wall(scenario)
    assert both[: len(posts)] == posts
    assert len(both) == 9
    assert stand_off_m(scenario, both) >= stand_off_m(scenario, posts)
    assert LayoutState.of(scenario, both)


def test_without_a_vehicle_there_is_no_line_of_posts() -> None:
    with pytest.raises(BlastEnvError, match="courtyard has no vehicle"):
        line_of_posts(load_scenario("courtyard"))


def test_pieces_keep_off_all_places_where_a_known_charge_may_be() -> None:
    """The lines are those of the charge, but a place near another possible one is not legal."""
    scenario = generate_site(10_009, close_ranges(20.0))
    (threat,) = draw_threats(scenario, [0])
    for layout in layouts_by_rule(scenario, threat.charge).values():
        assert check_layout(scenario, layout) == layout


@pytest.mark.parametrize(
    ("rule", "worse"),
    [("ring_around_building", True), ("wall_near_building", True), ("wall_in_middle", False)],
)
def test_a_rule_that_makes_a_site_worse_comes_with_the_word(rule: str, worse: bool) -> None:
    """By gas dynamics the first two of hotel_forecourt add 9 %, the third takes off 56 %."""
    problem = problem_of("hotel_forecourt", None)
    found = find_proposer(rule).propose(problem, 0)
    assert found.layout
    assert (found.by == WORSE) == worse


def test_layouts_by_rule_are_those_of_their_own_charge() -> None:
    """Two rules share the layout of sight lines, which is that of one site and one charge."""
    scenario = load_scenario("courtyard")
    charges = [Charge((5.0, y_m), 100.0) for y_m in (12.0, 18.0)]
    found = [layouts_by_rule(scenario, charge) for charge in (*charges, *charges)]
    assert found[:2] == found[2:]
    assert found[0] != found[1]
    again = layouts_by_rule(scenario.model_copy(), charges[1])
    assert again == found[1]
