"""Fits of the laws of the atlas, judged on groups that are left out."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from blast_env.arrays import FloatArray, IntArray
from blast_env.atlas import attached, between, echoes, edges, shadow
from blast_env.atlas.laws import LOG_WIDEST, SMALL, FamilyError, Law, Laws
from studies.atlas.families import FAMILIES
from studies.atlas.samples import (
    Bays,
    Group,
    Numbers,
    Samples,
    impulses_in_the_open,
    less_echoes,
    samples,
    samples_attached,
    samples_between,
    samples_echoes,
    samples_edges,
    samples_shadow,
    scenes_with_loads,
)

Names = np.ndarray[Any, np.dtype[np.str_]]

FOLDS: Final = 6
"""Shares into which the groups are divided; each is left out once."""

_ENDS: Final = (0.05, 0.95)
_DIGITS: Final = 5
_STEPS: Final = 600
_ROUGH: Final = 0.02  # of ln(factor): smaller errors are alike
_POWER: Final = 3.0  # of errors in the width: large ones count
_OF_MEAN: Final = 0.2  # share of the penalty for the network that follows the mean
_CALM: Final = 3e-3  # penalty on the weights of widths
_HELD: Final = 0.9
_ALIKE: Final = MappingProxyType(
    {"far": "wall", "distant": "pieces"}
)  # of few groups: held as one family
_LEAST: Final = 1e-3


def folds_of(groups: Names, seed: int = 0) -> IntArray:
    """Return the fold of each sample; a group is in one fold (samples,)."""
    names, index = np.unique(groups, return_inverse=True)
    order = np.random.default_rng(seed).permutation(len(names))
    return np.asarray((order % FOLDS)[index])


def fit(
    found: Samples,
    judged: Collection[str],
    columns: Sequence[str],
    gates: Sequence[float],
    wider: Sequence[str],
    hidden: int,
    decay: float,
) -> Law:
    """Return the law of all samples, with intervals and errors by groups left out.

    It follows the mean of the networks that were fitted without each fold: their own errors, which
    depend on chance, cancel out.

    Args:
        found: The samples.
        judged: Families that intervals and errors are of.
        columns: Names of their numbers.
        gates: Share of each number in the gate.
        wider: Numbers that make intervals wider or narrower.
        hidden: Hidden units.
        decay: Weight of the penalty on the weights.
    """
    numbers, target = found.numbers, found.log_change
    folds = folds_of(found.group)
    left, mean = np.empty_like(target), np.zeros_like(target)
    for fold in range(FOLDS):
        rest = folds != fold
        law = _fitted(numbers[rest], target[rest], columns, gates, hidden, decay)
        left[~rest] = law.log_factors(numbers[~rest])
        mean += law.log_factors(numbers) / FOLDS
    law = _fitted(numbers, mean, columns, gates, hidden, _OF_MEAN * decay)
    kept = np.isin(found.family, [*judged])
    off = found.less_known(target - left)
    law = _with_intervals(
        law, numbers[kept], found.family[kept], found.group[kept], off[kept], wider
    )
    width = law.width(numbers)
    below, above = np.array(law.below), np.array(law.above)
    inside = (off >= -width * below) & (off <= width * above)
    families = {}
    for name in judged:
        own = found.family == name
        if own.any():
            families[name] = FamilyError(
                title=FAMILIES[name].title,
                blasts=len(np.unique(found.scene[own])),
                bays=int(own.sum()),
                before=_pair(np.sqrt((target[own] ** 2).mean(axis=0))),
                error=_pair(np.sqrt(((target - left)[own] ** 2).mean(axis=0))),
                inside=_pair(inside[own].mean(axis=0)),
            )
    return _changed(law, families=families)


def _with_intervals(
    law: Law,
    numbers: FloatArray,
    family: Names,
    group: Names,
    off: FloatArray,
    wider: Sequence[str],
) -> Law:
    """Return a law with the narrowest intervals that hold 90 % of the bays of each family.

    They hold one standard error of that share more, over the groups of the family: bays of one
    group are alike, and those of new designs are to be held as well.

    Args:
        law: The law without intervals.
        numbers: Numbers of the bays.
        family: Their families.
        group: Their groups.
        off: What the law leaves of ln(factor) where it was not fitted (bays, loads).
        wider: See `fit`.
    """
    kind = np.array([_ALIKE.get(name, name) for name in family.tolist()])
    kinds = [kind == name for name in np.unique(kind)]
    errors = [np.sqrt(_HELD * (1.0 - _HELD) / len(np.unique(group[own]))) for own in kinds]
    law = _changed(law, widths=_widths(law, numbers, off, wider))
    width = np.maximum(law.width(numbers), _LEAST)
    low, high = np.quantile(off / width, _ENDS, axis=0)
    ends = np.maximum(-low, _LEAST), np.maximum(high, _LEAST)
    reach = np.maximum(-off / (width * ends[0]), off / (width * ends[1]))
    more = np.max(
        [
            np.quantile(reach[own], min(_HELD + error, 1.0), axis=0)
            for own, error in zip(kinds, errors, strict=True)
        ],
        axis=0,
    )
    below, above = (_pair(more * end + 10.0**-_DIGITS) for end in ends)
    return _changed(law, below=below, above=above)


def _changed(law: Law, **more: Any) -> Law:
    """Return a law with other values; a copy would keep arrays of the old ones."""
    return Law.model_validate({**law.model_dump(), **more})


def _widths(
    law: Law, numbers: FloatArray, off: FloatArray, wider: Sequence[str]
) -> tuple[tuple[float, float], ...]:
    """Return the weights of some numbers in the logarithm of the width, for each load.

    The likeliest ones for errors whose logarithmic density falls with a power of them over the
    width, with a penalty.
    """
    from scipy.optimize import minimize  # takes a while to import

    chosen = [law.numbers.index(name) for name in wider]
    there = law.gate(numbers) >= SMALL  # where hardly anything stands, widths are small anyway
    numbers, off = numbers[there], off[there]
    weights = np.zeros((len(law.numbers), off.shape[1]))
    z = ((numbers - np.array(law.centre)) / np.array(law.scale))[:, chosen]
    least = np.maximum(law.width(numbers), _LEAST)
    for load in range(off.shape[1]) if chosen else ():
        size = (np.abs(off[:, load]) + _ROUGH) / least[:, load]

        def loss(flat: FloatArray, size: FloatArray = size) -> tuple[float, FloatArray]:
            bound = np.tanh(z @ flat[1:] / LOG_WIDEST)
            log_width = flat[0] + LOG_WIDEST * bound
            over = (size * np.exp(-log_width)) ** _POWER
            wider = (1.0 - over) * (1.0 - bound**2)
            slope = np.append((1.0 - over).mean(), z.T @ wider / len(z))
            slope[1:] += 2.0 * _CALM * flat[1:]
            value = (log_width + over / _POWER).mean() + _CALM * (flat[1:] ** 2).sum()
            return float(value), slope

        start = np.append(np.log(size.mean()), np.zeros(len(chosen)))
        weights[chosen, load] = minimize(loss, start, jac=True, method="L-BFGS-B").x[1:]
    return tuple(map(_pair, weights))


def _pair(values: FloatArray) -> tuple[float, float]:
    first, second = values.round(_DIGITS).tolist()
    return first, second


def _fitted(
    numbers: FloatArray,
    target: FloatArray,
    names: Sequence[str],
    gates: Sequence[float],
    hidden: int,
    decay: float,
) -> Law:
    """Return the network of least squares with a penalty on its weights; no intervals."""
    from scipy.optimize import minimize  # takes a while to import

    centre, scale = numbers.mean(axis=0), np.maximum(numbers.std(axis=0), 1e-6)
    z = (numbers - centre) / scale
    gate = np.clip(numbers @ np.array(gates), 0.0, 2.0)[:, np.newaxis]
    count, loads = z.shape[1], target.shape[1]
    shapes = [(count, hidden), (hidden,), (hidden, loads), (loads,)]
    ends = np.cumsum([int(np.prod(shape)) for shape in shapes])

    def parts(flat: FloatArray) -> list[FloatArray]:
        pieces = np.split(flat, ends[:-1])
        return [piece.reshape(shape) for piece, shape in zip(pieces, shapes, strict=True)]

    def loss(flat: FloatArray) -> tuple[float, FloatArray]:
        inner, shift, outer, outer_shift = parts(flat)
        active = np.tanh(z @ inner + shift)
        off = gate * (active @ outer + outer_shift) - target
        slope = 2.0 * gate * off / off.size
        back = (slope @ outer.T) * (1.0 - active**2)
        gradient = [
            z.T @ back + 2.0 * decay * inner,
            back.sum(axis=0),
            active.T @ slope + 2.0 * decay * outer,
            slope.sum(axis=0),
        ]
        penalty = decay * ((inner**2).sum() + (outer**2).sum())
        return float((off**2).mean() + penalty), np.concatenate([own.ravel() for own in gradient])

    start = np.random.default_rng(0).normal(0.0, 0.3, ends[-1])
    found = minimize(loss, start, jac=True, method="L-BFGS-B", options={"maxiter": _STEPS})
    lowest = numbers.min(axis=0).round(_DIGITS)
    inner, shift, outer, outer_shift = (own.round(_DIGITS).tolist() for own in parts(found.x))
    return Law(
        numbers=tuple(names),
        gates=tuple(gates),
        widths=((0.0, 0.0),) * len(names),
        least=tuple(np.where(np.array(gates) > 0.0, 0.0, lowest).tolist()),
        most=tuple(numbers.max(axis=0).round(_DIGITS).tolist()),
        centre=tuple(centre.tolist()),
        scale=tuple(scale.tolist()),
        inner=tuple(map(tuple, inner)),
        inner_shift=tuple(shift),
        outer=tuple(map(tuple, outer)),
        outer_shift=tuple(outer_shift),
        below=(0.0, 0.0),
        above=(0.0, 0.0),
        families={},
    )


@dataclass(frozen=True)
class Recipe:
    """How a law is fitted.

    Attributes:
        families: Families whose blasts it has.
        numbers_of: Its numbers.
        columns: Their names.
        gates: Share of each in the gate.
        wider: Numbers that make intervals wider or narrower.
        scenes_of: Yields the scenes of groups with the changes that the law is of.
        less: Laws of echoes whose factors are taken off these changes first.
        also: Families whose blasts it has as well, and which another law judges.
        hidden: Hidden units.
        decay: Penalty on weights.
    """

    families: tuple[str, ...]
    numbers_of: Numbers
    columns: Sequence[str]
    gates: Mapping[str, float]
    wider: tuple[str, ...] = ()
    scenes_of: Callable[[Iterable[Group]], Iterator[Bays]] = scenes_with_loads
    less: tuple[str, ...] = ()
    also: tuple[str, ...] = ()
    hidden: int = 8
    decay: float = 3e-4

    def samples(
        self, groups: Iterable[Group], known: Mapping[str, Law], families: Collection[str] = ()
    ) -> Samples:
        """Return the samples of some groups, those of its families that are named, or of all.

        Args:
            groups: The groups.
            known: Laws by name, with those of `less`.
            families: The families.
        """
        chosen = families or (*self.families, *self.also)
        scenes = (bays for bays in self.scenes_of(groups) if bays.family in chosen)
        return samples(less_echoes(scenes, [known[name] for name in self.less]), self.numbers_of)

    def fitted(self, groups: Iterable[Group], known: Mapping[str, Law]) -> Law:
        """Return the law of some groups, with other laws known."""
        gates = [self.gates.get(name, 0.0) for name in self.columns]
        found = self.samples(groups, known)
        return fit(found, self.families, self.columns, gates, self.wider, self.hidden, self.decay)


_THIRD: Final = 1.0 / len(between.WIDTHS)

RECIPES: Final[Mapping[str, Recipe]] = MappingProxyType(
    {
        "edges": Recipe(
            ("open",),
            samples_edges,
            edges.NUMBERS,
            {"facing": 1.0},
            ("root_to_far_end", "bay_height", "charge_height"),
            impulses_in_the_open,
            hidden=12,
            decay=1e-4,
        ),
        "opposite": Recipe(
            ("opposite", "street"),
            samples_echoes,
            echoes.NUMBERS,
            {"opposite": 1.0},
            ("near_opposite", "near_beside"),
        ),
        "beside": Recipe(
            ("tee", "court"),
            samples_echoes,
            echoes.NUMBERS,
            {"beside": 1.0},
            ("near_opposite", "near_beside"),
        ),
        "between": Recipe(
            (
                *("wall", "posts", "rows", "raised", "far", "pieces", "shaft", "distant", "slant"),
                "yard",
            ),
            samples_between,
            between.NUMBERS,
            {name: _THIRD for name in between.NUMBERS if name.startswith("taken")},
            tuple(name for name in between.NUMBERS if name != "both_sides"),
            less=("opposite", "beside"),
            also=("tee",),
            hidden=20,
            decay=1e-4,
        ),
        "attached": Recipe(
            ("canopy",),
            samples_attached,
            attached.NUMBERS,
            {"roofed": 1.0, "podium": 1.0},
            ("roofed", "podium"),
            hidden=12,
        ),
        "shadow": Recipe(("shadow",), samples_shadow, shadow.NUMBERS, {"away": 1.0}),
    }
)
"""The laws by name."""


def fit_all(groups: Sequence[Group], about: Mapping[str, str]) -> Laws:
    """Return all laws, in the order of the recipes."""
    found: dict[str, Law] = {}
    for name, recipe in RECIPES.items():
        found[name] = recipe.fitted(groups, found)
    return Laws(**found, about=dict(about))
