"""Scenes of facades among other buildings, with many pieces between: as sites have them.

A yard has some of these: a front behind the charge, wings that reach forward from the ends of the
facade, neighbours in its line, a house anywhere, and pieces: a row with gaps, a wall just before
the facade, posts, or walls scattered along and across. Lengths are in modules, from the charge.
"""

from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np

from studies.atlas.scenes import MODULES, Box, Scene

NEAREST: Final = 4
"""Modules between the charge and a solid: what its source needs."""

_PIECES: Final = 24
_TRIES: Final = 40


class _Yard:
    """A facade and what stands around it so far."""

    def __init__(self, facade: Box, rng: np.random.Generator) -> None:
        self.facade = facade
        self.rng = rng
        self.boxes: list[Box] = []

    def put(self, box: Box) -> bool:
        """Put a box where nothing is, and return whether it stands."""
        near_charge = Box(-NEAREST, -NEAREST, 2 * NEAREST, 2 * NEAREST, 1)
        stands = box.depth > 0 and box.width > 0
        stands &= not any(_meet(box, other) for other in (near_charge, self.facade, *self.boxes))
        if stands:
            self.boxes.append(box)
        return stands

    def drawn(self, low: int, high: int) -> int:
        """Draw a whole number; the ends count."""
        return int(self.rng.integers(low, max(high, low) + 1))

    def happens(self, probability: float) -> bool:
        """Draw whether something happens."""
        return bool(self.rng.random() < probability)


def _meet(first: Box, second: Box) -> bool:
    return (
        first.x < second.x + second.depth
        and second.x < first.x + first.depth
        and first.y < second.y + second.width
        and second.y < first.y + first.width
    )


def yard_scenes(site: Mapping[str, float], obstacles: list[Mapping[str, float]]) -> list[Scene]:
    """Return a facade alone, then with buildings around it, most times with pieces."""
    width, distance = round(site["width"] * MODULES), round(site["distance"] * MODULES)
    high, deep = round(site["facade_height"] * MODULES), round(site["depth"] * MODULES)
    aside = round(site["aside"] * (0.5 * width + 12.0))
    facade = Box(distance, -width // 2 + aside, deep, width, high)
    lengths = {"distance": distance, "width": width, "aside": aside, "facade_height": high}
    numbers = {name: value / MODULES for name, value in lengths.items()}
    scenes = [Scene(numbers, facade)]
    for drawn in obstacles:
        yard = _Yard(facade, np.random.default_rng(round(drawn["draw"] * 2**40)))
        houses = _put_houses(yard, drawn)
        pieces = _put_pieces(yard, drawn)
        own = {"houses": float(houses), "pieces": float(pieces)}
        scenes.append(Scene({**numbers, **own}, facade, others=tuple(yard.boxes)))
    return scenes


def _put_houses(yard: _Yard, drawn: Mapping[str, float]) -> int:
    """Put buildings around the facade; return their number."""
    facade, before = yard.facade, len(yard.boxes)
    if drawn["opposite"] > 0.0:
        behind = max(round(drawn["opposite"] * MODULES), NEAREST)
        length = yard.drawn(12, 60)
        left = yard.drawn(-length - 6, 6) if yard.happens(0.3) else yard.drawn(4 - length, -4)
        yard.put(Box(-behind - 5, left, 5, length, yard.drawn(8, 30)))
    if drawn["wing"] > 0.0:
        ends = (facade.y - 3, facade.y + facade.width)
        for y in ends if yard.happens(0.3) else (ends[yard.drawn(0, 1)],):
            reach = round(drawn["wing"] * facade.x)
            yard.put(Box(facade.x - reach, y, reach + yard.drawn(0, 6), 3, yard.drawn(8, 30)))
    if drawn["next"] > 0.0:
        gap, length = round(drawn["next"] * MODULES), yard.drawn(8, 36)
        y = facade.y + facade.width + gap if yard.happens(0.5) else facade.y - gap - length
        yard.put(
            Box(facade.x + yard.drawn(-12, 8), y, yard.drawn(5, 18), length, yard.drawn(8, 30))
        )
    if drawn["house"] > 0.0:
        for _ in range(_TRIES):
            x, y = yard.drawn(-24, facade.x), yard.drawn(-48, 48)
            size = yard.drawn(3, 18), yard.drawn(3, 30)
            if yard.put(Box(x, y, *size, yard.drawn(6, 30))):
                break
    return len(yard.boxes) - before


def _put_pieces(yard: _Yard, drawn: Mapping[str, float]) -> int:
    """Put pieces between charge and facade; return their number."""
    before = len(yard.boxes)
    kind = int(drawn["kind"])
    if kind in (1, 4, 5):
        for box in _row(yard, drawn["share"]):
            yard.put(box)
    if kind in (2, 5):  # a wall just before the facade
        for box in _row(yard, 1.0):
            yard.put(box)
    if kind in (3, 4, 6):
        for _ in range(yard.drawn(2, _PIECES)):
            _scatter(yard)
    return len(yard.boxes) - before


def _row(yard: _Yard, share: float) -> Iterator[Box]:
    """Yield pieces of a row along the facade, or before the charge, with gaps or without."""
    facade, thick = yard.facade, yard.drawn(1, 2)
    last = facade.x - thick - yard.drawn(1, 8)
    x = NEAREST + round(share * (last - NEAREST))
    high, other = yard.drawn(2, 14), yard.drawn(2, 14)
    length, gap = yard.drawn(1, 14), yard.drawn(0, 4) * yard.happens(0.6)
    count = yard.drawn(1, max(60 // (length + gap), 1))
    middle = round(yard.rng.random() * (facade.y + 0.5 * facade.width))
    y = middle - count * (length + gap) // 2
    two = yard.happens(0.3)
    for number in range(count):
        if not yard.happens(0.1):
            top = other if two and number % 2 else high
            yield Box(x, y, thick, length, top)
        y += length + gap


def _scatter(yard: _Yard) -> None:
    """Put a piece of any size somewhere before the facade, along or across."""
    facade = yard.facade
    low, high = min(facade.y, -6) - 8, max(facade.y + facade.width, 6) + 8
    size = (yard.drawn(1, 2), yard.drawn(1, 14))
    depth, width = size if yard.happens(0.6) else size[::-1]
    for _ in range(_TRIES):
        x, y = yard.drawn(NEAREST - 8, facade.x - depth - 1), yard.drawn(low, high - width)
        if yard.put(Box(x, y, depth, width, yard.drawn(2, 14))):
            break
