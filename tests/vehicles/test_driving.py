"""How fast a vehicle gets, against closed forms and simulated drives, and what its speed breaks."""

from math import cos, hypot, pi, sin, sqrt
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from blast_env.geometry import Piece, Rectangle
from blast_env.layout import LayoutState, vehicle_drive, worst_places
from blast_env.rules import line_of_posts
from blast_env.site import Scenario, ScenarioError, Site, VehicleSource, loaded_walls
from blast_env.vehicles import (
    KM_H_PER_M_S,
    STEP_M,
    CrashPiece,
    CrashRating,
    Obstacles,
    SpeedField,
    VehicleGround,
)
from tests.vehicle_sites import gate_site, site_document, vehicle_document

LORRY: dict[str, Any] = {
    "mass_kg": 7200.0,
    "max_speed_km_h": 90.0,
    "acceleration_m_s2": 2.0,
    "entry_speed_km_h": 0.0,
    "grip": 0.7,
}


def ground(
    width_m: float,
    height_m: float,
    entry: tuple[float, float],
    drivable: list[tuple[float, float, float, float]],
    **motion: Any,
) -> VehicleGround:
    """A site with roads (left, bottom, right, top) that a lorry of 2 m enters in the west."""
    areas = [
        {"corner_m": [left, bottom], "size_m": [right - left, top - bottom]}
        for left, bottom, right, top in drivable
    ]
    low, high = entry
    document = vehicle_document(
        entries=[{"start_m": [0.0, low], "end_m": [0.0, high]}],
        drivable=areas,
        motion=LORRY | motion,
    )
    source = VehicleSource.model_validate(document)
    return VehicleGround(source, Site(width_m=width_m, height_m=height_m))


def speeds_of(ground: VehicleGround, obstacles: Obstacles | None = None) -> SpeedField:
    speeds = ground.drive(obstacles or Obstacles()).speeds
    assert speeds is not None
    return speeds


@pytest.mark.parametrize("entry_speed_km_h", [0.0, 40.0])
@pytest.mark.parametrize("run_up_m", [10.0, 30.0, 60.0])
def test_a_straight_run_up_gives_what_constant_acceleration_gives(
    run_up_m: float, entry_speed_km_h: float
) -> None:
    road = ground(80.0, 6.0, (2.0, 4.0), [(0, 2, 80, 4)], entry_speed_km_h=entry_speed_km_h)
    wall = Rectangle(run_up_m + 2.0, 2.0, run_up_m + 2.5, 4.0)
    speed_km_h = speeds_of(road, Obstacles((wall,))).impact_km_h(wall)
    exact = [
        KM_H_PER_M_S * sqrt((entry_speed_km_h / KM_H_PER_M_S) ** 2 + 4.0 * metres)
        for metres in (run_up_m, run_up_m + 2.0 * STEP_M)
    ]
    assert speed_km_h is not None
    assert exact[0] - 1e-3 <= speed_km_h <= exact[1] + 1e-3


def test_no_speed_is_above_the_largest() -> None:
    road = ground(120.0, 6.0, (2.0, 4.0), [(0, 2, 120, 4)], max_speed_km_h=50.0)
    assert np.nanmax(speeds_of(road).places_km_h) == pytest.approx(50.0)


@pytest.mark.parametrize(("road_m", "most"), [(4.0, 1.35), (6.0, 1.2), (10.0, 1.2)])
def test_a_corner_lets_through_what_grip_allows_on_the_widest_arc(
    road_m: float, most: float
) -> None:
    """The widest arc touches both outer edges of the way of the centre and the inner corner."""
    roads = [(0.0, 20.0, 40.0 + road_m, 20.0 + road_m), (40.0, 20.0, 40.0 + road_m, 60.0)]
    corner = ground(
        60.0, 60.0, (20.0, 20.0 + road_m), roads, entry_speed_km_h=90.0, acceleration_m_s2=0.1
    )
    beyond = float(np.nanmax(speeds_of(corner).places_km_h[round(58.0 / STEP_M)]))
    exact = KM_H_PER_M_S * sqrt(0.7 * 9.81 * (road_m - 2.0) * (2.0 + sqrt(2.0)))
    assert exact <= beyond <= most * exact


def test_a_speed_table_slows_what_comes_after_it() -> None:
    table = {"corner_m": [30.0, 0.0], "size_m": [3.0, 6.0], "speed_km_h": 20.0, "reason": "table"}
    road = ground(80.0, 6.0, (1.0, 5.0), [], entry_speed_km_h=60.0, slow=[table])
    wall = Rectangle(63.0, 0.0, 63.5, 6.0)
    speed_km_h = speeds_of(road, Obstacles((wall,))).impact_km_h(wall)
    assert speed_km_h is not None
    exact = [KM_H_PER_M_S * sqrt((20.0 / KM_H_PER_M_S) ** 2 + 4.0 * m) for m in (29.0, 33.5)]
    assert exact[0] <= speed_km_h <= exact[1]


boxes = st.lists(
    st.tuples(st.integers(8, 36), st.integers(0, 26), st.integers(1, 6), st.integers(1, 12)),
    max_size=5,
)


@settings(max_examples=4)
@given(boxes=boxes, seed=st.integers(0, 999))
@example(boxes=[(11, 2, 6, 12), (21, 16, 1, 1)], seed=999)  # a gap at a heading between two
@example(boxes=[(9, 16, 5, 10), (20, 23, 5, 2), (8, 2, 3, 2), (10, 6, 4, 7)], seed=943)
def test_no_simulated_drive_is_faster_than_the_bound(
    boxes: list[tuple[int, int, int, int]], seed: int
) -> None:
    """Drives with random steering, at the largest speed that it leaves, among random obstacles.

    Headings between the sixteen directions are worth at most 2 % of the speed.
    """
    yard = ground(45.0, 30.0, (10.0, 20.0), [], entry_speed_km_h=30.0)
    stops = tuple(Rectangle.from_corner((x, y), (a, b)) for x, y, a, b in boxes)
    places_km_h = speeds_of(yard, Obstacles(stops)).places_km_h
    grown = np.array([stop.grown(1.0 - 1e-9) for stop in stops]).reshape(-1, 4)
    rng = np.random.default_rng(seed)
    drives, step_m, most = 600, 0.2, 0.7 * 9.81
    x, y = np.full(drives, 1.0), rng.uniform(11.0, 19.0, drives)
    heading = rng.uniform(-1.2, 1.2, drives)
    square = np.full(drives, (30.0 / KM_H_PER_M_S) ** 2)
    curvature = np.zeros(drives)
    driving = np.ones(drives, dtype=bool)
    for _ in range(400):
        other = rng.choice([-1, 0, 1], drives) * rng.uniform(0, 0.25, drives)
        curvature = np.where(rng.random(drives) < 0.05, other, curvature)
        with np.errstate(divide="ignore"):
            square = np.minimum(square + 4.0 * step_m, most / np.abs(curvature))
        square = np.minimum(square, (90.0 / KM_H_PER_M_S) ** 2)
        heading = heading + curvature * step_m
        x, y = x + step_m * np.cos(heading), y + step_m * np.sin(heading)
        inside = (x >= 1.0) & (x <= 44.0) & (y >= 1.0) & (y <= 29.0)
        for left, bottom, right, top in grown:
            inside &= (x <= left) | (x >= right) | (y <= bottom) | (y >= top)
        driving &= inside
        at = np.rint(y[driving] / STEP_M).astype(int), np.rint(x[driving] / STEP_M).astype(int)
        assert (places_km_h[at] >= 0.98 * KM_H_PER_M_S * np.sqrt(square[driving])).all()


@settings(max_examples=4)
@given(boxes=boxes)
def test_more_obstacles_never_make_a_vehicle_faster(boxes: list[tuple[int, int, int, int]]) -> None:
    yard = ground(45.0, 30.0, (10.0, 20.0), [], entry_speed_km_h=30.0)
    stops = tuple(Rectangle.from_corner((x, y), (a, b)) for x, y, a, b in boxes)
    more = speeds_of(yard, Obstacles(stops)).run_up_m
    fewer = speeds_of(yard, Obstacles(stops[:-1])).run_up_m
    assert (more <= fewer).all()


@settings(max_examples=4)
@given(boxes=boxes, arc_step=st.sampled_from([2, 6, 50]))
def test_fewer_arcs_never_make_a_vehicle_faster(
    boxes: list[tuple[int, int, int, int]], arc_step: int
) -> None:
    yard = ground(45.0, 30.0, (10.0, 20.0), [], entry_speed_km_h=30.0)
    stops = tuple(Rectangle.from_corner((x, y), (a, b)) for x, y, a, b in boxes)
    every = speeds_of(yard, Obstacles(stops))
    start = np.zeros_like(every.is_open)
    start[20:41, :4] = True
    some = [
        SpeedField.of(every.motion, every.half_m, every.is_open, [(start, (1.0, 0.0))], step)
        for step in (1, arc_step)
    ]
    assert (some[1].run_up_m <= some[0].run_up_m).all()
    assert np.isnan(some[1].places_km_h).sum() == np.isnan(some[0].places_km_h).sum()


@settings(max_examples=6)
@given(boxes=boxes, over_km_h=st.lists(st.sampled_from([-0.1, 0.1]), min_size=5, max_size=5))
def test_what_gives_way_is_what_a_full_search_of_every_round_says(
    boxes: list[tuple[int, int, int, int]], over_km_h: list[float]
) -> None:
    """Ratings are just above or below the speed of a hit while all pieces stand."""
    yard = ground(45.0, 30.0, (10.0, 20.0), [], entry_speed_km_h=30.0)
    rectangles = tuple(Rectangle.from_corner((x, y), (a, b)) for x, y, a, b in boxes)
    every = speeds_of(yard, Obstacles(rectangles))
    held = tuple(
        CrashPiece(
            rectangle, CrashRating(mass_kg=7200.0, speed_km_h=km_h + over), f"piece {number}"
        )
        for number, (rectangle, over) in enumerate(zip(rectangles, over_km_h, strict=False))
        if (km_h := every.impact_km_h(rectangle)) is not None
    )
    drive = yard.drive(Obstacles(rated=held))
    broken: tuple[CrashPiece, ...] = ()
    while True:
        stops, solid = (tuple(case.rectangle for case in some) for some in (held, broken))
        speeds = speeds_of(yard, Obstacles(stops, solid))
        hits_km_h = [speeds.impact_km_h(ratedpiece.rectangle) or 0.0 for ratedpiece in held]
        weak = [
            ratedpiece
            for ratedpiece, km_h in zip(held, hits_km_h, strict=True)
            if km_h > ratedpiece.rating.speed_km_h
        ]
        if not weak:
            break
        broken = (*broken, *weak)
        held = tuple(ratedpiece for ratedpiece in held if ratedpiece not in weak)
    assert (drive.held, drive.broken) == (held, broken)


def test_a_grip_of_twice_as_much_takes_a_circle_root_two_times_as_fast() -> None:
    """A yard of 20 m leaves circles of 9 m; a turn on them is all that limits the speed."""
    fastest = []
    for grip in (0.4, 0.8):
        yard = ground(20.0, 20.0, (5.0, 15.0), [], grip=grip, acceleration_m_s2=9.0)
        ring = speeds_of(yard, Obstacles((Rectangle(3.0, 3.0, 17.0, 17.0),)))
        fastest.append(float(np.nanmax(ring.places_km_h[10:30, 3])))
    assert 1.0 <= fastest[1] / fastest[0] <= sqrt(2.0) + 1e-3


RATING = CrashRating(mass_kg=7200.0, speed_km_h=48.0)


@pytest.mark.parametrize(
    ("rating", "run_up_m", "holds"),
    [
        (RATING, 30.0, True),  # 39 km/h
        (RATING, 60.0, False),  # 56 km/h
        (CrashRating(mass_kg=7199.0, speed_km_h=96.0), 30.0, False),  # much more energy, too light
        (CrashRating(mass_kg=30000.0, speed_km_h=32.0), 30.0, False),  # more energy, too slow
    ],
)
def test_a_rated_piece_stops_what_is_no_heavier_and_no_faster(
    rating: CrashRating, run_up_m: float, holds: bool
) -> None:
    road = ground(90.0, 6.0, (2.0, 4.0), [(0, 2, 90, 4)])
    piece = CrashPiece(Rectangle(run_up_m + 2.0, 2.0, run_up_m + 2.5, 4.0), rating, "block")
    drive = road.drive(Obstacles(rated=(piece,)))
    assert (piece in drive.held) is holds
    assert bool(drive.reach.places_m[:, 0].max() > run_up_m + 2.0) is not holds
    (impact,) = drive.impacts
    assert impact.holds is holds


def test_a_piece_in_front_slows_nothing_but_one_that_narrows_the_way_may_save_the_next() -> None:
    """A weak post is run over; a strong one that makes the lorry turn saves the weak one."""
    road = ground(60.0, 12.0, (0.0, 12.0), [], entry_speed_km_h=50.0)
    weak = CrashPiece(Rectangle(40.0, 0.0, 40.5, 12.0), RATING, "fence")
    over = CrashPiece(Rectangle(20.0, 0.0, 20.5, 12.0), RATING, "first fence")
    assert road.drive(Obstacles(rated=(weak, over))).broken
    walls = (Rectangle(30.0, 0.0, 30.5, 9.5), Rectangle(36.0, 2.5, 36.5, 12.0))
    assert road.drive(Obstacles(stops=walls, rated=(weak,))).held == (weak,)


def test_what_gives_way_opens_the_run_up_to_the_next() -> None:
    road = ground(90.0, 6.0, (2.0, 4.0), [(0, 2, 90, 4)], entry_speed_km_h=60.0)
    pieces = tuple(
        CrashPiece(Rectangle(x, 2.0, x + 0.5, 4.0), CrashRating(mass_kg=7200.0, speed_km_h=v), n)
        for x, v, n in ((20.0, 48.0, "first"), (50.0, 64.0, "second"), (80.0, 96.0, "third"))
    )
    obstacles = Obstacles(rated=pieces)
    drive = road.drive(obstacles)
    assert [rated_piece.name for rated_piece in drive.broken] == ["first", "second"]
    assert [entry.name for entry in drive.held] == ["third"]


def rated_site(rating: Any, vehicle: dict[str, Any] | None = None, **motion: Any) -> Scenario:
    """The gate's site with posts of one rating."""
    post = {"name": "post", "length_modules": 1, "height_m": 1.0, "cost": 1.0, "stock": 16}
    items = [post | {"crash_rating": rating}]
    zone = {"corner_m": [4.0, 0.0], "rows": 16, "columns": 4, "items": items}
    drives = {"motion": LORRY | {"max_speed_km_h": 60.0, "entry_speed_km_h": 50.0} | motion}
    return gate_site(vehicle_document(**drives, **(vehicle or {})), build_zone=zone)


PIECES = tuple(Piece(row, 0, "post") for row in (0, 3, 6, 9, 12, 15))


def test_stand_off_is_what_the_ratings_leave_and_explained() -> None:
    strong, weak = (rated_site(f"V/7200[N2A]/{km_h}/90:0.0") for km_h in (64, 48))
    assert worst_stand_off_m(strong) == pytest.approx(7.0)
    assert worst_stand_off_m(weak) == pytest.approx(1.0)
    (text,) = LayoutState.of(weak, PIECES).explain_vehicles()
    assert "in at (1, " in text
    assert "with 5" in text
    assert "rated 7200 kg at 48 km/h (V/7200[N2A]/48/90:0.0)" in text
    (text,) = LayoutState.of(strong, PIECES).explain_vehicles()
    assert "comes as near as 7.0 m" in text
    assert "through" not in text


def worst_stand_off_m(scenario: Scenario) -> float:
    (source,) = scenario.vehicles
    placement = LayoutState.of(scenario, PIECES)
    return worst_places(scenario, source, placement.layout).stand_off_m


def test_the_load_of_a_stopped_vehicle_gets_as_far_as_the_penetration() -> None:
    # The posts end at x = 4.5 m, and the hut begins at 10 m.
    for penetration_m, stand_off_m in ((0.0, 7.0), (1.2, 4.3), (0.3, 5.0)):
        site = rated_site(f"V/7200[N2A]/64/90:{penetration_m}")
        assert worst_stand_off_m(site) == pytest.approx(stand_off_m)


def test_a_load_that_has_less_room_than_its_penetration_goes_up_to_what_stands() -> None:
    # From the posts to the hut are 5.5 m. A charge of 0.5 m radius lies against it at most.
    stand_offs_m = [
        worst_stand_off_m(rated_site(code)) for code in ("C740/P1", "C740/P2", "C740/P3")
    ]
    assert stand_offs_m == pytest.approx([4.5, 0.5, 0.5])


def test_a_load_comes_to_rest_before_a_wall_behind_the_piece() -> None:
    road = ground(40.0, 6.0, (2.0, 4.0), [(0, 2, 40, 4)], entry_speed_km_h=30.0)
    post = CrashPiece(
        Rectangle(20.0, 2.0, 20.5, 4.0), CrashRating.model_validate("C740/P2"), "post"
    )
    wall = Rectangle(23.0, 0.0, 23.5, 6.0)
    radius_m = road.charge_radius_m
    for obstacles, last_m in (((), 27.5), ((wall,), 23.0 - radius_m)):
        places_m = road.drive(Obstacles(stops=obstacles, rated=(post,))).places_m
        assert places_m[:, 0].max() == pytest.approx(last_m)


def test_without_a_speed_ratings_are_not_heeded() -> None:
    site = rated_site("V/7200[N2A]/32/90:0.0")
    assert worst_stand_off_m(site) == pytest.approx(1.0)
    (source,) = site.vehicles
    still = source.model_copy(update={"motion": None}).model_dump()
    site = gate_site(still, build_zone=site.zone.model_dump())
    assert worst_stand_off_m(site) == pytest.approx(7.0)


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("M30/P1", (6800.0, 48.0, 1.0, "rear")),
        ("M50-P3", (6800.0, 80.0, 30.0, "rear")),
        ("M50 P1", (6800.0, 80.0, 1.0, "rear")),
        ("ASTM F2656-15 M50/P1", (6800.0, 80.0, 1.0, "rear")),
        ("C750/P2", (7200.0, 80.0, 7.0, "rear")),
        ("PU60/P2", (2300.0, 96.0, 7.0, "rear")),
        ("V/7200[N2B]/80/90:0.7", (7200.0, 80.0, 0.7, "front")),
        ("IWA 14-1:2013 V/7200[N2A]/64/90:2.2", (7200.0, 64.0, 2.2, "front")),
        ("IWA 14-1:2013 Bollard V/7200[N2A]/64/90:2.2", (7200.0, 64.0, 2.2, "front")),
        ("ISO 22343-1:2023 V/7200[N3C]/80/90:1.2", (7200.0, 80.0, 1.2, "front")),
        ("PAS 68:2013 Fixed bollard V/7500(N2)/64/90:0.4/6.7", (7500.0, 64.0, 0.4, "rear")),
        ("V/7500[N3]/64/90.0/1.1/0", (7500.0, 64.0, 1.1, "front")),
        ("7500(N3)/80/90:2.3/4.0", (7500.0, 80.0, 2.3, "rear")),
    ],
)
def test_codes_of_tests_are_read(code: str, expected: tuple[float, float, float, str]) -> None:
    rating = CrashRating.model_validate(code)
    found = (rating.mass_kg, rating.speed_km_h, rating.penetration_m, rating.measured_from)
    assert found == expected
    assert rating.test == code


def test_a_test_at_an_angle_covers_its_speed_across_the_barrier() -> None:
    slanting = CrashRating.model_validate("V/7200[N3C]/80/30:1.2")
    assert slanting.covers(7200.0, 40.0)  # 80 sin 30
    assert not slanting.covers(7200.0, 41.0)
    assert CrashRating.model_validate("V/7200[N3C]/80/90:1.2").covers(7200.0, 80.0)


@pytest.mark.parametrize(
    ("code", "why"),
    [
        ("M60/P1", "its speeds are M30, M40, M50"),
        ("H60/P1", "its speeds are H30, H40, H50"),
        ("C70/P1", "its speeds are C30, C40, C50, C60"),
        ("M50/P4", "its penetrations are P1, P2, P3"),
        ("V/7200[N3C]/80/0:1.2", "angle is 0 degrees"),
        ("V/7200[N3C]/80/120:1.2", "angle is 120 degrees"),
    ],
)
def test_what_a_standard_does_not_have_is_refused(code: str, why: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        rated_site(code)
    (problem,) = map(str, caught.value.problems)
    assert problem.startswith(f"build_zone.items[0].crash_rating: is {code!r}, ")
    assert why in problem


@pytest.mark.parametrize("rating", ["K12", "M35/P1", "V/7200[N2A]/64", 7200.0])
def test_what_is_no_code_is_refused_with_examples(rating: Any) -> None:
    with pytest.raises(ScenarioError) as caught:
        rated_site(rating)
    (problem,) = map(str, caught.value.problems)
    assert problem.startswith("build_zone.items[0].crash_rating: is ")


def test_a_rating_of_what_stops_nothing_is_refused() -> None:
    post = {"name": "post", "length_modules": 1, "height_m": 1.0, "cost": 1.0, "stock": 16}
    hedge = post | {"name": "hedge", "stops_vehicles": False, "crash_rating": "M30/P1"}
    zone = {"corner_m": [4.0, 0.0], "rows": 16, "columns": 4, "items": [post, hedge]}
    with pytest.raises(ScenarioError, match=r"items\[1\].*must be left out"):
        gate_site(build_zone=zone)


def test_a_gate_with_a_rating_gives_way_to_what_is_faster() -> None:
    gate = {"corner_m": [4.0, 3.0], "size_m": [0.5, 2.0], "crash_rating": "V/7200[N2A]/32/90:0"}
    way = {"width_m": 2.0, "between": "left_right", "gate": gate}
    zone = site_document()["build_zone"] | {"access_way": way}
    posts = tuple((row, 0) for row in (0, 3, 5, 10, 12, 15))
    for motion, stand_off_m in ((None, 7.0), (LORRY | {"entry_speed_km_h": 50.0}, 1.0)):
        scenario = gate_site(vehicle_document(motion=motion), build_zone=zone)
        (source,) = scenario.vehicles
        assert worst_places(scenario, source, posts).stand_off_m == pytest.approx(stand_off_m)


def test_the_way_leads_from_the_entry_to_the_worst_place_in_short_steps() -> None:
    site = rated_site("V/7200[N2A]/64/90:0.0")
    (source,) = site.vehicles
    drive = vehicle_drive(site, source, PIECES)
    way, through = drive.weakest_way
    assert through == ()
    assert way[0].place_m[0] <= 1.25
    assert hypot(*np.subtract(way[-1].place_m, drive.worst.places_m[0])) <= 1.0
    assert all(point.speed_km_h <= 60.0 + 1e-3 for point in way)


def test_a_lane_at_any_angle_is_as_fast_as_straight() -> None:
    """Sixteen directions: whatever lies between two of them costs little in open ground."""
    yard = ground(60.0, 60.0, (20.0, 40.0), [], entry_speed_km_h=0.0)
    places_km_h = speeds_of(yard).places_km_h
    for angle in np.linspace(-pi / 3, pi / 3, 13):
        x, y = 1.0 + 25.0 * cos(angle), 30.0 + 25.0 * sin(angle)
        exact = KM_H_PER_M_S * sqrt(4.0 * 25.0)
        assert places_km_h[round(y / STEP_M), round(x / STEP_M)] >= exact - 1.5


def test_the_rule_of_posts_takes_those_that_hold() -> None:
    """Light posts are cheaper, but rated for less than the lorry's speed on its way to them."""
    light = {"name": "light", "length_modules": 1, "height_m": 1.0, "cost": 1.0, "stock": 16}
    heavy = light | {"name": "heavy", "cost": 3.0, "crash_rating": "V/7200[N2A]/64/90:0.0"}
    zone = {"corner_m": [4.0, 0.0], "rows": 16, "columns": 4}
    taken = []
    for km_h in (32, 64):
        items = [light | {"crash_rating": f"V/7200[N2A]/{km_h}/90:0.0"}, heavy]
        motion = LORRY | {"max_speed_km_h": 60.0, "entry_speed_km_h": 50.0}
        site = gate_site(vehicle_document(motion=motion), build_zone=zone | {"items": items})
        posts = line_of_posts(site)
        taken.append({post.item for post in posts if isinstance(post, Piece)})
    assert taken == [{"heavy"}, {"light"}]


def test_the_way_names_all_that_it_breaks_through_in_that_order() -> None:
    """On a straight road, and where the last of the way is one long arc."""
    yard = ground(60.0, 40.0, (2.0, 12.0), [], entry_speed_km_h=40.0)
    hut = gate_site().structures[0].model_copy(update={"corner_m": (56.0, 24.0)})
    site = VehicleGround(yard.source, yard.site, hut.boxes_m, loaded_walls([hut]))
    fences = tuple(
        CrashPiece(
            Rectangle(x, 0.0, x + 0.5, 40.0), CrashRating(mass_kg=3500.0, speed_km_h=32.0), n
        )
        for x, n in ((15.0, "first"), (30.0, "second"), (45.0, "third"))
    )
    way, through = site.drive(Obstacles(rated=fences)).weakest_way
    assert [case.piece.name for case in through] == ["first", "second", "third"]
    assert "first" in site.explain("a lorry", Obstacles(rated=fences))
    assert way[-1].place_m[0] > 46.0
