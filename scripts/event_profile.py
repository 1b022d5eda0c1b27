"""Where the time of a blast goes on the event engine, for docs/engines.md.

Prints three Markdown tables: what happens in a blast, the processor time of its parts, and the
time of what the compiled loop does most, finding out what a ball touches next.
"""

from collections.abc import Iterator
from math import inf
from time import process_time
from typing import Annotated, Final, NamedTuple

import numpy as np
import typer
from numba import njit
from numpy.typing import NDArray

from blast_env.cli.output import print_line
from blast_env.physics.event.engine import EventRun
from blast_env.physics.event.loop import run_world
from blast_env.physics.event.prediction import look_ahead
from blast_env.physics.event.state import RECORD_COLUMNS, Record, RecordArray, World, world_of
from blast_env.physics.scene import Scene
from blast_env.scenario.build_scene import build_scene
from blast_env.simulation import Blast
from blast_env.studies.benchmark.engines import BenchmarkScene, benchmark_scenes

_HEADERS: Final = (
    "| scene | collisions | moves between cells | foreseen in vain | ns an event |",
    "| scene | scene (ms) | walls and arrays (ms) | compiled loop (ms) | result (ms) |",
    "| scene | after (ms) | moving air balls | one takes (ns) | explosive balls | one takes (ns) |",
)
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


def main(
    repeats: Annotated[int, typer.Option(min=1, help="Blasts of each; the least counts.")] = 30,
) -> None:
    """Measure and print."""
    profiles = {scene.name: profile(scene, repeats) for scene in benchmark_scenes()}
    print_line(f"{_HEADERS[0]}\n|---|---|---|---|---|")
    for name, of_scene in profiles.items():
        counts = (of_scene.collisions, of_scene.crossings, of_scene.outdated)
        cells = " | ".join(f"{count:,}" for count in counts)
        print_line(f"| {name} | {cells} | {of_scene.event_ns:.0f} |")
    print_line(f"\n{_HEADERS[1]}\n|---|---|---|---|---|")
    for name, of_scene in profiles.items():
        parts = (of_scene.scene_s, of_scene.start_s, of_scene.loop_s, of_scene.result_s)
        print_line(f"| {name} | {' | '.join(f'{1e3 * part:.2f}' for part in parts)} |")
    print_line(f"\n{_HEADERS[2]}\n{'|---' * 6}|")
    for scene in benchmark_scenes():
        for look in look_aheads(build_scene(scene.scenario), repeats):
            numbers = (1e3 * look.time_s, look.air, look.air_ns, look.explosive, look.explosive_ns)
            cells = " | ".join(f"{number:.0f}" for number in numbers)
            print_line(f"| {scene.name} | {cells} |")


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


if __name__ == "__main__":
    typer.run(main)
