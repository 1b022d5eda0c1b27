"""Fronts that throw a wave back on a bay, as dimensionless numbers.

A wall that faces both the charge and the bay has an image of the charge behind it. The image counts
by the share of its zone (a bell around the way, as between obstacles) that meets the wall, by its
distance and by its angle of incidence on the bay, both relative to those of the charge. Walls that
face the bay's own wall are opposite it, those at a right angle to it are beside it, on its left or
on its right; one at another angle is so by the squares of its sine and cosine. A wave that goes to
and fro between walls has its first images as a measure.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray, IntArray

WIDTH: Final = 0.2
"""Difference of ways that makes the bell, m/kg^(1/3)."""

_EXPONENT: Final = 1.1  # of the distance: reflected impulses fall by it
_SLANT: Final = 0.35  # side-on over reflected impulse, about
_LEAST: Final = 0.02
_CLEAR: Final = 1e-6
_RIGHT: Final = 0.5 * np.pi
_DIGITS: Final = 9  # of an angle, rad

NUMBERS: Final[Sequence[str]] = (
    "opposite",
    "beside",
    "both_sides",
    "near_opposite",
    "near_beside",
    "ln_distance",
    "cosine",
    "bay_height",
    "charge_height",
    "building_height",
)
"""Names of the columns of `numbers_of_echoes`."""


_OPPOSITE: Final = [NUMBERS.index(name) for name in ("opposite", "near_opposite")]


@dataclass(frozen=True, eq=False)
class _Faces:
    """Walls of boxes: a point on each, its normal, its ends along it, and its height."""

    at: FloatArray
    axis: FloatArray
    outward: FloatArray
    low: FloatArray
    high: FloatArray
    base: FloatArray
    top: FloatArray

    @classmethod
    def of(cls, boxes: FloatArray) -> "_Faces":
        count = len(boxes)
        parts = [(0, 0, -1.0), (0, 2, 1.0), (1, 1, -1.0), (1, 3, 1.0)]
        return cls(
            at=np.concatenate([boxes[:, column] for _, column, _ in parts]),
            axis=np.repeat([axis for axis, *_ in parts], count),
            outward=np.repeat([side for *_, side in parts], count),
            low=np.concatenate([boxes[:, 1 - axis] for axis, *_ in parts]),
            high=np.concatenate([boxes[:, 3 - axis] for axis, *_ in parts]),
            base=np.tile(boxes[:, 4], 4),
            top=np.tile(boxes[:, 5], 4),
        )

    @classmethod
    def of_walls(cls, walls: FloatArray, turn: float) -> "_Faces":
        """Return upright walls that lie along an axis of a turned frame; see `in_frame`."""
        start, end = in_frame(walls[:, :2], turn), in_frame(walls[:, 2:4], turn)
        normal = in_frame(walls[:, 4:6], turn)
        axis, every = np.abs(normal).argmax(axis=1), np.arange(len(walls))
        ends = np.stack([start[every, 1 - axis], end[every, 1 - axis]])
        return cls(
            at=0.5 * (start + end)[every, axis],
            axis=axis,
            outward=np.sign(normal[every, axis]),
            low=ends.min(axis=0),
            high=ends.max(axis=0),
            base=walls[:, 6],
            top=walls[:, 7],
        )

    def towards(self, charge: FloatArray, bays: FloatArray, normal: FloatArray) -> "_Faces":
        """Return those that face a charge and a bay, and not the way of the bays' wall."""
        facing = self.outward * normal[self.axis] < 0.5
        for places in (charge, bays):
            ends = np.where(self.outward > 0.0, places.max(0)[self.axis], places.min(0)[self.axis])
            facing &= self.outward * (ends - self.at) > _CLEAR
        return _Faces(*(getattr(self, own.name)[facing] for own in fields(self)))


def _reflected(
    faces: _Faces, charge: FloatArray, bays: FloatArray
) -> tuple[tuple[IntArray, IntArray], FloatArray, FloatArray, FloatArray]:
    """Return the ways from bays to the images of the charge behind walls, and how much they meet.

    Args:
        faces: The walls.
        charge: Place of the charge for each bay, m/kg^(1/3) (bays, 3).
        bays: Middles of the bays (bays, 3).

    Returns:
        Of the pairs of a bay and a wall that faces it and the charge: the bays and walls, the ways
        (pairs, 3), their lengths (pairs,), and the share of the bell that meets the wall (pairs,).
    """
    from scipy.special import ndtr  # takes a while to import

    # (1) Walls that face the charge, and bays before them.
    before_charge = faces.outward * (charge[:, faces.axis] - faces.at)
    before_bay = faces.outward * (bays[:, faces.axis] - faces.at)
    bay, wall = np.nonzero((before_charge > _CLEAR) & (before_bay > _CLEAR))
    # (2) The image, where its way crosses the wall, and the share of the bell on the wall.
    pairs, axis = np.arange(len(bay)), faces.axis[wall]
    image = charge[bay]
    image[pairs, axis] = 2.0 * faces.at[wall] - image[pairs, axis]
    ways = image - bays[bay]
    longer = np.linalg.norm(ways, axis=1)
    first = before_charge[bay, wall]
    total = np.maximum(first + before_bay[bay, wall], _LEAST)
    share = np.clip(first / total, 0.0, 1.0)
    crossing = image - ways * share[:, np.newaxis]
    d1, d2 = share * longer, (1.0 - share) * longer
    bell = np.maximum(np.sqrt(WIDTH * d1 * d2 / np.maximum(longer, _LEAST)), _LEAST)
    slant = np.maximum(total / np.maximum(longer, _LEAST), 0.1) / bell
    along, up = crossing[pairs, 1 - axis], crossing[:, 2]
    wide = ndtr((faces.high[wall] - along) * slant) - ndtr((faces.low[wall] - along) * slant)

    def below(height: FloatArray) -> FloatArray:
        return np.asarray(ndtr((height - up) / bell) + ndtr((height + up) / bell) - 1.0)

    met = wide * np.maximum(below(faces.top[wall]) - below(faces.base[wall]), 0.0)
    return (bay, wall), ways, longer, met


def fronts_among(everything: FloatArray, buildings: FloatArray) -> FloatArray:
    """Return the numbers of the echoes that count apart from rows (bays, numbers).

    Pieces throw the wave back from behind the charge as buildings do. Those beside the way hide
    each other: what they throw back is part of the law of rows.

    Args:
        everything: Numbers of the echoes of all boxes (bays, numbers).
        buildings: Those of the buildings alone.
    """
    found = buildings.copy()
    found[:, _OPPOSITE] = everything[:, _OPPOSITE]
    return found


def in_frame(places: FloatArray, turn: float) -> FloatArray:
    """Return places (n, 2) or (n, 3) in a frame turned counterclockwise by an angle, rad."""
    found = places.copy()
    sine, cosine = np.sin(turn), np.cos(turn)
    found[..., 0] = cosine * places[..., 0] + sine * places[..., 1]
    found[..., 1] = cosine * places[..., 1] - sine * places[..., 0]
    return found


def _frames(boxes: FloatArray, walls: FloatArray | None) -> Iterator[tuple[float, _Faces]]:
    """Yield the faces along the axes of each frame, and its angle, rad.

    Walls at an angle are along the axes of a frame of their own.
    """
    if len(boxes):
        yield 0.0, _Faces.of(boxes)
    if walls is not None and len(walls):
        turns = (np.arctan2(walls[:, 5], walls[:, 4]) % _RIGHT).round(_DIGITS) % _RIGHT
        for turn in np.unique(turns).tolist():
            yield turn, _Faces.of_walls(walls[turns == turn], turn)


def _weights(
    faces: _Faces,
    charge: FloatArray,
    bays: FloatArray,
    normal: FloatArray,
    distance: FloatArray,
    cosine: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the weights of echoes, and how soon they follow the direct wave (bays, faces).

    Args:
        faces: The faces that reflect.
        charge: See `numbers_of_echoes`, in the frame of the faces; so are the next two.
        bays: The same.
        normal: The same.
        distance: Distance of each bay from the charge (bays,).
        cosine: Cosine of the incidence of the direct wave (bays,).
    """
    (bay, wall), ways, longer, met = _reflected(faces, charge, bays)
    # (3) The weight of an echo by distance and incidence, relative to the charge itself.
    own = np.maximum(ways @ normal / np.maximum(longer, _LEAST), 0.0)
    incidence = (_SLANT + (1.0 - _SLANT) * own**2) / (
        _SLANT + (1.0 - _SLANT) * np.maximum(cosine[bay], 0.0) ** 2
    )
    later = np.maximum(longer - distance[bay], _LEAST)
    weight, closeness = np.zeros((2, len(bays), len(faces.at)))
    weight[bay, wall] = met * incidence * (distance[bay] / longer) ** _EXPONENT
    closeness[bay, wall] = met * np.log1p(distance[bay] / later)
    return weight, closeness


def numbers_of_echoes(
    charge: FloatArray,
    bays: FloatArray,
    normal: FloatArray,
    boxes: FloatArray,
    high: FloatArray,
    walls: FloatArray | None = None,
) -> FloatArray:
    """Return the numbers of the law of echoes (bays, numbers), see `NUMBERS`.

    Args:
        charge: Place of the charge, m/kg^(1/3) (3,), or one for each bay (bays, 3).
        bays: Middles of the bays (bays, 3).
        normal: Outward normal of their wall (3,).
        boxes: Low x, y, high x, y, base and top of each box (boxes, 6).
        high: Height of the building of each bay (bays,).
        walls: Start x, y, end x, y, outward normal x, y, base and top of walls at any angle
            (walls, 8).
    """
    charge = np.broadcast_to(charge, bays.shape)
    way = charge - bays
    distance = np.maximum(np.linalg.norm(way, axis=1), _LEAST)
    cosine = way @ normal / distance
    sums, near = np.zeros((2, len(bays), 3))
    for turn, every in _frames(boxes, walls):
        own_charge, own_bays, own_normal = charge, bays, normal
        if turn:
            own_charge, own_bays = in_frame(charge, turn), in_frame(bays, turn)
            own_normal = in_frame(normal, turn)
        faces = every.towards(own_charge, own_bays, own_normal)
        weight, closeness = _weights(faces, own_charge, own_bays, own_normal, distance, cosine)
        # (4) Opposite, left and right of the bay's wall.
        outward = np.zeros((len(faces.at), 2))
        outward[np.arange(len(faces.at)), faces.axis] = faces.outward
        facing = outward @ own_normal[:2]
        turned = outward @ np.array([-own_normal[1], own_normal[0]])
        for k, part in enumerate((-facing, turned, -turned)):
            share = np.maximum(part, 0.0) ** 2
            sums[:, k] += (weight * share).sum(axis=1)
            near[:, k] += (closeness * share).sum(axis=1)
    return np.column_stack(
        [
            sums[:, 0],
            sums[:, 1] + sums[:, 2],
            sums[:, 1] * sums[:, 2],
            near[:, 0],
            near[:, 1] + near[:, 2],
            np.log(distance),
            cosine,
            bays[:, 2],
            charge[:, 2],
            high,
        ]
    )
