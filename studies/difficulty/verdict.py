"""Criteria for scenarios worth solving: the choice of layout must matter."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from blast_env.statistics import Estimate
from studies.difficulty.items import ItemResult
from studies.difficulty.study import TaskResult, WayOutcome
from studies.noise import Noise

LEAST_REDUCTION, MOST_REDUCTION = 0.15, 0.85
"""Bounds of the best reduction: it must be noticeable, and leave room for improvement."""
LEAST_GAIN: Final = 0.10
"""Lead in reduction of the best layout over random ones, as a share of the impulse."""
THREATS: Final = 16
"""Threats over which the environment averages where the charge is hidden."""
LEAST_SIGNAL: Final = 2.0
"""Ratio of the spread between random layouts to the scatter of their comparison on `THREATS`."""


@dataclass(frozen=True)
class Criterion:
    """A requirement of a scenario.

    Attributes:
        text: The requirement.
        finding: The value found.
        met: Whether the value satisfies the requirement.
    """

    text: str
    finding: str
    met: bool


def difficulty_criteria(hidden: TaskResult, visible: TaskResult) -> tuple[Criterion, ...]:
    """Return the criteria of a scenario without a catalogue.

    Args:
        hidden: Outcomes with one layout for all threats.
        visible: Outcomes with one layout per charge.
    """
    tasks = (hidden, visible)
    best = [result.best.reduction.value for result in tasks]
    distance = [result.best_rule.better_by(worst_wall(result)) for result in tasks]
    over_random = [result.best.better_by(result.random) for result in tasks]
    over_wall = [result.searched.better_by(result.best_rule) for result in tasks]
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


def worst_wall(result: TaskResult) -> WayOutcome:
    """Return the wall at the worst distance."""
    return min(result.rules, key=lambda outcome: outcome.reduction.value)


def points(difference: Estimate) -> str:
    """Return a difference of reductions in percentage points, with its interval."""
    value, low, high = (100.0 * each for each in difference)
    return f"{value:+.0f} points ({low:+.0f} to {high:+.0f})"


def _in_tasks(findings: Iterable[str]) -> str:
    hidden, visible = findings
    return f"charge hidden {hidden}, visible {visible}"


LEAST_WORTH: Final = 0.35
"""Least reduction by the best layout of items."""
LEAST_ITEM_GAIN: Final = 0.15
"""Least lead of that reduction over the mean of random layouts."""
LEAST_SPREAD: Final = 0.10
"""Least difference of the 90th and 10th percentiles of the reduction by random layouts."""
RULE_LOSS: Final = 0.05
"""Least shortfall against the best found that every rule has in some scenario."""
LEAST_OVER_RULES: Final = 0.03
"""Least lead of the best found over every rule, in some scenarios."""
ELSEWHERE_LOSS: Final = 0.05
"""Least shortfall of the best layout for one place at another one, in some scenarios."""


def item_criteria(result: ItemResult) -> tuple[Criterion, ...]:
    """Return the criteria of a single scenario with a catalogue."""
    best, random = result.best.reduction.value, result.task.random.reduction.value
    low, high = result.random_percentiles
    return (
        Criterion(
            f"the best reduction is at least {100.0 * LEAST_WORTH:.0f} %",
            f"{100.0 * best:.1f} %",
            best >= LEAST_WORTH,
        ),
        Criterion(
            f"the best is better than random layouts by {100.0 * LEAST_ITEM_GAIN:.0f} points",
            f"{100.0 * (best - random):+.1f} points",
            best - random >= LEAST_ITEM_GAIN,
        ),
        Criterion(
            f"random layouts spread by {100.0 * LEAST_SPREAD:.0f} points from the 10th to the 90th "
            "percentile",
            f"{100.0 * (high - low):.1f} points ({100.0 * low:.1f} to {100.0 * high:.1f} %)",
            high - low >= LEAST_SPREAD,
        ),
    )


def joint_criteria(results: Sequence[ItemResult]) -> tuple[Criterion, ...]:
    """Return the joint criteria of the scenarios with a catalogue."""
    losses = {
        name: max(
            (loss, result.scenario.name)
            for result in results
            if (loss := result.rule_loss(name)) is not None
        )
        for name in dict.fromkeys(row.name for result in results for row in result.task.rules)
    }
    best_rule = min(losses, key=lambda name: losses[name])
    over = {each.scenario.name: each.over_rules for each in results}
    elsewhere = {each.scenario.name: each.loss_elsewhere for each in results}
    buys = {each.scenario.name: each.better_buy.value for each in results}
    return (
        Criterion(
            f"every rule loses {100.0 * RULE_LOSS:.0f} points to the best found somewhere",
            f"least of all the {best_rule}, {100.0 * losses[best_rule][0]:.1f} points in "
            f"{losses[best_rule][1]}",
            losses[best_rule][0] >= RULE_LOSS,
        ),
        _in_scenarios(
            f"the best found beats every rule by {100.0 * LEAST_OVER_RULES:.0f} points in two",
            over,
            LEAST_OVER_RULES,
            2,
        ),
        _in_scenarios(
            "the best layout for one place of the charge loses "
            f"{100.0 * ELSEWHERE_LOSS:.0f} points at another one in three",
            elsewhere,
            ELSEWHERE_LOSS,
            3,
        ),
        Criterion(
            "of height, length and distance, not the same one is the best buy in all",
            ", ".join(f"{what} in {name}" for name, what in buys.items()),
            len(set(buys.values())) > 1,
        ),
    )


def _in_scenarios(text: str, found: Mapping[str, float], least: float, count: int) -> Criterion:
    finding = ", ".join(f"{name} {100.0 * value:.1f}" for name, value in found.items())
    return Criterion(text, finding, sum(value >= least for value in found.values()) >= count)
