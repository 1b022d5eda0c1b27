"""Processor time and memory of blasts and of the environment on this machine.

Processor times are medians on one core, which do not depend on other processes.
"""

import os
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from time import process_time
from typing import Annotated, Any, Final

import gymnasium as gym
import numpy as np
import typer
from numpy.typing import NDArray

from blast_env.answers.terminal import print_line, print_table
from blast_env.arrays import FloatArray
from blast_env.cli.output import progress_bar, user_errors
from blast_env.envs.vector_env import BlastBarrierVectorEnv
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.evaluation.engines import ENGINE_NAMES, find_engine, simulate
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.gas.cost import CostGuess
from blast_env.gas.settings import CELLS, UNIFORM
from blast_env.site import Scenario, load_scenario
from blast_env.units import MODULE_SIDE_M, MS_PER_S
from studies.side_by_side import ROWS, SideError, compare

ENV_ID: Final = "BlastBarrier-v0"
LARGE: Final = "large"
"""In the place of a scenario: streets of `LENGTHS_M`."""

LENGTHS_M: Final = (20.0, 50.0, 100.0)
_LONGEST_M: Final = 200.0
_LONGEST_UNIFORM_M: Final = 100.0
_PACKAGES: Final = ("numpy", "numba", "pymunk")
_BLAST_HEADERS: Final = (
    *("scenario", "engine", "simulated (ms)", "steps", "CPU (ms)", "blasts per CPU s"),
    *("million cell updates per CPU s", "memory (MB)"),
)
_ENVIRONMENT_HEADERS: Final = (
    *("scenario", "engine", "observation", "steps", "episode (ms)", "placing (ms)"),
    *("steps per CPU s", "in a batch", "memory of the batch (MB)"),
)
_SITE_HEADERS: Final = (
    *("site", "cells", "smallest", "steps estimated", "steps", "CPU estimated (s)", "CPU (s)"),
    *("million cell updates per CPU s", "memory estimated (MB)", "memory (MB)"),
)
_ELSEWHERE: Final = (
    "elsewhere, million cell updates per s: rhoCentralFoam 1.3 (a core), MFC 59 (96 cores) and 222 "
    "(an H100), AthenaK above 1,000 (a Grace Hopper)"
)


@dataclass(frozen=True)
class BlastCost:
    """The cost of one blast, from scenario to result.

    Attributes:
        scenario: Name of the scenario.
        engine: Name of the engine.
        simulated_s: Simulated time at the end of the blast.
        steps: Number of steps, or events, of the engine.
        cpu_s: Processor time per blast, median over the seeds.
        cell_updates: Cells times steps; None for engines without cells.
        memory_mb: Peak memory of a fresh process that runs one blast; None if not measured.
    """

    scenario: str
    engine: str
    simulated_s: float
    steps: int
    cpu_s: float
    cell_updates: int | None
    memory_mb: float | None = None


def blast_cost(scenario: Scenario, engine: str, repeats: int, *, memory: bool = True) -> BlastCost:
    """Time blasts of a scenario without a barrier.

    Args:
        scenario: The scenario.
        engine: Name of the engine.
        repeats: Number of blasts; their seeds are 0 and up.
        memory: Whether to measure the peak memory, too, in a separate process.
    """
    run = partial(simulate, scenario, engine=engine)
    result: Any = run(seed=0)  # compiles code that is not on disk yet
    times_s = []
    for seed in range(repeats):
        began = process_time()
        run(seed=seed)
        times_s.append(process_time() - began)
    return BlastCost(
        scenario=scenario.name,
        engine=engine,
        simulated_s=result.time_s,
        steps=result.steps,
        cpu_s=median(times_s),
        cell_updates=result.run_record.get("cell updates"),
        memory_mb=peak_memory_mb(scenario, engine) if memory else None,
    )


def peak_memory_mb(scenario: Scenario, engine: str) -> float:
    """Return the peak memory, MB, of a fresh process that runs a blast."""
    with get_context("spawn").Pool(1) as pool:
        return pool.apply(_peak_memory_mb, (scenario, engine))


def _peak_memory_mb(scenario: Scenario, engine: str) -> float:
    simulate(scenario, engine=engine)
    return own_memory_mb()


def own_memory_mb() -> float:
    """Return the peak memory, MB, of this process."""
    try:
        # On Linux, the maximum of getrusage is inherited from the parent process.
        status = Path("/proc/self/status").read_text(encoding="utf-8")
        return 1024.0 * int(status.split("VmHWM:")[1].split()[0]) / 1e6
    except (OSError, IndexError):
        import resource  # not on Windows

        kilobytes = 1 if platform.system() == "Darwin" else 1024
        return kilobytes * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def street(length_m: float) -> Scenario:
    """Return a street between an office and a school, for measuring the cost of large sites.

    At 100 m: an L-shaped office of four storeys, 25 m from a van of 500 kg at the kerb, and a
    school behind a perimeter wall. Other lengths scale all of it, rounded to whole modules; the
    charge scales with the cube of the length.

    Args:
        length_m: Length of the site; at least 20 m.
    """
    share = length_m / 100.0

    def whole_m(at_100_m: float) -> float:
        return max(round(at_100_m * share / MODULE_SIDE_M), 1) * MODULE_SIDE_M

    def solid(
        name: str, box_m: tuple[float, float, float, float], height_m: float, *, protected: bool
    ) -> dict[str, Any]:
        left_m, bottom_m, width_m, depth_m = (whole_m(side_m) for side_m in box_m)
        return {
            "kind": "ModularObstacle",
            "name": name,
            "corner_m": (left_m, bottom_m),
            "rows": round(depth_m / MODULE_SIDE_M),
            "columns": round(width_m / MODULE_SIDE_M),
            "height_m": whole_m(height_m),
            "protected": protected,
        }

    name = f"street_{length_m:g}_m"
    document = {
        "schema_version": 2,
        "name": name,
        "site": {
            "width_m": whole_m(100.0),
            "height_m": whole_m(80.0),
            "air_height_m": whole_m(19.0),
        },
        "charge": [
            {
                "kind": "point",
                "position_m": (whole_m(45.0), whole_m(28.0)),
                "tnt_kg": 500.0 * share**3,
            }
        ],
        "structures": [
            solid("office_front", (22.0, 55.0, 56.0, 14.0), 13.0, protected=True),
            solid("office_wing", (64.0, 69.0, 14.0, 10.0), 13.0, protected=True),
            solid("school", (16.0, 4.0, 44.0, 10.0), 7.5, protected=True),
            solid("school_wall", (10.0, 18.0, 65.0, 0.5), 2.0, protected=False),
        ],
        "build_zone": {
            "corner_m": (whole_m(22.0), whole_m(31.0)),
            "rows": round(whole_m(23.0) / MODULE_SIDE_M),
            "columns": round(whole_m(56.0) / MODULE_SIDE_M),
            "stock": 40,
            "height_m": whole_m(3.0),
        },
    }
    return Scenario.from_document(document, name)


@dataclass(frozen=True)
class SiteCost:
    """The cost of a blast by gas dynamics without a barrier, and its estimate before the run.

    Attributes:
        site: Name of the scenario.
        cells: Growth of its cells; see `GasSettings`.
        estimate: Estimate of the cost before the run.
        steps: Number of steps.
        cell_updates: Cell updates, one per cell and step.
        cpu_s: Processor time, from scenario to loads.
        memory_mb: Peak memory of the process.
    """

    site: str
    cells: str
    estimate: CostGuess
    steps: int
    cell_updates: int
    cpu_s: float
    memory_mb: float


def site_cost(scenario: Scenario, engine: GasEngine) -> SiteCost:
    """Run a blast on a site, in a separate process."""
    with get_context("spawn").Pool(1) as pool:
        return pool.apply(_site_cost, (scenario, engine))


def _site_cost(scenario: Scenario, engine: GasEngine) -> SiteCost:
    engine.blast(street(LENGTHS_M[0])).run()  # compiles code that is not on disk yet
    began = process_time()
    result = engine.blast(scenario).run()
    cpu_s = process_time() - began
    return SiteCost(
        site=scenario.name,
        cells=engine.cells,
        estimate=result.run.cost,
        steps=result.steps,
        cell_updates=result.run.solver.cell_updates,
        cpu_s=cpu_s,
        memory_mb=own_memory_mb(),
    )


@dataclass(frozen=True)
class EnvironmentCost:
    """The cost of episodes of random legal placements; medians of processor times.

    Attributes:
        episode_s: Time of an episode of one environment.
        blast_s: Time of its last step, with the blasts and the reward.
        steps: Number of steps per episode.
        batch_steps_per_s: Steps per CPU second of environments in one batch.
        batch_mb: Peak memory of a fresh process with such a batch; None if not measured.
    """

    episode_s: float
    blast_s: float
    steps: int
    batch_steps_per_s: float
    batch_mb: float | None = None

    @property
    def placing_s(self) -> float:
        """Time of `reset`, masks, observations and placements: all but the last step."""
        return self.episode_s - self.blast_s


def environment_cost(
    chosen: Mapping[str, Any], episodes: int, environments: int, *, memory: bool = True
) -> EnvironmentCost:
    """Time one environment, and several in one batch.

    Args:
        chosen: Arguments of `gymnasium.make`, with `action="place"`. The scenario needs a build
            zone, and a calibration where the engine does.
        episodes: Number of timed episodes, after one to warm up.
        environments: Number of environments in the batch.
        memory: Whether to measure the memory of the batch, too, in a separate process.

    Raises:
        BlastEnvError: If the environment cannot be made of the scenario.
    """
    env = gym.make(ENV_ID, **chosen)
    rng = np.random.default_rng(0)
    _episode(env, rng, 0)
    played = [_episode(env, rng, seed) for seed in range(1, episodes + 1)]
    env.close()
    whole_s, blast_s, steps = zip(*played, strict=True)
    rate = _batch_rate(chosen, environments, episodes)
    batch_mb = None
    if memory:
        with get_context("spawn").Pool(1) as pool:
            batch_mb = pool.apply(_batch_memory_mb, (chosen, environments))
    return EnvironmentCost(median(whole_s), median(blast_s), round(median(steps)), rate, batch_mb)


def _batch_rate(chosen: Mapping[str, Any], environments: int, episodes: int) -> float:
    """Return the median over some episodes of steps per CPU second; the first ones warm up."""
    envs = BlastBarrierVectorEnv(environments, **chosen)
    rng, rates = np.random.default_rng(0), []
    _, info = envs.reset(seed=0)
    over = np.zeros(environments, dtype=bool)
    for _ in range(episodes + 1):
        ended, steps, began = 0, 0, process_time()
        while ended < environments:
            steps += int(np.count_nonzero(~over))  # others begin: no step
            masks = info["action_mask"]
            free = masks[:, :-1] * rng.random((environments, masks.shape[1] - 1), np.float32)
            actions = np.where(free.any(axis=1), free.argmax(axis=1), masks.shape[1] - 1)
            _, _, over, _, info = envs.step(actions)
            ended += int(np.count_nonzero(over))
        rates.append(steps / (process_time() - began))
    return median(rates[1:])


def _batch_memory_mb(chosen: Mapping[str, Any], environments: int) -> float:
    _batch_rate(chosen, environments, 1)
    return own_memory_mb()


def _episode(
    env: gym.Env[Any, Any], rng: np.random.Generator, seed: int
) -> tuple[float, float, int]:
    """Return the processor times of an episode and of its last step, and its number of steps."""
    began, steps, ended = process_time(), 0, False
    _, info = env.reset(seed=seed)
    last_s = began
    while not ended:
        action = random_action(info["action_mask"], rng)
        last_s = process_time()
        _, _, ended, _, info = env.step(action)
        steps += 1
    now_s = process_time()
    return now_s - began, now_s - last_s, steps


def random_action(mask: FloatArray | NDArray[Any], rng: np.random.Generator) -> int:
    """Return a random legal placement, or the last action, which finishes, if there is none."""
    free = np.flatnonzero(mask[:-1])
    return int(rng.choice(free)) if len(free) else len(mask) - 1


def hardware() -> str:
    """Return the processor, the number of cores and the versions on which the speed depends."""
    packages = ", ".join(f"{name} {version(name)}" for name in _PACKAGES)
    return f"{_processor()}, {os.cpu_count()} cores, Python {platform.python_version()}, {packages}"


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    models = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    return next(models, platform.processor() or platform.machine())


def _print_blasts(costs: Sequence[BlastCost], repeats: int) -> None:
    rows = [
        (
            cost.scenario,
            cost.engine,
            f"{MS_PER_S * cost.simulated_s:.0f}",
            f"{cost.steps:,}",
            f"{MS_PER_S * cost.cpu_s:.1f}",
            f"{1.0 / cost.cpu_s:.2f}",
            "-" if cost.cell_updates is None else f"{1e-6 * cost.cell_updates / cost.cpu_s:.1f}",
            "-" if cost.memory_mb is None else f"{cost.memory_mb:.0f}",
        )
        for cost in costs
    ]
    if rows:
        print_table(f"a blast: medians of {repeats} seeds", _BLAST_HEADERS, rows, 2)


def _print_environments(
    pairs: Sequence[tuple[Scenario, str]], repeats: int, environments: int, *, memory: bool
) -> None:
    rows, left_out = [], []
    for scenario, engine in pairs:
        for observation in ("features", "image"):
            chosen = {
                "scenario": scenario,
                "engine": engine,
                "observation": observation,
                "action": "place",
            }
            try:
                cost = environment_cost(chosen, repeats, environments, memory=memory)
            except BlastEnvError as error:
                left_out.append(f"{scenario.name}, {engine}: no environment: {error}")
                break
            milliseconds = (f"{MS_PER_S * item:.1f}" for item in (cost.episode_s, cost.placing_s))
            rows.append(
                (
                    *(scenario.name, engine, observation, str(cost.steps), *milliseconds),
                    f"{cost.steps / cost.episode_s:,.0f}",
                    f"{cost.batch_steps_per_s:,.0f}",
                    "-" if cost.batch_mb is None else f"{cost.batch_mb:.0f}",
                )
            )
    if rows:
        title = f"{ENV_ID}: medians of {repeats} episodes; a batch has {environments} environments"
        print_table(title, _ENVIRONMENT_HEADERS, rows, 3)
    for line in left_out:
        print_line(line)


def _sites(names: Sequence[str], lengths_m: Sequence[float]) -> Iterator[Scenario]:
    for name in names:
        if name != LARGE:
            yield load_scenario(name)
            continue
        for length_m in lengths_m or LENGTHS_M:
            if not LENGTHS_M[0] <= length_m <= _LONGEST_M:
                bounds = f"{LENGTHS_M[0]:g} to {_LONGEST_M:g}"
                raise BlastEnvError(f"--length is {length_m:g}, must be {bounds}")
            yield street(length_m)


def _print_sites(sites: Sequence[Scenario], cells: Sequence[str]) -> None:
    pairs = [
        (scenario, GasEngine(cells=cell))
        for scenario in sites
        for cell in cells or CELLS
        if cell != UNIFORM or scenario.site.width_m <= _LONGEST_UNIFORM_M
    ]
    rows = []
    with progress_bar("blasts") as progress:
        for scenario, engine in pairs:
            cost = site_cost(scenario, engine)
            rows.append(
                (
                    cost.site,
                    cost.cells,
                    f"{cost.estimate.cells:,}",
                    f"{cost.estimate.steps:,}",
                    f"{cost.steps:,}",
                    f"{cost.estimate.seconds:.1f}",
                    f"{cost.cpu_s:.1f}",
                    f"{1e-6 * cost.cell_updates / cost.cpu_s:.1f}",
                    f"{1e-6 * cost.estimate.memory_bytes:.0f}",
                    f"{cost.memory_mb:.0f}",
                )
            )
            progress(len(rows) / len(pairs))
    print_table("a blast by gas dynamics, without a barrier", _SITE_HEADERS, rows, 2)
    print_line(_ELSEWHERE)


def _print_ratios(older: Path, names: Sequence[str], turns: int) -> None:
    unknown = [name for name in names if name not in ROWS]
    if unknown:
        raise UnknownNameError("row", unknown[0], list(ROWS))
    if not (older / "blast_env" / "__init__.py").is_file():
        raise BlastEnvError(f"--against is {older}, must be the folder of a checkout")
    newer, chosen = Path(__file__).resolve().parents[1], list(names or ROWS)
    rows = []
    with progress_bar("rows") as progress:
        try:
            for found in compare(older.resolve(), newer, chosen, turns):
                old_s, new_s = median(found.old_s), median(found.new_s)
                rows.append(
                    (
                        *(found.row.title, found.row.unit),
                        *(f"{1.0 / item:,.4g}" for item in (old_s, new_s)),
                        f"{found.ratio:.2f}",
                        f"{min(found.ratios):.2f} to {max(found.ratios):.2f}",
                    )
                )
                progress(len(rows) / len(chosen))
        except SideError as error:
            raise BlastEnvError(str(error)) from error
    title = f"per CPU s, medians of {turns} turns"
    print_table(title, ("work", "unit", "older", "this one", "ratio", "of the turns"), rows, 2)


_AgainstOption = Annotated[
    Path | None,
    typer.Option(
        help="Only the ratios of costs to those of an older checkout in this folder, measured "
        "in turns: above 1 this one is faster."
    ),
]


def main(
    scenario: Annotated[
        list[str] | None, typer.Option(help="A scenario, else courtyard. May be repeated.")
    ] = None,
    engine: Annotated[
        list[str] | None, typer.Option(help="Engine, else all of them. May be repeated.")
    ] = None,
    repeats: Annotated[int, typer.Option(help="Blasts or episodes of each.", min=1)] = 5,
    memory: Annotated[bool, typer.Option(help="Measure the memory of a process, too.")] = True,
    environment: Annotated[bool, typer.Option(help=f"Time {ENV_ID}, too.")] = True,
    environments: Annotated[
        int, typer.Option(help="Environments in a batch, which steps them together.", min=1)
    ] = 256,
    site: Annotated[
        list[str] | None,
        typer.Option(
            help="Only the cost of a blast by gas dynamics there, beside its estimate: a scenario, "
            "or `large` for streets. May be repeated."
        ),
    ] = None,
    cells: Annotated[
        list[str] | None,
        typer.Option(help="With --site: how cells grow, else each way. May be repeated."),
    ] = None,
    length: Annotated[
        list[float] | None,
        typer.Option(help="With --site large: 20 to 200 m, else 20, 50 and 100. May be repeated."),
    ] = None,
    against: _AgainstOption = None,
    row: Annotated[
        list[str] | None,
        typer.Option(help=f"With --against: {', '.join(ROWS)}, else all. May be repeated."),
    ] = None,
) -> None:
    """Time blasts and the environment on this machine, and measure the memory."""
    with user_errors():
        if length and LARGE not in (site or ()):
            raise BlastEnvError("--length needs --site large")
        if cells and not site:
            raise BlastEnvError("--cells needs --site")
        if row and against is None:
            raise BlastEnvError("--row needs --against")
        if against is not None:
            print_line(hardware())
            _print_ratios(against, row or (), repeats)
        elif site:
            sites = list(_sites(site, length or ()))
            print_line(hardware())
            _print_sites(sites, cells or ())
        else:
            scenarios = [load_scenario(name) for name in scenario or ("courtyard",)]
            engines = [find_engine(name).name for name in engine or ENGINE_NAMES]
            print_line(hardware())
            pairs = [(own, name) for own in scenarios for name in engines]
            _print_blasts(_costs(pairs, repeats, memory=memory), repeats)
            if environment:
                _print_environments(pairs, repeats, environments, memory=memory)


def _costs(pairs: Sequence[tuple[Scenario, str]], repeats: int, *, memory: bool) -> list[BlastCost]:
    """Measure the blasts of each scenario and engine that has a medium."""
    costs: list[BlastCost] = []
    with progress_bar("blasts") as progress:
        for item, name in (pair for pair in pairs if find_engine(pair[1]).medium):
            costs.append(blast_cost(item, name, repeats, memory=memory))
            progress(len(costs) / len(pairs))
    return costs


if __name__ == "__main__":
    typer.run(main)
