"""Whether layouts can be told apart: in the noise of seeds, by both engines, by finer balls."""

from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass
from functools import partial
from itertools import product
from time import process_time
from typing import Final, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import rankdata, spearmanr

from blast_env.arrays import FloatArray
from blast_env.geometry import Layout
from blast_env.physics.parameters import SimulationParameters
from blast_env.physics.presets import preset, with_resolution
from blast_env.physics.scene import Charge
from blast_env.runner import run_all
from blast_env.scenario import Scenario
from blast_env.simulation import Blast, simulate

AVERAGED: Final = (1, 2, 4, 8, 16)


@dataclass(frozen=True)
class Noise:
    """Signal and noise of the impulse, as shares of the impulse without a barrier.

    Attributes:
        signal: Standard deviation between layouts.
        noise: Standard deviation of one layout's impulse between draws.
        reduction_noise: Standard deviation of one layout's reduction between draws, each against
            no barrier on the same draw.
        paired_noise: That of the impulse after what a draw does to all layouts alike is taken off:
            the noise of a comparison of layouts on the same draws.
    """

    signal: float
    noise: float
    reduction_noise: float
    paired_noise: float

    @classmethod
    def of(cls, impulses: FloatArray, unprotected: FloatArray) -> "Noise":
        """Return the estimates.

        Args:
            impulses: Impulses with layouts (layouts, draws).
            unprotected: Impulses without a barrier (draws,).
        """
        reductions = 1.0 - impulses[:, unprotected > 0.0] / unprotected[unprotected > 0.0]
        impulses = impulses / unprotected.mean()
        layouts, draws = impulses.shape
        between = impulses.mean(axis=1, keepdims=True)
        residual = impulses - between - impulses.mean(axis=0) + impulses.mean()
        interaction = float((residual**2).sum() / ((layouts - 1) * (draws - 1)))
        # The means over the draws scatter by chance as well, which is no signal.
        signal = max(float(between.var(ddof=1)) - interaction / draws, 0.0)
        noise = float(impulses.var(axis=1, ddof=1).mean())
        of_reduction = float(reductions.var(axis=1, ddof=1).mean())
        return cls(signal**0.5, noise**0.5, of_reduction**0.5, interaction**0.5)

    @classmethod
    def mean_of(cls, noises: list["Noise"]) -> "Noise":
        """Return the root mean squares."""
        squares = np.array([astuple(each) for each in noises]) ** 2
        return cls(*np.sqrt(squares.mean(axis=0)).tolist())

    def cells(self) -> list[str]:
        """Return the four as shares, and the signal over the noise by the draws averaged."""
        ratio, paired = self.signal / self.noise, self.signal / self.paired_noise
        ratios = (f"{n**0.5 * ratio:.2f} ({n**0.5 * paired:.2f})" for n in AVERAGED)
        shares = (f"{100.0 * each:.1f} %" for each in astuple(self))
        return [*shares, *ratios]


ENGINES: Final = ("pymunk", "event")

LOTS: Final = 2

_RESAMPLES: Final = 2000


class Correlation(NamedTuple):
    """A rank correlation with its 95 % bootstrap interval over the layouts."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        """Return the value with its interval."""
        return f"{self.value:.3f} ({self.low:.3f} to {self.high:.3f})"


def measured_loads(
    scenario: Scenario,
    layouts: Sequence[Layout],
    charges: list[Charge],
    processes: int,
    progress: Callable[[float], None] | None = None,
) -> FloatArray:
    """Return m |v| on the building (engines, lots, layouts, charges)."""
    jobs = list(product(ENGINES, range(LOTS), layouts))
    of_layout = partial(_loads_of_layout, scenario, charges)
    loads = run_all(of_layout, jobs, processes, progress)
    return np.array(loads).reshape(len(ENGINES), LOTS, len(layouts), len(charges))


def _loads_of_layout(
    scenario: Scenario, charges: list[Charge], job: tuple[str, int, Layout]
) -> list[float]:
    """Return m |v| on the building for each charge; the seeds are the same for all layouts."""
    engine, lot, layout = job
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


FINER: Final = 1.5
"""How much finer the finest balls are than those of `collisional_fine`."""


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


def with_parameters(scenario: Scenario, parameters: SimulationParameters) -> Scenario:
    """Return the scenario with exactly these parameters."""
    return scenario.with_simulation("ballistic", parameters.model_dump())


def blasts_of(
    name: str,
    scenario: Scenario,
    layouts: Sequence[Layout],
    seeds: range,
    processes: int,
    progress: Callable[[float], None] | None = None,
) -> Blasts:
    """Run every layout with every seed; the first layout is the empty one."""
    done = run_all(partial(_load_of, scenario), list(product(layouts, seeds)), processes, progress)
    impulses, times_s = np.array(done).T
    impulses = impulses.reshape(len(layouts), len(seeds))
    return Blasts(name, impulses[1:] / impulses[0], float(times_s.mean()))


def _load_of(scenario: Scenario, job: tuple[Layout, int]) -> tuple[float, float]:
    """Return the transferred impulse on the protected structures, and the processor time."""
    layout, seed = job
    start = process_time()
    result = simulate(scenario, layout, seed, "event")
    impulse = sum(o.weight * o.transferred_impulse for o in result.obstacles if o.protected)
    return impulse, process_time() - start


def share_table(layouts: Sequence[Layout], found: Sequence[Blasts]) -> pd.DataFrame:
    """Return what each layout leaves of the impulse, a column a resolution."""
    table = pd.DataFrame({each.name: each.shares.mean(axis=1) for each in found})
    table.insert(0, "modules", [len(layout) for layout in layouts])
    return table


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


def mean_loads(layouts: Sequence[Layout], loads: FloatArray) -> pd.DataFrame:
    """Return the mean loads of every layout, a column an engine and lot."""
    return pd.DataFrame(
        {"layout": range(len(layouts)), "modules": [len(layout) for layout in layouts]}
        | {
            f"{engine}_{lot}": loads[number, lot].mean(axis=-1)
            for number, engine in enumerate(ENGINES)
            for lot in range(LOTS)
        }
    )
