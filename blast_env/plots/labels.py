"""Labels of a picture, and their placement without overlap.

Positions are in any units, y upwards: metres of a drawing, pixels of a frame.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import cos, hypot, inf, pi, sin, sqrt
from typing import Final

from blast_env.geometry import Rectangle
from blast_env.plots.plan import Feature, FeatureKind, Kinds

Point = tuple[float, float]
_NOTHING: Final = 1e-6  # share of an area that rounding may cover


@dataclass(frozen=True)
class Label:
    """A text of a picture.

    Attributes:
        text: The text, of one or more lines.
        feature: The labelled feature.
    """

    text: str
    feature: Feature


def labels_of(features: Iterable[Feature]) -> tuple[Label, ...]:
    """Return the labels of features, in the order of the features.

    Features of one kind and one bounding box share a label, with a line per distinct text.
    """
    shared: dict[tuple[FeatureKind, Rectangle], list[Feature]] = {}
    for feature in features:
        if feature.label:
            shared.setdefault((feature.kind, feature.bounds_m), []).append(feature)
    return tuple(
        Label("\n".join(dict.fromkeys(item.label for item in group)), group[0])
        for group in shared.values()
    )


@dataclass(frozen=True)
class LabelPlacement:
    """A label and its position.

    Attributes:
        place: Rectangle of its text.
        leader: A line from its feature to the text, if the two are far apart.
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
) -> list[LabelPlacement]:
    """Place each label as near to its feature as occupied space allows.

    If there is no free position, a label takes the one that covers least.

    Args:
        features: The features on the site; labels avoid structures, barriers and signs.
        labels: The labels, the most important first.
        sizes: Width and height of each label.
        box: Returns the rectangle of a feature in the picture.
        room: Returns the rectangle inside a feature that its label may use, or None.
        gap: Distance between a label and its feature.
        far: Distance beyond which a label has a leader.
        others: Further rectangles to avoid.

    Returns:
        The labels in the given order.
    """
    solid = [
        box(feature)
        for feature in features
        if feature.kind.level >= Kinds.STRUCTURE.level or len(feature.places_m) == 1
    ]
    taken, found = [*solid, *others], list[LabelPlacement]()
    for label, size in zip(labels, sizes, strict=True):
        own, inside = box(label.feature), room(label.feature)
        free_of = [index for index in taken if index != own] + [item.place for item in found]
        tried = [(place, [*free_of, own]) for place in _places_around(own, size, gap)]
        middle = None if inside is None else _centred(inside.centre, size)
        if middle is not None and inside is not None and inside.contains(middle):
            tried.insert(0, (middle, free_of))
        place = best_place(tried, within)
        found.append(LabelPlacement(label, place, _leader(own, place, far)))
    return found


_RINGS: Final = 12  # around a feature, each farther off by half the height of the text
_DIRECTIONS: Final = 24


def _leader(own: Rectangle, place: Rectangle, far: float) -> tuple[Point, Point] | None:
    """Return a line from a feature to its text, if it is longer than `far`."""
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
    """Return the first rectangle that covers nothing, or else the one that covers least.

    Args:
        places: The candidates, the best first, each with the rectangles to avoid.
        within: Rectangle for the result; area outside of it counts as covering.
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
    """Yield positions around a feature, nearer ones first: above, below, beside, then in rings."""
    (x, y), (width, height) = own.centre, size
    across = (own.right - own.left + width) / 2.0 + gap
    along = (own.top - own.bottom + height) / 2.0 + gap
    for dx, dy in ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (-1, 1), (1, -1), (-1, -1)):
        yield _centred((x + dx * across, y + dy * along), size)
    for ring in range(_RINGS):
        for step in range(_DIRECTIONS):
            angle = 2.0 * pi * step / _DIRECTIONS
            # Along a rectangle, so that texts slide along the sides of their feature.
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
