"""Joined faces and free corners against brute force: every single square, on its own.

What a ball touches first on a set of squares is the earliest of what it would touch on each of them
alone, and nothing about seams, faces or corners has to be known to find that.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blast_env.arrays import FloatArray
from blast_env.site.scene import Scene, StructureOutline
from tests.particles.scenes import EVENT, EXPLOSIVE, KEEP_MASS, balls, parameters, scene, wall

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
@settings(max_examples=75, deadline=None, derandomize=True)
def test_first_hits_on_any_set_of_modules(cells: list[tuple[int, int]], seed: int) -> None:
    check_first_hits(rays([wall((92.0, 92.0), 8, 8, cells=tuple(cells))], seed))


@given(
    CELLS,
    CELLS,
    st.sampled_from([(0.0, 0.5), (1.0, 0.0), (0.3, 0.7), (2.0, 2.0), (1e-10, 0.0)]),
    st.integers(0, 2**32 - 1),
)
@settings(max_examples=75, deadline=None, derandomize=True)
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
