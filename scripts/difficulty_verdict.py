"""Whether a scenario is worth solving: whether it matters where the barrier stands."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from blast_env.statistics import Estimate
from blast_env.studies.agreement.layouts import Noise
from scripts.difficulty_outcomes import Outcome, TaskResult

LEAST_REDUCTION, MOST_REDUCTION = 0.15, 0.85
"""Between these the best layout does something and leaves something to do."""
LEAST_GAIN: Final = 0.10
"""What the best layout takes off beyond a random one, as a share of the impulse."""
THREATS: Final = 16
"""Threats over which the environment averages where the charge is hidden."""
LEAST_SIGNAL: Final = 2.0
"""Spread between random layouts over the scatter of their comparison on `THREATS` threats."""


@dataclass(frozen=True)
class Criterion:
    """One thing that a scenario must have.

    Attributes:
        text: What.
        finding: What it has.
        met: Whether that is enough.
    """

    text: str
    finding: str
    met: bool


def difficulty_criteria(hidden: TaskResult, visible: TaskResult) -> tuple[Criterion, ...]:
    """Return what a scenario must have, and whether it has it.

    Args:
        hidden: Where one layout has to do for all threats.
        visible: Where every charge has a layout of its own.
    """
    tasks = (hidden, visible)
    best = [result.best.reduction.value for result in tasks]
    distance = [result.best_wall.better_by(worst_wall(result)) for result in tasks]
    over_random = [result.best.better_by(result.random) for result in tasks]
    over_wall = [result.searched.better_by(result.best_wall) for result in tasks]
    noise = Noise.of(hidden.random.impulse_pa_s, hidden.random.unprotected_pa_s)
    signal = THREATS**0.5 * noise.signal / noise.paired_noise
    return (
        Criterion(
            f"the best reduction is {100.0 * LEAST_REDUCTION:.0f} to {100.0 * MOST_REDUCTION:.0f} %"
            " in both tasks",
            _in_tasks(f"{100.0 * each:.0f} %" for each in best),
            all(LEAST_REDUCTION <= each <= MOST_REDUCTION for each in best),
        ),
        Criterion(
            f"in both the best is better than random ones by {100.0 * LEAST_GAIN:.0f} points",
            _in_tasks(map(points, over_random)),
            all(gain.low >= LEAST_GAIN for gain in over_random),
        ),
        Criterion(
            "in one of them the wall's distance matters, best against worst",
            _in_tasks(map(points, distance)),
            any(gain.low > 0.0 for gain in distance),
        ),
        Criterion(
            "in one of them the best random layout and the best wall differ",
            _in_tasks(map(points, over_wall)),
            any(gain.low > 0.0 or gain.high < 0.0 for gain in over_wall),
        ),
        Criterion(
            f"random layouts differ {LEAST_SIGNAL:g} times as much as their comparison on"
            f" {THREATS} threats scatters",
            f"charge hidden {signal:.1f} times",
            signal >= LEAST_SIGNAL,
        ),
    )


def worst_wall(result: TaskResult) -> Outcome:
    """Return the wall at the worst distance."""
    return min(result.walls, key=lambda outcome: outcome.reduction.value)


def points(difference: Estimate) -> str:
    """Return a difference of reductions in percentage points, with its interval."""
    value, low, high = (100.0 * each for each in difference)
    return f"{value:+.0f} points ({low:+.0f} to {high:+.0f})"


def _in_tasks(findings: Iterable[str]) -> str:
    hidden, visible = findings
    return f"charge hidden {hidden}, visible {visible}"
