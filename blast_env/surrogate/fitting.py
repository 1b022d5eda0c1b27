"""Fit of the surrogate to blasts, and its errors on samples held out of the fit."""

import json
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import groupby
from math import ceil
from typing import Any, Final, NamedTuple

import numpy as np
import pandas as pd
import torch
from scipy.stats import spearmanr
from torch import Tensor, nn

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.errors import BlastEnvError
from blast_env.geometry import Element, Piece
from blast_env.site import Scenario
from blast_env.site.blast_site import Charge
from blast_env.surrogate.approach import FEATURES, INPUTS
from blast_env.surrogate.network import (
    HIDDEN,
    IMPULSE_POWER,
    MESSAGE,
    PEAK_POWER,
    Fit,
    Member,
    Networks,
    Surrogate,
    agreed,
    bounded,
    log_loads,
)
from blast_env.surrogate.relations import RELATIONS
from blast_env.surrogate.walls import site_of

MEMBERS: Final = 5
_BATCH: Final = 6
"""Groups of samples per update."""

_GROUP: Final = 24
"""Largest number of samples in a group; a group is of one case."""

_COMMON: Final = 0.2
"""Weight of the error common to all layouts of a case, which does not affect their ranking."""

_RATE: Final = 7e-3
_DECAY: Final = 1e-3
_MOST_GRADIENT: Final = 1.0
"""Bound on the norm of a gradient, against outliers among the groups."""

_AGAIN: Final = 4
"""In a fit that goes on, a pass has one in so many of the earlier samples; so falls the rate."""

_LEAST_SCALE: Final = 1e-3
_LEAST_CASE: Final = 4
"""Least number of layouts of a case for its rank correlation."""

_CHARGE: Final = ("charge_x_m", "charge_y_m", "charge_height_m", "tnt_kg")


@dataclass(frozen=True, eq=False)
class Loads:
    """One kind of load on the structures of samples: impulses, Pa s, or peaks, Pa.

    Attributes:
        known: Logarithm of Kingery and Bulmash's load at all points (points,).
        target: Logarithm of the load by gas dynamics (samples,).
        power: Exponent of the mean over the points of a structure.
    """

    known: FloatArray
    target: FloatArray
    power: float


@dataclass(frozen=True, eq=False)
class Samples:
    """Loads of structures, with the features of the points on their walls.

    Attributes:
        features: Features of all points (points, FEATURES).
        relations: Relations of solids to points, ordered by sample, solid and point
            (rows, RELATIONS).
        area_m2: Wall area represented by each point (points,).
        counts: Number of points of each sample (samples,).
        solids: Number of structures and pieces of each sample (samples,).
        impulse: The impulses.
        peak: The peak overpressures.
        site: Index of the site (samples,).
        scenario: Name of the site, or "" (samples,).
        case: Index of the combination of site, structure and charge (samples,).
        layout: Index of the combination of site and layout (samples,).
    """

    features: FloatArray
    relations: FloatArray
    area_m2: FloatArray
    counts: np.ndarray
    solids: np.ndarray
    impulse: Loads
    peak: Loads
    site: np.ndarray
    scenario: np.ndarray
    case: np.ndarray
    layout: np.ndarray

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.counts)

    @classmethod
    def of(cls, blasts: pd.DataFrame, scenarios: dict[str, Scenario]) -> "Samples":
        """Return the loads on protected structures of a table of `studies.blast_table`.

        Args:
            blasts: The table.
            scenarios: Scenarios by content hash; rows of others are omitted.

        Raises:
            BlastEnvError: If no row remains.
        """
        known = blasts["protected"] & blasts["scenario_hash"].isin(list(scenarios))
        rows = blasts[known & (blasts["impulse_pa_s"] > 0.0) & (blasts["peak_pa"] > 0.0)]
        if rows.empty:
            raise BlastEnvError("no load of a protected structure of a known scenario")
        # 1. Each site once; each blast once, with the features of all points of its walls.
        sites = {name: site_of(scenarios[name]) for name in rows["scenario_hash"].unique()}
        features, related, area_m2, impulses, peaks = [], [], [], [], []
        wanted = ("scenario_hash", "layout", *_CHARGE, "structure")
        columns: list[list[Any]] = [rows[name].tolist() for name in wanted]
        of_blast = groupby(zip(*columns, strict=True), key=lambda row: row[:-1])
        for (scenario_hash, layout, *numbers), loads in of_blast:
            site = sites[scenario_hash]
            x_m, y_m, height_m, tnt_kg = map(float, numbers)
            approach = site.approach(Charge((x_m, y_m), tnt_kg, height_m))
            barrier = site.barrier(elements(layout))
            of_points = approach.features(barrier).astype(np.float32)
            of_solids = np.concatenate((approach.solids, approach.relations(barrier)))
            names = [structure.name for structure in site.protected]
            # 2. Of these, the points of each protected structure: a sample.
            for *_, structure in loads:
                own = approach.points_of(names.index(structure))
                features.append(of_points[own])
                related.append(of_solids[:, own].astype(np.float32))
                area_m2.append(approach.area_m2[own])
                impulses.append(approach.log_impulse[own])
                peaks.append(approach.log_peak[own])
        # 3. The samples in a row, and the cases in which layouts compete.
        place = rows[["scenario_hash", "structure", *_CHARGE]]
        return cls(
            features=np.concatenate(features),
            relations=np.concatenate([thing.reshape(-1, RELATIONS) for thing in related]),
            area_m2=np.concatenate(area_m2),
            counts=np.array([len(feature) for feature in features]),
            solids=np.array([len(thing) for thing in related]),
            impulse=Loads(
                np.concatenate(impulses),
                np.log(rows["impulse_pa_s"].to_numpy()),
                IMPULSE_POWER,
            ),
            peak=Loads(
                np.concatenate(peaks),
                np.log(rows["peak_pa"].to_numpy()),
                PEAK_POWER,
            ),
            site=rows.groupby("scenario_hash").ngroup().to_numpy(),
            scenario=rows["scenario"].to_numpy(),
            case=place.groupby(list(place.columns)).ngroup().to_numpy(),
            layout=rows.groupby(["scenario_hash", "layout"]).ngroup().to_numpy(),
        )


def elements(text: str) -> tuple[Element, ...]:
    """Return the layout of a row of the table."""
    found = (tuple(load) for load in json.loads(text))
    return tuple(prediction if len(prediction) == 2 else Piece(*prediction) for prediction in found)


def fit(
    samples: Samples,
    chosen: BoolArray,
    epochs: int,
    seed: int,
    about: Fit,
    members: int = MEMBERS,
    peaks: bool = True,
    device: str = "cpu",
    begun: "Begun | None" = None,
) -> Surrogate:
    """Fit the networks to some of the samples, two networks at a time.

    Args:
        samples: All samples.
        chosen: Mask of the samples to use (samples,).
        epochs: Number of passes over the samples.
        seed: Seed of initial weights and orders.
        about: Provenance, for the surrogate's file.
        members: Number of networks per kind of load.
        peaks: Whether to fit the networks for peaks, too.
        device: Device of torch; the fit depends on it by rounding.
        begun: The surrogate that the fit goes on from, and what that one was fitted to.
    """
    # 1. Inputs are scaled by the data of the first fit, which a fit that goes on must keep.
    old = np.zeros(len(samples), dtype=bool) if begun is None else begun.samples
    if begun is None:
        mean, scale = _scales(samples, chosen)
    else:
        mean, scale = begun.surrogate.mean, begun.surrogate.scale
    own, again = (_cases(samples, chosen & mask) for mask in (~old, old))
    tensors = _Tensors.of(samples, mean, scale, device)
    # 2. One network for each kind of load and seed: an ensemble, whose spread tells where it does
    # not know (Lakshminarayanan, Pritzel & Blundell, NeurIPS 2017).
    tasks = []
    for loads, kind in ((samples.impulse, "impulse"), (samples.peak, "peak"))[: 1 + peaks]:
        for number in range(members):
            torch.manual_seed(seed + number)
            network = _Network()
            if begun is not None:
                network.take(getattr(begun.surrogate, kind).members[number])
            tasks.append((network.to(device), _Target.of(loads, device), seed + number))

    def fitted(task: tuple["_Network", "_Target", int]) -> Member:
        return _fitted(tensors, own, again, epochs, *task)

    # 3. Two at a time, since torch leaves the interpreter to others while it multiplies.
    with ThreadPoolExecutor(2) as pool:
        found = [*pool.map(fitted, tasks)]
    impulse, peak = found[:members], found[members:]
    return Surrogate(mean, scale, Networks(impulse), Networks(peak), about)


@dataclass(frozen=True, eq=False)
class Begun:
    """A surrogate that a fit goes on from.

    Attributes:
        surrogate: The surrogate.
        samples: Mask of the samples of its own data (samples,). A pass has a quarter of them,
            drawn anew, so that it does not forget them.
    """

    surrogate: Surrogate
    samples: BoolArray


def _scales(samples: Samples, chosen: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return mean and standard deviation of features and relations (INPUTS,)."""
    points = samples.features[np.repeat(chosen, samples.counts)]
    solids = samples.relations[np.repeat(chosen, samples.counts * samples.solids)]
    mean = np.concatenate([array.mean(axis=0, dtype=np.float64) for array in (points, solids)])
    scale = np.concatenate([item.std(axis=0, dtype=np.float64) for item in (points, solids)])
    return mean, scale + _LEAST_SCALE


def _cases(samples: Samples, chosen: BoolArray) -> list[IntArray]:
    """Return the indices of the chosen samples of each case that has some."""
    cases = [np.flatnonzero(chosen & (samples.case == case)) for case in np.unique(samples.case)]
    return [case for case in cases if len(case)]


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


class LoadErrors(NamedTuple):
    """Errors of the predictions of impulses and of peaks."""

    impulse: Errors
    peak: Errors


def errors(surrogate: Surrogate, samples: Samples, chosen: BoolArray) -> LoadErrors:
    """Compare predictions with gas dynamics on some samples."""
    return LoadErrors(
        load_errors(surrogate, surrogate.impulse, samples, samples.impulse, chosen),
        load_errors(surrogate, surrogate.peak, samples, samples.peak, chosen),
    )


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
    counts, solids = samples.counts[chosen], samples.solids[chosen]
    points = np.repeat(chosen, samples.counts)
    starts = np.cumsum([0, *counts[:-1]])
    # 1. What each solid says to each point; 2. the sum over the solids, sample by sample; 3. the
    # loads of points, and their mean over each structure.
    messages = networks.messages(
        surrogate.related(samples.relations[np.repeat(chosen, samples.counts * samples.solids)])
    )
    heard = np.zeros((len(messages), points.sum(), messages.shape[2]))
    first = 0
    for start, count, number in zip(starts, counts, solids, strict=True):
        own = messages[:, first : first + number * count]
        own = own.reshape(len(messages), number, count, -1)
        heard[:, start : start + count] = own.sum(axis=1)
        first += number * count
    differs = networks(surrogate.scaled(samples.features[points]), heard)
    known, area_m2 = loads.known[points], samples.area_m2[points]
    logs = log_loads(differs, known, area_m2, starts, loads.power)
    return Predictions(agreed(logs), logs.std(axis=0))


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


@dataclass(frozen=True, eq=False)
class _Target:
    """`Loads` as tensors.

    Attributes:
        known: As in `Loads`.
        target: As in `Loads`.
        power: As in `Loads`.
    """

    known: Tensor
    target: Tensor
    power: float

    @classmethod
    def of(cls, loads: Loads, device: str) -> "_Target":
        known, target = (
            torch.from_numpy(array.astype(np.float32)).to(device)
            for array in (loads.known, loads.target)
        )
        return cls(known, target, loads.power)


@dataclass(frozen=True, eq=False)
class _Tensors:
    """`Samples` as inputs of the networks.

    Attributes:
        features: Scaled features (points, FEATURES).
        relations: Scaled relations (rows, RELATIONS).
        area_m2: Wall area represented by each point (points,).
        starts: Index of the first point of each sample (samples,).
        counts: Number of points of each sample (samples,).
        first_rows: Index of the first row of relations of each sample (samples,).
        rows: Number of these rows (samples,).
        solids: Number of structures and pieces of each sample (samples,).
    """

    features: Tensor
    relations: Tensor
    area_m2: Tensor
    starts: IntArray
    counts: IntArray
    first_rows: IntArray
    rows: IntArray
    solids: IntArray

    @classmethod
    def of(cls, samples: Samples, mean: FloatArray, scale: FloatArray, device: str) -> "_Tensors":
        of_points, of_solids = slice(None, FEATURES), slice(FEATURES, INPUTS)
        features, relations = (
            torch.from_numpy(bounded(item, mean[own], scale[own]).astype(np.float32)).to(device)
            for item, own in ((samples.features, of_points), (samples.relations, of_solids))
        )
        area_m2 = torch.from_numpy(samples.area_m2.astype(np.float32)).to(device)
        starts = np.cumsum([0, *samples.counts[:-1]])
        rows = samples.counts * samples.solids
        firsts = np.cumsum([0, *rows[:-1]])
        return cls(
            features, relations, area_m2, starts, samples.counts, firsts, rows, samples.solids
        )

    def loss(self, network: "_Network", target: _Target, groups: Sequence[IntArray]) -> Tensor:
        """Return the mean square error of the logarithm on groups of samples, each of one case.

        The mean error of a group has a smaller weight (`_COMMON`) than the deviations from it.
        """
        # A common error of all layouts of a case ranks none of them, so it counts less.
        errors = self._errors(network, target, np.concatenate(groups))
        parts = errors.split([*map(len, groups)])  # type: ignore[no-untyped-call]
        common = torch.cat([part.mean().expand(len(part)) for part in parts])
        return (errors - common).square().mean() + _COMMON * common.square().mean()

    def _errors(self, network: "_Network", target: _Target, numbers: IntArray) -> Tensor:
        """Return the errors of the logarithm on some samples (samples,)."""
        # 1. The rows of the points and of the relations of the samples, one sample after the other.
        counts, solids, device = self.counts[numbers], self.solids[numbers], self.area_m2.device
        points = torch.from_numpy(_runs_of(self.starts[numbers], counts)).to(device)
        related = torch.from_numpy(_runs_of(self.first_rows[numbers], self.rows[numbers]))
        begin = np.cumsum([0, *counts[:-1]])
        # 2. Each solid speaks to all points of its sample.
        hearing = [
            np.tile(np.arange(first, first + count), number)
            for first, count, number in zip(begin, counts, solids, strict=True)
        ]
        over = network(
            self.features[points],
            self.relations[related.to(device)],
            torch.from_numpy(np.concatenate(hearing)).to(device),
        )
        # 3. The load of a structure: the power mean of its points, by area.
        owner = torch.from_numpy(np.repeat(np.arange(len(numbers)), counts)).to(device)
        logs = target.power * (target.known[points] + over)
        empty = torch.zeros(len(numbers), device=device)
        # Relative to the largest: high powers of pascals overflow.
        largest = (empty - torch.inf).scatter_reduce(0, owner, logs.detach(), "amax")
        area_m2 = self.area_m2[points]
        shares = area_m2 * torch.exp(logs - largest[owner])
        mean = empty.index_add(0, owner, shares) / empty.index_add(0, owner, area_m2)
        log_loads = (torch.log(mean) + largest) / target.power
        return log_loads - target.target[torch.from_numpy(numbers).to(device)]


def _runs_of(starts: IntArray, counts: IntArray) -> IntArray:
    """Return the concatenated ranges of `counts` integers from each start."""
    runs = [np.arange(e, e + count) for e, count in zip(starts, counts, strict=True)]
    return np.concatenate(runs)


class _Network(nn.Module):
    """A network during its fit; its parameters are in the order of `Member`."""

    def __init__(self) -> None:
        super().__init__()
        self.send = nn.Linear(RELATIONS, MESSAGE)
        self.message = nn.Linear(MESSAGE, MESSAGE)
        self.first = nn.Linear(FEATURES + MESSAGE, HIDDEN)
        self.second = nn.Linear(HIDDEN, HIDDEN)
        self.last = nn.Linear(HIDDEN, 1)

    def forward(self, features: Tensor, relations: Tensor, hearing: Tensor) -> Tensor:
        """Return the predictions at points (points,).

        Args:
            features: Features of the points (points, FEATURES).
            relations: Relations of solids to points (rows, RELATIONS).
            hearing: Index of the point of each of these rows (rows,).
        """
        # (1) Each solid sends a message to each point; (2) their sum does not depend on their order
        # or number (Zaheer and others, Deep sets, NeurIPS 2017); (3) point and sum give the load.
        silu = nn.functional.silu
        messages = silu(self.message(silu(self.send(relations))))
        heard = features.new_zeros(len(features), MESSAGE).index_add(0, hearing, messages)
        hidden = silu(self.first(torch.cat((features, heard), dim=1)))
        said: Tensor = self.last(silu(self.second(hidden)))[:, 0]
        return said

    def take(self, member: Member) -> None:
        """Take over weights and biases."""
        with torch.no_grad():
            for parameter, array in zip(self.parameters(), member, strict=True):
                parameter.copy_(torch.from_numpy(np.ascontiguousarray(array.T)))

    def plain(self) -> Member:
        """Return the weights and biases as arrays."""
        arrays: Sequence[FloatArray] = [
            parameter.detach().cpu().numpy().astype(np.float64) for parameter in self.parameters()
        ]
        return Member(*(array.T if array.ndim == 2 else array for array in arrays))


def _fitted(
    data: _Tensors,
    cases: Sequence[IntArray],
    again: Sequence[IntArray],
    epochs: int,
    network: _Network,
    target: _Target,
    seed: int,
) -> Member:
    """Fit one network to the samples of some cases, and to some of those that it has met."""
    rng = np.random.default_rng(seed)
    # 1. Cases in groups of a few samples; those of an earlier fit in part, and more slowly.
    groups, met = _groups(cases, rng), _groups(again, rng)
    drawn, new = len(met) // _AGAIN, np.arange(len(groups))
    rate = _RATE / _AGAIN if met else _RATE
    groups += met
    # 2. AdamW (Loshchilov & Hutter, ICLR 2019), with a rate that rises and falls once (Smith &
    # Topin, Super-convergence, 2019).
    optimizer = torch.optim.AdamW(network.parameters(), rate, weight_decay=_DECAY)
    batches = max(1, round((len(new) + drawn) / _BATCH))
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, rate, total_steps=epochs * batches)
    # 3. Passes over all groups, in a new order each time; gradients are clipped, because a few
    # groups are outliers (Pascanu, Mikolov & Bengio, ICML 2013).
    for epoch in range(epochs):
        shown = new
        if met:
            shown = np.append(new, len(new) + rng.choice(len(met), drawn, replace=False))
        for batch in np.array_split(rng.permutation(shown), batches):
            loss = data.loss(network, target, [groups[number] for number in batch])
            if not torch.isfinite(loss):
                raise BlastEnvError(f"network of seed {seed} in epoch {epoch}: no finite error")
            optimizer.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            nn.utils.clip_grad_norm_(network.parameters(), _MOST_GRADIENT)
            optimizer.step()
            schedule.step()
    return network.plain()


def _groups(cases: Sequence[IntArray], rng: np.random.Generator) -> list[IntArray]:
    """Return the samples of cases in groups of a few, drawn anew."""
    return [
        group
        for case in cases
        for group in np.array_split(rng.permutation(case), ceil(len(case) / _GROUP))
    ]
