"""Prediction intervals of the surrogate that hold on new sites: conformal prediction by site.

The networks of an ensemble differ too little where all of them are wrong. The width of an interval
is therefore the spread of the networks times a factor that the errors on held-out sites set
(Angelopoulos & Bates 2023, section 2.3). Where they agree closely they may all be wrong alike, so
that a least spread adds to theirs: with it one factor serves sites of all kinds better, and
intervals are narrower. Loads of one site are alike, so that a site, not a load,
is the unit: each has the same weight (Dunn, Wasserman & Ramdas 2023).
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.errors import BlastEnvError

COVERAGE: Final = 0.95
"""Share of the loads of a new site that lie in their intervals."""

IMPULSE_LEAST_SPREAD: Final = 0.01
"""Least spread of ln(impulse)."""

PEAK_LEAST_SPREAD: Final = 0.03
"""Least spread of ln(peak overpressure)."""


def widened(spreads: FloatArray, least: float) -> FloatArray:
    """Return spreads of networks with a least spread added, as of independent errors."""
    found: FloatArray = np.hypot(spreads, least)
    return found


def interval_factor(
    errors: FloatArray, spreads: FloatArray, sites: IntArray, coverage: float = COVERAGE
) -> float:
    """Return the half-width of an interval of a new site's load, in spreads.

    Args:
        errors: Errors of predictions of ln load by networks without the sample's site (samples,).
        spreads: Standard deviations of ln load among these networks (samples,).
        sites: Index of the site (samples,).
        coverage: Share of the loads in their intervals.

    Raises:
        BlastEnvError: If there are too few sites for such a coverage.
    """
    _, site, counts = np.unique(sites, return_inverse=True, return_counts=True)
    wanted = coverage * (len(counts) + 1)
    if wanted > len(counts):
        raise BlastEnvError(
            f"{len(counts)} sites are too few for intervals of {coverage:g}: it takes at least "
            f"{least_sites(coverage)}"
        )
    # Split conformal prediction. (1) The score of a load is its error in spreads; (2) each site has
    # the weight 1, spread over its loads; (3) the interval takes in the scores up to the weight c
    # (n + 1): the new site is one of n + 1 alike ones.
    ratios = np.abs(errors) / spreads
    order = np.argsort(ratios)
    weight = np.cumsum(1.0 / counts[site][order])
    found = min(int(np.searchsorted(weight, wanted)), len(order) - 1)
    return float(ratios[order[found]])


def least_sites(coverage: float = COVERAGE) -> int:
    """Return the least number of sites that set an interval of such a coverage."""
    # The quantile c (n + 1) must not exceed n.
    return int(np.ceil(coverage / (1.0 - coverage) - 1e-9))


def covered(
    errors: FloatArray,
    spreads: FloatArray,
    sites: IntArray,
    held_out: Sequence[BoolArray],
    coverage: float = COVERAGE,
) -> BoolArray:
    """Return whether each load lies in an interval set on the sites of the other folds (samples,).

    Args:
        errors: As in `interval_factor`.
        spreads: As in `interval_factor`.
        sites: As in `interval_factor`.
        held_out: Masks of the folds, by site; each sample is in one of them.
        coverage: As in `interval_factor`.
    """
    inside = np.zeros(len(errors), dtype=bool)
    # Each fold in turn is new: its interval is set by the others.
    for own in held_out:
        factor = interval_factor(errors[~own], spreads[~own], sites[~own], coverage)
        inside[own] = np.abs(errors[own]) <= factor * spreads[own]
    return inside
