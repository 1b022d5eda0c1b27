"""Whether both engines put layouts into the same order, for docs/engines.md.

Random layouts of the courtyard, each with the same charges on both engines. Two lots of seeds of
fan and air on each engine say how well an engine agrees with itself, which bounds how well it can
agree with the other one.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Final, NamedTuple

import joblib
import numpy as np
import pandas as pd
import typer
from scipy.stats import rankdata

from blast_env import load_scenario
from blast_env.arrays import FloatArray
from blast_env.cli.output import print_line, progress_bar, user_errors
from blast_env.files import write_atomically
from blast_env.geometry import Cell
from blast_env.physics.scene import Charge
from blast_env.scenario import Scenario
from blast_env.simulation import Blast
from scripts.measure_noise import LAYOUTS

Layout = tuple[Cell, ...]


ENGINES: Final = ("pymunk", "event")


LOTS: Final = 2


OUT: Final = Path("out/rank_layouts.csv")


_RESAMPLES: Final = 2000


class Correlation(NamedTuple):
    """A rank correlation with its 95 % bootstrap interval over the layouts."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        """Return the value with its interval."""
        return f"{self.value:.3f} ({self.low:.3f} to {self.high:.3f})"


def main(
    layouts: Annotated[int, typer.Option(min=10)] = 200,
    charges: Annotated[int, typer.Option(min=1, help="Charges drawn from the scenario.")] = 8,
    processes: int = 2,
    out: Annotated[Path, typer.Option(help="File for the mean loads.")] = OUT,
) -> None:
    """Run the blasts and print the correlations."""
    with user_errors():
        out.parent.mkdir(parents=True, exist_ok=True)
        scenario = load_scenario("courtyard").with_simulation("ballistic")
        rng = np.random.default_rng(0)
        drawn = random_layouts(scenario, layouts, rng)
        threats = [scenario.sample_charge(rng) for _ in range(charges)]
        loads = measured_loads(scenario, drawn, threats, processes)
        _write_loads(drawn, loads, out)
    print_line("| compared | 1 seed a layout | " + f"{charges} seeds a layout |")
    print_line("|---|---|---|")
    for name, statistic in STATISTICS.items():
        single = correlation(loads, statistic, rng)
        averaged = correlation(loads.mean(axis=-1, keepdims=True), statistic, rng)
        print_line(f"| {name} | {single} | {averaged} |")
    print_line(f"wrote {out}")


def random_layouts(scenario: Scenario, count: int, rng: np.random.Generator) -> list[Layout]:
    """Return layouts of 1 module up to the whole stock: scattered ones and walls in turn."""
    kinds = list(LAYOUTS.values())
    whole = (kinds[number % len(kinds)](scenario, rng) for number in range(count))
    return [layout[: rng.integers(1, len(layout) + 1)] for layout in whole]


def measured_loads(
    scenario: Scenario, layouts: list[Layout], charges: list[Charge], processes: int
) -> FloatArray:
    """Return m |v| on the building (engines, lots, layouts, charges)."""
    jobs = (
        joblib.delayed(_loads_of_layout)(scenario, layout, charges, engine, lot)
        for engine in ENGINES
        for lot in range(LOTS)
        for layout in layouts
    )
    parallel = joblib.Parallel(n_jobs=processes, return_as="generator")
    loads: list[list[float]] = []
    with progress_bar("blasts") as progress:
        for each in parallel(jobs):
            loads.append(each)
            progress(len(loads) / (len(ENGINES) * LOTS * len(layouts)))
    return np.array(loads).reshape(len(ENGINES), LOTS, len(layouts), len(charges))


def _loads_of_layout(
    scenario: Scenario, layout: Layout, charges: list[Charge], engine: str, lot: int
) -> list[float]:
    """Return m |v| on the building for each charge; the seeds are the same for all layouts."""
    return [
        Blast(scenario, layout, lot * len(charges) + number, engine, charge)
        .run()
        .impulse_sim("building")
        for number, charge in enumerate(charges)
    ]


def spearman(one: FloatArray, other: FloatArray) -> float:
    """Return the mean over the columns of the rank correlation of (layouts, columns)."""
    ranks = rankdata(one, axis=0), rankdata(other, axis=0)
    centred = [rank - rank.mean(axis=0) for rank in ranks]
    norms = [np.sqrt((each**2).sum(axis=0)) for each in centred]
    return float(((centred[0] * centred[1]).sum(axis=0) / (norms[0] * norms[1])).mean())


def between_engines(loads: FloatArray) -> float:
    """Return the correlation of one engine with the other, on other seeds of fan and air."""
    pymunk, event = loads
    return (spearman(pymunk[0], event[1]) + spearman(pymunk[1], event[0])) / 2.0


def on_same_seeds(loads: FloatArray) -> float:
    """Return the correlation of one engine with the other, on the same seeds."""
    pymunk, event = loads
    return (spearman(pymunk[0], event[0]) + spearman(pymunk[1], event[1])) / 2.0


def of_pymunk(loads: FloatArray) -> float:
    """Return the correlation of pymunk with itself, on other seeds."""
    return spearman(*loads[0])


def of_event(loads: FloatArray) -> float:
    """Return the correlation of the event engine with itself, on other seeds."""
    return spearman(*loads[1])


def without_noise(loads: FloatArray) -> float:
    """Return the correlation between the engines over that of each with itself.

    Over the geometric mean of the two (Spearman's correction for attenuation): 1 where the
    engines differ by no more than one engine does from itself.
    """
    within: float = np.sqrt(of_pymunk(loads) * of_event(loads))
    return between_engines(loads) / within


STATISTICS: Final[dict[str, Callable[[FloatArray], float]]] = {
    "pymunk with the event engine, other seeds": between_engines,
    "pymunk with the event engine, same seeds": on_same_seeds,
    "pymunk with itself, other seeds": of_pymunk,
    "event engine with itself, other seeds": of_event,
    "between the engines over within them": without_noise,
}


def correlation(
    loads: FloatArray, statistic: Callable[[FloatArray], float], rng: np.random.Generator
) -> Correlation:
    """Return a correlation with its bootstrap interval.

    Args:
        loads: (engines, lots, layouts, charges).
        statistic: Which one.
        rng: Draws the layouts that are resampled.
    """
    count = loads.shape[2]
    resampled = [statistic(loads[:, :, rng.integers(0, count, count)]) for _ in range(_RESAMPLES)]
    low, high = np.percentile(resampled, (2.5, 97.5)).tolist()
    return Correlation(statistic(loads), low, high)


def _write_loads(layouts: list[Layout], loads: FloatArray, path: Path) -> None:
    """Write the mean loads of every layout."""
    rows = pd.DataFrame(
        {"layout": range(len(layouts)), "modules": [len(layout) for layout in layouts]}
        | dict(_mean_columns(loads))
    )
    with write_atomically(path) as temporary:
        rows.to_csv(temporary, index=False, lineterminator="\n")


def _mean_columns(loads: FloatArray) -> Iterator[tuple[str, FloatArray]]:
    for engine, of_engine in zip(ENGINES, loads, strict=True):
        for lot, of_lot in enumerate(of_engine):
            yield f"{engine}_{lot}", of_lot.mean(axis=-1)


if __name__ == "__main__":
    typer.run(main)
