"""Fits of the laws of the atlas, judged on groups that are left out."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from blast_env.arrays import FloatArray, IntArray
from blast_env.atlas import between, echoes, shadow
from blast_env.atlas.laws import FamilyError, Law, Laws
from studies.atlas.families import FAMILIES
from studies.atlas.samples import (
    Bays,
    Numbers,
    Samples,
    samples,
    samples_between,
    samples_echoes,
    samples_shadow,
)

FOLDS: Final = 6
"""Shares into which the groups are divided; each is left out once."""

_ENDS: Final = (0.05, 0.95)
_DIGITS: Final = 5
_STEPS: Final = 600


def folds_of(groups: np.ndarray[Any, np.dtype[np.str_]], seed: int = 0) -> IntArray:
    """Return the fold of each sample; a group is in one fold (samples,)."""
    names, index = np.unique(groups, return_inverse=True)
    order = np.random.default_rng(seed).permutation(len(names))
    return np.asarray((order % FOLDS)[index])


def fit(
    found: Samples,
    columns: Sequence[str],
    gates: Sequence[float],
    widths: Sequence[float],
    hidden: int,
    decay: float,
) -> Law:
    """Return the law of all samples, with intervals and errors by groups left out."""
    numbers, target = found.numbers, found.log_change
    folds = folds_of(found.group)
    left = np.empty_like(target)
    for fold in range(FOLDS):
        rest = folds != fold
        law = _fitted(numbers[rest], target[rest], columns, gates, widths, hidden, decay)
        left[~rest] = law.log_factors(numbers[~rest])
    law = _fitted(numbers, target, columns, gates, widths, hidden, decay)
    width = law.width(numbers)[:, np.newaxis]
    shares = (target - left) / np.maximum(width, 1e-3)
    low, high = np.quantile(shares, _ENDS, axis=0)
    below, above = np.maximum(-low, 0.0).round(_DIGITS), np.maximum(high, 0.0).round(_DIGITS)
    inside = (target >= left - width * below) & (target <= left + width * above)
    families = {}
    for name in FAMILIES:
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
    return law.model_copy(
        update={"below": _pair(below), "above": _pair(above), "families": families}
    )


def _pair(values: FloatArray) -> tuple[float, float]:
    first, second = values.round(_DIGITS).tolist()
    return first, second


def _fitted(
    numbers: FloatArray,
    target: FloatArray,
    names: Sequence[str],
    gates: Sequence[float],
    widths: Sequence[float],
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
        widths=tuple(widths),
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
class _Recipe:
    """How a law is fitted.

    Attributes:
        families: Families whose blasts it has.
        numbers_of: Its numbers.
        columns: Their names.
        gates: Share of each in the gate.
        widths: Share of each in the width of intervals.
        hidden: Hidden units.
        decay: Penalty on weights.
    """

    families: tuple[str, ...]
    numbers_of: Numbers
    columns: Sequence[str]
    gates: Mapping[str, float]
    widths: Mapping[str, float] = field(default_factory=dict)
    hidden: int = 8
    decay: float = 3e-4

    def fitted(self, scenes: Iterable[Bays]) -> Law:
        """Return the law of some scenes."""
        own = samples((bays for bays in scenes if bays.family in self.families), self.numbers_of)
        gates = [self.gates.get(name, 0.0) for name in self.columns]
        widths = [self.widths.get(name, 0.0) for name in self.columns]
        return fit(own, self.columns, gates, widths, self.hidden, self.decay)


_THIRD: Final = 1.0 / len(between.WIDTHS)

RECIPES: Final[Mapping[str, _Recipe]] = MappingProxyType(
    {
        "between": _Recipe(
            ("wall", "posts", "rows", "raised"),
            samples_between,
            between.NUMBERS,
            {name: _THIRD for name in between.NUMBERS if name.startswith("taken")},
            {"root_thickness": 0.7, "charge_height": 0.6},  # houses and raised charges vary most
        ),
        "opposite": _Recipe(
            ("opposite", "street"), samples_echoes, echoes.NUMBERS, {"opposite": 1.0}
        ),
        "beside": _Recipe(("tee", "court"), samples_echoes, echoes.NUMBERS, {"beside": 1.0}),
        "shadow": _Recipe(("shadow",), samples_shadow, shadow.NUMBERS, {"away": 1.0}),
    }
)
"""The laws by name."""


def fit_all(scenes: Sequence[Bays], about: Mapping[str, str]) -> Laws:
    """Return all laws."""
    return Laws(**{name: own.fitted(scenes) for name, own in RECIPES.items()}, about=dict(about))
