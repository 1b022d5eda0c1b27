"""The time of the event engine: of an event by the number of balls, of the parts of a blast."""

from collections.abc import Callable, Iterator
from functools import partial
from math import ceil, inf
from time import process_time
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from blast_env.geometry import Rectangle
from blast_env.physics.event.engine import EventRun
from blast_env.physics.event.loop import run_world
from blast_env.physics.event.prediction import look_ahead
from blast_env.physics.event.state import RECORD_COLUMNS, Record, RecordArray, World, world_of
from blast_env.physics.parameters import SimulationParameters, with_overrides
from blast_env.physics.particles import Balls, CollisionType
from blast_env.physics.scene import Charge, Scene, StructureOutline
from blast_env.physics.structure import ModularObstacle
from blast_env.rendering.style import render_extra
from blast_env.scenario.build_scene import build_scene
from blast_env.simulation import Blast
from blast_env.studies.benchmark.engines import BenchmarkScene
from blast_env.units import MODULE_SIDE_UNITS

with render_extra():
    from matplotlib.figure import Figure

BALLS: Final = (2_000, 5_000, 10_000, 20_000, 50_000, 100_000, 200_000)
SPACING_UNITS: Final = 3.0
SPEED_UNITS_PER_S: Final = 1000.0
MIXED_AFTER: Final = 1.0
"""Spacings that a ball goes at the mean speed before the lattice is forgotten."""
MEASURED_UNTIL: Final = 5.0
MOST_FITTED: Final = 20_000
"""Up to so many balls everything that the engine works on fits into a few MB of cache."""


class Cost(NamedTuple):
    """What one run took.

    Attributes:
        balls: Number of balls.
        events: Collisions, moves into other cells, and collisions foreseen that did not happen.
        collisions: Collisions.
        seconds: Processor time.
        megabytes: Size of the arrays.
    """

    balls: int
    events: int
    collisions: int
    seconds: float
    megabytes: float

    @property
    def event_ns(self) -> float:
        """Nanoseconds an event."""
        return 1e9 * self.seconds / self.events

    @property
    def collision_ns(self) -> float:
        """Nanoseconds a collision, all other events included."""
        return 1e9 * self.seconds / self.collisions


class LogFit(NamedTuple):
    """Nanoseconds = `at_one` + `per_doubling` log2(balls), by least squares."""

    at_one: float
    per_doubling: float


def measure(
    gases: list[Scene], repeats: int, progress: Callable[[float], None] | None = None
) -> list[Cost]:
    """Return the least cost of each gas over the repeats."""
    costs = []
    for scene in gases:
        runs = [measure_once(scene) for _ in range(repeats)]
        costs.append(min(runs, key=lambda cost: cost.seconds))
        if progress is not None:
            progress(len(costs) / len(gases))
    return costs


def measure_once(scene: Scene) -> Cost:
    """Let a gas mix, then time it."""
    run = EventRun(scene)
    spacing_s = SPACING_UNITS / SPEED_UNITS_PER_S
    run.advance(MIXED_AFTER * spacing_s)
    collisions, events = run.steps, _events(run)
    start = process_time()
    run.advance(MEASURED_UNTIL * spacing_s)
    seconds = process_time() - start
    return Cost(
        len(scene.balls),
        _events(run) - events,
        run.steps - collisions,
        seconds,
        _megabytes(scene),
    )


def _megabytes(scene: Scene) -> float:
    """Return the size of the arrays that the engine works on, its record excepted."""
    parts = [part for obstacle in scene.obstacles() for part in obstacle.parts]
    return sum(array.nbytes for array in world_of(scene, parts)) / 1e6


def _events(run: EventRun) -> int:
    return run.steps + run.crossings + run.outdated


def gas(balls: int) -> Scene:
    """Return about so many balls on a lattice in a walled square, all moving at random."""
    side = round(balls**0.5)
    modules = ceil(side * SPACING_UNITS / MODULE_SIDE_UNITS)
    length = modules * MODULE_SIDE_UNITS
    line = (np.arange(side) + 0.5) * (length / side)
    position = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    inside = Rectangle(0.0, 0.0, length, length)
    return Scene(
        site=inside.grown(MODULE_SIDE_UNITS),
        charge_centre=(0.0, 0.0),
        charge=Charge((0.0, 0.0), 1.0),
        balls=_moving(position),
        structures=(
            _wall("left", (-MODULE_SIDE_UNITS, 0.0), modules, 1),
            _wall("right", (length, 0.0), modules, 1),
            _wall("lower", (0.0, -MODULE_SIDE_UNITS), 1, modules),
            _wall("upper", (0.0, length), 1, modules),
        ),
        parameters=_parameters(),
    )


def _wall(name: str, corner: tuple[float, float], rows: int, columns: int) -> StructureOutline:
    return StructureOutline(
        kind=ModularObstacle,
        name=name,
        corner=corner,
        rows=rows,
        columns=columns,
        protected=True,
        weight=1.0,
        cells=None,
        capacity=None,
    )


def _moving(position: np.ndarray) -> Balls:
    """Return air balls at the positions (n, 2) with normally distributed velocities."""
    rng, parameters = np.random.default_rng(0), _parameters().air
    velocity = SPEED_UNITS_PER_S / 2.0**0.5 * rng.normal(size=position.shape)
    return Balls.of_one_kind(CollisionType.AirBall, parameters, position, velocity)


def _parameters() -> SimulationParameters:
    overrides = {
        "air": {"spacing_units": SPACING_UNITS, "elasticity": 1.0},
        "contact": {"module_restitution": 1.0},
    }
    return with_overrides(SimulationParameters(), overrides)


def log_fit(costs: list[Cost]) -> LogFit:
    """Return the least-squares fit of the time of an event."""
    doublings = np.log2([cost.balls for cost in costs])
    slope, intercept = np.polyfit(doublings, [cost.event_ns for cost in costs], 1)
    return LogFit(float(intercept), float(slope))


def cost_figure(costs: list[Cost], fit: LogFit) -> Figure:
    """Return the time of an event and of a collision over the number of balls."""
    figure = Figure(figsize=(7.5, 4.8), layout="constrained")
    axes = figure.subplots()
    balls = np.array([cost.balls for cost in costs])
    collision_ns = [cost.collision_ns for cost in costs]
    axes.plot(balls, collision_ns, color="#D55E00", marker="s", label="a collision, all included")
    event_ns = [cost.event_ns for cost in costs]
    axes.plot(balls, event_ns, color="#0072B2", marker="o", ls="", label="an event")
    fitted = fit.at_one + fit.per_doubling * np.log2(balls)
    label = (
        f"{fit.at_one:.0f} + {fit.per_doubling:.0f} log$_2$(balls), "
        f"fitted up to {MOST_FITTED:,} balls"
    )
    axes.plot(balls, fitted, color="#0072B2", lw=1.2, ls="--", label=label)
    axes.axhline(1000.0, color="#000000", lw=1.0, ls=":", label="1 µs")
    axes.set_xscale("log")
    axes.set_ylim(0.0, 1.15 * max(1000.0, *collision_ns))
    axes.set_xlabel("balls, all moving, three radii apart")
    axes.set_ylabel("processor time (ns)")
    axes.set_title("What an event costs the event engine", fontweight="bold")
    axes.grid(alpha=0.3, which="both")
    megabytes = float(np.mean([cost.megabytes / cost.balls for cost in costs]))
    scale = (partial(np.multiply, megabytes), partial(np.multiply, 1.0 / megabytes))
    axes.secondary_xaxis("top", functions=scale).set_xlabel("size of the engine's arrays (MB)")
    axes.legend(loc="upper left")
    return figure


_INSTANTS_S: Final = (0.004, 0.016, 0.064)
"""When look-aheads are timed: with the fan close together, spread out, and arriving."""
_MOST_RECORDS: Final = 1_000_000


class Profile(NamedTuple):
    """One blast; the seconds are the least over the repeats.

    Attributes:
        collisions: Collisions.
        crossings: Moves of balls between cells.
        outdated: Collisions foreseen that did not happen.
        scene_s: Laying out the scene.
        start_s: Building the walls and arrays of the engine.
        loop_s: The compiled loop, with its record copied.
        result_s: Putting together the result.
    """

    collisions: int
    crossings: int
    outdated: int
    scene_s: float
    start_s: float
    loop_s: float
    result_s: float

    @property
    def event_ns(self) -> float:
        """Nanoseconds of the loop for each event."""
        return 1e9 * self.loop_s / (self.collisions + self.crossings + self.outdated)


def profile(scene: BenchmarkScene, repeats: int) -> Profile:
    """Run a blast of seed 0 several times and time its parts."""
    blast = Blast(scene.scenario, engine="event")
    blast.run()  # compiles, where nothing is on disk yet
    run = EventRun(blast.scene)
    times = []
    for _ in range(repeats):
        clock = [process_time()]
        laid_out = build_scene(scene.scenario)
        clock.append(process_time())
        run = EventRun(laid_out)
        clock.append(process_time())
        run.advance(inf)
        clock.append(process_time())
        blast.result(run)
        clock.append(process_time())
        times.append(np.diff(clock))
    least = np.min(times, axis=0).tolist()
    return Profile(run.steps, run.crossings, run.outdated, *least)


class LookAheads(NamedTuple):
    """What it takes to find out what a ball touches next, at one instant; see `look_aheads`.

    Attributes:
        time_s: The instant.
        air: Air balls that move.
        air_ns: Nanoseconds of processor time for one of them; 0 if there is none.
        explosive: Explosive balls that move.
        explosive_ns: For one of them; likewise.
    """

    time_s: float
    air: int
    air_ns: float
    explosive: int
    explosive_ns: float


def look_aheads(scene: Scene, repeats: int) -> Iterator[LookAheads]:
    """Time the look-ahead for all balls that move at some instants of a blast.

    It changes nothing when it is done once more. Repeated, with everything in the cache, it takes
    the least that it can.

    Args:
        scene: The scene.
        repeats: How often; the least counts.
    """
    world = world_of(scene, [part for each in scene.obstacles() for part in each.parts])
    record = np.empty((_MOST_RECORDS, len(RECORD_COLUMNS)))
    for time_s in _INSTANTS_S:
        run_world(world, record, time_s)
        balls = world.balls
        moves = (balls["alive"] == 1) & ((balls["vx"] != 0.0) | (balls["vy"] != 0.0))
        air = np.flatnonzero(moves & (balls["explosive"] == 0))
        explosive = np.flatnonzero(moves & (balls["explosive"] == 1))
        times = (_look_ahead_ns(world, which, repeats) for which in (air, explosive))
        yield LookAheads(time_s, len(air), next(times), len(explosive), next(times))


def _look_ahead_ns(world: World, which: NDArray[np.int64], repeats: int) -> float:
    arguments = (world.balls, world.cells, world.heap, world.surfaces, world.rules, which)
    _look_ahead_all(*arguments)
    times = []
    for _ in range(repeats):
        start = process_time()
        _look_ahead_all(*arguments)
        times.append(process_time() - start)
    return 1e9 * min(times) / max(len(which), 1)


@njit(cache=True, error_model="numpy")
def _look_ahead_all(
    balls: RecordArray,
    cells: RecordArray,
    heap: RecordArray,
    surfaces: RecordArray,
    rules: Record,
    which: NDArray[np.int64],
) -> None:
    for ball in which:
        look_ahead(balls, cells, heap, surfaces, rules, ball)
