"""The geometry of the event engine: first hits by brute force, random scenes, and backwards."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env.arrays import FloatArray
from blast_env.geometry import distance_to_rectangle
from blast_env.particles import Balls, BallStates, Scene, obstacle_of
from blast_env.results import EndReason
from blast_env.site import SimulationParameters, StructureOutline
from tests.particles.scenes import (
    AIR,
    EVENT,
    EXPLOSIVE,
    KEEP_MASS,
    balls,
    closed_box,
    finished,
    parameters,
    scene,
    wall,
)

RAYS = 150
TOLERANCE_UNITS = 3e-9
"""Of lengths, for a head-on hit: faces are joined, and overlap, if their gap is below 1e-9."""

GRAZING = 1e-5
"""Share of the speed along the normal below which rounding decides whether there is a hit."""


def first_touch(
    position: FloatArray, direction: FloatArray, radius: FloatArray, centre: FloatArray
) -> FloatArray:
    """Return the way (n,) after which discs touch one square, inf for never.

    Args:
        position: Centres of discs (n, 2) that do not touch the square.
        direction: Unit vectors (n, 2).
        radius: Radii (n,).
        centre: Centre of the square (2,).
    """
    offset = position - centre
    ways = [np.full(len(position), np.inf)]
    with np.errstate(divide="ignore", invalid="ignore"):
        for axis in (0, 1):  # the four faces, moved outwards by the radius
            for sign in (-1.0, 1.0):
                way = (sign * (1.0 + radius) - offset[:, axis]) / direction[:, axis]
                across = offset[:, 1 - axis] + way * direction[:, 1 - axis]
                is_hit = (way >= 0.0) & (np.abs(across) <= 1.0) & (sign * direction[:, axis] < 0.0)
                ways.append(np.where(is_hit, way, np.inf))
        for corner in ((-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)):
            to_corner = offset - corner
            half = (to_corner * direction).sum(axis=1)
            root = np.sqrt(half**2 - (to_corner**2).sum(axis=1) + radius**2)
            way = -half - root
            ways.append(np.where((way >= 0.0) & np.isfinite(root), way, np.inf))
    return np.min(ways, axis=0)


def rays(structures: list[StructureOutline], seed: int) -> Scene:
    """Return balls of many sizes, from all sides, which do not collide with each other."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0.0, 2.0 * np.pi, RAYS)
    heading = angle + np.pi + rng.uniform(-0.5, 0.5, RAYS)
    heading[::5] = np.round(heading[::5] / (np.pi / 4.0)) * (np.pi / 4.0)  # along the lattice too
    position = 100.0 + 40.0 * np.column_stack((np.cos(angle), np.sin(angle)))
    position[::3] = np.round(position[::3])  # at seams and corners, and in exact touch
    direction = np.column_stack((np.cos(heading), np.sin(heading)))
    radius = rng.choice([0.01, 0.3, 1.0, 1.0, 2.5, 6.0], RAYS)
    contact = {**KEEP_MASS, "module_restitution": 0.7, "minimum_radius_units": 0.001}
    start = balls([EXPLOSIVE] * RAYS, position.tolist(), (100.0 * direction).tolist(), 1.0, radius)
    # Far from all rays, so that the run goes on although the modules are those of a layout.
    return scene(start, [*structures, wall((196.0, 4.0), 1, 1, "far")], parameters(contact=contact))


def centres_of(of_scene: Scene) -> FloatArray:
    parts = [part for obstacle in of_scene.obstacles() for part in obstacle.parts]
    return np.array([(part.x, part.y) for part in parts])


def check_first_hits(of_scene: Scene) -> int:
    """Compare the first hit of every ball with brute force; return how many there were."""
    centres, start = centres_of(of_scene), of_scene.balls
    direction = start.velocity / 100.0
    ways = np.array(
        [first_touch(start.position, direction, start.radius, centre) for centre in centres]
    )
    expected = ways.min(axis=0)
    run = EVENT.start(of_scene)
    run.advance(1.5)
    hits = run.log.to_array()
    _, first = np.unique(hits["ball"], return_index=True)
    found = {int(hit["ball"]): hit for hit in hits[first]}
    for ball in range(RAYS):
        at = start.position[ball] + expected[ball] * direction[ball]
        radius = float(start.radius[ball])
        has_left = not (np.abs(at - 100.0) <= 100.0 - radius).all()
        if has_left or expected[ball] > 149.0:  # off the site, or after the end
            assert ball not in found or _share_along_normal(found[ball]) < GRAZING
            continue
        outside = at - centres
        beyond = outside - np.clip(outside, -1.0, 1.0)  # from the nearest point of each square
        nearest = beyond[np.hypot(*beyond.T).argmin()] / radius
        if abs(nearest @ direction[ball]) < GRAZING:
            continue
        if _share_along_normal(found[ball]) >= GRAZING:
            _check_hit(found[ball], beyond, float(expected[ball]), radius)
    return len(found)


def _check_hit(hit: np.void, beyond: FloatArray, way: float, radius: float) -> None:
    """Compare a hit with brute force.

    Args:
        hit: The row of the record.
        beyond: From the nearest point of each square to the ball, where it touches (m, 2).
        way: On which it got there.
        radius: Of the ball.
    """
    tolerance = TOLERANCE_UNITS / _share_along_normal(hit)
    assert hit["time_s"] * 100.0 == pytest.approx(way, abs=tolerance)
    distance = np.hypot(*beyond.T)
    assert distance[hit["module"]] == pytest.approx(radius, abs=tolerance)
    assert distance.min() >= radius - tolerance
    normal = tuple(beyond[hit["module"]] / distance[hit["module"]])
    assert (hit["normal_x"], hit["normal_y"]) == pytest.approx(normal, abs=tolerance / radius)


def _share_along_normal(hit: np.void) -> float:
    return float(abs(hit["vx"] * hit["normal_x"] + hit["vy"] * hit["normal_y"]) / 100.0)


CELLS = st.lists(
    st.tuples(st.integers(0, 7), st.integers(0, 7)), min_size=1, max_size=64, unique=True
)


@given(CELLS, st.integers(0, 2**32 - 1))
def test_first_hits_on_any_set_of_modules(cells: list[tuple[int, int]], seed: int) -> None:
    check_first_hits(rays([wall((92.0, 92.0), 8, 8, cells=tuple(cells))], seed))


@given(
    CELLS,
    CELLS,
    st.sampled_from([(0.0, 0.5), (1.0, 0.0), (0.3, 0.7), (2.0, 2.0), (1e-10, 0.0)]),
    st.integers(0, 2**32 - 1),
)
def test_first_hits_on_two_structures_side_by_side(
    cells: list[tuple[int, int]],
    others: list[tuple[int, int]],
    shift: tuple[float, float],
    seed: int,
) -> None:
    """Flush, but on lattices of their own: half of a face is covered, and so are some corners."""
    left = wall((84.0, 92.0), 8, 8, "left", cells=tuple(cells))
    right = wall((100.0 + shift[0], 92.0 + shift[1]), 8, 8, "right", cells=tuple(others))
    check_first_hits(rays([left, right], seed))


def test_first_hits_on_a_solid_block_and_in_a_yard() -> None:
    """A closed yard: balls inside, too, in all directions."""
    yard = [wall((92.0, 92.0), 8, 1), wall((106.0, 92.0), 8, 1, "right")]
    yard += [wall((94.0, 92.0), 1, 6, "lower"), wall((94.0, 106.0), 1, 6, "upper")]
    assert check_first_hits(rays([wall((94.0, 94.0), 6, 6)], 1)) > 60
    inside = rays(yard, 2)
    rng = np.random.default_rng(3)
    radius = np.minimum(inside.balls.radius, 2.5)
    centred = 100.0 + rng.uniform(-1.0, 1.0, (RAYS, 2)) * (6.0 - radius[:, None]) * 0.99
    of_balls = replace(inside.balls, position=centred, radius=radius)
    assert check_first_hits(replace(inside, balls=of_balls)) == RAYS


@pytest.mark.parametrize("seed", range(4))
def test_after_modules_broke_the_rest_is_hit_like_a_set_of_its_own(seed: int) -> None:
    """Once with modules in the middle that break early, once without them from the beginning."""
    frail = wall((98.0, 96.0), 2, 3, "frail", capacity=10.0)
    rest = [wall((98.0, 84.0), 6, 3, "below"), wall((98.0, 100.0), 6, 3, "above")]
    # Six to break the six frail ones, row by row; then 40 others.
    breakers = [(60.0 - 4.0 * i, 97.0 + 2.0 * (i % 2)) for i in range(6)]
    later = [(20.0, y) for y in np.random.default_rng(seed).uniform(84.0, 112.0, 40).tolist()]
    velocities = [(200.0, 0.0)] * 6 + [(100.0, 1.0)] * 40
    start = balls([EXPLOSIVE] * 46, breakers + later, velocities)
    of_parameters = parameters(contact={**KEEP_MASS, "module_restitution": 1.0})
    runs = [EVENT.start(scene(start, [*rest, *more], of_parameters)) for more in ([frail], [])]
    logs = []
    for run in runs:
        run.advance(1.2)
        log = run.log.to_array()
        logs.append(log[log["ball"] >= 6])
    assert all(part.destroyed for part in runs[0].obstacles[2].parts)
    assert len(logs[0]) > 20
    assert (logs[0] == logs[1]).all()


# --- Small scenes full of trouble, drawn at random: whatever happens, the geometry stays sound.


MOST_COLLISIONS = 20_000
OVERLAP_UNITS = 1e-9
"""Allowed overlap. Positions of 200 units are rounded by 3e-14, and a ball in touch that approaches
by less than 1e-12 of its speed is not stopped on a way of at most 300 units.
"""

SHARES = st.sampled_from((0.0, 0.1, 0.5, 0.9, 1.0))
FRICTIONS = st.sampled_from((0.0, 0.5, 10.0))
SPEEDS = st.sampled_from((0.0, 1e-9, 1.0, -1.0, 57.123, 100.0, -100.0, -3.3e3, 1e5))
PLACES = st.one_of(
    st.floats(86.0, 114.0),
    st.integers(86, 114).map(float),
    st.integers(172, 228).map(lambda n: n / 2),
)
RADII = st.sampled_from((0.01, 0.1, 0.5, 1.0, 3.0))


@st.composite
def some_structures(draw: st.DrawFn) -> StructureOutline:
    """Return up to 36 modules between (94, 94) and (106, 106)."""
    cell = st.tuples(st.integers(0, 5), st.integers(0, 5))
    cells = draw(st.lists(cell, min_size=1, max_size=20, unique=True))
    capacity = draw(st.sampled_from((None, None, 0.0, 50.0, 1e4)))
    return wall((94.0, 94.0), 6, 6, cells=tuple(cells), capacity=capacity)


@st.composite
def clear_balls(draw: st.DrawFn, structure: StructureOutline, masses: st.SearchStrategy) -> Balls:
    """Return up to a dozen balls that overlap no module; the first one always moves."""
    kinds = st.sampled_from((EXPLOSIVE, AIR))
    places, speeds = st.tuples(PLACES, PLACES), st.tuples(SPEEDS, SPEEDS)
    ball = st.tuples(kinds, places, speeds, masses, RADII)
    drawn = draw(st.lists(ball, max_size=11))
    rectangles = [part.rectangle for part in obstacle_of(structure).parts]
    kept = [(draw(kinds), (84.0, 84.0), (300.0, 0.5 + draw(SPEEDS)), draw(masses), draw(RADII))]
    for one in drawn:
        place = np.array([one[1]])
        if all(distance_to_rectangle(place, part)[0] >= one[4] for part in rectangles):
            kept.append(one)
    return balls(*zip(*kept, strict=True))


@st.composite
def small_scenes(
    draw: st.DrawFn, masses: st.SearchStrategy, restitutions: st.SearchStrategy
) -> Scene:
    structure = draw(some_structures())
    friction = draw(FRICTIONS)
    explosive = {"friction": friction, "collide_within_charge": draw(st.booleans())}
    settings = parameters(
        explosive={"elasticity": draw(SHARES), **explosive},
        air={"elasticity": draw(SHARES), "friction": friction},
        contact={
            "module_restitution": draw(restitutions),
            "module_friction": friction,
            "base_impulse": draw(st.sampled_from((0.0, 0.0, 1.0, 100.0))),
            "air_shrink": draw(st.sampled_from((0.9, 1.0))),
            "module_shrink": draw(st.sampled_from((0.7, 1.0))),
            "minimum_radius_units": 0.005,
        },
        stepping={
            "time_limit_s": draw(st.sampled_from((0.1, 1.0))),
            "contact_time_s": draw(st.sampled_from((1e-9, 1e-6, 1e-2))),
            "most_collisions": MOST_COLLISIONS,
        },
    )
    of_balls = draw(clear_balls(structure, masses))
    return scene(of_balls, [structure, wall((196.0, 196.0), 1, 1, "far")], settings)


def gaps(states: Balls | BallStates) -> np.ndarray:
    """Return the ways between the surfaces of all pairs (n, n), negative where they overlap."""
    between = np.hypot(*(states.position[:, None] - states.position[None]).transpose(2, 0, 1))
    free: np.ndarray = between - (states.radius[:, None] + states.radius[None])
    return free


def check_geometry(of_scene: Scene, left: BallStates, parts: list[Any]) -> None:
    """Fail if a ball is in a module, off the site, or in another ball that it was not in before."""
    assert (left.position - left.radius[:, None] >= -OVERLAP_UNITS).all()
    assert (left.position + left.radius[:, None] <= 200.0 + OVERLAP_UNITS).all()
    for part in parts:
        if not part.destroyed:
            outside = distance_to_rectangle(left.position, part.rectangle)
            assert (outside >= left.radius - OVERLAP_UNITS).all()
    before = gaps(of_scene.balls)[np.ix_(left.index, left.index)]
    may_overlap = (before < 0.0) | np.eye(len(left), dtype=bool)
    if not of_scene.parameters.explosive.collide_within_charge:
        is_explosive = left.kind == EXPLOSIVE
        may_overlap |= is_explosive[:, None] & is_explosive[None]
    assert (may_overlap | (gaps(left) >= -OVERLAP_UNITS)).all()


def check_scene(of_scene: Scene) -> EndReason | None:
    run = finished(of_scene)
    left, log = run.balls(), run.log.to_array()
    for values in (left.position, left.velocity, left.mass, left.radius):
        assert np.isfinite(values).all()
    for name in log.dtype.names or ():
        assert np.isfinite(log[name]).all(), name
    assert (np.diff(log["time_s"]) >= 0.0).all()
    assert run.steps <= MOST_COLLISIONS
    parts = [part for obstacle in run.obstacles for part in obstacle.parts]
    check_geometry(of_scene, left, parts)
    return run.end_reason


@given(small_scenes(st.sampled_from((1e-6, 0.79, 1.0, 1e6)), SHARES))
def test_nothing_overlaps_leaves_or_becomes_nan_in_any_scene(of_scene: Scene) -> None:
    """Masses from 1e-6 to 1e6; then, or in an elastic gap, the limit of collisions may be met."""
    check_scene(of_scene)


@given(small_scenes(st.sampled_from((0.1, 0.79, 1.0)), st.sampled_from((0.0, 0.1, 0.5, 0.9))))
def test_no_scene_with_masses_of_one_size_goes_on_without_end(of_scene: Scene) -> None:
    assert check_scene(of_scene) is not EndReason.EVENT_LIMIT


# --- Elastic mechanics runs backwards: the sharpest test of the order and the times of collisions.


ELASTIC: dict[str, object] = {"elasticity": 1.0}


def gas(settings: SimulationParameters, seed: int) -> Scene:
    """Balls of two sizes and masses in a closed box with an obstacle that has corners."""
    rng = np.random.default_rng(seed)
    obstacle = wall((92.0, 96.0), 4, 6, "obstacle", cells=((0, 0), (0, 1), (1, 1), (3, 3), (2, 5)))
    grid = np.stack(np.meshgrid(np.arange(28), np.arange(28)), axis=-1).reshape(-1, 2)
    position = 61.5 + 2.85 * grid + rng.uniform(-0.3, 0.3, grid.shape)
    clear = (np.abs(position - (98.0, 100.0)) > (7.5, 5.5)).any(axis=1)
    position = position[clear]
    explosive = rng.random(len(position)) < 0.3
    return scene(
        balls(
            np.where(explosive, EXPLOSIVE, AIR).tolist(),
            position.tolist(),
            rng.normal(0.0, 300.0, position.shape).tolist(),
            mass=np.where(explosive, 1.0, 0.3),
            radius=np.where(explosive, 0.7, 1.0),
        ),
        [*closed_box((60.0, 60.0), (40, 40)), obstacle],
        settings,
    )


@pytest.mark.parametrize("collide_within_charge", [True, False])
@pytest.mark.parametrize("seed", [0, 1])
def test_a_gas_finds_its_way_back(seed: int, collide_within_charge: bool) -> None:
    """Ten collisions a ball. An error in a position grows by some 1 + 2 l / r in each, where l is
    the way between two of them and r a radius: here about by three. From a rounding of 1e-14
    units, 3^10 makes 1e-9, and more for the ball that meets most others. A single wrong collision
    gives errors of whole units.
    """
    settings = parameters(
        explosive={**ELASTIC, "collide_within_charge": collide_within_charge},
        air=ELASTIC,
        contact={**KEEP_MASS, "module_restitution": 1.0},
    )
    there = gas(settings, seed)
    run = EVENT.start(there)
    run.advance(0.02)
    turned = run.balls()
    assert run.steps > 3000
    assert len(run.log) > 100
    back = replace(there.balls, position=turned.position, velocity=-turned.velocity)
    return_run = EVENT.start(replace(there, balls=back))
    return_run.advance(0.02)
    assert return_run.steps == run.steps
    assert len(return_run.log) == len(run.log)
    error = np.hypot(*(return_run.balls().position - there.balls.position).T)
    assert np.median(error) < 1e-9
    assert error.max() < 1e-5
