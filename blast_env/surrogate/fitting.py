"""Fit of the surrogate to blasts, and its errors on samples held out of the fit."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from math import ceil
from typing import Final, NamedTuple

import numpy as np
import torch
from scipy.stats import spearmanr
from torch import Tensor, nn

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.errors import BlastEnvError
from blast_env.surrogate.approach import FEATURES, INPUTS
from blast_env.surrogate.layers import SingleArray
from blast_env.surrogate.network import (
    HIDDEN,
    MESSAGE,
    Fit,
    Member,
    Networks,
    Surrogate,
    agreed,
    bounded,
    log_loads,
)
from blast_env.surrogate.relations import RELATIONS
from blast_env.surrogate.samples import Loads, Samples
from blast_env.surrogate.ways import SHARES

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

_THINNING: Final = 2
"""One in so many points of a wall is used in an update."""

_FEW_POINTS: Final = 12
"""Walls of so many points or fewer have all of them in an update."""

_AT_ONCE: Final = 2**20
"""Rows that are scaled at once."""

_LEAST_SCALE: Final = 1e-3
_LEAST_CASE: Final = 4
"""Least number of layouts of a case for its rank correlation."""


def fit(
    samples: Samples,
    chosen: BoolArray,
    epochs: int,
    seed: int,
    about: Fit,
    members: int = MEMBERS,
    peaks: bool = True,
    device: str = "cpu",
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
    """
    # 1. Inputs are scaled by the data of the fit.
    mean, scale = _scales(samples, chosen)
    cases = _cases(samples, chosen)
    tensors = _Tensors.of(samples, mean, scale, device)
    # 2. One network for each kind of load and seed: an ensemble, whose spread tells where it does
    # not know (Lakshminarayanan, Pritzel & Blundell, NeurIPS 2017).
    tasks = []
    for loads in (samples.impulse, samples.peak)[: 1 + peaks]:
        for number in range(members):
            torch.manual_seed(seed + number)
            network = _Network()
            tasks.append((network.to(device), _Target.of(loads, device), seed + number))

    # 3. Two at a time, since torch leaves the interpreter to others while it multiplies.
    with ThreadPoolExecutor(2) as pool:
        found = [*pool.map(lambda task: _fitted(tensors, cases, epochs, *task), tasks)]
    impulse, peak = found[:members], found[members:]
    return Surrogate(mean, scale, Networks(impulse), Networks(peak), about)


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
    counts, points = samples.counts[chosen], np.repeat(chosen, samples.counts)
    starts = np.cumsum([0, *counts[:-1]])
    # 1. What each solid says to each point; 2. the sum over the solids, sample by sample; 3. the
    # loads of points, and their mean over each structure.
    rows = np.repeat(chosen, samples.counts * samples.solids)
    parts = np.stack((samples.structures, samples.solids - samples.structures), axis=1)
    is_piece = np.repeat(
        np.tile((False, True), len(samples)), (samples.counts[:, np.newaxis] * parts).ravel()
    )
    heard = [
        _heard(
            networks,
            surrogate.related(samples.relations[own]),
            counts,
            parts[chosen, which],
            of_pieces=bool(which),
        )
        for which, own in enumerate((rows & ~is_piece, rows & is_piece))
    ]
    differs = networks(surrogate.scaled(samples.features[points]), np.concatenate(heard, axis=2))
    known, area_m2 = loads.known[points], samples.area_m2[points]
    logs = log_loads(differs, known, area_m2, starts, loads.power)
    return Predictions(agreed(logs), logs.std(axis=0))


def _heard(
    networks: Networks, related: FloatArray, counts: IntArray, solids: IntArray, *, of_pieces: bool
) -> SingleArray:
    """Return the sum of the messages of solids to each point (members, points, MESSAGE).

    Args:
        networks: The networks.
        related: Scaled relations, by sample, solid and point (rows, RELATIONS).
        counts: Number of points of each sample (samples,).
        solids: Number of its solids (samples,).
        of_pieces: Whether they are pieces, not structures.
    """
    messages = networks.messages(related, of_pieces=of_pieces)
    heard = np.zeros((len(messages), counts.sum(), messages.shape[2]), dtype=np.float32)
    start = first = 0
    for count, number in zip(counts.tolist(), solids.tolist(), strict=True):
        own = messages[:, first : first + number * count]
        heard[:, start : start + count] = own.reshape(len(messages), number, count, MESSAGE).sum(
            axis=1
        )
        start, first = start + count, first + number * count
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
        samples: The samples.
        features: Scaled features (points, FEATURES).
        relations: Scaled relations (rows, RELATIONS).
        area_m2: Wall area represented by each point (points,).
        starts: Index of the first point of each sample (samples,).
        first_rows: Index of the first row of relations of each sample (samples,).
        device: Device of torch.
    """

    samples: Samples
    features: Tensor
    relations: Tensor
    area_m2: Tensor
    starts: IntArray
    first_rows: IntArray
    device: str

    @classmethod
    def of(cls, samples: Samples, mean: FloatArray, scale: FloatArray, device: str) -> "_Tensors":
        of_points, of_solids = slice(None, FEATURES), slice(FEATURES, INPUTS)
        features, relations = (
            torch.from_numpy(_bounded(item, mean[own], scale[own])).to(device)
            for item, own in ((samples.features, of_points), (samples.relations, of_solids))
        )
        area_m2 = torch.from_numpy(samples.area_m2.astype(np.float32)).to(device)
        starts = np.cumsum([0, *samples.counts[:-1]])
        firsts = np.cumsum([0, *(samples.counts * samples.solids)[:-1]])
        return cls(samples, features, relations, area_m2, starts, firsts, device)

    def loss(
        self,
        network: "_Network",
        target: _Target,
        groups: Sequence[IntArray],
        rng: np.random.Generator,
    ) -> Tensor:
        """Return the mean square error of the logarithm on groups of samples, each of one case.

        The mean error of a group has a smaller weight (`_COMMON`) than the deviations from it.
        """
        # A common error of all layouts of a case ranks none of them, so it counts less.
        errors = self._errors(network, target, groups, rng)
        parts = errors.split([*map(len, groups)])  # type: ignore[no-untyped-call]
        common = torch.cat([part.mean().expand(len(part)) for part in parts])
        return (errors - common).square().mean() + _COMMON * common.square().mean()

    def _errors(
        self,
        network: "_Network",
        target: _Target,
        groups: Sequence[IntArray],
        rng: np.random.Generator,
    ) -> Tensor:
        """Return the errors of the logarithm on samples, at some of their points (samples,)."""
        # 1. The rows of all inputs: layouts of a case have its structures in common.
        rows = _Rows.of(self, groups, rng)
        walls, structures, behind, pieces = map(self._indices, rows.inputs)
        over = network(
            self.features[walls][:, : FEATURES - SHARES],
            (self.relations[structures], self._indices(rows.hearing_structures)),
            self.features[behind][:, FEATURES - SHARES :],
            (self.relations[pieces], self._indices(rows.hearing_pieces)),
            self._indices(rows.wall),
        )
        # 2. The load of a structure: the power mean of its points, by area.
        numbers, owner = np.concatenate(groups), self._indices(rows.owner)
        logs = target.power * (target.known[behind] + over)
        empty = torch.zeros(len(numbers), device=self.device)
        # Relative to the largest: high powers of pascals overflow.
        largest = (empty - torch.inf).scatter_reduce(0, owner, logs.detach(), "amax")
        area_m2 = self.area_m2[behind]
        shares = area_m2 * torch.exp(logs - largest[owner])
        mean = empty.index_add(0, owner, shares) / empty.index_add(0, owner, area_m2)
        log_loads = (torch.log(mean) + largest) / target.power
        return log_loads - target.target[self._indices(numbers)]

    def _indices(self, numbers: IntArray) -> Tensor:
        return torch.from_numpy(numbers).to(self.device)


class _Rows(NamedTuple):
    """Where the inputs of groups of samples are, and what they belong to.

    Attributes:
        inputs: Indices of the points of each group (walls,), of the relations of structures to
            them, of the points behind each layout (behind,), and of the relations of its pieces.
        hearing_structures: Number of the point, among the walls, of each relation of a structure.
        hearing_pieces: The same of each relation of a piece, among those behind layouts.
        wall: Number of each point behind a layout among the walls (behind,).
        owner: Number of its sample (behind,).
    """

    inputs: tuple[IntArray, IntArray, IntArray, IntArray]
    hearing_structures: IntArray
    hearing_pieces: IntArray
    wall: IntArray
    owner: IntArray

    @classmethod
    def of(cls, tensors: _Tensors, groups: Sequence[IntArray], rng: np.random.Generator) -> "_Rows":
        """Return the rows of groups of samples, each of one case, at every other point of walls."""
        samples, starts, firsts = tensors.samples, tensors.starts, tensors.first_rows
        none: IntArray = np.empty(0, dtype=np.int64)
        walls, structures, heard, behind = [none], [none], [none], [none]
        pieces, heard_pieces, wall, owner = [none], [none], [none], [none]
        number = walls_before = behind_before = 0
        for group in groups:
            first = group[0]
            count, standing = int(samples.counts[first]), int(samples.structures[first])
            points = _some_points(count, rng)
            own = np.arange(len(points))
            walls.append(starts[first] + points)
            rows = firsts[first] + count * np.arange(standing)[:, np.newaxis] + points
            structures.append(rows.ravel())
            heard.append(np.tile(walls_before + own, standing))
            for sample in group:
                behind.append(starts[sample] + points)
                wall.append(walls_before + own)
                owner.append(np.full(len(points), number))
                solids = np.arange(standing, samples.solids[sample])
                rows = firsts[sample] + count * solids[:, np.newaxis] + points
                pieces.append(rows.ravel())
                heard_pieces.append(np.tile(behind_before + own, len(solids)))
                number, behind_before = number + 1, behind_before + len(points)
            walls_before += len(points)
        of_all = (walls, structures, behind, pieces, heard, heard_pieces, wall, owner)
        found = [np.concatenate(item) for item in of_all]
        return cls((found[0], found[1], found[2], found[3]), *found[4:])


def _some_points(count: int, rng: np.random.Generator) -> IntArray:
    """Return every other point of a wall, of a few all: an update costs half."""
    if count <= _FEW_POINTS:
        return np.arange(count)
    return np.arange(int(rng.integers(_THINNING)), count, _THINNING)


def _bounded(numbers: FloatArray, mean: FloatArray, scale: FloatArray) -> SingleArray:
    """Return `bounded` in single precision, part by part: there are gigabytes of relations."""
    found = np.empty(numbers.shape, dtype=np.float32)
    for first in range(0, len(numbers), _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        found[part] = bounded(numbers[part], mean, scale)
    return found


class _Network(nn.Module):
    """A network during its fit; its parameters are in the order of `Member`."""

    def __init__(self) -> None:
        super().__init__()
        self.send = nn.Linear(RELATIONS, MESSAGE)
        self.message = nn.Linear(MESSAGE, MESSAGE)
        self.piece_send = nn.Linear(RELATIONS, MESSAGE)
        self.piece_message = nn.Linear(MESSAGE, MESSAGE)
        self.first = nn.Linear(FEATURES + 2 * MESSAGE, HIDDEN)
        self.second = nn.Linear(HIDDEN, HIDDEN)
        self.last = nn.Linear(HIDDEN, 1)

    def forward(
        self,
        walls: Tensor,
        structures: tuple[Tensor, Tensor],
        shares: Tensor,
        pieces: tuple[Tensor, Tensor],
        wall: Tensor,
    ) -> Tensor:
        """Return the predictions at points behind layouts (points,).

        Args:
            walls: Features of the points of walls that no layout changes (walls, n).
            structures: Relations of structures, and the number of the wall's point of each.
            shares: Open shares behind layouts (points, SHARES).
            pieces: Relations of pieces, and the number of the point behind a layout of each.
            wall: Number of each of these among the points of walls (points,).
        """
        # (1) Each solid sends a message to each point; (2) their sum does not depend on their order
        # or number (Zaheer and others, Deep sets, NeurIPS 2017); (3) point and sums give the load.
        silu = nn.functional.silu
        of_structures = silu(self.message(silu(self.send(structures[0]))))
        of_pieces = silu(self.piece_message(silu(self.piece_send(pieces[0]))))
        heard = walls.new_zeros(len(walls), MESSAGE).index_add(0, structures[1], of_structures)
        also = walls.new_zeros(len(shares), MESSAGE).index_add(0, pieces[1], of_pieces)
        # The first layer's sums over what layouts have in common are made once.
        constant, share, structure, piece = torch.split(
            self.first.weight, [FEATURES - SHARES, SHARES, MESSAGE, MESSAGE], dim=1
        )
        same = walls @ constant.T + heard @ structure.T + self.first.bias
        hidden = silu(same[wall] + shares @ share.T + also @ piece.T)
        said: Tensor = self.last(silu(self.second(hidden)))[:, 0]
        return said

    def plain(self) -> Member:
        """Return the weights and biases as arrays."""
        arrays: Sequence[FloatArray] = [
            parameter.detach().cpu().numpy().astype(np.float64) for parameter in self.parameters()
        ]
        return Member(*(array.T if array.ndim == 2 else array for array in arrays))


def _fitted(
    data: _Tensors,
    cases: Sequence[IntArray],
    epochs: int,
    network: _Network,
    target: _Target,
    seed: int,
) -> Member:
    """Fit one network to the samples of some cases."""
    rng = np.random.default_rng(seed)
    # 1. Cases in groups of a few samples.
    groups = _groups(cases, rng)
    # 2. AdamW (Loshchilov & Hutter, ICLR 2019), with a rate that rises and falls once (Smith &
    # Topin, Super-convergence, 2019).
    optimizer = torch.optim.AdamW(network.parameters(), _RATE, weight_decay=_DECAY)
    batches = max(1, round(len(groups) / _BATCH))
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, _RATE, total_steps=epochs * batches)
    # 3. Passes over all groups, in a new order each time; gradients are clipped, because a few
    # groups are outliers (Pascanu, Mikolov & Bengio, ICML 2013).
    for epoch in range(epochs):
        for batch in np.array_split(rng.permutation(len(groups)), batches):
            loss = data.loss(network, target, [groups[number] for number in batch], rng)
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
