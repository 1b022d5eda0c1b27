"""Whether single modules take the same from pymunk and from the event engine."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from scipy.stats import ks_2samp

from blast_env.arrays import FloatArray
from blast_env.runner import run_all
from blast_env.scenario import Scenario
from blast_env.simulation import Blast
from blast_env.studies.benchmark.engines import BenchmarkScene

STRUCTURE: Final = "building"

_SPLITS: Final = 200


class Agreement(NamedTuple):
    """A distance between the engines, and how large it gets by chance.

    Attributes:
        value: Between blasts on pymunk and blasts on the event engine.
        chance: 95 % of the distances between as many blasts on the event engine and the others
            there are smaller.
    """

    value: float
    chance: float

    def __str__(self) -> str:
        """Return both, with three digits."""
        return f"{self.value:.3f} ({self.chance:.3f})"


def stepped(scene: BenchmarkScene) -> Iterator[tuple[float, Scenario]]:
    """Yield the default step and, if it is another, the one at which pymunk is within 5 %."""
    default = scene.scenario.parameters.stepping.step_radii
    yield default, scene.scenario
    close = scene.at_close_step()
    if close is not None and scene.close_step_radii not in (None, default):
        yield close.parameters.stepping.step_radii, close


def module_impulses(
    scenario: Scenario,
    engine: str,
    seeds: int,
    processes: int,
    progress: Callable[[float], None] | None = None,
) -> FloatArray:
    """Return m |v| and the transferred impulse of every module of the building.

    Args:
        scenario: The scenario.
        engine: Name of the engine.
        seeds: Number of blasts; their seeds are 0 and up.
        processes: Worker processes.
        progress: Called with the share of the blasts that is done.

    Returns:
        Simulation units (seeds, modules, 2).
    """
    blast = partial(_of_one_blast, scenario, engine)
    return np.array(run_all(blast, range(seeds), processes, progress))


def _of_one_blast(scenario: Scenario, engine: str, seed: int) -> list[tuple[float, float]]:
    building = Blast(scenario, seed=seed, engine=engine).run().obstacle(STRUCTURE)
    return [(part.impulse, part.transferred_impulse) for part in building.parts]


def distribution_distance(one: FloatArray, other: FloatArray) -> float:
    """Return the Kolmogorov-Smirnov distance of the impulses of single modules.

    Over all modules that any of these blasts hits.

    Args:
        one: Impulses (seeds, modules).
        other: Likewise, of as many modules.
    """
    hit = one.any(axis=0) | other.any(axis=0)
    return float(ks_2samp(one[:, hit].ravel(), other[:, hit].ravel(), method="asymp").statistic)


def profile_distance(one: FloatArray, other: FloatArray) -> float:
    """Return how far the mean impulses along the facade are apart.

    The root of the sum of the squares of their differences over that of the second ones.

    Args:
        one: Impulses (seeds, modules).
        other: Likewise, of as many modules.
    """
    profile, other_profile = one.mean(axis=0), other.mean(axis=0)
    return float(np.linalg.norm(profile - other_profile) / np.linalg.norm(other_profile))


def agreement(
    distance: Callable[[FloatArray, FloatArray], float], pymunk: FloatArray, event: FloatArray
) -> Agreement:
    """Compare impulses of modules with a distance.

    Args:
        distance: One of the two above.
        pymunk: Impulses (seeds, modules).
        event: Of more blasts.
    """
    rng, chances = np.random.default_rng(0), []
    for _ in range(_SPLITS):
        order = rng.permutation(len(event))
        chances.append(distance(event[order[: len(pymunk)]], event[order[len(pymunk) :]]))
    return Agreement(distance(pymunk, event), float(np.percentile(chances, 95.0)))
