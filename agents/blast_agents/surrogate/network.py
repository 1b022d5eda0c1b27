"""The surrogate: small networks that tell what reaches each point of a wall, and how surely.

Each solid sends a message to each point, made from where it stands for that. What a network says of
a point goes by the features of the point and the sum of all messages.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from itertools import pairwise, zip_longest
from math import prod
from pathlib import Path
from typing import Annotated, Any, Final, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from blast_agents.surrogate.relations import RELATIONS
from blast_agents.surrogate.walls import FEATURES, INPUTS, Approach, SingleArray, SurrogateSite
from blast_env.arrays import FloatArray
from blast_env.documents import DocumentError, checked_as, parse_json, read_text
from blast_env.errors import BlastEnvError
from blast_env.files import write_atomically
from blast_env.geometry import Element
from blast_env.physics.scene import Charge
from blast_env.response.damage import BayDamage

IntArray = NDArray[np.int64]
AnyFloats = NDArray[np.floating[Any]]
_PACKAGED: Final = Path(__file__).with_name("gas.json")

HIDDEN: Final = 64
"""Width of the two hidden layers."""

MESSAGE: Final = 32
"""Length of a message, and width of the layer that it is made by."""

IMPULSE_POWER: Final = 1.0
"""The impulse on a structure is the mean over its walls."""

PEAK_POWER: Final = 16.0
"""The peak on a structure is nearly the largest: a mean of so high a power."""

_AT_ONCE: Final = 64
"""Points of which a network is asked at a time.

So few stay in a processor's cache, and are multiplied by one thread: with more of them OpenBLAS
wakes others, which wait in a loop for most of the time, or for ever where processors are taken.
"""

_MOST_SPREADS: Final = 4.0
"""Inputs are cut so far from their mean, in their scale."""

SHAPES: Final = ((RELATIONS, MESSAGE), (MESSAGE,), (MESSAGE, MESSAGE), (MESSAGE,)) + (
    (FEATURES + MESSAGE, HIDDEN),
    (HIDDEN,),
    (HIDDEN, HIDDEN),
    (HIDDEN,),
    (HIDDEN, 1),
    (1,),
)
"""Of the arrays of a network, in the order of `Member`."""


class Check(BaseModel):
    """How far guesses of one load are off on sites that were held out of the fit.

    Attributes:
        rms: Root of the mean square error of the logarithm of a load.
        rank: Rank correlation with the engine among the layouts of a case.
        lost: What choosing among these by it costs: by how much the load behind the layout that it
            likes best is above the least one of the case, as a share of the largest.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    rms: float
    rank: float
    lost: float


class Fit(BaseModel):
    """What a surrogate was fitted to, and how far it was off where it was not.

    Attributes:
        format: Version of this form.
        command: What fitted it.
        versions: With what.
        engine: The engine of the blasts.
        blasts: How many loads of structures it was fitted to.
        sites: Of how many sites.
        seconds: Time that the fit took, without the check.
        impulse: How far impulses are off, if that was told.
        peak: How far peak overpressures are off, if that was told.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    format: Literal[3] = 3
    command: str
    versions: dict[str, str]
    engine: str
    blasts: Annotated[int, Field(ge=1)]
    sites: Annotated[int, Field(ge=1)]
    seconds: Annotated[float, Field(ge=0.0)] = 0.0
    impulse: Check | None = None
    peak: Check | None = None


class Guess(NamedTuple):
    """What the surrogate says of layouts.

    Attributes:
        impulse_pa_s: Mean impulse on each protected structure (layouts, structures).
        spread: By how much its members differ about that, as a share of it: the standard deviation
            of the logarithm (layouts, structures).
        peak_pa: Largest overpressure on each (layouts, structures); `None` where the objective
            counts none.
        peak_spread: By how much its members differ about that (layouts, structures).
    """

    impulse_pa_s: FloatArray
    spread: FloatArray
    peak_pa: FloatArray | None = None
    peak_spread: FloatArray | None = None

    def loads(self, site: SurrogateSite, layouts: Sequence[Sequence[Element]] = ()) -> FloatArray:
        """Return the load that counts behind each layout, in the objective's unit (layouts,).

        Where the response of facades counts, each bay of a structure gets a triangular load with
        the impulse and the peak that were guessed for the structure. The peak is the largest one
        on it, so that the guess of the response is on the safe side.

        Args:
            site: The site that was guessed.
            layouts: The layouts; needed where the response of facades counts.
        """
        load, structures = site.scenario.objective.load, site.protected
        if site.scenario.objective.is_response:
            return np.array(
                [self._response(site, index, each) for index, each in enumerate(layouts)]
            )
        peak_pa = np.zeros_like(self.impulse_pa_s) if self.peak_pa is None else self.peak_pa
        both = np.stack((self.impulse_pa_s, peak_pa), axis=2).tolist()
        return np.array(
            [
                sum(
                    load(impulse, peak, each.weight, each.counted_peak_weight)
                    for each, (impulse, peak) in zip(structures, of_layout, strict=True)
                )
                for of_layout in both
            ]
        )

    def bays(self, site: SurrogateSite, index: int) -> tuple[BayDamage, ...]:
        """Return the damage of the bays behind a layout, by its index, under triangular loads."""
        assert self.peak_pa is not None
        found: list[BayDamage] = []
        for column, structure in enumerate(site.protected):
            peak_pa, impulse_pa_s = self.peak_pa[index, column], self.impulse_pa_s[index, column]
            found += site.bay_damages(structure.name, float(peak_pa), float(impulse_pa_s))
        return tuple(found)

    def _response(self, site: SurrogateSite, index: int, layout: Sequence[Element]) -> float:
        assert self.peak_pa is not None
        loads = zip(self.peak_pa[index].tolist(), self.impulse_pa_s[index].tolist(), strict=True)
        return sum(
            each.weight * site.response(each.name, layout, *load)
            for each, load in zip(site.protected, loads, strict=True)
        )


class Member(NamedTuple):
    """A network: weights and biases of its layers, in the order in which they are used.

    The first two layers make messages, the others say what they and the features of a point mean.
    """

    send: AnyFloats
    send_bias: AnyFloats
    message: AnyFloats
    message_bias: AnyFloats
    first: AnyFloats
    first_bias: AnyFloats
    second: AnyFloats
    second_bias: AnyFloats
    last: AnyFloats
    last_bias: AnyFloats


class Networks:
    """Networks that were fitted to the same loads, each from another start; asked together.

    They work with single precision: what is lost is far below what they are off.

    Args:
        members: The networks.

    Attributes:
        members: The same.
    """

    def __init__(self, members: Sequence[Member]) -> None:
        self.members = tuple(members)
        stacked = [
            np.stack(arrays) if members else np.empty((0, *shape))
            for arrays, shape in zip_longest(zip(*members, strict=True), SHAPES)
        ]
        single = [each.astype(np.float32) for each in stacked]
        self._layers = Member(*(each[:, np.newaxis] if each.ndim == 2 else each for each in single))

    def messages(self, scaled: FloatArray) -> SingleArray:
        """Return what each solid tells each point (members, solids x points, MESSAGE).

        Args:
            scaled: Where they stand, less the mean, over the scale (solids x points, RELATIONS).
        """
        layers = self._layers
        found = np.empty((len(self.members), len(scaled), MESSAGE), dtype=np.float32)
        given = scaled.astype(np.float32)
        for few in _runs(len(scaled)):
            sent = _silu(given[few] @ layers.send + layers.send_bias)
            found[:, few] = _silu(sent @ layers.message + layers.message_bias)
        return found

    def __call__(self, scaled: FloatArray, heard: SingleArray) -> FloatArray:
        """Return by how much each says that logarithms of loads differ from Kingery and Bulmash's.

        Args:
            scaled: Features of points, less the mean, over the scale (points, FEATURES).
            heard: The messages to each, added up (members, points, MESSAGE).

        Returns:
            (members, points).
        """
        layers = self._layers
        of_point, of_message = layers.first[:, :FEATURES], layers.first[:, FEATURES:]
        differs = np.empty((len(self.members), len(scaled)))
        given = scaled.astype(np.float32)
        for few in _runs(len(scaled)):
            met = given[few] @ of_point + heard[:, few] @ of_message
            first = _silu(met + layers.first_bias)
            second = _silu(first @ layers.second + layers.second_bias)
            differs[:, few] = (second @ layers.last + layers.last_bias)[..., 0]
        return differs


def _runs(count: int) -> list[slice]:
    """Return which rows are multiplied together.

    None is left alone: a single row is multiplied in another order than several are.
    """
    starts = range(0, max(count - 1, 1), _AT_ONCE)
    return [slice(*ends) for ends in pairwise((*starts, count))]


@dataclass(frozen=True, eq=False)
class Surrogate:
    """Networks that were fitted to blasts.

    Attributes:
        mean: Of each feature and each relation (INPUTS,).
        scale: Their spread (INPUTS,).
        impulse: The networks that know impulses.
        peak: Those that know peak overpressures.
        fit: What they were fitted to.
    """

    mean: FloatArray
    scale: FloatArray
    impulse: Networks
    peak: Networks
    fit: Fit

    @property
    def digest(self) -> str:
        """Tells surrogates apart: of their numbers."""
        members = (*self.impulse.members, *self.peak.members)
        arrays = (self.mean, self.scale, *(each for member in members for each in member))
        numbers = b"".join(np.ascontiguousarray(each).tobytes() for each in arrays)
        return sha256(numbers).hexdigest()[:16]

    def guess(
        self, site: SurrogateSite, layouts: Sequence[Sequence[Element]], charges: Sequence[Charge]
    ) -> Guess:
        """Return what blasts behind layouts would do, without one.

        Args:
            site: The site.
            layouts: Legal layouts.
            charges: What goes off behind each of them, where it does (layouts,).

        Raises:
            LayoutError: If the catalogue has no such piece.
        """
        pairs = [
            (site.approach(charge), site.barrier(layout))
            for layout, charge in zip(layouts, charges, strict=True)
        ]
        scaled = self.scaled(np.concatenate([each.features(barrier) for each, barrier in pairs]))
        area_m2 = np.concatenate([each.area_m2 for each, _ in pairs])
        before = np.cumsum([0, *(len(each.area_m2) for each, _ in pairs[:-1])])
        starts = np.concatenate(
            [first + each.starts for first, (each, _) in zip(before, pairs, strict=True)]
        )

        def of(networks: Networks, known: Sequence[FloatArray], power: float) -> list[FloatArray]:
            heard = [self._heard(networks, *each, site) for each in pairs]
            differs = networks(scaled, np.concatenate(heard, axis=1))
            logs = log_loads(differs, np.concatenate(known), area_m2, starts, power)
            return [each.reshape(len(pairs), -1) for each in _mean_and_spread(logs)]

        impulse = of(self.impulse, [each.log_impulse for each, _ in pairs], IMPULSE_POWER)
        if not site.counts_peaks:
            return Guess(*impulse)
        return Guess(*impulse, *of(self.peak, [each.log_peak for each, _ in pairs], PEAK_POWER))

    def save(self, path: str | Path) -> Path:
        """Write everything as one JSON file, numbers to five digits.

        Raises:
            BlastEnvError: If it cannot be written.
        """
        path = Path(path)
        content = _File(
            fit=self.fit,
            mean=_numbers(self.mean),
            scale=_numbers(self.scale),
            members=_flat(self.impulse.members),
            peak_members=_flat(self.peak.members),
        )
        with write_atomically(path) as temporary:
            temporary.write_text(f"{content.model_dump_json()}\n", encoding="utf-8")
        return path

    def _heard(
        self, networks: Networks, approach: Approach, barrier: FloatArray, site: SurrogateSite
    ) -> SingleArray:
        """Return the messages to points from all that stands there (members, points, MESSAGE).

        Layouts have many pieces in common, so those of each piece are remembered.
        """

        def sent(related: FloatArray) -> SingleArray:
            solids, points, _ = related.shape
            told = networks.messages(self.related(related.reshape(-1, RELATIONS)))
            summed: SingleArray = told.reshape(-1, solids, points, MESSAGE).sum(axis=1)
            return summed

        heard = site.memory.of((networks, approach), lambda: sent(approach.solids)).copy()
        for piece in barrier:
            key = (networks, approach, piece.tobytes())
            heard += site.memory.of(key, partial(_of_piece, sent, approach, piece))
        return heard

    def scaled(self, features: FloatArray) -> FloatArray:
        """Return what the networks are given of features of points (points, FEATURES)."""
        return bounded(features, self.mean[:FEATURES], self.scale[:FEATURES])

    def related(self, relations: FloatArray) -> FloatArray:
        """Return what they are given of relations (solids x points, RELATIONS)."""
        return bounded(relations, self.mean[FEATURES:], self.scale[FEATURES:])


def _of_piece(
    sent: Callable[[FloatArray], SingleArray], approach: Approach, piece: FloatArray
) -> SingleArray:
    return sent(approach.relations(piece[np.newaxis]))


def bounded(numbers: FloatArray, mean: FloatArray, scale: FloatArray) -> FloatArray:
    """Return numbers less their mean, over their scale, cut where networks have met none (rows, n).

    A wall of 60 m has points much farther from its edges than those of the sites of a fit, and what
    a network says so far outside has no bounds.
    """
    found: FloatArray = np.clip((numbers - mean) / scale, -_MOST_SPREADS, _MOST_SPREADS)
    return found


def _mean_and_spread(logs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what the networks say on the mean, and by how much they differ (structures,)."""
    return np.exp(agreed(logs)), logs.std(axis=0)


def agreed(logs: FloatArray) -> FloatArray:
    """Return the mean over the networks without the highest and the lowest (members, n) -> (n,).

    Where nothing like it was in the fit, one of them may be far off.
    """
    middle: FloatArray = np.sort(logs, axis=0)[1:-1] if len(logs) > 2 else logs
    mean: FloatArray = middle.mean(axis=0)
    return mean


def log_loads(
    differs: FloatArray, known: FloatArray, area_m2: FloatArray, starts: IntArray, power: float
) -> FloatArray:
    """Return the logarithm of the load on each structure, by each network (members, structures).

    It is the power mean of the loads at its points, each by the area that it stands for.

    Args:
        differs: What the networks say of all points: `Networks` (members, points).
        known: Logarithm of Kingery and Bulmash's load there (points,).
        area_m2: What each point stands for (points,).
        starts: The first point of each structure (structures,).
        power: Of the mean.
    """
    area_of_all_m2 = np.add.reduceat(area_m2, starts)
    loads = area_m2 * np.exp(power * (known + differs))
    logs: FloatArray = np.log(np.add.reduceat(loads, starts, axis=1) / area_of_all_m2) / power
    return logs


def load_surrogate(path: str | Path) -> Surrogate:
    """Return a surrogate from its file.

    Raises:
        BlastEnvError: If there is no such file, or it is no surrogate or damaged.
    """
    path = Path(path)
    try:
        text = read_text(path)
    except DocumentError as error:
        raise BlastEnvError(f"{path}: {error}") from error
    try:
        content = checked_as(_File, parse_json(text))
    except DocumentError as error:
        raise BlastEnvError(f"{path}: is no surrogate, or damaged: {error}") from error
    return Surrogate(
        np.array(content.mean),
        np.array(content.scale),
        _networks(content.members),
        _networks(content.peak_members),
        content.fit,
    )


def packaged_surrogate() -> Surrogate:
    """Return the surrogate that comes with the package.

    Its `fit` says what it was fitted to: generated sites only, so that it may be judged on all
    bundled ones.
    """
    return load_surrogate(_PACKAGED)


_Members = Annotated[list[list[list[float]]], Field(min_length=1, max_length=100)]


class _File(BaseModel):
    """What is in a file: arrays as flat lists."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    fit: Fit
    mean: list[float]
    scale: list[Annotated[float, Field(gt=0.0)]]
    members: _Members
    peak_members: _Members

    @model_validator(mode="after")
    def _check_sizes(self) -> Self:
        for name, numbers in (("mean", self.mean), ("scale", self.scale)):
            if len(numbers) != INPUTS:
                raise ValueError(f"{name} has {len(numbers)} numbers, must be {INPUTS}")
        wanted = [prod(shape) for shape in SHAPES]
        for name, members in (("members", self.members), ("peak_members", self.peak_members)):
            for number, member in enumerate(members):
                sizes = [len(flat) for flat in member]
                if sizes != wanted:
                    raise ValueError(f"{name}: network {number} has {sizes}, must be {wanted}")
        return self


def _flat(members: Sequence[Member]) -> list[list[list[float]]]:
    return [[_numbers(array) for array in member] for member in members]


def _networks(members: Sequence[Sequence[Sequence[float]]]) -> Networks:
    return Networks(
        [
            Member(
                *(np.array(flat).reshape(shape) for flat, shape in zip(each, SHAPES, strict=True))
            )
            for each in members
        ]
    )


def _numbers(array: AnyFloats) -> list[float]:
    return [float(f"{value:.5g}") for value in array.ravel()]


def _silu(values: AnyFloats) -> SingleArray:
    """Return x / (1 + exp(-x)); by the hyperbolic tangent nothing overflows, and it is faster."""
    half: SingleArray = np.float32(0.5) * values
    silu: SingleArray = np.tanh(half)
    silu *= half
    silu += half
    return silu
