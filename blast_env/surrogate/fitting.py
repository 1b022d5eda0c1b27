"""Fit of the surrogate to blasts."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import starmap
from math import ceil
from typing import Final, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.errors import BlastEnvError
from blast_env.surrogate.approach import FEATURES, INPUTS
from blast_env.surrogate.ensemble import Surrogate
from blast_env.surrogate.fit_record import Fit
from blast_env.surrogate.loads import MOST_OVER
from blast_env.surrogate.network import (
    MESSAGE,
    MOST_SPREADS,
    SHAPES,
    SIGHT,
    AnyFloats,
    Member,
    Networks,
    bounded,
)
from blast_env.surrogate.relations import RELATIONS
from blast_env.surrogate.samples import Loads, Samples
from blast_env.surrogate.views import HUNDREDTHS
from blast_env.surrogate.ways import SHARES

MEMBERS: Final = 4
_BATCH: Final = 12
"""Groups of samples per update."""

_GROUP: Final = 24
"""Largest number of samples in a group; a group is of one case."""

_COMMON: Final = 0.2
"""Weight of the error common to all layouts of a case, which does not affect their ranking."""

_AT_POINTS: Final = 1.0
"""Weight of the errors at points, where loads there are known, beside those of their means."""

_RATE: Final = 5e-3
_DECAY: Final = 2e-2
"""Decay of weights: with a twentieth of it they grow, and networks say anything off their data."""

_MOST_GRADIENT: Final = 1.0
"""Bound on the norm of a gradient, against outliers among the groups."""

_TINY: Final = 1e-6
_POINTS: Final = 12
"""Most points of a wall in an update."""

_EVEN: Final = 1.28
"""Bias at which the bend of a layer is 1."""

_AT_ONCE: Final = 2**20
"""Rows that are scaled at once."""

_LEAST_SCALE: Final = 1e-3


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
    """Fit the networks to some of the samples, those of impulses beside those of peaks.

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
    # 2. Several networks for each kind of load, from different initial weights: an ensemble, whose
    # spread tells where it does not know (Lakshminarayanan, Pritzel & Blundell, NeurIPS 2017).
    tasks = [
        (_Stack(members, seed).to(device), _Target.of(loads, samples.counts, device), seed)
        for loads in (samples.impulse, samples.peak)[: 1 + peaks]
    ]
    # 3. Both kinds at once, since torch leaves the interpreter to others while it multiplies.
    with ThreadPoolExecutor(2) as pool:
        found = [*pool.map(lambda task: _fitted(tensors, cases, epochs, *task), tasks)]
    impulse, peak = (Networks(own) for own in (*found, [])[:2])
    return Surrogate(mean, scale, impulse, peak, about)


def _scales(samples: Samples, chosen: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return mean and standard deviation of features, relations and traits (INPUTS,)."""
    given = (
        (samples.features, np.repeat(chosen, samples.counts)),
        (samples.relations, np.repeat(chosen, samples.counts * samples.solids)),
        (samples.traits, np.repeat(chosen, samples.pieces)),
    )
    mean, variance = (np.concatenate(item) for item in zip(*starmap(_moments, given), strict=True))
    return mean, np.sqrt(variance) + _LEAST_SCALE


def _moments(numbers: AnyFloats, chosen: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return mean and variance of the chosen rows, part by part: there are gigabytes of them."""
    sums, squares = np.zeros(numbers.shape[1]), np.zeros(numbers.shape[1])
    for first in range(0, len(numbers), _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        own = numbers[part][chosen[part]].astype(np.float64)
        sums += own.sum(axis=0)
        squares += (own**2).sum(axis=0)
    count = max(int(chosen.sum()), 1)
    mean = sums / count
    return mean, np.maximum(squares / count - mean**2, 0.0)


def _cases(samples: Samples, chosen: BoolArray) -> list[IntArray]:
    """Return the indices of the chosen samples of each case that has some."""
    cases = [np.flatnonzero(chosen & (samples.case == case)) for case in np.unique(samples.case)]
    return [case for case in cases if len(case)]


@dataclass(frozen=True, eq=False)
class _Target:
    """`Loads` as tensors, bounded by what networks may say.

    Attributes:
        known: As in `Loads`.
        target: As in `Loads`, bounded.
        at_points: As in `Loads`, bounded.
        power: As in `Loads`.
        is_known: Where `at_points` is known (points,).
    """

    known: Tensor
    target: Tensor
    at_points: Tensor
    power: float
    is_known: BoolArray

    @classmethod
    def of(cls, loads: Loads, counts: IntArray, device: str) -> "_Target":
        # No network may say more. Pieces that touch a wall close to a charge raise the peak of a
        # cell there to thousands of times others'.
        most = loads.known + MOST_OVER
        most_of_all = np.maximum.reduceat(most, np.cumsum(counts) - counts)
        known, target, at_points = (
            torch.from_numpy(array.astype(np.float32)).to(device)
            for array in (
                loads.known,
                np.minimum(loads.target, most_of_all),
                np.minimum(loads.at_points, most),
            )
        )
        return cls(known, target, at_points, loads.power, ~np.isnan(loads.at_points))


@dataclass(frozen=True, eq=False)
class _Tensors:
    """`Samples` as inputs of the networks.

    Attributes:
        samples: The samples.
        features: Scaled features (points, FEATURES).
        relations: The relations as they are: there are gigabytes of them (rows, RELATIONS).
        center: Mean of each relation (RELATIONS,).
        scale: Scale of each relation (RELATIONS,).
        views: Views from each column of points, in hundredths (columns, 2, VIEW).
        column: Index of the column of each point (points,).
        traits: Scaled traits (pieces, TRAITS).
        area_m2: Wall area represented by each point (points,).
        starts: Index of the first point of each sample (samples,).
        first_rows: Index of the first row of relations of each sample (samples,).
        first_pieces: Index of the first piece of each sample (samples,).
        device: Device of torch.
    """

    samples: Samples
    features: Tensor
    relations: Tensor
    center: Tensor
    scale: Tensor
    views: Tensor
    column: Tensor
    traits: Tensor
    area_m2: Tensor
    starts: IntArray
    first_rows: IntArray
    first_pieces: IntArray
    device: str

    @classmethod
    def of(cls, samples: Samples, mean: FloatArray, scale: FloatArray, device: str) -> "_Tensors":
        of_features, of_relations, of_traits = np.split(
            np.arange(INPUTS), (FEATURES, FEATURES + RELATIONS)
        )
        relations = torch.from_numpy(samples.relations).to(device)
        features, center, scales, traits, area_m2 = (
            torch.from_numpy(array.astype(np.float32)).to(device)
            for array in (
                bounded(samples.features, mean[of_features], scale[of_features]),
                mean[of_relations],
                scale[of_relations],
                bounded(samples.traits, mean[of_traits], scale[of_traits]),
                samples.area_m2,
            )
        )
        numbers = samples.counts, samples.counts * samples.solids, samples.pieces
        starts, rows, pieces = (np.cumsum([0, *counts[:-1]]) for counts in numbers)
        views, column = (
            torch.from_numpy(array).to(device) for array in (samples.views, samples.column)
        )
        of_all = features, relations, center, scales, views, column, traits, area_m2
        return cls(samples, *of_all, starts, rows, pieces, device)

    def related(self, rows: Tensor) -> Tensor:
        """Return the scaled relations of some rows (rows, RELATIONS)."""
        scaled = (self.relations[rows].float() - self.center) / self.scale
        return scaled.clamp_(-MOST_SPREADS, MOST_SPREADS)

    def seen(self, points: Tensor, *, of_pieces: bool) -> Tensor:
        """Return the views of structures, or of pieces, from some points (points, VIEW)."""
        own = self.views[self.column[points], int(of_pieces)]
        return own.float() / HUNDREDTHS

    def loss(
        self,
        networks: "_Stack",
        target: _Target,
        groups: Sequence[IntArray],
        rng: np.random.Generator,
    ) -> Tensor:
        """Return the mean square error of the logarithm on groups of samples, each of one case.

        It is that of the loads on structures, plus that at points of walls where those loads are
        known. A mean error of a group has a smaller weight (`_COMMON`) than the deviations from it.

        Returns:
            Of each network (members,).
        """
        rows = _Rows(*map(self._indices, _rows_of(self, groups, rng)))
        over = networks(self, rows)
        # A common error of all layouts of a case ranks none of them, so it counts less.
        errors = self._errors(over, target, rows)
        own = np.repeat(np.arange(len(groups)), [*map(len, groups)])
        of_loads = _mean_square(errors, self._indices(own), len(groups))
        # A point of a wall has one load for each layout: a case of its own.
        known = self._indices(np.flatnonzero(target.is_known[rows.behind.cpu().numpy()]))
        if not len(known):
            return of_loads
        at_points = target.known[rows.behind] + over - target.at_points[rows.behind]
        errors, walls = at_points[:, known], rows.wall[known]
        return of_loads + _AT_POINTS * _mean_square(errors, walls, len(rows.walls))

    def _errors(self, over: Tensor, target: _Target, rows: "_Rows") -> Tensor:
        """Return the errors of the logarithm of the loads on structures (members, samples).

        Args:
            over: What the networks say at points behind layouts (members, points).
            target: The loads.
            rows: The samples, and their points.
        """
        # The load of a structure: the power mean of its points, by area.
        logs = target.power * (target.known[rows.behind] + over)
        empty = logs.new_zeros(len(logs), len(rows.samples))
        # Relative to the largest: high powers of pascals overflow.
        owners = rows.owner.expand(len(logs), -1)
        largest = (empty - torch.inf).scatter_reduce(1, owners, logs.detach(), "amax")
        area_m2 = self.area_m2[rows.behind]
        shares = area_m2 * torch.exp(logs - largest[:, rows.owner])
        mean = empty.index_add(1, rows.owner, shares)
        mean = mean / empty[0].index_add(0, rows.owner, area_m2)
        log_loads = (torch.log(mean) + largest) / target.power
        found: Tensor = log_loads - target.target[rows.samples]
        return found

    def _indices(self, numbers: IntArray) -> Tensor:
        return torch.from_numpy(numbers).to(self.device)


def _mean_square(errors: Tensor, group: Tensor, groups: int) -> Tensor:
    """Return the mean square of errors, the mean of a group with the weight `_COMMON` (members,).

    Args:
        errors: The errors (members, errors).
        group: Number of the group of each (errors,).
        groups: Number of groups.
    """
    sums = errors.new_zeros(len(errors), groups).index_add(1, group, errors)
    counts = errors.new_zeros(groups).index_add(0, group, torch.ones_like(errors[0]))
    common = (sums / counts.clamp(min=1.0))[:, group]
    return (errors - common).square().mean(1) + _COMMON * common.square().mean(1)


class _Rows(NamedTuple):
    """Where the inputs of groups of samples are, and what they belong to.

    Attributes:
        samples: Indices of the samples (samples,).
        walls: Indices of the points of each group, which its samples share (walls,).
        structures: Indices of the relations of structures to them.
        hearing_structures: Number of the point, among the walls, of each of these.
        behind: Indices of the points behind each layout (behind,).
        wall: Number of each of these among the walls (behind,).
        owner: Number of its sample (behind,).
        related: Indices of the relations of pieces to the points behind layouts.
        hearing_pieces: Number of the point, among those behind layouts, of each of these.
        piece: Number of its piece, among all pieces.
        pieces: Indices of the pieces.
    """

    samples: Tensor
    walls: Tensor
    structures: Tensor
    hearing_structures: Tensor
    behind: Tensor
    wall: Tensor
    owner: Tensor
    related: Tensor
    hearing_pieces: Tensor
    piece: Tensor
    pieces: Tensor


def _rows_of(
    tensors: _Tensors, groups: Sequence[IntArray], rng: np.random.Generator
) -> tuple[IntArray, ...]:
    """Return the rows of groups of samples, each of one case, at some points of walls."""
    samples, numbers = tensors.samples, np.concatenate(groups)
    sizes = np.array([*map(len, groups)])
    # 1. Some points of the walls of each group.
    leads = np.array([group[0] for group in groups])
    points = [_some_points(count, rng) for count in samples.counts[leads].tolist()]
    counts, own = np.array([*map(len, points)]), np.concatenate(points)
    begins = np.cumsum(counts) - counts
    walls = np.repeat(tensors.starts[leads], counts) + own
    # 2. Its structures, at each of these points.
    standing = samples.structures[leads]
    solid = _runs(np.zeros_like(standing), standing)
    hearing_structures = _runs(np.repeat(begins, standing), np.repeat(counts, standing))
    of_solid = np.repeat(tensors.first_rows[leads], standing)
    of_solid += solid * np.repeat(samples.counts[leads], standing)
    structures = np.repeat(of_solid, np.repeat(counts, standing)) + own[hearing_structures]
    # 3. The same points behind each layout.
    behind_counts = np.repeat(counts, sizes)
    wall = _runs(np.repeat(begins, sizes), behind_counts)
    behind = np.repeat(tensors.starts[numbers], behind_counts) + own[wall]
    owner = np.repeat(np.arange(len(numbers)), behind_counts)
    # 4. Its pieces, at each of these points.
    many, behind_begins = samples.pieces[numbers], np.cumsum(behind_counts) - behind_counts
    of_piece = _runs(samples.structures[numbers], many) * np.repeat(samples.counts[numbers], many)
    of_piece += np.repeat(tensors.first_rows[numbers], many)
    related_counts = np.repeat(behind_counts, many)
    hearing_pieces = _runs(np.repeat(behind_begins, many), related_counts)
    related = np.repeat(of_piece, related_counts) + own[wall[hearing_pieces]]
    piece = np.repeat(np.arange(len(of_piece)), related_counts)
    pieces = _runs(tensors.first_pieces[numbers], many)
    found = numbers, walls, structures, hearing_structures, behind, wall, owner, related
    return (*found, hearing_pieces, piece, pieces)


def _runs(firsts: IntArray, counts: IntArray) -> IntArray:
    """Return the runs of whole numbers from each first one on, one after the other."""
    before = np.cumsum(counts) - counts
    found: IntArray = np.repeat(firsts - before, counts) + np.arange(counts.sum())
    return found


def _some_points(count: int, rng: np.random.Generator) -> IntArray:
    """Return a few points of a wall, one in each of as many equal parts, or all of a small one."""
    if count <= _POINTS:
        return np.arange(count)
    found: IntArray = ((np.arange(_POINTS) + rng.random(_POINTS)) * count / _POINTS).astype(int)
    return found


class _Stack(nn.Module):
    """Networks during their fit, all on the same samples: a third of the time of one by one.

    Args:
        members: Number of networks.
        seed: Seed of their initial weights.
    """

    def __init__(self, members: int, seed: int) -> None:
        super().__init__()
        generator = torch.Generator().manual_seed(seed)
        arrays: list[Tensor] = []
        # Weights of a layer, and biases after them, are uniform up to 1 / sqrt(inputs).
        for shape in SHAPES:
            if len(shape) > 1:
                most = shape[0] ** -0.5
            own = shape if len(shape) > 1 else (1, *shape)
            drawn = torch.rand((members, *own), generator=generator)
            arrays.append(most * (2.0 * drawn - 1.0))
        # At first all messages of pieces count about equally.
        arrays[Member._fields.index("weight_bias")].add_(_EVEN)
        self.layers = nn.ParameterList(arrays)

    def forward(self, data: _Tensors, rows: _Rows) -> Tensor:
        """Return the predictions at points behind layouts (members, points)."""
        # (1) Each solid sends a message to each point; (2) their sum does not depend on their order
        # or number (Zaheer and others, Deep sets, NeurIPS 2017); (3) point and sums give the load.
        layers = [*self.layers]
        view, piece_view, first, first_bias, second, second_bias, last, last_bias = layers[12:]
        structures = _two_layers(data.related(rows.structures), layers[:4])
        pieces = _two_layers(data.related(rows.related), layers[4:8])
        # Each message of a piece is weighted, number by number, by its traits.
        weights = _two_layers(data.traits[rows.pieces], layers[8:12])
        pieces = pieces * weights.index_select(1, rows.piece)
        heard = _sums(structures, rows.hearing_structures, len(rows.walls))
        also = _sums(pieces, rows.hearing_pieces, len(rows.behind))
        # The first layer's sums over what layouts have in common are made once.
        sizes = [FEATURES - SHARES, SHARES, MESSAGE, MESSAGE, SIGHT, SIGHT]
        constant, share, structure, piece, seen, seen_piece = torch.split(first, sizes, dim=1)
        walls = data.features[rows.walls][:, : FEATURES - SHARES]
        same = walls @ constant + heard @ structure + first_bias
        same = same + data.seen(rows.walls, of_pieces=False) @ view @ seen
        shares = data.features[rows.behind][:, FEATURES - SHARES :] @ share
        of_view = data.seen(rows.behind, of_pieces=True) @ piece_view @ seen_piece
        hidden = _silu(same.index_select(1, rows.wall) + shares + also @ piece + of_view)
        hidden = _silu(torch.baddbmm(second_bias, hidden, second))
        said: Tensor = torch.baddbmm(last_bias, hidden, last)[..., 0]
        return said

    def plain(self) -> list[Member]:
        """Return the weights and biases of each network as arrays."""
        arrays = [layer.detach().cpu().numpy().astype(np.float64) for layer in self.layers]
        single = [
            array[:, 0] if len(shape) == 1 else array
            for array, shape in zip(arrays, SHAPES, strict=True)
        ]
        return [Member(*own) for own in zip(*single, strict=True)]


_silu = nn.functional.silu


def _two_layers(given: Tensor, layers: Sequence[Tensor]) -> Tensor:
    """Return the outputs of two layers of each member (members, rows, outputs)."""
    first, first_bias, second, second_bias = layers
    of_each = given.expand(len(first), *given.shape)
    middle = _silu(torch.baddbmm(first_bias, of_each, first))
    return _silu(torch.baddbmm(second_bias, middle, second))


def _sums(messages: Tensor, hearing: Tensor, points: int) -> Tensor:
    """Return the sum of the messages to each point (members, points, MESSAGE)."""
    empty = messages.new_zeros(len(messages), points, MESSAGE)
    return empty.index_add(1, hearing, messages)


def _fitted(
    data: _Tensors,
    cases: Sequence[IntArray],
    epochs: int,
    networks: _Stack,
    target: _Target,
    seed: int,
) -> list[Member]:
    """Fit networks to the samples of some cases."""
    rng = np.random.default_rng(seed)
    # 1. Cases in groups of a few samples.
    groups = _groups(cases, rng)
    # 2. AdamW (Loshchilov & Hutter, ICLR 2019), with a rate that rises and falls once (Smith &
    # Topin, Super-convergence, 2019).
    optimizer = torch.optim.AdamW(networks.parameters(), _RATE, weight_decay=_DECAY)
    batches = max(1, round(len(groups) / _BATCH))
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, _RATE, total_steps=epochs * batches)
    # 3. Passes over all groups, in a new order each time.
    for epoch in range(epochs):
        for batch in np.array_split(rng.permutation(len(groups)), batches):
            loss = data.loss(networks, target, [groups[number] for number in batch], rng).sum()
            if not torch.isfinite(loss):
                raise BlastEnvError(f"networks of seed {seed} in epoch {epoch}: no finite error")
            optimizer.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            _clip(networks)
            optimizer.step()
            schedule.step()
    return networks.plain()


def _clip(networks: _Stack) -> None:
    """Bound the norm of the gradient of each network: a few groups are outliers.

    See Pascanu, Mikolov & Bengio (ICML 2013).
    """
    gradients = [layer.grad for layer in networks.layers if layer.grad is not None]
    squares = torch.stack([own.flatten(1).square().sum(1) for own in gradients]).sum(0)
    by = (_MOST_GRADIENT / (squares.sqrt() + _TINY)).clamp(max=1.0)[:, np.newaxis, np.newaxis]
    for own in gradients:
        own.mul_(by)


def _groups(cases: Sequence[IntArray], rng: np.random.Generator) -> list[IntArray]:
    """Return the samples of cases in groups of a few, drawn anew."""
    return [
        group
        for case in cases
        for group in np.array_split(rng.permutation(case), ceil(len(case) / _GROUP))
    ]
