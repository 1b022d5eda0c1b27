"""Collisions in the event engine: by hand, with friction, and contacts that never end."""

from math import ceil, cos, pi, radians, sin, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env import load_scenario, simulate
from blast_env.particles import Balls, Scene
from blast_env.particles.event import engine as event_engine
from blast_env.results import EndReason
from blast_env.site import SimulationParameters, StructureOutline
from tests.particles.scenes import (
    AIR,
    EVENT,
    EXPLOSIVE,
    FACADE,
    FAR_WALL,
    KEEP_MASS,
    balls,
    energy,
    finished,
    momentum,
    parameters,
    scene,
    states_at,
    wall,
)
from tests.particles.worlds import WorldRun


def elastic_rules(restitution: float, at_module: float = 1.0) -> SimulationParameters:
    """The product of the two elasticities is `restitution`."""
    of_ball = {"elasticity": sqrt(restitution)}
    contact = {**KEEP_MASS, "module_restitution": at_module}
    return parameters(explosive=of_ball, air=of_ball, contact=contact)


@given(
    masses=st.tuples(st.floats(0.01, 100.0), st.floats(0.01, 100.0)),
    radii=st.tuples(st.floats(0.1, 3.0), st.floats(0.1, 3.0)),
    restitution=st.floats(0.0, 1.0),
    degrees=st.floats(0.0, 360.0),
    offset=st.floats(-0.99, 0.99),
    speed=st.floats(50.0, 1e5),
    drift=st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)),
)
def test_two_balls_of_any_mass_and_size_from_any_side(
    masses: tuple[float, float],
    radii: tuple[float, float],
    restitution: float,
    degrees: float,
    offset: float,
    speed: float,
    drift: tuple[float, float],
) -> None:
    """In the frame of the struck ball: J = (1 + e) mu v_n along the line of the centres.

    `offset` is the distance of that ball's centre from the path, in sums of the radii, which is
    the sine of the angle between the path and the normal; `drift`, in shares of the speed, is the
    velocity of that frame.
    """
    wait = 20.0 / speed
    ahead = np.array([cos(radians(degrees)), sin(radians(degrees))])
    normal = sqrt(1.0 - offset**2) * ahead + offset * np.array([-ahead[1], ahead[0]])
    frame = speed * np.array(drift)
    second = np.array([100.0, 100.0]) - frame * wait
    first = second - sum(radii) * normal - speed * wait * ahead
    velocities = np.array([speed * ahead + frame, frame])
    pair = balls([AIR, EXPLOSIVE], [tuple(first), tuple(second)], velocities, masses, radii)
    after = states_at(scene(pair, [FAR_WALL], elastic_rules(restitution)), 1.0001 * wait)
    reduced = masses[0] * masses[1] / sum(masses)
    impulse = (1.0 + restitution) * reduced * speed * sqrt(1.0 - offset**2) * normal
    expected = velocities + np.array([-impulse / masses[0], impulse / masses[1]])
    # Positions of 100 units are rounded by 1e-14, which turns the normal by that over the radii.
    tolerance = 1e-11 * speed / sum(radii) * max(masses) / min(masses)
    assert after.velocity == pytest.approx(expected, abs=tolerance)


def test_a_light_ball_between_two_heavy_ones_bounces_as_reckoned_one_by_one() -> None:
    """Three bodies in a line, elastic, against a reckoning with one dimension and no engine."""
    mass, x, v = np.array([50.0, 1.0, 80.0]), [60.0, 70.0, 80.0], [100.0, 0.0, -120.0]
    row = balls([EXPLOSIVE, AIR, EXPLOSIVE], [(c, 80.0) for c in x], [(c, 0.0) for c in v], mass)
    run = EVENT.start(scene(row, [FAR_WALL], elastic_rules(1.0)))
    run.advance(0.25)
    place, speed, left_s, collisions = np.array(x), np.array(v), 0.25, 0
    while True:
        gaps, closing = np.diff(place) - 2.0, -np.diff(speed)
        with np.errstate(divide="ignore", invalid="ignore"):
            wait = np.where(closing > 1e-9, gaps / closing, np.inf)
        pair = int(wait.argmin())
        if wait[pair] > left_s:
            break
        left_s -= wait[pair]
        place = place + speed * wait[pair]
        impulse = 2.0 * closing[pair] * mass[pair] * mass[pair + 1] / mass[pair : pair + 2].sum()
        speed[pair] -= impulse / mass[pair]
        speed[pair + 1] += impulse / mass[pair + 1]
        collisions += 1
    assert collisions > 8
    assert run.steps == collisions
    assert run.balls().velocity[:, 0] == pytest.approx(speed, rel=1e-9)


@pytest.mark.parametrize("restitution", [1.0, 0.5])
def test_a_ball_between_two_walls_hits_them_on_time(restitution: float) -> None:
    """Six units of free way, then v, C_e v, C_e^2 v, ..."""
    of_scene = scene(
        balls([AIR], [(90.0, 99.3)], [(400.0, 0.0)], 0.5, 0.75),
        [FACADE, wall((90.5 - 2.0, 90.0), 10, 1, "left")],
        elastic_rules(1.0, restitution),
    )
    of_scene.balls.position[0, 0] = 92.0
    run = EVENT.start(of_scene)
    run.advance(0.3)
    hits = run.log.to_array()
    free = 100.0 - 90.5 - 1.5
    speeds = 400.0 * restitution ** np.arange(len(hits))
    times = (7.25 + np.concatenate(([0.0], np.cumsum(free * 400.0 / speeds[1:])))) / 400.0
    assert len(hits) == (15 if restitution == 1.0 else 4)
    assert hits["time_s"] == pytest.approx(times, rel=1e-12)
    assert hits["impulse"] == pytest.approx(0.5 * speeds, rel=1e-9)
    assert hits["transferred_impulse"] == pytest.approx((1 + restitution) * 0.5 * speeds)
    assert (hits["normal_x"] == np.resize([-1.0, 1.0], len(hits))).all()
    assert (hits["module"] == np.resize([4, 14], len(hits))).all()
    assert hits["earlier_collisions"].tolist() == list(range(len(hits)))
    assert hits["first_contact"].tolist() == [True, True] + [False] * (len(hits) - 2)


@pytest.mark.parametrize("share", [0.05, 0.4, 0.8, 0.999])
@pytest.mark.parametrize("radius", [0.3, 1.0, 2.7])
def test_at_a_corner_the_normal_goes_through_the_centre(share: float, radius: float) -> None:
    """A ball flies right, its centre `share` radii above the upper edge of the facade."""
    start = balls([AIR], [(80.0, 110.0 + share * radius)], [(500.0, 0.0)], 1.0, radius)
    run = EVENT.start(scene(start, [FACADE], elastic_rules(1.0, 0.4)))
    run.advance(0.05)
    (hit,) = run.log.to_array()
    normal = np.array([-sqrt(1.0 - share**2), share])
    # Coordinates of 110 units are rounded by 1.4e-14 now and then.
    rounding = 1e-13 / radius / -normal[0]
    assert (hit["normal_x"], hit["normal_y"]) == pytest.approx(tuple(normal), abs=rounding)
    assert hit["module"] == 9
    assert hit["time_s"] == pytest.approx((20.0 + radius * normal[0]) / 500.0, rel=1e-12)
    assert hit["impulse"] == pytest.approx(500.0, rel=1e-9)
    assert hit["transferred_impulse"] == pytest.approx(1.4 * 500.0 * -normal[0], rel=1e-9)
    velocity = np.array([500.0, 0.0]) + 1.4 * 500.0 * -normal[0] * normal
    assert run.balls().velocity[0] == pytest.approx(velocity, abs=1e3 * rounding)


def test_a_ball_that_slides_along_a_wall_meets_no_seam() -> None:
    """In touch from end to end, corners included, but pressed on by nothing: no hit at all."""
    start = balls([AIR], [(99.0, 85.0)], [(0.0, 300.0)])
    run = EVENT.start(scene(start, [FACADE], elastic_rules(1.0)))
    run.advance(0.1)
    assert run.balls().position.tolist() == [[99.0, 115.0]]
    assert len(run.log) == run.steps == 0


@pytest.mark.parametrize("lead", [0.3, 0.0, -0.3])
def test_an_inner_corner_sends_a_ball_back_where_it_came_from(lead: float) -> None:
    """Both walls, one after the other or at the same time; the corner of neither is touched."""
    walls = [wall((100.0, 90.0), 10, 1, "upright"), wall((80.0, 88.0), 1, 11, "flat")]
    start = balls([AIR], [(90.0, 100.0 + lead)], [(300.0, -300.0)], 2.0)
    run = EVENT.start(scene(start, walls, elastic_rules(1.0, 1.0)))
    run.advance(0.05)
    hits = run.log.to_array()
    assert run.balls().velocity == pytest.approx(np.array([[-300.0, 300.0]]), abs=1e-9)
    # With a lead it reaches the upright wall first.
    normals = [(-1.0, 0.0), (0.0, 1.0)]
    found = list(zip(hits["normal_x"].tolist(), hits["normal_y"].tolist(), strict=True))
    assert found == (normals if lead >= 0.0 else normals[::-1])
    assert hits["module"].tolist() == ([0, 19] if lead >= 0.0 else [19, 0])
    assert hits["transferred_impulse"].tolist() == pytest.approx([1200.0, 1200.0])


# --- Friction: none at all, and Coulomb's law for discs that spin, by hand.


RESTITUTION = 0.64


def rough(coefficient: float, inertia_factor: float = 0.5) -> SimulationParameters:
    """Both coefficients of a contact are products: these give `coefficient` and RESTITUTION."""
    of_ball = {
        "elasticity": sqrt(RESTITUTION),
        "friction": sqrt(coefficient),
        "inertia_factor": inertia_factor,
    }
    contact = {"module_restitution": RESTITUTION, "module_friction": sqrt(coefficient)}
    return parameters(explosive=of_ball, air=of_ball, contact=KEEP_MASS | contact)


@pytest.mark.parametrize("along", [0.0, 123.456789, -1e-7, 3e4])
def test_without_friction_tangential_velocities_stay_to_the_last_bit(along: float) -> None:
    """Two balls at exactly the same height, then one at a wall: the normal is exactly along x."""
    velocities = [(300.0, along), (-1e3, along)]
    pair = balls([AIR, AIR], [(50.0, 120.0), (52.5, 120.0)], velocities, [1.0, 3.0])
    met = states_at(scene(pair, [FAR_WALL], rough(0.0)), 1e-3)
    assert (met.velocity[:, 0] != pair.velocity[:, 0]).all()
    assert met.velocity[:, 1].tolist() == [along, along]
    at_wall = balls([AIR], [(98.5, 120.0)], [(300.0, along)])
    bounced = states_at(scene(at_wall, [wall((100.0, 2.0), 98, 1)], rough(0.0)), 2e-3)
    assert bounced.velocity[0, 0] == pytest.approx(-RESTITUTION * 300.0)
    assert bounced.velocity[0, 1] == along


def brushing(
    of_settings: SimulationParameters, masses: tuple[float, float], radii: tuple[float, float]
) -> Scene:
    """The first ball comes with (200, 80) and meets the second, at rest, along x."""
    time_s = 0.05
    first = (60.0, 80.0)
    second = (60.0 + 200.0 * time_s + sum(radii), 80.0 + 80.0 * time_s)
    pair = balls([AIR, EXPLOSIVE], [first, second], [(200.0, 80.0), (0.0, 0.0)], masses, radii)
    return scene(pair, [FAR_WALL], of_settings)


@pytest.mark.parametrize("inertia_factor", [0.3, 0.5, 1.0])
@pytest.mark.parametrize("coefficient", [0.01, 0.05, 0.2, 5.0])
def test_balls_slide_or_stick_by_coulomb_s_law(coefficient: float, inertia_factor: float) -> None:
    """The tangential impulse is what stops the slip, but at most the coefficient times J.

    Slip of the surfaces: v_t - w1 r1 - w2 r2. An impulse P changes it by
    P (1/m1 + 1/m2) (1 + 1/f) where f m r^2 are the moments of inertia.
    """
    (m1, m2), (r1, r2) = masses, radii = (0.4, 1.5), (0.8, 1.3)
    run = WorldRun(brushing(rough(coefficient, inertia_factor), masses, radii))
    one, other = run.balls_at(0.06)
    reduced = m1 * m2 / (m1 + m2)
    normal = (1.0 + RESTITUTION) * reduced * 200.0
    sticking = 80.0 * reduced / (1.0 + 1.0 / inertia_factor)
    along = min(sticking, coefficient * normal)
    assert one["vx"] == pytest.approx(200.0 - normal / m1, rel=1e-9)
    assert other["vx"] == pytest.approx(normal / m2, rel=1e-9)
    assert one["vy"] == pytest.approx(80.0 - along / m1, rel=1e-9)
    assert other["vy"] == pytest.approx(along / m2, rel=1e-9)
    # The first brushes past on its right side, upwards: it is turned clockwise, and so is the
    # second on its left side, like two gears that both turn back.
    assert one["spin"] == pytest.approx(-along * r1 / (inertia_factor * m1 * r1**2), rel=1e-9)
    assert other["spin"] == pytest.approx(-along * r2 / (inertia_factor * m2 * r2**2), rel=1e-9)
    slip = other["vy"] - one["vy"] - (one["spin"] * r1 + other["spin"] * r2)
    assert (abs(slip) < 1e-9 * 80.0) == (sticking <= coefficient * normal)


def test_a_ball_that_sticks_to_a_wall_rolls_and_then_brakes_at_the_opposite_wall() -> None:
    """Solid disc: v_t falls to 2/3, with w r = v_t. At the other wall the spin is the wrong way
    round: the slip is 2 v_t, and v_t falls to a third.
    """
    of_scene = scene(
        balls([AIR], [(90.0, 40.0)], [(500.0, 90.0)]),
        [wall((100.0, 20.0), 80, 1), wall((78.0, 20.0), 80, 1, "left")],
        rough(10.0),
    )
    run = WorldRun(of_scene)
    first = run.balls_at(9.0 / 500.0 + 1e-6)[0]
    assert first["vx"] == pytest.approx(-RESTITUTION * 500.0)
    assert first["vy"] == pytest.approx(60.0)
    assert abs(first["spin"]) == pytest.approx(60.0)
    second = run.balls_at(9.0 / 500.0 + 18.0 / (RESTITUTION * 500.0) + 1e-6)[0]
    assert second["collisions"] == 2
    assert second["vy"] == pytest.approx(20.0)
    assert second["spin"] == pytest.approx(np.sign(-first["spin"]) * 20.0)


@pytest.mark.parametrize("coefficient", [0.02, 0.03])
def test_a_ball_slides_along_a_wall_by_coulomb_s_law(coefficient: float) -> None:
    of_scene = scene(
        balls([AIR], [(90.0, 40.0)], [(500.0, 90.0)], 2.5, 0.8),
        [wall((100.0, 20.0), 80, 1)],
        rough(coefficient),
    )
    run = EVENT.start(of_scene)
    run.advance(0.03)
    push = coefficient * (1.0 + RESTITUTION) * 500.0
    assert run.balls().velocity[0] == pytest.approx([-RESTITUTION * 500.0, 90.0 - push])
    # The record is that of the normal: friction is no part of it.
    assert run.log.to_array()["transferred_impulse"] == pytest.approx((1 + RESTITUTION) * 1250.0)


# --- Contacts that never end for ideal hard discs: pressed, wedged, touching and overlapping balls.


def rules(restitution: float, at_module: float = 0.5, **overrides: dict) -> SimulationParameters:
    of_ball = {"elasticity": sqrt(restitution)}
    stepping = {"most_collisions": 50_000} | overrides.pop("stepping", {})
    contact = {**KEEP_MASS, "module_restitution": at_module}
    return parameters(
        explosive={**of_ball, **overrides.pop("explosive", {})},
        air=of_ball,
        contact=contact,
        stepping=stepping,
    )


def run_to(
    time_s: float,
    of_balls: Balls,
    settings: SimulationParameters,
    structures: tuple[StructureOutline, ...] = (FACADE,),
) -> tuple[Balls, int]:
    """Return the balls as they are then, and the number of collisions."""
    run = EVENT.start(scene(of_balls, structures, settings))
    run.advance(time_s)
    assert run.end_reason is not EndReason.EVENT_LIMIT
    states = run.balls()
    assert np.isfinite(states.position).all()
    assert np.isfinite(states.velocity).all()
    return (
        Balls(states.kind, states.position, states.velocity, states.mass, states.radius),
        run.steps,
    )


@pytest.mark.parametrize("at_module", [0.0, 0.1, 0.5, 1.0])
@pytest.mark.parametrize("restitution", [0.0, 0.1, 0.5, 1.0])
@pytest.mark.parametrize("gap", [0.0, 0.1])
def test_a_ball_pressed_between_a_heavy_one_and_a_wall_gets_free(
    gap: float, restitution: float, at_module: float
) -> None:
    """Without loss there are about pi sqrt(M / m) collisions, half of them at the wall.

    With loss ideal discs would collide for ever; here the contact loses no energy in between. The
    heavy ball comes back, so that both leave the wall.
    """
    pair = balls(
        [AIR, AIR], [(99.0 - gap, 99.0), (90.0, 99.0)], [(0.0, 0.0), (400.0, 0.0)], [1.0, 1000.0]
    )
    after, steps = run_to(0.2, pair, rules(restitution, at_module))
    assert steps <= ceil(pi * sqrt(1000.0)) + 10
    assert (after.velocity[:, 0] < 0.0).all()
    assert after.position[0, 0] - after.position[1, 0] >= 2.0
    assert energy(after) <= energy(pair) * (1.0 + 1e-12)


@pytest.mark.parametrize(("gap", "time_s"), [(0.0, 0.2), (0.01, 0.2), (0.5, 0.6)])
@pytest.mark.parametrize("restitution", [0.0, 0.1, 0.5])
def test_a_line_of_twenty_that_is_hit_moves_on_together(
    restitution: float, gap: float, time_s: float
) -> None:
    """The textbook case of inelastic collapse: more than some 15 balls at a restitution of 0.5."""
    line = balls(
        [AIR] * 21,
        [(20.0, 150.0), *((30.0 + (2.0 + gap) * i, 150.0) for i in range(20))],
        [(400.0, 0.0)] + [(0.0, 0.0)] * 20,
    )
    after, steps = run_to(time_s, line, rules(restitution), (FAR_WALL,))
    assert 20 <= steps < 5000
    assert momentum(after) == pytest.approx(momentum(line), rel=1e-12)
    assert (np.diff(after.position[:, 0]) >= 2.0 - 1e-9).all()  # still one behind the other
    assert energy(after) <= energy(line)
    assert after.velocity[-1, 0] > 0.0


def test_balls_in_touch_that_part_do_not_collide() -> None:
    pair = balls([AIR, AIR], [(50.0, 150.0), (52.0, 150.0)], [(0.0, 10.0), (50.0, 0.0)])
    after, steps = run_to(0.1, pair, rules(1.0), (FAR_WALL,))
    assert steps == 0
    assert after.velocity.tolist() == pair.velocity.tolist()


def test_a_charge_whose_balls_all_overlap_flies_apart() -> None:
    """200 balls of radius 1 in a disc of radius 2, in all directions: they push each other out."""
    rng = np.random.default_rng(0)
    angle = 2.0 * np.pi * np.arange(200) / 200
    position = 150.0 + np.column_stack((np.cos(angle), np.sin(angle)))
    charge = balls([EXPLOSIVE] * 200, position.tolist(), rng.normal(0, 500.0, (200, 2)).tolist())
    settings = rules(1.0, explosive={"collide_within_charge": True})
    after, steps = run_to(0.01, charge, settings, (FAR_WALL,))
    assert steps > 1000
    assert len(after) == 200
    assert energy(after) == pytest.approx(energy(charge), rel=1e-12)
    assert np.median(np.hypot(*(after.position - 150.0).T)) > 5.0


@pytest.mark.parametrize("velocity", [(10.0, 0.0), (-10.0, 3.0)])
def test_two_balls_at_the_very_same_place_pass_through_each_other(
    velocity: tuple[float, float],
) -> None:
    """There is no direction in which they could push each other."""
    pair = balls([AIR, AIR], [(150.0, 150.0)] * 2, [(10.0, 0.0), velocity])
    after, steps = run_to(0.5, pair, rules(0.5), (FAR_WALL,))
    assert steps == 0
    assert after.velocity.tolist() == pair.velocity.tolist()


@pytest.mark.parametrize("aside", [1e-15, 1e-12, 1e-9])
def test_a_ball_that_hardly_touches_another_is_hardly_moved(aside: float) -> None:
    """Depth d gives a normal velocity of v sqrt(d), whose momentum is kept."""
    pair = balls([AIR, AIR], [(140.0, 150.0), (160.0, 152.0 - aside)], [(512.0, 0.0), (0.0, 0.0)])
    after, steps = run_to(0.05, pair, rules(1.0), (FAR_WALL,))
    assert steps <= 1
    assert np.abs(after.velocity - pair.velocity).max() <= 512.0 * sqrt(aside + 3e-14)


SLOT = (wall((98.0, 60.0), 20, 1, "left"), wall((102.0, 60.0), 20, 1, "right"))
"""Exactly as wide as a ball of radius 1."""


def test_a_ball_flies_through_a_gap_of_its_own_diameter() -> None:
    one = balls([AIR], [(101.0, 50.0)], [(0.0, 400.0)])
    after, steps = run_to(0.2, one, rules(1.0), SLOT)
    assert steps == 0
    assert after.position[0] == pytest.approx([101.0, 130.0])


@pytest.mark.parametrize("aside", [0.0, 1e-12, 1e-6, 1e-3, 0.1])
@pytest.mark.parametrize("at_module", [0.0, 0.5, 0.9])
def test_a_ball_caught_in_the_mouth_of_such_a_gap_ends_there(
    at_module: float, aside: float
) -> None:
    """The two corners make a funnel that gets ever narrower: it bounces back, or is wedged."""
    one = balls([AIR], [(101.0 + aside, 50.0)], [(0.0, 400.0)])
    _, steps = run_to(0.4, one, rules(1.0, at_module), SLOT)
    assert steps < 100


@pytest.mark.parametrize("seed", [118, 144, 210])
def test_balls_that_press_on_each_other_in_gaps_come_to_rest(seed: int) -> None:
    """Default balls are exactly as wide as a gap of one module: here several are caught in one."""
    scattered = np.random.default_rng(seed).random((6, 6)) < 0.42
    layout = [(22 + row, 4 + column) for row, column in np.argwhere(scattered)[:16].tolist()]
    scenario = load_scenario("courtyard").with_simulation("ballistic")
    result = simulate(scenario, layout, seed=seed, engine="event")
    assert result.steps < 10_000


def test_an_elastic_ball_in_such_a_gap_meets_the_limit_of_collisions() -> None:
    """Nothing can stop it: that is what the limit is for. The record is kept up to there."""
    settings = rules(1.0, 1.0, stepping={"most_collisions": 12_345})
    run = finished(scene(balls([AIR], [(101.0, 80.0)], [(10.0, 0.0)]), SLOT, settings))
    assert run.end_reason is EndReason.EVENT_LIMIT
    assert run.steps == len(run.log) == 12_345
    assert run.time_s == 0.0
    run.advance(np.inf)  # it stays at its end
    assert run.steps == 12_345


def test_a_record_too_large_for_memory_ends_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Long before 10^8 collisions, if all of them are hits."""
    monkeypatch.setattr(event_engine, "MOST_RECORDS", 10_000)
    settings = rules(1.0, 1.0, stepping={"most_collisions": 10**8})
    run = finished(scene(balls([AIR], [(101.0, 80.0)], [(10.0, 0.0)]), SLOT, settings))
    assert run.end_reason is EndReason.EVENT_LIMIT
    assert 10_000 <= len(run.log) < 20_000
