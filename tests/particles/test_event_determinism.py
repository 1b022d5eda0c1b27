"""A run is the same to the last bit: in any process, cells, slices, and mirrored or turned."""

import signal
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from hashlib import sha256
from math import sqrt

import numpy as np
import pytest

from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import Blast, ParticleEngine
from blast_env.evaluation.engines.particles import EventEngine, PymunkEngine
from blast_env.geometry import Rectangle
from blast_env.particles import (
    Balls,
    BlastRun,
    ModularObstacle,
    Scene,
    air_lattice,
    explosion_fan,
    obstacle_of,
)
from blast_env.particles.event import EventRun
from blast_env.units import MODULE_SIDE_UNITS
from tests.builders import point, site, square
from tests.particles.scenes import AIR, EVENT, EXPLOSIVE, balls, finished, parameters, scene, wall

LAYOUT = ((4, 0), (5, 0), (6, 1))
CELLS = (None, 2.0, 2.7, 3.3, 7.0, 1000.0)


@cache
def blast(kind: str) -> Scene:
    """Return a blast in front of modules that break.

    - `random`: air as it is by default, only denser;
    - `touching`: a bare lattice of balls that all touch, so that much happens at the same time, and
      cells of the size of a ball are filled exactly;
    - `friction`: balls that spin, with different masses.
    """
    of_air: dict[str, object] = {"mass": 0.2, "elasticity": 0.97, "spacing_units": 3.4}
    of_charge: dict[str, object] = {"ball_count": 180, "elasticity": 0.97}
    contact: dict[str, object] = {}
    if kind == "touching":
        of_air |= {"jitter": 0.0, "lattice_offset": "centred", "spacing_units": 2.0}
        of_charge |= {"fan_phase": "fixed"}
    elif kind == "friction":
        of_air |= {"friction": 0.6}
        of_charge |= {"friction": 0.4}
        contact |= {"module_friction": 0.5, "base_impulse": 1.0}
    stepping: dict[str, object] = {"time_limit_s": 0.03}
    settings = parameters(air=of_air, explosive=of_charge, contact=contact, stepping=stepping)
    rng = np.random.default_rng(11)
    facade, site = wall((46.0, 10.0), 20, 2, capacity=2000.0), Rectangle(0.0, 0.0, 64.0, 60.0)
    air = air_lattice(settings.air, site, [obstacle_of(facade).rectangle], (30.0, 30.0), 2.0, rng)
    fan = explosion_fan(settings.explosive, (30.0, 30.0), rng)
    return replace(
        scene(Balls.concatenate((air, fan)), [facade], settings), site_m=site.scaled(0.25)
    )


@cache
def break_shot() -> Scene:
    """Return a triangle of balls in touch that is hit in its axis, in front of a wall.

    Left and right of the axis the first balls meet theirs at exactly the same time.
    """
    rows = [
        (100.0 + sqrt(3.0) * row, 100.0 - row + 2.0 * i) for row in range(9) for i in range(row + 1)
    ]
    velocities = [(500.0, 0.0)] + [(0.0, 0.0)] * len(rows)
    rack = balls([AIR] * (len(rows) + 1), [(80.0, 100.0), *rows], velocities)
    contact: dict[str, object] = {"module_restitution": 0.9}
    stepping: dict[str, object] = {"time_limit_s": 0.3}
    settings = parameters(air={"elasticity": 0.99}, contact=contact, stepping=stepping)
    return scene(rack, [wall((118.0, 70.0), 30, 1, capacity=400.0)], settings)


SCENES: dict[str, Callable[[], Scene]] = {
    "random": partial(blast, "random"),
    "touching": partial(blast, "touching"),
    "friction": partial(blast, "friction"),
    "break shot": break_shot,
}


def digest_of(run: BlastRun) -> str:
    """Return a digest of all that can be seen of a run."""
    state = sha256(run.log.to_array().tobytes())
    left = run.balls()
    for array in (left.index, left.position, left.velocity, left.mass, left.radius):
        state.update(np.ascontiguousarray(array).tobytes())
    parts = [part for obstacle in run.obstacles for part in obstacle.parts]
    seen = [(p.hits, p.impulse, p.transferred_impulse, p.first_hit_s, p.destroyed) for p in parts]
    state.update(repr((seen, run.time_s, run.steps, run.end_reason)).encode())
    return state.hexdigest()


def digest(kind: str, engine: ParticleEngine = EVENT) -> str:
    return digest_of(finished(SCENES[kind](), engine))


def test_the_scenes_are_what_they_are_meant_to_be() -> None:
    """Modules break in all of them."""
    for kind, build in SCENES.items():
        run = finished(build())
        assert run.steps > 200, kind
        assert any(part.destroyed for part in run.obstacles[0].parts), kind


@pytest.mark.parametrize("kind", SCENES)
def test_cells_of_any_size_give_the_same_run(kind: str) -> None:
    digests = {digest(kind, EventEngine(cell_units=cell)) for cell in CELLS}
    assert len(digests) == 1


@pytest.mark.parametrize("kind", SCENES)
@pytest.mark.parametrize("slice_s", [3e-5, 7e-4, 0.011])
def test_cutting_a_run_into_slices_does_not_change_it(kind: str, slice_s: float) -> None:
    """A slice may also end in the middle of what happens after a module broke."""
    run = EVENT.start(SCENES[kind]())
    end_s = 0.0
    while run.end_reason is None:
        end_s += slice_s
        run.advance(end_s)
        run.balls()
    assert digest_of(run) == digest(kind)


def test_more_collisions_than_one_batch_of_records_holds() -> None:
    """The record is read in batches of some thousand: none is lost or doubled."""
    one = balls([EXPLOSIVE], [(101.5, 50.0)], [(1000.0, 0.3)], radius=0.01)
    box = (wall((100.0, 30.0), 40, 1), wall((102.05, 30.0), 40, 1, "right"))
    settings = parameters(
        contact={"module_restitution": 1.0, "module_shrink": 1.0, "minimum_radius_units": 0.001},
        stepping={"time_limit_s": 1.0},
    )
    hits = finished(scene(one, box, settings)).log.to_array()
    assert len(hits) > 10_000
    assert hits["earlier_collisions"].tolist() == list(range(len(hits)))
    assert np.diff(hits["time_s"])[1:] == pytest.approx(0.03 / 1000.0, rel=1e-6)


def test_a_scene_is_not_changed_by_running_it() -> None:
    of_scene = blast("random")
    before = [
        of_scene.balls.position.copy(),
        of_scene.balls.velocity.copy(),
        of_scene.balls.mass.copy(),
    ]
    finished(of_scene)
    after = [of_scene.balls.position, of_scene.balls.velocity, of_scene.balls.mass]
    assert all((one == other).all() for one, other in zip(before, after, strict=True))


@pytest.mark.parametrize("cell_units", [1.999, 0.0, -3.0, np.nan, np.inf])
def test_cells_that_cannot_hold_a_ball_are_refused(cell_units: float) -> None:
    """They would make the engine overlook collisions."""
    with pytest.raises(BlastEnvError, match="must be at least 2, the diameter of the largest ball"):
        EventEngine(cell_units=cell_units).start(blast("random"))


def test_balls_off_the_site_are_refused() -> None:
    off = scene(balls([AIR, AIR], [(5.0, 5.0), (201.0, 5.0)], [(1.0, 0.0)] * 2), [], parameters())
    with pytest.raises(BlastEnvError, match=r"ball 1 is at \(201.0, 5.0\)"):
        EVENT.start(off)


# --- A scene that is mirrored or turned gives the same blast, mirrored or turned, to the last bit.


SITE = Rectangle(-60.0, -60.0, 60.0, 60.0)
"""Centred on the origin: there, and only there, mirroring rounds nothing."""


@dataclass(frozen=True)
class Turn:
    """A symmetry of the square: a matrix of -1, 0 and 1."""

    name: str
    matrix: tuple[tuple[int, int], tuple[int, int]]

    def points(self, points: np.ndarray) -> np.ndarray:
        """Return the images of points (n, 2), with -0.0 replaced by 0.0."""
        turned: np.ndarray = points @ np.array(self.matrix, dtype=np.float64).T + 0.0
        return turned


TURNS = [  # all other symmetries of the square are made of these two
    Turn("left and right swapped", ((-1, 0), (0, 1))),
    Turn("a quarter turn", ((0, -1), (1, 0))),
]


def turned_blast(turn: Turn | None, air: dict[str, object], contact: dict[str, object]) -> Scene:
    """A charge and air in front of a structure with a notch, all of it turned."""
    of_parameters = parameters(
        air={"mass": 0.2, "elasticity": 0.97, "spacing_units": 4.1, **air},
        explosive={"ball_count": 360, "elasticity": 0.97},
        contact=contact,
        stepping={"time_limit_s": 0.15},
    )
    rng = np.random.default_rng(5)
    corner, rows, columns = (20.0, -9.0), 10, 4
    cells = tuple((r, c) for r in range(rows) for c in range(columns) if (r, c) != (3, 0))
    rectangle = obstacle_of(wall(corner, rows, columns)).rectangle
    lattice = air_lattice(of_parameters.air, SITE, [rectangle], (-7.3, 1.7), 2.0, rng)
    fan = explosion_fan(of_parameters.explosive, (-7.3, 1.7), rng)
    of_balls = Balls.concatenate((lattice, fan))
    if turn is not None:
        of_balls = replace(
            of_balls,
            position=turn.points(of_balls.position),
            velocity=turn.points(of_balls.velocity),
        )
    # Single modules: a grid would number them in an order of its own.
    parts = obstacle_of(wall(corner, rows, columns, cells=cells)).parts
    centres = np.array([(part.x, part.y) for part in parts])
    corners = (centres if turn is None else turn.points(centres)) - MODULE_SIDE_UNITS / 2.0
    modules = [
        wall(tuple(corner), 1, 1, f"module {number}")
        for number, corner in enumerate(corners.tolist())
    ]
    return replace(scene(of_balls, modules, of_parameters), site_m=SITE.scaled(0.25))


def loads(obstacles: tuple[ModularObstacle, ...]) -> list[tuple[int, float, float]]:
    return [(o.hits, o.impulse, o.transferred_impulse) for o in obstacles]


@pytest.mark.parametrize("contact", [{}, {"base_impulse": 3.0, "module_restitution": 0.9}])
@pytest.mark.parametrize("turn", TURNS, ids=lambda turn: turn.name)
def test_a_turned_blast_is_the_same_blast(turn: Turn, contact: dict[str, object]) -> None:
    plain, turned = (finished(turned_blast(t, {}, contact)) for t in (None, turn))
    assert plain.steps == turned.steps > 5000
    assert plain.obstacles[0].hits + plain.obstacles[5].hits > 0
    assert loads(plain.obstacles) == loads(turned.obstacles)
    before, after = plain.balls(), turned.balls()
    assert (before.index == after.index).all()
    assert (turn.points(before.position) == after.position + 0.0).all()
    assert (turn.points(before.velocity) == after.velocity + 0.0).all()


def test_a_mirrored_blast_loads_modules_alike_in_steps() -> None:
    air: dict[str, object] = {"spacing_units": 8.0}
    plain, mirrored = (finished(turned_blast(t, air, {}), PymunkEngine()) for t in (None, TURNS[0]))
    assert plain.obstacles[0].hits + plain.obstacles[5].hits > 0
    assert [o.impulse for o in plain.obstacles] == [o.impulse for o in mirrored.obstacles]


@pytest.mark.parametrize("turn", TURNS, ids=lambda turn: turn.name)
def test_ties_do_not_break_the_symmetry(turn: Turn) -> None:
    """On a bare lattice balls meet several others at exactly the same time, all over the site."""
    air: dict[str, object] = {"jitter": 0.0, "lattice_offset": "centred", "spacing_units": 4.0}
    plain, turned = (finished(turned_blast(t, air, {})) for t in (None, turn))
    assert plain.steps == turned.steps > 5000
    assert loads(plain.obstacles) == loads(turned.obstacles)


# --- Ctrl-C is heard while compiled code runs, and costs nothing of what a run comes to.


def touching_air() -> Scene:
    """Return air whose balls touch each other: a hundred thousand events in one moment."""
    air = {"spacing_units": 2.0, "radius_units": 1.0, "elasticity": 1.0, "jitter": 0.0}
    house = square("house", 8.0, 4.0, 4, protected=True)
    model = {"preset": "ballistic", "overrides": {"air": air}}
    scenario = site("touching_air", (20.0, 20.0), point(5.0, 5.0), house, simulation=model)
    return Blast(scenario, (), 0, "event").scene


def outcome(run: EventRun) -> tuple[float, int, bytes, bytes]:
    run.advance(np.inf)
    return run.time_s, run.steps, run.log.to_array().tobytes(), run.balls().position.tobytes()


def advance_with_alarm(run: EventRun) -> None:
    signal.setitimer(signal.ITIMER_REAL, 0.005)  # a tenth of the run, or less
    run.advance(np.inf)


def test_an_interrupted_run_goes_on_to_the_same_end() -> None:
    whole = outcome(EventEngine().start(touching_air()))
    run = EventEngine().start(touching_air())
    run.advance(1e-6)
    # An alarm of the system: a thread might wait for the processor until the run has ended.
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            advance_with_alarm(run)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert run.steps < whole[1]  # at once, not at its end
    assert outcome(run) == whole
