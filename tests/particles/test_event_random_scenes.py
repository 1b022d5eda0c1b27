"""Small scenes full of trouble, drawn at random: whatever happens, the geometry stays sound.

Sizes, places and speeds are such that many are equal: balls overlap each other and touch modules at
the start, fit exactly into gaps, and move along walls or straight at seams and corners.
"""

from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from blast_env.particles.run import BallStates, EndReason
from blast_env.site.balls import Balls, distance_to_rectangle
from blast_env.site.scene import Scene, StructureOutline
from tests.particles.scenes import AIR, EXPLOSIVE, balls, finished, parameters, scene, wall

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
def structures(draw: st.DrawFn) -> StructureOutline:
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
    rectangles = [part.rectangle for part in structure.build().parts]
    kept = [(draw(kinds), (84.0, 84.0), (300.0, 0.5 + draw(SPEEDS)), draw(masses), draw(RADII))]
    for one in drawn:
        place = np.array([one[1]])
        if all(distance_to_rectangle(place, part)[0] >= one[4] for part in rectangles):
            kept.append(one)
    return balls(*zip(*kept, strict=True))


@st.composite
def scenes(draw: st.DrawFn, masses: st.SearchStrategy, restitutions: st.SearchStrategy) -> Scene:
    structure = draw(structures())
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


def check(of_scene: Scene) -> EndReason | None:
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


@given(scenes(st.sampled_from((1e-6, 0.79, 1.0, 1e6)), SHARES))
@settings(max_examples=50, deadline=None, derandomize=True)
def test_nothing_overlaps_leaves_or_becomes_nan_in_any_scene(of_scene: Scene) -> None:
    """Masses from 1e-6 to 1e6; then, or in an elastic gap, the limit of collisions may be met."""
    check(of_scene)


@given(scenes(st.sampled_from((0.1, 0.79, 1.0)), st.sampled_from((0.0, 0.1, 0.5, 0.9))))
@settings(max_examples=50, deadline=None, derandomize=True)
def test_no_scene_with_masses_of_one_size_goes_on_without_end(of_scene: Scene) -> None:
    assert check(of_scene) is not EndReason.EVENT_LIMIT
