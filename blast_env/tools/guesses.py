"""Predicted shares of the load with their intervals."""

from math import isnan

from blast_env.benchmark import BenchmarkProblem
from blast_env.geometry import Layout
from blast_env.surrogate import Surrogate, SurrogateSite


def guessed_shares(
    problem: BenchmarkProblem, surrogate: Surrogate, site: SurrogateSite, layout: Layout
) -> tuple[float, float, float]:
    """Return the predicted share of the load that remains, and the ends of its 95 % interval.

    The load without a barrier is that of a blast, so that the interval is that of the load behind
    the barriers alone.

    Args:
        site: Its scenario as the surrogate represents it.
        layout: A legal layout.
    """
    case = problem.case
    unprotected = case.objective_value(problem.unprotected, ())
    if not layout:
        return 1.0, 1.0, 1.0
    loads: list[list[float]] = [[], [], []]
    for threat in case.threats:
        charge = threat.charge_against(case.scenario, layout)
        guess = surrogate.guess(site, [layout], [charge])
        ends = (guess, surrogate.lower_ends(guess), surrogate.upper_ends(guess))
        for found, own in zip(loads, ends, strict=True):
            found.append(own.loads(site, [layout]).item())
    share, low, high = (case.objective_value(own, layout) / unprotected for own in loads)
    if isnan(share):  # it counts as nothing placed, as in a blast
        return 1.0, 1.0, 1.0
    return share, low, high
