"""Where a vehicle gets to, against a search step by step, and where its charge goes off."""

from collections.abc import Callable
from itertools import product
from math import hypot

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from blast_env.arrays import FloatArray
from blast_env.geometry import Rectangle
from blast_env.layout import LayoutState, charge_against, vehicle_reach, worst_places
from blast_env.site import AnyCharge, Charge, Site, VehicleCharge, VehicleSource, ranked
from blast_env.vehicles import Entry, Obstacles, Reach, VehicleGround
from tests.vehicle_sites import POSTS, gate_site, vehicle_document, vehicle_of

SIDE = 12
"""Squares along the sites of the pictures."""


def squares(*places: tuple[int, int]) -> tuple[Rectangle, ...]:
    return tuple(
        Rectangle.from_corner((0.5 * column, 0.5 * row), (0.5, 0.5)) for row, column in places
    )


def ground(width_m: float, side_m: float = 0.5 * SIDE) -> VehicleGround:
    """An empty square; the vehicle comes in anywhere in the west."""
    source = VehicleSource.model_validate(
        vehicle_document(width_m=width_m, entries=[{"start_m": [0.0, 0.0], "end_m": [0.0, side_m]}])
    )
    return VehicleGround(source, Site(width_m=side_m, height_m=side_m))


def step_by_step(
    width: int, is_closed: Callable[[int, int], bool], side: int
) -> set[tuple[int, int]]:
    """Lower left squares of a vehicle of whole squares that moves along rows and columns."""

    def is_free(row: int, column: int) -> bool:
        inside = 0 <= row <= side - width and 0 <= column <= side - width
        covered = product(range(row, row + width), range(column, column + width))
        return inside and not any(is_closed(*square) for square in covered)

    frontier = [(row, 0) for row in range(side) if is_free(row, 0)]
    found = set(frontier)
    while frontier:
        row, column = frontier.pop()
        for step in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            place = (row + step[0], column + step[1])
            if place not in found and is_free(*place):
                found.add(place)
                frontier.append(place)
    return found


def whole_places(reach: Reach, width_m: float) -> set[tuple[int, int]]:
    """The lower left squares of a vehicle that stands on whole squares."""
    corners = (reach.places_m - width_m / 2.0) / 0.5
    whole = np.abs(corners - corners.round()).max(axis=1, initial=0.0) < 1e-6
    return {(round(y), round(x)) for x, y in corners[whole]}


places = st.tuples(st.integers(0, SIDE - 1), st.integers(0, SIDE - 1))


@given(stops=st.frozensets(places, max_size=40), width=st.integers(1, 4))
@example(stops=frozenset((row, 5) for row in range(0, SIDE, 3)), width=2)  # just fits
@example(stops=frozenset((row, 5) for row in range(0, SIDE, 3)), width=3)  # half a metre too wide
@example(stops=frozenset((row, 11 - row) for row in range(SIDE)), width=1)  # only corners touch
def test_it_gets_where_a_search_along_rows_and_columns_gets(
    stops: frozenset[tuple[int, int]], width: int
) -> None:
    reach = ground(0.5 * width).reach(Obstacles(stops=squares(*sorted(stops))))
    expected = step_by_step(width, lambda *square: square in stops, SIDE)
    assert whole_places(reach, 0.5 * width) == expected
    covered = {
        (row + up, column + right)
        for row, column in expected
        for up, right in product(range(width), repeat=2)
    }
    drawn = reach.ground(SIDE, SIDE)
    assert {(int(row), int(column)) for row, column in np.argwhere(drawn)} == covered


@given(
    boxes=st.lists(st.tuples(*[st.integers(0, 27)] * 2, *[st.integers(1, 9)] * 2), max_size=8),
    width=st.integers(5, 11),
)
def test_lengths_need_be_no_multiple_of_half_a_metre(
    boxes: list[tuple[int, int, int, int]], width: int
) -> None:
    """The search goes by steps of 0.1 m, of which all lengths here are multiples."""
    side = 30
    rectangles = tuple(
        Rectangle.from_corner((0.1 * x, 0.1 * y), (0.1 * across, 0.1 * up))
        for x, y, across, up in boxes
    )
    closed = {
        (row, column)
        for x, y, across, up in boxes
        for row, column in product(range(y, y + up), range(x, x + across))
    }
    reach = ground(0.1 * width, 0.1 * side).reach(Obstacles(stops=rectangles))
    corners = range(side - width + 1)
    got = {
        (row, column)
        for row, column in product(corners, repeat=2)
        if reach.reached[
            part(reach.y_m, 0.1 * row + 0.05 * width), part(reach.x_m, 0.1 * column + 0.05 * width)
        ]
    }
    assert got == step_by_step(width, lambda *square: square in closed, side)


@given(
    boxes=st.lists(st.tuples(*[st.integers(0, 47)] * 2, *[st.integers(1, 9)] * 2), max_size=8),
    solid=st.integers(0, 3),
    width=st.integers(5, 11),
)
def test_the_worst_places_need_no_reach_and_are_the_same_to_the_last_bit(
    boxes: list[tuple[int, int, int, int]], solid: int, width: int
) -> None:
    rectangles = tuple(
        Rectangle.from_corner((0.1 * x, 0.1 * y), (0.1 * across, 0.1 * up))
        for x, y, across, up in boxes
    )
    obstacles = Obstacles(stops=rectangles[solid:], solid=rectangles[:solid])
    own = ground(0.1 * width)
    walls = (Rectangle(4.0, 4.5, 5.0, 4.5), Rectangle(5.0, 1.3, 5.0, 4.5))
    own = VehicleGround(own.source, own.site, (Rectangle(4.0, 1.3, 5.0, 4.5),), walls)
    if len(own.drive(obstacles).places_m):
        assert own.worst_places(obstacles) == own.drive(obstacles).worst


def part(cuts_m: FloatArray, at_m: float) -> int:
    """Number of the cut at a value, or of the part between two cuts."""
    after = int(np.searchsorted(cuts_m, at_m - 1e-9))
    return 2 * after if abs(cuts_m[after] - at_m) < 1e-9 else 2 * after - 1


@pytest.mark.parametrize(("gap_m", "passes"), [(1.8, True), (1.799999, False)])
def test_posts_closer_together_than_the_width_stop_it(gap_m: float, passes: bool) -> None:
    posts = (Rectangle(3.0, 0.0, 3.1, 2.0), Rectangle(3.0, 2.0 + gap_m, 3.1, 6.0))
    reach = ground(1.8).reach(Obstacles(stops=posts))
    assert bool(reach.places_m[:, 0].max() > 3.0) is passes


def test_ground_that_is_not_drivable_and_keep_outs_are_closed() -> None:
    road = [{"corner_m": [0.0, 2.0], "size_m": [8.0, 3.0]}]
    ditch = [{"corner_m": [6.0, 0.0], "size_m": [1.0, 8.0], "reason": "a ditch"}]
    free = gate_site()
    on_road = gate_site(vehicle_document(drivable=road))
    on_both = gate_site(vehicle_document(drivable=road, keep_outs=ditch))
    reaches = [vehicle_reach(case, vehicle_of(case)) for case in (free, on_road, on_both)]
    farthest_m = [reach.places_m.max(axis=0).tolist() for reach in reaches]
    assert farthest_m == [[13.0, 7.0], [7.0, 4.0], [5.0, 4.0]]


def test_a_gate_is_closed_to_the_vehicle_and_open_to_the_access_way() -> None:
    """The posts leave a way of 2 m, which is closed by a gate for all but the fire engine."""
    way = {"width_m": 2.0, "between": "left_right"}
    gate = {"corner_m": [4.0, 3.0], "size_m": [0.5, 2.0]}
    posts = tuple((row, 0) for row in (0, 3, 5, 10, 12, 15))

    def stand_off_m(access_way: dict[str, object]) -> float:
        zone = gate_site().zone.model_dump() | {"access_way": access_way}
        scenario = gate_site(build_zone=zone)
        return worst_places(scenario, vehicle_of(scenario), posts).stand_off_m

    assert stand_off_m(way) == pytest.approx(1.0)
    assert stand_off_m(way | {"gate": gate}) == pytest.approx(7.0)


def test_the_worst_places_touch_the_wall_that_faces_them_from_its_middle_outwards() -> None:
    scenario = gate_site(vehicle_document(places=3))
    worst = worst_places(scenario, vehicle_of(scenario))
    # All around the hut it can touch; the west wall's middle is as near as the others', and first.
    assert worst.places_m[0] == (9.0, 4.0)
    assert worst.distances_m == pytest.approx((1.0, 1.0, 1.0))
    for one, other in ((0, 1), (0, 2), (1, 2)):
        (x0, y0), (x1, y1) = worst.places_m[one], worst.places_m[other]
        assert hypot(x1 - x0, y1 - y0) >= 2.0 - 1e-6


def test_places_are_as_far_apart_as_the_scenario_says() -> None:
    scenario = gate_site(vehicle_document(apart_m=3.5, places=100))
    worst = worst_places(scenario, vehicle_of(scenario), POSTS)
    for (x0, y0), (x1, y1) in product(worst.places_m, repeat=2):
        assert (x0, y0) == (x1, y1) or hypot(x1 - x0, y1 - y0) >= 3.5 - 1e-6
    assert list(worst.distances_m) == sorted(worst.distances_m)
    # Nothing that it could reach is far enough from all of them.
    left = vehicle_reach(scenario, vehicle_of(scenario), POSTS).places_m
    for place_m in left:
        assert min(np.hypot(*(np.array(worst.places_m) - place_m).T)) < 3.5


def test_only_walls_that_count_are_approached() -> None:
    hut = gate_site().structures[0].model_dump()
    east = gate_site(structures=[hut | {"faces": ["east"]}])
    assert worst_places(east, vehicle_of(east)).places_m[0] == (13.0, 4.0)
    unprotected = {**hut, "name": "shed", "protected": False, "corner_m": [7.0, 6.0], "rows": 2}
    beside = gate_site(structures=[hut, unprotected])
    assert worst_places(beside, vehicle_of(beside)).places_m[0] == (9.0, 4.0)


def test_behind_posts_it_stands_at_the_posts() -> None:
    scenario = gate_site()
    worst = worst_places(scenario, vehicle_of(scenario), POSTS)
    assert worst.places_m[0] == (3.0, 4.0)
    assert worst.stand_off_m == pytest.approx(7.0)
    gap = worst_places(scenario, vehicle_of(scenario), POSTS[:2] + POSTS[3:])
    assert gap.stand_off_m == pytest.approx(1.0)


def test_a_charge_beyond_the_last_place_is_at_the_worst_one_again() -> None:
    scenario = gate_site(vehicle_document(places=2, height_m=0.5))
    source = vehicle_of(scenario)
    worst = worst_places(scenario, source, POSTS)
    charges = [charge_against(scenario, POSTS, VehicleCharge(source, rank)) for rank in range(4)]
    first, second = (Charge(place_m, 5.0, 0.5) for place_m in worst.places_m)
    assert charges == [first, second, first, second]
    fixed = Charge((1.0, 1.0), 3.0)
    assert charge_against(scenario, POSTS, fixed) is fixed


def test_charges_of_one_vehicle_take_one_place_after_the_other() -> None:
    one, other = vehicle_of(gate_site()), vehicle_of(gate_site(vehicle_document(tnt_kg=9.0)))
    fixed = Charge((1.0, 1.0), 3.0)
    drawn: list[AnyCharge] = [VehicleCharge(one), VehicleCharge(other), fixed, VehicleCharge(one)]
    numbered = [VehicleCharge(one), VehicleCharge(other), fixed, VehicleCharge(one, 1)]
    assert list(ranked(drawn)) == numbered


def test_modules_keep_clear_of_the_entries_so_that_it_can_always_enter() -> None:
    zone = gate_site().zone.model_dump() | {"corner_m": [0.5, 0.0]}
    scenario = gate_site(build_zone=zone)
    placement = LayoutState.empty(scenario)
    assert placement.explain((4, 0)) == "cell (4, 0) is where a vehicle enters (charge[0])"
    entered = np.zeros((16, 4), dtype=bool)
    entered[4:12, :3] = True  # the entry of 4 m, as deep as the vehicle is wide
    assert (placement.usable == ~entered).all()
    cells = [(int(row), int(column)) for row, column in np.argwhere(placement.usable)]
    worst = worst_places(scenario, vehicle_of(scenario), cells)
    assert worst.places_m[0] == (1.0, 4.0)


def test_what_does_not_stop_it_is_driven_over_but_holds_no_charge() -> None:
    scenario = gate_site()
    source = vehicle_of(scenario)
    bed = Rectangle(4.0, 0.0, 9.5, 8.0)
    worst = scenario.vehicle_ground(source).worst_places(Obstacles(solid=(bed,)))
    assert worst.places_m[0] == (11.0, 1.0)  # beyond the bed, at the south wall's middle
    assert not any(bed.overlaps(Rectangle(x - 1, y - 1, x + 1, y + 1)) for x, y in worst.places_m)


def test_an_entry_is_found_on_every_side() -> None:
    site = Site(width_m=10.0, height_m=6.0)
    ends = {
        "west": ((0.0, 1.0), (0.0, 4.0)),
        "east": ((10.0, 4.0), (10.0, 1.0)),
        "south": ((1.0, 0.0), (4.0, 0.0)),
        "north": ((1.0, 6.0), (4.0, 6.0)),
        None: ((0.0, 1.0), (1.0, 0.0)),
    }
    strips = {
        "west": (0.0, 1.0, 2.0, 4.0),
        "east": (8.0, 1.0, 10.0, 4.0),
        "south": (1.0, 0.0, 4.0, 2.0),
        "north": (1.0, 4.0, 4.0, 6.0),
    }
    for side, (start_m, end_m) in ends.items():
        entry = Entry(start_m=start_m, end_m=end_m)
        assert entry.side(site) == side
        found = entry.side(site)
        if found is not None:
            assert entry.strip_m(site, found, 2.0) == strips[found]
