"""The surrogate: small networks that tell what reaches each point of a wall, and how surely."""

from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from itertools import pairwise
from math import prod
from pathlib import Path
from typing import Annotated, Final, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from blast_agents.surrogate.walls import ALL_FEATURES, FEATURES, Approach, SurrogateSite
from blast_env.arrays import FloatArray
from blast_env.documents import DocumentError, checked_as, parse_json, read_text
from blast_env.errors import BlastEnvError
from blast_env.files import write_atomically
from blast_env.geometry import Element
from blast_env.physics.scene import Charge
from blast_env.response.damage import BayDamage

IntArray = NDArray[np.int64]
_PACKAGED: Final = Path(__file__).with_name("gas.json")

HIDDEN: Final = 48
"""Width of the two hidden layers."""

IMPULSE_POWER: Final = 1.0
"""The impulse on a structure is the mean over its walls."""

PEAK_POWER: Final = 16.0
"""The peak on a structure is nearly the largest: a mean of so high a power."""

_AT_ONCE: Final = 64
"""Points of which a network is asked at a time.

So few stay in a processor's cache, and are multiplied by one thread: with more of them OpenBLAS
wakes others, which wait in a loop for most of the time, or for ever where processors are taken.
"""


def shapes(features: int) -> tuple[tuple[int, ...], ...]:
    """Return the shapes of the arrays of a network with so many inputs, as `Member` has them."""
    return (features, HIDDEN), (HIDDEN,), (HIDDEN, HIDDEN), (HIDDEN,), (HIDDEN, 1), (1,)


class Check(BaseModel):
    """How far guesses of one load are off where the surrogate was not fitted.

    Attributes:
        layouts_rms: Root of the mean square error of the logarithm of a load, on layouts that were
            held out, of sites that were not.
        layouts_rank: Rank correlation with the engine among the held-out layouts of a case.
        layouts_lost: What choosing among these by it costs: by how much the load behind the layout
            that it likes best is above the least one of the case, as a share of the largest.
        sites_rms: The error on sites that were held out.
        sites_rank: The correlation on them.
        sites_lost: What choosing by it costs on them.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    layouts_rms: float
    layouts_rank: float
    layouts_lost: float
    sites_rms: float
    sites_rank: float
    sites_lost: float


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

    format: Literal[2] = 2
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
    """A network: weights and biases of its layers, in the order in which they are used."""

    first: FloatArray
    first_bias: FloatArray
    second: FloatArray
    second_bias: FloatArray
    last: FloatArray
    last_bias: FloatArray

    def __call__(self, features: FloatArray) -> FloatArray:
        """Return by how much the logarithm of a load differs from Kingery and Bulmash's (points,).

        Args:
            features: Of points, less their mean, over their scale (points, features).
        """
        differs = np.empty(len(features))
        # No point is left alone: a single row is multiplied in another order than several are.
        starts = range(0, max(len(features) - 1, 1), _AT_ONCE)
        for start, end in pairwise((*starts, len(features))):
            few = slice(start, end)
            hidden = _silu(features[few] @ self.first + self.first_bias)
            hidden = _silu(hidden @ self.second + self.second_bias)
            differs[few] = (hidden @ self.last + self.last_bias)[:, 0]
        return differs


@dataclass(frozen=True, eq=False)
class Surrogate:
    """Some networks that were fitted to the same blasts, each from another start.

    Attributes:
        mean: Of each feature that the networks are given: (FEATURES,), or (ALL_FEATURES,) with
            horizons.
        scale: Its spread, of the same shape.
        members: The networks that know impulses.
        peak_members: Those that know peak overpressures.
        fit: What they were fitted to.
    """

    mean: FloatArray
    scale: FloatArray
    members: tuple[Member, ...]
    peak_members: tuple[Member, ...]
    fit: Fit

    @property
    def digest(self) -> str:
        """Tells surrogates apart: of their numbers."""
        members = (*self.members, *self.peak_members)
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
        barriers = [site.barrier(layout) for layout in layouts]
        approaches = [site.approaches(charge) for charge in charges]
        columns = [
            self._on_structure([each[number] for each in approaches], barriers, site.counts_peaks)
            for number in range(len(site.protected))
        ]
        return Guess(*(np.stack(each, axis=1) for each in zip(*columns, strict=True)))

    def save(self, path: str | Path) -> Path:
        """Write everything as one JSON file, numbers to six digits.

        Raises:
            BlastEnvError: If it cannot be written.
        """
        path = Path(path)
        content = _File(
            fit=self.fit,
            mean=_numbers(self.mean),
            scale=_numbers(self.scale),
            members=_flat(self.members),
            peak_members=_flat(self.peak_members),
        )
        with write_atomically(path) as temporary:
            temporary.write_text(f"{content.model_dump_json()}\n", encoding="utf-8")
        return path

    def _on_structure(
        self, approaches: Sequence[Approach], barriers: Sequence[FloatArray], peaks: bool
    ) -> tuple[FloatArray, ...]:
        """Return mean and spread of the impulse on one structure, then of its peak if asked."""
        starts: IntArray = np.cumsum([0, *(len(each.area_m2) for each in approaches[:-1])])
        area_m2 = np.concatenate([each.area_m2 for each in approaches])
        given = len(self.mean)
        behind = [each.behind(b, given) for each, b in zip(approaches, barriers, strict=True)]
        rows = np.concatenate([start + of for start, (of, _) in zip(starts, behind, strict=True)])
        scaled = self.scaled(np.concatenate([features for _, features in behind]))

        def of(
            members: tuple[Member, ...], known: Sequence[FloatArray], power: float
        ) -> FloatArray:
            differs = np.hstack([self._on_empty(each, members) for each in approaches])
            differs[:, rows] = answers(members, scaled)
            return log_loads(differs, np.concatenate(known), area_m2, starts, power)

        impulse = of(self.members, [each.log_impulse for each in approaches], IMPULSE_POWER)
        if not peaks:
            return _mean_and_spread(impulse)
        peak = of(self.peak_members, [each.log_peak for each in approaches], PEAK_POWER)
        return (*_mean_and_spread(impulse), *_mean_and_spread(peak))

    def _on_empty(self, approach: Approach, members: tuple[Member, ...]) -> FloatArray:
        """Return what networks say of the points where no barrier stands (members, points)."""
        kept = approach.kept.get((self, members is self.members))
        if kept is None:
            kept = answers(members, self.scaled(approach.on_empty))
            approach.kept[self, members is self.members] = kept
        return kept

    def scaled(self, features: FloatArray) -> FloatArray:
        """Return what the networks are given of points, from all features or from as many."""
        scaled: FloatArray = (features[:, : len(self.mean)] - self.mean) / self.scale
        return scaled


def _mean_and_spread(logs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what the networks say on the mean, and by how much they differ (structures,)."""
    return np.exp(logs.mean(axis=0)), logs.std(axis=0)


def answers(members: Sequence[Member], scaled: FloatArray) -> FloatArray:
    """Return what each network says of points (members, points); see `Member`."""
    return np.array([member(scaled) for member in members])


def log_loads(
    differs: FloatArray, known: FloatArray, area_m2: FloatArray, starts: IntArray, power: float
) -> FloatArray:
    """Return the logarithm of the load on each structure, by each network (members, structures).

    It is the power mean of the loads at its points, each by the area that it stands for.

    Args:
        differs: What the networks say of all points: `answers` (members, points).
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
        _members(content.members, len(content.mean)),
        _members(content.peak_members, len(content.mean)),
        content.fit,
    )


def packaged_surrogate() -> Surrogate:
    """Return the surrogate that comes with the package.

    Its `fit` says what it was fitted to: generated sites only, so that it may be judged on all
    bundled ones.
    """
    return load_surrogate(_PACKAGED)


_Networks = Annotated[list[list[list[float]]], Field(min_length=1, max_length=100)]


class _File(BaseModel):
    """What is in a file: arrays as flat lists."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    fit: Fit
    mean: list[float]
    scale: list[Annotated[float, Field(gt=0.0)]]
    members: _Networks
    peak_members: _Networks

    @model_validator(mode="after")
    def _check_sizes(self) -> Self:
        given = len(self.mean)
        if given not in (FEATURES, ALL_FEATURES):
            raise ValueError(f"mean has {given} numbers, must be {FEATURES} or {ALL_FEATURES}")
        if len(self.scale) != given:
            raise ValueError(f"scale has {len(self.scale)} numbers, must be {given}")
        wanted = [prod(shape) for shape in shapes(given)]
        for name, members in (("members", self.members), ("peak_members", self.peak_members)):
            for number, member in enumerate(members):
                sizes = [len(flat) for flat in member]
                if sizes != wanted:
                    raise ValueError(f"{name}: network {number} has {sizes}, must be {wanted}")
        return self


def _flat(members: Sequence[Member]) -> list[list[list[float]]]:
    return [[_numbers(array) for array in member] for member in members]


def _members(networks: Sequence[Sequence[Sequence[float]]], features: int) -> tuple[Member, ...]:
    wanted = shapes(features)
    return tuple(
        Member(*(np.array(flat).reshape(shape) for flat, shape in zip(each, wanted, strict=True)))
        for each in networks
    )


def _numbers(array: FloatArray) -> list[float]:
    return [float(f"{value:.6g}") for value in array.ravel()]


def _silu(values: FloatArray) -> FloatArray:
    below = np.negative(values)
    np.exp(below, out=below)
    below += 1.0
    silu: FloatArray = np.divide(values, below, out=below)
    return silu
