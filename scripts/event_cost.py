"""What an event costs the event engine, by the number of balls, for docs/engines.md.

A dense, elastic gas in which every ball moves, in boxes of different sizes. Prints a Markdown
table and the fit against the logarithm of the number of balls, and draws a figure.
"""

from functools import partial
from math import ceil
from pathlib import Path
from time import process_time
from typing import Annotated, Final, NamedTuple

import numpy as np
import typer

from blast_env.cli.output import print_line, progress_bar, user_errors
from blast_env.errors import BlastEnvError
from blast_env.geometry import Rectangle
from blast_env.physics.event.engine import EventRun
from blast_env.physics.event.state import world_of
from blast_env.physics.parameters import SimulationParameters, with_overrides
from blast_env.physics.particles import Balls, CollisionType
from blast_env.physics.scene import Charge, Scene, StructureOutline
from blast_env.physics.structure import ModularObstacle
from blast_env.rendering.figures import save_figure
from blast_env.rendering.style import render_extra
from blast_env.units import MODULE_SIDE_UNITS

with render_extra():
    from matplotlib.figure import Figure

OUT: Final = Path("out/engine_cost.png")
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


def main(
    repeats: Annotated[int, typer.Option(min=1, help="Runs of each size; the least counts.")] = 5,
    least_balls: Annotated[int, typer.Option(help="The smallest size.")] = BALLS[0],
    most_balls: Annotated[int, typer.Option(help="The largest size.")] = BALLS[-1],
    out: Annotated[Path, typer.Option(help="The figure.")] = OUT,
) -> None:
    """Measure, print and draw."""
    with user_errors():
        out.parent.mkdir(parents=True, exist_ok=True)
        sizes = [count for count in BALLS if least_balls <= count <= most_balls]
        if len(sizes) < 2:
            raise BlastEnvError(
                f"least_balls is {least_balls} and most_balls {most_balls}, must leave at least "
                f"two of {', '.join(map(str, BALLS))} for a fit"
            )
        costs = measure([gas(count) for count in sizes], repeats)
        print_costs(costs)
        fit = log_fit([cost for cost in costs if cost.balls <= MOST_FITTED] or costs)
        print_line(f"ns an event = {fit.at_one:.0f} + {fit.per_doubling:.1f} log2(balls)")
        print_line(f"wrote {save_figure(cost_figure(costs, fit), out)}")


def print_costs(costs: list[Cost]) -> None:
    """Print a table."""
    print_line("| balls | MB | events | ns an event | collisions | ns a collision |")
    print_line("|---|---|---|---|---|---|")
    for cost in costs:
        print_line(
            f"| {cost.balls:,} | {cost.megabytes:.1f} | {cost.events:,} | {cost.event_ns:.0f} "
            f"| {cost.collisions:,} | {cost.collision_ns:.0f} |"
        )


def measure(gases: list[Scene], repeats: int) -> list[Cost]:
    """Return the least cost of each gas over the repeats."""
    costs = []
    with progress_bar("gases") as progress:
        for done, scene in enumerate(gases):
            runs = [measure_once(scene) for _ in range(repeats)]
            costs.append(min(runs, key=lambda cost: cost.seconds))
            progress((done + 1) / len(gases))
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


if __name__ == "__main__":
    typer.run(main)
