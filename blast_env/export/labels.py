"""Where the names of a drawing stand, so that none covers another.

Structures and pieces have their names inside them. Everything else has a letter beside it, which
the notes explain: reasons are whole sentences, and many sites have no room for those.
"""

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from blast_env.export.plan import Feature, FeatureKind, LayoutPlan, PlaceM
from blast_env.geometry import Rectangle
from blast_env.units import MODULE_SIDE_M

_NAMED_INSIDE: Final = (FeatureKind.STRUCTURE, FeatureKind.PROTECTED_STRUCTURE)
_UNNAMED: Final = (FeatureKind.SITE, FeatureKind.BARRIER)  # the notes have the site's name
_STEPS: Final = 12  # places that are tried along a line
_SIGN_WIDTH: Final = 0.75  # in heights; of most typefaces that programs take for drawings
_OFF_LINE: Final = 0.9  # from a line to the middle of a letter, in heights of the text


@dataclass(frozen=True)
class Label:
    """A text on the drawing.

    Attributes:
        text: The text.
        feature: What it belongs to.
        centre_m: Its middle.
        height_m: Height of the letters.
        upright: Whether it is turned by 90 degrees.
    """

    text: str
    feature: Feature
    centre_m: PlaceM
    height_m: float
    upright: bool = False

    @property
    def box_m(self) -> Rectangle:
        """The rectangle that it takes."""
        long, short = _SIGN_WIDTH * len(self.text) * self.height_m, self.height_m
        width, height = (short, long) if self.upright else (long, short)
        x, y = self.centre_m
        return Rectangle(x - width / 2.0, y - height / 2.0, x + width / 2.0, y + height / 2.0)


def key_of(plan: LayoutPlan) -> dict[str, str]:
    """Return the letter of each name that the notes explain; the same name has the same letter."""
    names = dict.fromkeys(_name(each) for each in plan.features if _has_letter(each))
    return {name: _letter(number) for number, name in enumerate(names)}


def labels_of(plan: LayoutPlan, height_m: float) -> tuple[Label, ...]:
    """Return all texts on the site.

    Args:
        plan: What is drawn.
        height_m: Height of the letters; names inside things are smaller where they must.
    """
    inside = [_label_inside(each, height_m) for each in plan.features if _text_inside(each)]
    modules = [_outline(each) for each in plan.features if each.kind is FeatureKind.BARRIER]
    taken = [label.box_m for label in inside] + modules
    key = key_of(plan)
    letters = []
    for feature in filter(_has_letter, plan.features):
        text = key[_name(feature)]
        tries = [Label(text, feature, place, height_m) for place in _places(feature, height_m)]
        free = (each for each in tries if not any(each.box_m.overlaps(box) for box in taken))
        label = next(free, tries[0])
        taken.append(label.box_m)
        letters.append(label)
    return (*inside, *letters)


def _letter(number: int) -> str:
    """Return A to Z, then AA, AB and so on."""
    before, last = divmod(number, 26)
    return (_letter(before - 1) if before else "") + chr(ord("A") + last)


def _name(feature: Feature) -> str:
    return " ".join(feature.name.split())  # a line break would end a text


def _has_letter(feature: Feature) -> bool:
    return feature.kind not in _NAMED_INSIDE + _UNNAMED


def _text_inside(feature: Feature) -> str:
    """Return what is written inside a structure or a piece; nothing in a module."""
    if feature.kind in _NAMED_INSIDE:
        return _name(feature)
    if "item" in feature.properties:
        return f"{feature.properties['item']} {feature.properties['height_m']:g} m"
    return ""


def _outline(feature: Feature) -> Rectangle:
    return Rectangle(*feature.places_m[0], *feature.places_m[2])


def _label_inside(feature: Feature, height_m: float) -> Label:
    """Return a text along the middle, as high as there is room for."""
    text, outline = _text_inside(feature), _outline(feature)
    width_m, depth_m = outline.right - outline.left, outline.top - outline.bottom
    signs = _SIGN_WIDTH * len(text)
    upright = depth_m > width_m and signs * height_m > width_m
    long_m, short_m = (depth_m, width_m) if upright else (width_m, depth_m)
    piece_m = MODULE_SIDE_M / 2.0 if feature.kind is FeatureKind.BARRIER else height_m
    fitting_m = min(height_m, piece_m, 0.6 * short_m, 0.95 * long_m / signs)
    return Label(text, feature, outline.centre, fitting_m, upright)


def _places(feature: Feature, height_m: float) -> list[PlaceM]:
    """Return where a letter may stand, the best place first."""
    off_m = _OFF_LINE * height_m
    if len(feature.places_m) == 4:
        return list(_places_of_area(_outline(feature), off_m))
    if len(feature.places_m) == 2:
        return list(_places_along(*feature.places_m, off_m))
    (x, y), gap_m = feature.places_m[0], off_m + MODULE_SIDE_M
    around = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1))
    return [(x + right * gap_m, y + up * gap_m) for right, up in around]


def _places_of_area(outline: Rectangle, off_m: float) -> Iterator[PlaceM]:
    """Yield places along the sides, inside first; from the lower left corner on."""
    width_m, depth_m = outline.right - outline.left, outline.top - outline.bottom
    inside = min(width_m, depth_m) > 2.0 * off_m
    for ring in (outline.grown(-off_m),) * inside + (outline.grown(off_m),):
        shares = np.linspace(0.0, 1.0, _STEPS)
        for y in (ring.bottom, ring.top):
            for share in shares:
                yield ring.left + share * (ring.right - ring.left), y
        for x in (ring.left, ring.right):
            for share in shares:
                yield x, ring.bottom + share * (ring.top - ring.bottom)


def _places_along(start: PlaceM, end: PlaceM, off_m: float) -> Iterator[PlaceM]:
    """Yield places on either side of a line."""
    along = np.array(end) - np.array(start)
    across = off_m * np.array((-along[1], along[0])) / np.hypot(*along)
    for share in np.linspace(0.0, 1.0, _STEPS):
        for side in (across, -across):
            x, y = np.array(start) + share * along + side
            yield float(x), float(y)


def wrapped(lines: Sequence[str], characters: int) -> list[str]:
    """Return lines that have at most so many characters, broken between words."""
    return [part for line in lines for part in textwrap.wrap(line, characters)]
