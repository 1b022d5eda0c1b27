"""Predictions on samples held out of a fit, and their errors."""

from dataclasses import dataclass
from math import ceil
from typing import Final, NamedTuple

import numpy as np
from scipy.stats import spearmanr

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.surrogate.ensemble import Surrogate
from blast_env.surrogate.layers import SingleArray
from blast_env.surrogate.network import MESSAGE, Networks, agreed, log_loads
from blast_env.surrogate.samples import Loads, Samples
from blast_env.surrogate.views import HUNDREDTHS

_SAMPLES_AT_ONCE: Final = 1000
"""Samples that are predicted at once."""

_LEAST_CASE: Final = 4
"""Least number of layouts of a case for its rank correlation."""


@dataclass(frozen=True, eq=False)
class Errors:
    """Errors of the predictions of one kind of load.

    Attributes:
        rms: Root mean square error of the logarithm.
        within: The same after subtraction of the mean error of each case, which ranks no layout.
        bias: Mean error of the logarithm.
        rank: Rank correlation among the layouts of a case, mean over the cases.
        lost: Excess of the load of the layout with the best prediction over that of the best
            layout, relative to the largest load of the case; mean over the cases.
        cases: Number of cases with enough layouts for `rank` and `lost`.
    """

    rms: float
    within: float
    bias: float
    rank: float
    lost: float
    cases: int


def load_errors(
    surrogate: Surrogate,
    networks: Networks,
    samples: Samples,
    loads: Loads,
    chosen: BoolArray,
) -> Errors:
    """Compare predictions of one kind of load, by `networks` of the surrogate, with `loads`."""
    found = predictions(surrogate, networks, samples, loads, chosen)
    return errors_of(found, loads.target[chosen], samples.case[chosen])


class Predictions(NamedTuple):
    """Predictions of one kind of load.

    Attributes:
        log_load: Logarithm of each load (samples,).
        spread: Its standard deviation among the networks (samples,).
    """

    log_load: FloatArray
    spread: FloatArray


def predictions(
    surrogate: Surrogate,
    networks: Networks,
    samples: Samples,
    loads: Loads,
    chosen: BoolArray,
) -> Predictions:
    """Predict one kind of load, by `networks` of the surrogate, on the `chosen` samples."""
    # Part by part: there are gigabytes of messages.
    numbers = np.flatnonzero(chosen)
    parts = np.array_split(numbers, max(1, ceil(len(numbers) / _SAMPLES_AT_ONCE)))
    logs = np.concatenate(
        [
            _log_loads(surrogate, networks, samples, loads, _mask(len(samples), own))
            for own in parts
        ],
        axis=1,
    )
    return Predictions(agreed(logs), logs.std(axis=0))


def _log_loads(
    surrogate: Surrogate,
    networks: Networks,
    samples: Samples,
    loads: Loads,
    chosen: BoolArray,
) -> FloatArray:
    """Return what each network predicts on the `chosen` samples (members, samples)."""
    counts, points = samples.counts[chosen], np.repeat(chosen, samples.counts)
    starts = np.cumsum([0, *counts[:-1]])
    # 1. What each solid says to each point; 2. the sum over the solids, sample by sample; 3. the
    # loads of points, and their mean over each structure.
    rows = np.repeat(chosen, samples.counts * samples.solids)
    parts = np.stack((samples.structures, samples.pieces), axis=1)
    is_piece = np.repeat(
        np.tile((False, True), len(samples)), (samples.counts[:, np.newaxis] * parts).ravel()
    )
    of_traits = np.repeat(chosen, parts[:, 1])
    weights = networks.weights(surrogate.told(samples.traits[of_traits]))
    heard = [
        _heard(
            networks.messages(surrogate.related(samples.relations[own]), of_pieces=bool(which)),
            counts,
            parts[chosen, which],
            weights if which else None,
        )
        for which, own in enumerate((rows & ~is_piece, rows & is_piece))
    ]
    views = samples.views[samples.column[points]].astype(np.float32) / np.float32(HUNDREDTHS)
    differs = networks(
        surrogate.scaled(samples.features[points]),
        np.concatenate(heard, axis=2),
        (views[:, 0], views[:, 1]),
    )
    known, area_m2 = loads.known[points], samples.area_m2[points]
    return log_loads(differs, known, area_m2, starts, loads.power)


def _mask(count: int, numbers: IntArray) -> BoolArray:
    found: BoolArray = np.zeros(count, dtype=bool)
    found[numbers] = True
    return found


def _heard(
    messages: SingleArray, counts: IntArray, solids: IntArray, weights: SingleArray | None
) -> SingleArray:
    """Return the sum of the messages of solids to each point (members, points, MESSAGE).

    Args:
        messages: The messages, by sample, solid and point (members, rows, MESSAGE).
        counts: Number of points of each sample (samples,).
        solids: Number of its solids (samples,).
        weights: Weights of the messages, by sample and solid (members, solids of all, MESSAGE);
            `None` for equal ones.
    """
    heard = np.zeros((len(messages), counts.sum(), messages.shape[2]), dtype=np.float32)
    start = first = solid = 0
    for count, number in zip(counts.tolist(), solids.tolist(), strict=True):
        own = messages[:, first : first + number * count]
        own = own.reshape(len(messages), number, count, MESSAGE)
        if weights is not None:
            own = own * weights[:, solid : solid + number, np.newaxis]
        heard[:, start : start + count] = own.sum(axis=1)
        start, first, solid = start + count, first + number * count, solid + number
    return heard


def errors_of(found: Predictions, target: FloatArray, cases: np.ndarray) -> Errors:
    """Compare predictions with logarithms of simulated loads (samples,)."""
    guess = found.log_load
    # Errors of logarithms are relative errors. Those common to a case do not change which of its
    # layouts is the best.
    off = guess - target
    ranks, lost, within = [], [], np.zeros_like(off)
    for case in np.unique(cases):
        own = cases == case
        within[own] = off[own] - off[own].mean()
        true = target[own]
        if own.sum() >= _LEAST_CASE and np.ptp(true) > 0.0:
            ranks.append(float(spearmanr(guess[own], true).statistic))
            # Loads relative to the worst layout; what is lost by taking the predicted best one.
            shares = np.exp(true - true.max())
            lost.append(float(shares[guess[own].argmin()] - shares.min()))
    return Errors(
        rms=float(np.sqrt(np.mean(off**2))),
        within=float(np.sqrt(np.mean(within**2))),
        bias=float(off.mean()),
        rank=float(np.mean(ranks)) if ranks else float("nan"),
        lost=float(np.mean(lost)) if lost else float("nan"),
        cases=len(ranks),
    )


def folds(numbers: np.ndarray, count: int, seed: int) -> list[BoolArray]:
    """Return the masks of held-out samples for each fold; equal numbers share a fold.

    Args:
        numbers: Index of the site or the layout of each sample (samples,).
        count: Number of folds.
        seed: Seed of the order.
    """
    # Sites or layouts are dealt out whole, so that no fold knows a neighbour of what it is tried
    # on.
    distinct = np.random.default_rng(seed).permutation(np.unique(numbers))
    return [np.isin(numbers, distinct[first::count]) for first in range(count)]
