"""Obstacles between a charge and a bay, as dimensionless numbers.

An obstacle takes away a part of the zone through which the wave reaches the bay: a bell around the
straight way, of variance `width * d1 d2 / (d1 + d2)` in the plane of the obstacle, where d1 and d2
are its distances from the charge and from the bay, and `width` is a difference of ways (Fresnel's
zones). The ground mirrors it. What obstacles take away of several bells, narrow and wide, their
distances and their thickness are the numbers of a law, with the bay's height and angle, since the
wave that comes over an obstacle meets low bays otherwise than high ones. What it takes away on one
side of the straight way alone, a wall that ends or becomes lower there, leaves more than the same
share on both. Without an obstacle nothing is taken away.

Of several rows, one behind the other, each counts by the fourth power of what it takes away, so
that the one that takes most stands for all; what the others take away is a number of its own.

Obstacles throw waves back on a bay, too, as fronts do. The law is of what they leave apart from
that: its factor is multiplied by those of echoes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.atlas.echoes import NUMBERS as ECHOES

WIDTHS: Final = (0.03, 0.2, 1.0, 4.0)
"""Differences of ways that make the bells, m/kg^(1/3).

The widest one meets what lies beside: the wave that runs into the gap behind a wall from its ends.
"""

_MIDDLE: Final = 1  # of the widths

_TOGETHER: Final = 0.3
"""Obstacles whose middles are nearer to each other than this along the normal of the bay's wall,
m/kg^(1/3), stand in one row."""

_LEAST: Final = 0.02  # m/kg^(1/3): distances and bells are at least so large
_REACH: Final = 5.0  # of a bell, in its widths
_NOTHING: Final = 1e-3  # share of a bell that is not worth a row
_HIGH: Final = (0.25, 1.7)
_BUILDING: Final = (0.5, 2.0)
"""Ends of the ranges of the blasts, for numbers that hardly change the factor beyond them."""

_OVER: Final = 1.4
"""Height over the straight way, m/kg^(1/3), that higher obstacles count as: they take more off."""

_CLOSE: Final = 0.4
"""Distance from a bay, m/kg^(1/3), within which the wave falls into the gap and is thrown back."""

_POWER: Final = 4
"""Of what a row takes away, for its weight among several."""

_BEFORE: Final = 0.04  # m/kg^(1/3) before a wall: what lies behind that does not shield it


@dataclass(frozen=True, eq=False)
class Row:
    """A row of obstacles, seen from several bays of a wall.

    Attributes:
        taken: Share of each bell that it takes away (bays, widths).
        sided: What it takes of the right half less what it takes of the left one (bays, widths).
        across: Share of the middle bell that it would take away if it were endlessly high (bays,).
        over: Height of its top over the straight way times that share, at most `_OVER` (bays,).
        from_charge: Distance from the charge, m/kg^(1/3) (bays,).
        from_bay: Distance from the bay (bays,).
        thickness: Way of the line of sight through it (bays,).
        members: The obstacles, by their indices.
    """

    taken: FloatArray
    sided: FloatArray
    across: FloatArray
    over: FloatArray
    from_charge: FloatArray
    from_bay: FloatArray
    thickness: FloatArray
    members: IntArray

    @property
    def gate(self) -> FloatArray:
        """How much of an obstacle it is, 0 for none (bays,)."""
        return np.asarray(self.taken.mean(axis=1))


def lies_before(bays: FloatArray, normal: FloatArray, boxes: FloatArray) -> BoolArray:
    """Return whether a part of each box lies before the wall of some bays (boxes,)."""
    out = np.maximum(boxes[:, [0, 1]] * normal[:2], boxes[:, [2, 3]] * normal[:2]).sum(axis=1)
    return np.asarray(out - float(bays[0] @ normal) > _BEFORE)


def rows_between(
    charge: FloatArray, bays: FloatArray, normal: FloatArray, boxes: FloatArray
) -> list[Row]:
    """Return the rows of obstacles between a charge and the bays of one wall.

    Args:
        charge: Place of the charge, m/kg^(1/3) (3,), or one for each bay (bays, 3).
        bays: Middles of the bays (bays, 3).
        normal: Outward normal of their wall (3,).
        boxes: Low x, y, high x, y, base and top of each obstacle (boxes, 6).
    """
    if not len(boxes) or not len(bays):
        return []
    before = np.flatnonzero(lies_before(bays, normal, boxes))
    if not len(before):
        return []
    own = boxes[before]
    corners = np.stack([own[:, [0, 1]], own[:, [2, 1]], own[:, [2, 3]], own[:, [0, 3]]])
    crossings = _Crossings.of(np.broadcast_to(charge, bays.shape), bays, own, corners)
    parts = _Parts.of(crossings, own)
    middle = 0.5 * (own[:, [0, 1]] + own[:, [2, 3]]) @ normal[:2]
    order = np.argsort(middle)
    starts = np.flatnonzero(np.diff(middle[order]) > _TOGETHER) + 1
    found = (parts.row(members, before[members]) for members in np.split(order, starts))
    return [row for row in found if row.taken.max() > _NOTHING]


class _Crossings(NamedTuple):
    """Where the straight ways from the charge to bays cross boxes, or pass them by (bays, boxes).

    Attributes:
        from_charge: Distance from the charge there.
        from_bay: Distance from the bay.
        thickness: Way through the box.
        left: Where the box begins across the way, in plan.
        right: Where it ends.
        line: Height of the way there.
        between: Whether that lies between the charge and the bay.
    """

    from_charge: FloatArray
    from_bay: FloatArray
    thickness: FloatArray
    left: FloatArray
    right: FloatArray
    line: FloatArray
    between: BoolArray

    @classmethod
    def of(
        cls, charge: FloatArray, bays: FloatArray, boxes: FloatArray, corners: FloatArray
    ) -> "_Crossings":
        # (1) Coordinates along the straight way in plan, s, and across it, e.
        plan = bays[:, :2] - charge[:, :2]
        length = np.maximum(np.linalg.norm(plan, axis=1), _LEAST)
        unit = plan / length[:, np.newaxis]
        # e = x . (-u_y, u_x), with x from the charge: one term for the corner, one for the charge.
        aside = np.stack([-unit[:, 1], unit[:, 0]], axis=1)
        flat = corners.reshape(-1, 2)
        shape = (len(bays), *corners.shape[:2])  # corners before boxes: sums over them are faster
        s = (unit @ flat.T - (unit * charge[:, :2]).sum(axis=1, keepdims=True)).reshape(shape)
        e = (aside @ flat.T - (aside * charge[:, :2]).sum(axis=1, keepdims=True)).reshape(shape)
        # (2) Where the way enters and leaves the box, or else its corner nearest to the way.
        at = charge[:, np.newaxis, :2]
        low, high = boxes[:, :2] - at, boxes[:, 2:4] - at  # (bays, boxes, 2)
        with np.errstate(divide="ignore", invalid="ignore"):
            first, last = low / unit[:, np.newaxis], high / unit[:, np.newaxis]
        inside = (low < 0.0) & (high > 0.0)  # for ways along an axis
        level = np.abs(unit)[:, np.newaxis] < 1e-9
        near = np.where(level, np.where(inside, -np.inf, np.inf), np.minimum(first, last))
        far = np.where(level, np.where(inside, np.inf, -np.inf), np.maximum(first, last))
        enter = np.maximum(near[..., 0], near[..., 1])
        leave = np.minimum(far[..., 0], far[..., 1])
        cuts = enter < leave
        whole = length[:, np.newaxis]
        enter, leave = np.clip(enter, 0.0, whole), np.clip(leave, 0.0, whole)
        nearest = np.take_along_axis(s, np.abs(e).argmin(axis=1)[:, np.newaxis], axis=1)[:, 0]
        along = np.where(cuts, 0.5 * (enter + leave), nearest)
        # (3) The same in space.
        slope = np.sqrt(1.0 + ((bays[:, 2] - charge[:, 2]) / length) ** 2)[:, np.newaxis]
        up = charge[:, 2, np.newaxis]
        share = np.clip(along / whole, 0.0, 1.0)
        return cls(
            np.maximum(along * slope, _LEAST),
            np.maximum((whole - along) * slope, _LEAST),
            np.where(cuts, leave - enter, 0.0),
            e.min(axis=1),
            e.max(axis=1),
            up + (bays[:, 2, np.newaxis] - up) * share,
            (along > 0.0) & (along < whole) & (~cuts | (leave > enter)),
        )


@dataclass(frozen=True, eq=False)
class _Parts:
    """What each obstacle takes of the bells of each bay (bays, boxes, ...)."""

    crossings: _Crossings
    taken: FloatArray
    sided: FloatArray
    across: FloatArray
    over: FloatArray

    @classmethod
    def of(cls, found: _Crossings, boxes: FloatArray) -> "_Parts":
        """Return the shares of the bells at the crossings; the ground mirrors the bells."""
        from scipy.special import ndtr  # takes a while to import

        zone = found.from_charge * found.from_bay / (found.from_charge + found.from_bay)
        # Only where the widest bell meets the box: most pairs are far aside, or not between.
        widest = _REACH * np.maximum(np.sqrt(WIDTHS[-1] * zone), _LEAST)
        pairs = np.nonzero(found.between & (found.left < widest) & (found.right > -widest))
        taken, sided = np.zeros((2, *zone.shape, len(WIDTHS)))
        endless, over = np.zeros((2, *zone.shape))
        low_up, high_up = boxes[pairs[1], 4], boxes[pairs[1], 5]
        left, right, line = (own[pairs] for own in (found.left, found.right, found.line))
        for k, width in enumerate(WIDTHS):
            bell = np.maximum(np.sqrt(width * zone[pairs]), _LEAST)
            ends = ndtr(right / bell), ndtr(left / bell)
            across = ends[0] - ends[1]
            on_right = np.maximum(ends[0], 0.5) - np.maximum(ends[1], 0.5)

            def below(height: FloatArray, bell: FloatArray = bell) -> FloatArray:
                mirrored = ndtr((height - line) / bell) + ndtr((height + line) / bell) - 1.0
                return np.asarray(np.maximum(mirrored, 0.0))

            base = below(low_up) if low_up.any() else np.zeros(len(low_up))
            up = below(high_up) - base
            taken[pairs[0], pairs[1], k] = across * up
            sided[pairs[0], pairs[1], k] = (2.0 * on_right - across) * up
            if k == _MIDDLE:
                endless[pairs] = across * (1.0 - base)
                over[pairs] = across * np.clip(high_up - line, 0.0, _OVER)
        return cls(found, taken, sided, endless, over)

    def row(self, members: IntArray, indices: IntArray) -> Row:
        """Return a row of some of the obstacles."""
        taken = self.taken[:, members]
        weight = taken[..., -1] + 1e-9
        weight = weight / weight.sum(axis=1, keepdims=True)

        def mean(values: FloatArray) -> FloatArray:
            return np.asarray((values[:, members] * weight).sum(axis=1))

        return Row(
            np.minimum(taken.sum(axis=1), 1.0),
            self.sided[:, members].sum(axis=1),
            np.minimum(self.across[:, members].sum(axis=1), 1.0),
            np.minimum(self.over[:, members].sum(axis=1), _OVER),
            mean(self.crossings.from_charge),
            mean(self.crossings.from_bay),
            mean(self.crossings.thickness),
            indices,
        )


def numbers_between(
    rows: Sequence[Row],
    charge: FloatArray,
    bays: FloatArray,
    normal: FloatArray,
    high: FloatArray,
    fronts: FloatArray,
) -> FloatArray:
    """Return the numbers of the law of all rows together (bays, numbers), see `NUMBERS`.

    Args:
        rows: The rows, at least one.
        charge: Place of the charge, m/kg^(1/3) (3,), or one for each bay (bays, 3).
        bays: Middles of the bays (bays, 3).
        normal: Outward normal of their wall (3,).
        high: Height of the building of each bay (bays,).
        fronts: Numbers of the echoes of all that stands before the wall (bays, echoes' numbers).
    """
    way = charge - bays
    cosine = way @ normal / np.maximum(np.linalg.norm(way, axis=1), _LEAST)
    weights = np.stack([row.gate for row in rows]) ** _POWER + 1e-30
    weights /= weights.sum(axis=0)

    def mean(values: Sequence[FloatArray]) -> FloatArray:
        return np.asarray(np.einsum("rb,rb...->b...", weights, np.stack(values)))

    taken = mean([row.taken for row in rows])
    others = np.minimum(np.sum([row.taken for row in rows], axis=0) - taken, 1.0)
    return np.column_stack(
        [
            taken,
            np.log(mean([row.from_charge for row in rows])),
            np.log(mean([row.from_bay for row in rows])),
            np.sqrt(mean([row.thickness for row in rows])),
            np.broadcast_to(charge[..., 2], len(taken)),
            cosine,
            np.clip(bays[:, 2], *_HIGH),
            np.clip(high, *_BUILDING),
            mean([row.across for row in rows]),
            fronts[:, ECHOES.index("near_beside")],
            mean([row.over for row in rows]),
            np.exp(-mean([row.from_bay for row in rows]) / _CLOSE),
            np.abs(mean([row.sided for row in rows])[:, _MIDDLE:]),
            others[:, _MIDDLE:],
        ]
    )


NUMBERS: Final[Sequence[str]] = (
    *(f"taken_{width:g}" for width in WIDTHS),
    "ln_from_charge",
    "ln_from_bay",
    "root_thickness",
    "charge_height",
    "cosine",
    "bay_height",
    "building_height",
    "across",
    "near_beside",
    "over",
    "close",
    *(f"sided_{width:g}" for width in WIDTHS[_MIDDLE:]),
    *(f"others_{width:g}" for width in WIDTHS[_MIDDLE:]),
)
"""Names of the columns of `numbers_between`."""
