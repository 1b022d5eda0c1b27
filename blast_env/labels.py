"""Texts of a picture, and where they stand so that none covers another.

Places are in any units, y upwards: metres of a drawing, pixels of a frame.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import cos, hypot, inf, pi, sin, sqrt
from typing import Final

from blast_env.geometry import Rectangle
from blast_env.plan import Feature, FeatureKind, Kinds

Point = tuple[float, float]
_NOTHING: Final = 1e-6  # of a place: what may be covered by rounding


@dataclass(frozen=True)
class Label:
    """A text of a picture.

    Attributes:
        text: The text, perhaps in lines.
        feature: What it belongs to.
    """

    text: str
    feature: Feature


def labels_of(features: Iterable[Feature]) -> tuple[Label, ...]:
    """Return the texts of features, those of the lowest first.

    Things of a kind in one place share a text, in lines; what they have in common is there once.
    """
    shared: dict[tuple[FeatureKind, Rectangle], list[Feature]] = {}
    for feature in features:
        if feature.label:
            shared.setdefault((feature.kind, feature.bounds_m), []).append(feature)
    return tuple(
        Label("\n".join(dict.fromkeys(each.label for each in group)), group[0])
        for group in shared.values()
    )


@dataclass(frozen=True)
class Settled:
    """A label where it stands.

    Attributes:
        label: The label.
        place: What its text fills.
        leader: A line from what it belongs to, where that is far off.
    """

    label: Label
    place: Rectangle
    leader: tuple[Point, Point] | None


def settled_labels(
    features: Sequence[Feature],
    labels: Sequence[Label],
    sizes: Sequence[tuple[float, float]],
    box: Callable[[Feature], Rectangle],
    room: Callable[[Feature], Rectangle | None],
    within: Rectangle,
    gap: float,
    far: float,
    others: Iterable[Rectangle] = (),
) -> list[Settled]:
    """Return where labels stand, each as near to its own as the others and what is taken let it.

    Where nothing is free, it is the place that covers least.

    Args:
        features: What is on the site; no label covers what stands, and signs.
        labels: The labels, the most important first.
        sizes: Width and height of each label.
        box: Gives what a feature takes in the picture.
        room: Gives where inside of a feature its label may stand, if anywhere.
        within: Where all are to be.
        gap: Between a label and its own.
        far: From where on a label has a leader.
        others: What else should not be covered.
    """
    solid = [
        box(each)
        for each in features
        if each.kind.level >= Kinds.STRUCTURE.level or len(each.places_m) == 1
    ]
    taken, found = [*solid, *others], list[Settled]()
    for label, size in zip(labels, sizes, strict=True):
        own, inside = box(label.feature), room(label.feature)
        free_of = [each for each in taken if each != own] + [each.place for each in found]
        tried = [(each, [*free_of, own]) for each in _places_around(own, size, gap)]
        middle = None if inside is None else _centred(inside.centre, size)
        if middle is not None and inside is not None and inside.contains(middle):
            tried.insert(0, (middle, free_of))
        place = best_place(tried, within)
        found.append(Settled(label, place, _leader(own, place, far)))
    return found


_RINGS: Final = 12  # around a thing, each half a text higher than the one before
_DIRECTIONS: Final = 24


def _leader(own: Rectangle, place: Rectangle, far: float) -> tuple[Point, Point] | None:
    """Return the shortest line from a thing to its text, if that is far off."""
    ends = [
        (
            min(max(other.centre[0], box.left), box.right),
            min(max(other.centre[1], box.bottom), box.top),
        )
        for box, other in ((own, place), (place, own))
    ]
    (x0, y0), (x1, y1) = ends
    return ((x0, y0), (x1, y1)) if hypot(x1 - x0, y1 - y0) > far else None


def best_place(
    places: Iterable[tuple[Rectangle, Sequence[Rectangle]]], within: Rectangle
) -> Rectangle:
    """Return the first place that covers nothing, or else the one that covers least.

    Args:
        places: The places, each with what it should not cover, the best one first.
        within: Where it is to be.
    """
    best, least = None, inf
    for place, taken in places:
        outside = _area(place) - _common_area(place, within)
        covered = outside + sum(_common_area(place, box) for box in taken)
        if best is None or covered < least:
            best, least = place, covered
        if covered <= _NOTHING * _area(place):
            return place
    assert best is not None
    return best


def _places_around(own: Rectangle, size: tuple[float, float], gap: float) -> Iterator[Rectangle]:
    """Yield places beside a thing, nearer ones first: above, below, beside, then all around."""
    (x, y), (width, height) = own.centre, size
    across = (own.right - own.left + width) / 2.0 + gap
    along = (own.top - own.bottom + height) / 2.0 + gap
    for dx, dy in ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (-1, 1), (1, -1), (-1, -1)):
        yield _centred((x + dx * across, y + dy * along), size)
    for ring in range(_RINGS):
        for step in range(_DIRECTIONS):
            angle = 2.0 * pi * step / _DIRECTIONS
            # Along a rectangle, so that texts slide along the sides of their own.
            right, up = (min(max(sqrt(2.0) * part, -1.0), 1.0) for part in (sin(angle), cos(angle)))
            off = 0.5 * ring * height
            yield _centred((x + right * (across + off), y + up * (along + off)), size)


def _centred(place: tuple[float, float], size: tuple[float, float]) -> Rectangle:
    (x, y), (width, height) = place, size
    return Rectangle(x - width / 2.0, y - height / 2.0, x + width / 2.0, y + height / 2.0)


def _area(box: Rectangle) -> float:
    return (box.right - box.left) * (box.top - box.bottom)


def _common_area(first: Rectangle, second: Rectangle) -> float:
    width = min(first.right, second.right) - max(first.left, second.left)
    height = min(first.top, second.top) - max(first.bottom, second.bottom)
    return max(width, 0.0) * max(height, 0.0)
