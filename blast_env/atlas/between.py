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

_CORNER: Final = 0.5
"""Distance of a wall beside a bay, m/kg^(1/3), from which waves come back into the corner."""

_CROWD: Final = 3.0  # most that buildings or pieces around a bay count
_CORNERS: Final = 2.0  # most that walls beside a bay count

_POWER: Final = 4
"""Of what a row takes away, for its weight among several."""

_ECHOES: Final = ("opposite", "beside", "both_sides", "near_opposite", "near_beside")
"""Numbers of echoes that are also numbers of this law: waves come round an obstacle by them."""

_PIECES: Final = ("beside", "near_beside")
"""Those of pieces beside the way."""

_OF_PIECES: Final = [ECHOES.index(name) for name in _PIECES]

_OF_ECHOES: Final = [ECHOES.index(name) for name in _ECHOES]

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


def around_of(
    bays: FloatArray,
    normal: FloatArray,
    boxes: FloatArray,
    buildings: BoolArray,
    pieces: BoolArray,
) -> FloatArray:
    """Return how much bays of a wall lie in a corner and in a crowd (bays, 3).

    Args:
        bays: Middles of the bays of one wall (bays, 3).
        normal: Its outward normal (3,).
        boxes: Low x, y, high x, y, base and top of each box (boxes, 6).
        buildings: Whether each box is another building than that of a bay (bays, boxes) or
            (boxes,).
        pieces: Whether it is a piece, likewise.
    """
    corners = corners_of(bays, normal, boxes)
    return np.column_stack([corners, crowd_of(bays, boxes, buildings, pieces)])


def corners_of(bays: FloatArray, normal: FloatArray, boxes: FloatArray) -> FloatArray:
    """Return how much each bay lies in a corner: walls close beside it, on any side of the charge.

    A wave that comes round an obstacle is thrown back in the corner behind it.

    Args:
        bays: Middles of the bays of one wall (bays, 3).
        normal: Its outward normal (3,).
        boxes: Low x, y, high x, y, base and top of each obstacle (boxes, 6).
    """
    own = boxes[lies_before(bays, normal, boxes)]
    ends = []
    for axis in (normal[:2], np.array([-normal[1], normal[0]])):
        first, last = own[:, :2] * axis, own[:, 2:4] * axis
        ends += [np.minimum(first, last).sum(axis=1), np.maximum(first, last).sum(axis=1)]
    near, far, left, right = ends
    plane, across = float(bays[0] @ normal), bays[:, :2] @ np.array([-normal[1], normal[0]])
    before = np.maximum(near - plane, 0.0)
    deep = 1.0 - np.exp(-(far - plane - before) / _CORNER)
    aside = np.maximum(left - across[:, np.newaxis], across[:, np.newaxis] - right)
    covered = np.clip((own[:, 5] - own[:, 4]) / (bays[:, 2, np.newaxis] + _CORNER), 0.0, 1.0)
    close = np.where(aside > 0.0, np.exp(-(aside + before) / _CORNER), 0.0)
    return np.asarray(np.minimum((deep * covered * close).sum(axis=1), _CORNERS))


def crowd_of(
    bays: FloatArray, boxes: FloatArray, buildings: BoolArray, pieces: BoolArray
) -> FloatArray:
    """Return how much of what a bay sees all round is filled by buildings, and by pieces (bays, 2).

    Waves go to and fro between them: rows leave more there, and less surely.

    Args:
        bays: Middles of the bays (bays, 3).
        boxes: Low x, y, high x, y, base and top of each box (boxes, 6).
        buildings: See `around_of`.
        pieces: See `around_of`.
    """
    at = bays[:, np.newaxis, :2]
    away = np.linalg.norm(at - np.clip(at, boxes[:, :2], boxes[:, 2:4]), axis=2)
    size = np.linalg.norm(boxes[:, 2:4] - boxes[:, :2], axis=1)
    high = boxes[:, 5] - boxes[:, 4]
    filled = size / (size + 2.0 * away + _LEAST) * high / (high + 0.5 * away + _LEAST)
    whole = [np.where(own, filled, 0.0).sum(axis=1) for own in (buildings, pieces)]
    return np.asarray(np.minimum(np.stack(whole, axis=1), _CROWD))


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
    middle = 0.5 * (own[:, [0, 1]] + own[:, [2, 3]]) @ normal[:2]
    order = np.argsort(middle)
    starts = np.flatnonzero(np.diff(middle[order]) > _TOGETHER) + 1
    rows = np.split(order, starts)
    parts = _Parts.of(crossings, own, rows)
    found = (parts.row(members, before[members]) for members in rows)
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

    def free_from(self, zone: FloatArray, rows: Sequence[IntArray]) -> FloatArray:
        """Return where each box begins to take what those on its left in its row leave.

        Args:
            zone: Square of the width of the bell at each crossing, for a width of 1.
            rows: The boxes of each row.
        """
        begin, unit = self.left.copy(), np.sqrt(zone)
        for members in (own for own in rows if len(own) > 1):
            left, right = (own[:, members] / unit[:, members] for own in (self.left, self.right))
            right = np.where(self.between[:, members], right, -np.inf)
            order = np.argsort(left, axis=1)
            reach = np.maximum.accumulate(np.take_along_axis(right, order, axis=1), axis=1)
            before = np.full_like(left, -np.inf)
            np.put_along_axis(before, order[:, 1:], reach[:, :-1], axis=1)
            begin[:, members] = np.clip(before, left, np.maximum(right, left)) * unit[:, members]
        return begin

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
    wide: FloatArray
    free: FloatArray

    @classmethod
    def of(cls, found: _Crossings, boxes: FloatArray, rows: Sequence[IntArray]) -> "_Parts":
        """Return the shares of the bells at the crossings; the ground mirrors the bells."""
        from scipy.special import ndtr  # takes a while to import

        zone = found.from_charge * found.from_bay / (found.from_charge + found.from_bay)
        # Only where the widest bell meets the box: most pairs are far aside, or not between.
        widest = _REACH * np.maximum(np.sqrt(WIDTHS[-1] * zone), _LEAST)
        pairs = np.nonzero(found.between & (found.left < widest) & (found.right > -widest))
        taken, sided, wide, free = np.zeros((4, *zone.shape, len(WIDTHS)))
        endless, over = np.zeros((2, *zone.shape))
        low_up, high_up = boxes[pairs[1], 4], boxes[pairs[1], 5]
        left, right, line = (own[pairs] for own in (found.left, found.right, found.line))
        begin = found.free_from(zone, rows)[pairs]
        overlap = np.flatnonzero(begin > left)
        for k, width in enumerate(WIDTHS):
            bell = np.maximum(np.sqrt(width * zone[pairs]), _LEAST)
            ends = ndtr(right / bell), ndtr(left / bell)
            across = ends[0] - ends[1]
            alone = across.copy()
            alone[overlap] = ends[0][overlap] - ndtr(begin[overlap] / bell[overlap])
            wide[pairs[0], pairs[1], k], free[pairs[0], pairs[1], k] = across, alone
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
        return cls(found, taken, sided, endless, over, wide, free)

    def row(self, members: IntArray, indices: IntArray) -> Row:
        """Return a row of some of the obstacles; those behind others count less."""
        taken = self.taken[:, members]
        wide, free = (own[:, members].sum(axis=1) for own in (self.wide, self.free))
        share = np.where(wide > 0.0, free / np.maximum(wide, 1e-30), 1.0)
        middle = share[:, _MIDDLE]
        weight = taken[..., -1] + 1e-9
        weight = weight / weight.sum(axis=1, keepdims=True)

        def mean(values: FloatArray) -> FloatArray:
            return np.asarray((values[:, members] * weight).sum(axis=1))

        return Row(
            np.minimum(np.maximum(taken.sum(axis=1) * share, taken.max(axis=1)), 1.0),
            self.sided[:, members].sum(axis=1) * share,
            np.minimum(self.across[:, members].sum(axis=1) * middle, 1.0),
            np.minimum(self.over[:, members].sum(axis=1) * middle, _OVER),
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
    everything: FloatArray,
    around: FloatArray,
) -> FloatArray:
    """Return the numbers of the law of all rows together (bays, numbers), see `NUMBERS`.

    Args:
        rows: The rows, at least one.
        charge: Place of the charge, m/kg^(1/3) (3,), or one for each bay (bays, 3).
        bays: Middles of the bays (bays, 3).
        normal: Outward normal of their wall (3,).
        high: Height of the building of each bay (bays,).
        fronts: Numbers of the echoes that count apart from rows (bays, echoes' numbers).
        everything: Those of all that stands before the wall.
        around: How much each bay lies in a corner and in a crowd, see `around_of` (bays, 3).
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
            fronts[:, _OF_ECHOES],
            np.maximum(everything - fronts, 0.0)[:, _OF_PIECES],
            around,
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
    *_ECHOES,
    *(f"{name}_of_pieces" for name in _PIECES),
    *("corners", "buildings_around", "pieces_around"),
    "over",
    "close",
    *(f"sided_{width:g}" for width in WIDTHS[_MIDDLE:]),
    *(f"others_{width:g}" for width in WIDTHS[_MIDDLE:]),
)
"""Names of the columns of `numbers_between`."""
