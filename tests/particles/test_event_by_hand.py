"""Collisions of two and three bodies, worked out by hand."""

from math import cos, radians, sin, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blast_env.site.parameters import SimulationParameters
from tests.particles.scenes import (
    AIR,
    EVENT,
    EXPLOSIVE,
    KEEP_MASS,
    balls,
    parameters,
    scene,
    states_at,
    wall,
)

FAR_WALL = wall((180.0, 180.0), 2, 2)
FACADE = wall((100.0, 90.0), 10, 1)
"""From (100, 90) to (102, 110)."""


def rules(restitution: float, at_module: float = 1.0) -> SimulationParameters:
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
@settings(max_examples=75, deadline=None, derandomize=True)
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
    after = states_at(scene(pair, [FAR_WALL], rules(restitution)), 1.0001 * wait)
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
    run = EVENT.start(scene(row, [FAR_WALL], rules(1.0)))
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
        rules(1.0, restitution),
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
    run = EVENT.start(scene(start, [FACADE], rules(1.0, 0.4)))
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
    run = EVENT.start(scene(start, [FACADE], rules(1.0)))
    run.advance(0.1)
    assert run.balls().position.tolist() == [[99.0, 115.0]]
    assert len(run.log) == run.steps == 0


@pytest.mark.parametrize("lead", [0.3, 0.0, -0.3])
def test_an_inner_corner_sends_a_ball_back_where_it_came_from(lead: float) -> None:
    """Both walls, one after the other or at the same time; the corner of neither is touched."""
    walls = [wall((100.0, 90.0), 10, 1, "upright"), wall((80.0, 88.0), 1, 11, "flat")]
    start = balls([AIR], [(90.0, 100.0 + lead)], [(300.0, -300.0)], 2.0)
    run = EVENT.start(scene(start, walls, rules(1.0, 1.0)))
    run.advance(0.05)
    hits = run.log.to_array()
    assert run.balls().velocity == pytest.approx(np.array([[-300.0, 300.0]]), abs=1e-9)
    # With a lead it reaches the upright wall first.
    normals = [(-1.0, 0.0), (0.0, 1.0)]
    found = list(zip(hits["normal_x"].tolist(), hits["normal_y"].tolist(), strict=True))
    assert found == (normals if lead >= 0.0 else normals[::-1])
    assert hits["module"].tolist() == ([0, 19] if lead >= 0.0 else [19, 0])
    assert hits["transferred_impulse"].tolist() == pytest.approx([1200.0, 1200.0])
