"""Whole runs, in every engine: the fan, tunnelling, closed rings, the end, the time step."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env.evaluation.engines import CALIBRATED_ENGINES, ParticleEngine, simulate
from blast_env.evaluation.engines.particles import PymunkEngine, find_particle_engine
from blast_env.geometry import Rectangle
from blast_env.particles import CollisionType, Scene, air_lattice, explosion_fan
from blast_env.results import EndReason
from blast_env.site import Scenario
from blast_env.units import MODULE_SIDE_M, UNITS_PER_M
from tests.builders import block, point, site
from tests.particles.scenes import AIR, EXPLOSIVE, balls, finished, parameters, scene, step_s, wall


def fan_scene(distance: float, count: int = 360, facade: float = 20.0) -> Scene:
    """A charge without air in front of a facade, far from its other sides."""
    of_parameters = parameters(explosive={"ball_count": count, "radius_units": 0.05})
    fan = explosion_fan(of_parameters.explosive, (50.0, 100.0), np.random.default_rng(0))
    structure = wall((50.0 + distance, 100.0 - facade / 2), round(facade / 2), 1)
    return scene(fan, [structure], of_parameters, size=(60.0 + distance, 200.0))


@pytest.mark.parametrize("distance", [20.0, 80.0])
def test_hits_without_air_equal_the_view_factor(engine: ParticleEngine, distance: float) -> None:
    """The share of the fan that the facade covers, as seen from the charge."""
    count, facade, radius = 360, 20.0, 0.05
    angle = 2.0 * np.arctan((facade / 2 + radius) / distance)
    expected = count * angle / (2.0 * np.pi)
    assert abs(len(finished(fan_scene(distance), engine).log) - expected) <= 1.0


def test_air_keeps_clear_of_everything() -> None:
    air, site = parameters(air={"jitter": 1.0, "spacing_units": 3.0}).air, Rectangle(0, 0, 90, 60)
    obstacle = Rectangle(40.0, 20.0, 60.0, 40.0)
    lattice = air_lattice(air, site, [obstacle], (15.0, 30.0), 2.0, np.random.default_rng(0))
    x, y = lattice.position.T
    assert ((x > 1.0) & (x < 89.0) & (y > 1.0) & (y < 59.0)).all()
    assert np.hypot(x - 15.0, y - 30.0).min() > 3.0
    assert not ((abs(x - 50.0) < 11.0) & (abs(y - 30.0) < 10.0)).any()
    gaps = np.hypot(*(lattice.position[:, None] - lattice.position[None]).transpose(2, 0, 1))
    assert gaps[~np.eye(len(lattice), dtype=bool)].min() >= 2.0  # no two overlap
    assert len(lattice) == pytest.approx((88 * 58 - 22 * 22 - np.pi * 9) / 9.0, rel=0.05)


def test_a_bare_centred_lattice_is_the_same_for_every_seed_and_symmetric() -> None:
    air = parameters(air={"jitter": 0.0, "lattice_offset": "centred", "spacing_units": 8.0}).air
    site = Rectangle(0.0, 0.0, 100.0, 60.0)
    one, other = (
        air_lattice(air, site, [], (0.0, 0.0), 0.0, np.random.default_rng(seed)).position
        for seed in (0, 1)
    )
    assert (one == other).all()
    assert np.diff(np.unique(one[:, 0])) == pytest.approx(8.0)
    assert one.mean(axis=0) == pytest.approx([50.0, 30.0])


@given(st.integers(0, 2**31), st.floats(2.0, 20.0), st.floats(30.0, 200.0))
def test_no_scene_has_more_air_than_its_capacity(seed: int, spacing: float, width: float) -> None:
    air, site = parameters(air={"spacing_units": spacing}).air, Rectangle(0.0, 0.0, width, 50.0)
    rng = np.random.default_rng(seed)
    lattice = air_lattice(air, site, [], (-99.0, -99.0), 1.0, rng)
    assert len(lattice) <= air.most_balls(site.scaled(1.0 / UNITS_PER_M))


@pytest.mark.slow
@pytest.mark.parametrize("engine_name", CALIBRATED_ENGINES)
@given(
    kind=st.sampled_from([EXPLOSIVE, AIR]),
    speed=st.floats(10.0, 1e6),
    radius=st.floats(0.1, 5.0),
    angle=st.floats(-1.2, 1.2),
    restitution=st.floats(0.0, 1.0),
    step_radii=st.floats(0.1, 0.5),
)
def test_nothing_tunnels_through_a_module_or_the_border(
    engine_name: str,
    kind: CollisionType,
    speed: float,
    radius: float,
    angle: float,
    restitution: float,
    step_radii: float,
) -> None:
    """One module thick, at any speed, size and angle: the ball stays on its side and inside."""
    direction = np.array([np.cos(angle), np.sin(angle)])
    time_s = 110.0 / speed  # the way to the wall is at most 75 units
    of_scene = scene(
        balls([kind], [tuple(80.0 - 20.0 * direction)], [tuple(speed * direction)], 1.0, radius),
        # From border to border, so that the only way to the right is through it.
        [wall((100.0, 0.0), 100, 1)],
        parameters(
            contact={"module_restitution": restitution, "minimum_radius_units": 1e-3},
            stepping={"step_radii": step_radii, "time_limit_s": time_s},
        ),
    )
    run = find_particle_engine(engine_name).start(of_scene)
    hit = False
    for share in np.linspace(0.05, 1.0, 20):
        run.advance(share * time_s)
        position = run.balls().position
        hit = hit or len(run.log) > 0
        assert (position >= 0.0).all()
        assert (position <= 200.0).all()
        assert (position[:, 0] < 100.0).all()
    assert hit


def test_a_ball_far_faster_than_expected_does_not_tunnel() -> None:
    """A light ball between two heavy ones that close in gets much faster than either."""
    kinds, mass = [EXPLOSIVE, AIR, EXPLOSIVE], [1e5, 1.0, 1e5]
    of_scene = scene(
        balls(
            kinds,
            [(60.0, 100.0), (70.0, 100.4), (80.0, 100.0)],
            [(1000.0, 0.0), (0.0, 0.0), (-1000.0, 0.0)],
            mass,
        ),
        [wall((100.0, 0.0), 100, 1), wall((30.0, 0.0), 100, 1, "other")],
        parameters(
            explosive={"elasticity": 1.0, "mass": 1e5},
            air={"elasticity": 1.0, "mass": 1.0},
            contact={"module_restitution": 1.0, "air_shrink": 1.0},
            stepping={"time_limit_s": 0.2},
        ),
    )
    run = PymunkEngine().start(of_scene)
    first_step_s = shortest_step_s = run.time_step_s
    fastest = 0.0
    while run.end_reason is None:
        run.advance(np.nextafter(run.time_s, np.inf))
        states, shortest_step_s = run.balls(), min(shortest_step_s, run.time_step_s)
        fastest = max(fastest, float(np.hypot(*states.velocity.T).max(initial=0.0)))
        assert ((states.position[:, 0] > 32.0) & (states.position[:, 0] < 100.0)).all()
    assert fastest > 4500.0  # more than twice the 2000 that the time step was made for
    assert shortest_step_s < first_step_s


def test_changing_the_time_step_gives_lasting_contacts_no_second_push() -> None:
    """A slow pair overlaps for many steps while a fast ball leaves and the step is doubled."""
    of_scene = scene(
        balls(
            [AIR, AIR, AIR],
            [(20.0, 100.0), (60.0, 20.0), (62.3, 20.0)],
            [(-2000.0, 0.0), (20.0, 0.0), (-20.0, 0.0)],
        ),
        [wall((100.0, 0.0), 100, 1)],
        parameters(air={"elasticity": 0.9}),
    )
    run = PymunkEngine().start(of_scene)
    first_step_s = run.time_step_s
    run.advance(0.2)
    assert run.time_step_s > 4.0 * first_step_s
    assert run.balls().index.tolist() == [1, 2]
    assert run.balls().velocity == pytest.approx(np.array([[-16.2, 0], [16.2, 0]]), abs=1e-9)


@pytest.mark.parametrize(("speed", "left"), [(10.0, 1), (-200.0, 0)])
def test_a_run_ends_when_nothing_can_reach_a_structure_or_all_has_left(
    engine: ParticleEngine, speed: float, left: int
) -> None:
    ball, far = balls([AIR], [(20.0, 20.0)], [(speed, 0.0)]), wall((150.0, 150.0), 2, 2)
    run = finished(scene(ball, [far], parameters(stepping={"time_limit_s": 1.0})), engine)
    assert run.end_reason is EndReason.OUT_OF_REACH
    assert len(run.balls()) == left


def test_a_run_ends_at_the_time_limit(engine: ParticleEngine) -> None:
    limit_s = 0.0123
    of_scene = scene(
        balls([AIR], [(26.0, 20.0)], [(200.0, 0.0)]),
        [wall((30.0, 15.0), 5, 2)],
        parameters(stepping={"time_limit_s": limit_s}),
    )
    run = finished(of_scene, engine)
    assert run.end_reason is EndReason.TIME_LIMIT
    assert limit_s <= run.time_s < limit_s + step_s(run)


# --- Nothing gets out of a closed ring of modules, however hard the balls inside press on it.


def ring(cavity_modules: int, shift_m: float) -> Scenario:
    """Return a charge in a square cavity with walls all around it, and a target outside.

    Args:
        cavity_modules: Side of the cavity.
        shift_m: By which the upper wall is moved along itself, off the lattice of the others.
    """
    side, corner = cavity_modules + 2, 6.0
    near, far = corner + MODULE_SIDE_M, corner + (side - 1) * MODULE_SIDE_M
    target_m = corner + side * MODULE_SIDE_M + 1.5
    walls: list[tuple[str, float, float, int, int]] = [
        ("lower", corner, corner, 1, side),
        ("upper", corner - shift_m, far, 1, side + (shift_m > 0.0)),
        ("left", corner, near, cavity_modules, 1),
        ("right", far, near, cavity_modules, 1),
        ("target", target_m, corner, side, 2),
    ]
    structures = [block(*wall, protected=wall[0] == "target") for wall in walls]
    middle_m = corner + side * MODULE_SIDE_M / 2.0
    size_m = (target_m + 4.0, 2.0 * corner + side * MODULE_SIDE_M)
    model = {"preset": "ballistic", "overrides": {"stepping": {"time_limit_s": 0.25}}}
    return site("ring", size_m, point(middle_m, middle_m), *structures, simulation=model)


@pytest.mark.parametrize("engine", ["pymunk", "event"])
@pytest.mark.parametrize(("cavity_modules", "shift_m"), [(4, 0.0), (5, 0.25)])
def test_a_closed_ring_is_closed_and_borne_alike_by_its_walls(
    engine: str, cavity_modules: int, shift_m: float
) -> None:
    """On pymunk, balls got between the modules of one wall, in the corners of the ring."""
    result = simulate(ring(cavity_modules, shift_m), seed=0, engine=engine)
    loads = [result.impulse_sim(name) for name in ("lower", "upper", "left", "right")]
    assert 1000.0 < max(loads) < 1.1 * min(loads)
    assert result.impulse_sim("target") == 0.0
    assert set(result.collisions["structure"]) == {"lower", "upper", "left", "right"}
