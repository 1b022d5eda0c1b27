"""Whether finer balls would rank layouts differently, for docs/validity.md.

Random layouts of a scenario (straight walls and scattered modules in turn) with `collisional`, with
`collisional_fine` and with still finer balls, on the same seeds: what each layout leaves of the
impulse, the rank correlations, the mean differences, and the time of a blast.
"""

from dataclasses import dataclass
from itertools import combinations, product
from pathlib import Path
from time import process_time
from typing import Annotated, Final

import joblib
import numpy as np
import pandas as pd
import typer
from blast_agents.rules import random_layout
from numpy.typing import NDArray
from scipy.stats import spearmanr

from blast_env import load_scenario, simulate
from blast_env.cli.output import print_line, progress_bar, user_errors
from blast_env.files import write_atomically
from blast_env.geometry import Cell
from blast_env.physics.parameters import SimulationParameters
from blast_env.physics.presets import preset, with_resolution
from blast_env.scenario import Scenario
from scripts.measure_noise import walled_layout

FINER: Final = 1.5
"""How much finer the finest balls are than those of `collisional_fine`."""

Layout = tuple[Cell, ...]


@dataclass(frozen=True)
class Blasts:
    """All blasts of one resolution.

    Attributes:
        name: Of the resolution.
        shares: Transferred impulse over that without a barrier (layouts, seeds).
        blast_s: Mean processor time of a blast.
    """

    name: str
    shares: NDArray[np.float64]
    blast_s: float


def resolutions() -> dict[str, SimulationParameters]:
    """Return the parameters of the three resolutions by name."""
    fine = preset("collisional_fine")
    return {
        "collisional": preset("collisional"),
        "collisional_fine": fine,
        "finest": with_resolution(fine, FINER),
    }


def random_layouts(scenario: Scenario, count: int) -> list[Layout]:
    """Return walls and scattered modules in turn, the same in every call."""
    rng = np.random.default_rng(0)
    kinds = (walled_layout, random_layout)
    return [kinds[index % 2](scenario, rng) for index in range(count)]


def main(
    scenario: str = "courtyard",
    layouts: Annotated[int, typer.Option(min=3)] = 30,
    seeds: Annotated[int, typer.Option(min=2)] = 4,
    first_seed: int = 2000,
    processes: Annotated[int, typer.Option(min=1)] = 2,
    out: Path = Path("out/resolution_convergence"),
) -> None:
    """Print the comparison and write the shares of every layout."""
    with user_errors():
        out.mkdir(parents=True, exist_ok=True)
        loaded = load_scenario(scenario)
        tried = [(), *random_layouts(loaded, layouts)]
        numbers = range(first_seed, first_seed + seeds)
        found = [
            run_all(name, with_parameters(loaded, parameters), tried, numbers, processes)
            for name, parameters in resolutions().items()
        ]
        table = pd.DataFrame({each.name: each.shares.mean(axis=1) for each in found})
        table.insert(0, "modules", [len(layout) for layout in tried[1:]])
        with write_atomically(out / f"{scenario}.csv") as temporary:
            table.to_csv(temporary, index=False)
        for each in found:
            print_line(
                f"{each.name}: {each.blast_s:.3f} s a blast, leaves {each.shares.mean():.3f}; "
                f"rank correlation between halves of the seeds {own_correlation(each):.2f}"
            )
        for one, other in combinations(found, 2):
            print_line(compared(one, other))


def with_parameters(scenario: Scenario, parameters: SimulationParameters) -> Scenario:
    """Return the scenario with exactly these parameters."""
    return scenario.with_simulation("ballistic", parameters.model_dump())


def run_all(
    name: str, scenario: Scenario, layouts: list[Layout], seeds: range, processes: int
) -> Blasts:
    """Run every layout with every seed; the first layout is the empty one."""
    jobs = [joblib.delayed(run_one)(scenario, each, seed) for each, seed in product(layouts, seeds)]
    done = []
    with progress_bar(name) as progress:
        for result in joblib.Parallel(n_jobs=processes, return_as="generator")(jobs):
            done.append(result)
            progress(len(done) / len(jobs))
    impulses = np.array([impulse for impulse, _ in done]).reshape(len(layouts), len(seeds))
    blast_s = float(np.mean([seconds for _, seconds in done]))
    return Blasts(name, impulses[1:] / impulses[0], blast_s)


def run_one(scenario: Scenario, layout: Layout, seed: int) -> tuple[float, float]:
    """Return the transferred impulse on the protected structures, and the processor time."""
    start = process_time()
    result = simulate(scenario, layout, seed, "event")
    impulse = sum(o.weight * o.transferred_impulse for o in result.obstacles if o.protected)
    return impulse, process_time() - start


def own_correlation(blasts: Blasts) -> float:
    """Return the rank correlation between the means of two halves of the seeds."""
    half = blasts.shares.shape[1] // 2
    parts = blasts.shares[:, :half].mean(axis=1), blasts.shares[:, half:].mean(axis=1)
    return float(spearmanr(*parts).statistic)


def compared(one: Blasts, other: Blasts) -> str:
    """Return how much two resolutions agree, as a line of text."""
    first, second = one.shares.mean(axis=1), other.shares.mean(axis=1)
    difference = second - first
    error = difference.std(ddof=1) / np.sqrt(len(difference))
    return (
        f"{one.name} - {other.name}: rank correlation {spearmanr(first, second).statistic:.2f}, "
        f"the second leaves {difference.mean():+.3f} +- {error:.3f} more"
    )


if __name__ == "__main__":
    typer.run(main)
