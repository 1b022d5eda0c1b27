"""Families of the atlas: which sites, with which obstacles, by which numbers.

A family is a list of groups. A group is a site and several obstacles on it, so that the blast
without an obstacle is run once. Sites and obstacles fill their ranges by scrambled Halton sequences
with fixed seeds. All lengths are over the cube root of the mass, m/kg^(1/3).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from studies.atlas.scenes import MODULES, Box, Scene
from studies.atlas.yards import yard_scenes

Numbers = Mapping[str, float]
Ranges = Mapping[str, tuple[float, float]]

_NEAREST: Final = 4  # modules between the charge and a solid: what its source needs
_WIDE: Final = 30  # modules of a facade: five bays


def _modules(scaled: float, least: int = 1) -> int:
    """Return a scaled length in whole modules."""
    return max(round(scaled * MODULES), least)


@dataclass(frozen=True)
class Family:
    """A kind of surroundings.

    Attributes:
        name: Its name.
        title: What it is, for readers.
        site: Ranges of the numbers of a site. In another order they draw other sites.
        obstacle: Ranges of the numbers of an obstacle.
        obstacles: Number of obstacles of a group.
        scenes: Returns the scenes of a group: a site's numbers, its obstacles' numbers; the first
            scene is what the others are compared with.
    """

    name: str
    title: str
    site: Ranges
    obstacle: Ranges
    obstacles: int
    scenes: Callable[[Numbers, list[Numbers]], list[Scene]]

    def group(self, number: int) -> list[Scene]:
        """Return the scenes of a group, by its number."""
        seed = sum(self.name.encode())
        (site,) = _points(self.site, seed, number, 1)
        obstacles = _points(self.obstacle, seed + 1, number * self.obstacles, self.obstacles)
        return self.scenes(site, obstacles)


def _points(ranges: Ranges, seed: int, first: int, count: int) -> list[Numbers]:
    """Return consecutive points of a scrambled Halton sequence in some ranges."""
    from scipy.stats import qmc  # takes a while to import

    if not ranges or not count:
        return [{}] * count
    sampler = qmc.Halton(len(ranges), scramble=True, seed=seed).fast_forward(first)
    low, high = np.array([*ranges.values()]).T
    drawn = low + (high - low) * sampler.random(count)
    return [dict(zip(ranges, row.tolist(), strict=True)) for row in drawn]


_FACADE: Final[Ranges] = {
    "distance": (1.5, 5.0),
    "facade_height": (0.5, 2.0),
    "aside": (0.0, 1.2),
    "raised": (-0.6, 0.4),
}
_NEAR: Final[Ranges] = {**_FACADE, "distance": (1.3, 4.0)}
_FAR: Final[Ranges] = {
    **_FACADE,
    "distance": (5.0, 14.0),
    "facade_height": (0.4, 2.0),
    "raised": (-0.8, 0.4),
}


def _facade(site: Numbers, width: int = _WIDE) -> tuple[Box, Numbers, float]:
    """Return the box of a facade, its numbers in whole modules, and the charge's height."""
    distance, high = _modules(site["distance"]), _modules(site["facade_height"], 6)
    aside = _modules(site["aside"], 0)
    up = _modules(site.get("raised", 0.0), 0)
    box = Box(distance, -width // 2 + aside, 4, width, high)
    lengths = {"distance": distance, "facade_height": high, "aside": aside, "raised": up}
    return box, {name: value / MODULES for name, value in lengths.items()}, float(up)


def _scaled(**modules: float) -> dict[str, float]:
    return {name: value / MODULES for name, value in modules.items()}


def _wall(facade: Box, drawn: Numbers) -> tuple[Numbers, tuple[Box, ...]]:
    """Return one wall, one with a gap, or two walls in a row."""
    high = _modules(drawn["height"])
    thick = _modules(drawn["thickness"])
    length = _modules(drawn["length"], 4)
    room = facade.x - thick - 1

    def at(share: float) -> int:
        return min(max(round(share * facade.x), _NEAREST), room)

    x = at(drawn["share"])
    left = round(drawn["shift"] * length) - length // 2
    numbers = _scaled(
        height=high, thickness=thick, length=length, from_charge=x, from_facade=facade.x - x - thick
    )
    if drawn["gap"] > 0.0:
        gap = min(_modules(drawn["gap"]), length - 2)
        first = min(max(round((0.5 + drawn["gap_at"]) * length) - gap // 2, 1), length - gap - 1)
        parts = (
            Box(x, left, thick, first, high),
            Box(x, left + first + gap, thick, length - first - gap, high),
        )
        return {**numbers, **_scaled(gap=gap), "walls": 1.0}, parts
    one = Box(x, left, thick, length, high)
    if drawn["second"] > 0.0:
        other = at(drawn["share"] + drawn["second"] * (1.0 - drawn["share"]))
        if other > x + thick + 1:
            behind = Box(other, left, thick, length, high)
            return {**numbers, "gap": 0.0, "walls": 2.0}, (one, behind)
    return {**numbers, "gap": 0.0, "walls": 1.0}, (one,)


_WALL: Final[Ranges] = {
    "height": (0.08, 1.5),
    "share": (0.1, 0.95),
    "length": (0.6, 4.5),
    "shift": (-0.4, 0.4),
    "thickness": (0.05, 0.3),
    "gap": (-1.2, 0.5),
    "gap_at": (-0.4, 0.4),
    "second": (-3.0, 0.9),
}


def _walls(site: Numbers, obstacles: list[Numbers]) -> list[Scene]:
    box, numbers, up = _facade(site)
    scenes = [Scene(numbers, box, up=up)]
    for drawn in obstacles:
        own, parts = _wall(box, drawn)
        scenes.append(Scene({**numbers, **own}, box, others=parts, up=up))
    return scenes


def _raised(site: Numbers, obstacles: list[Numbers]) -> list[Scene]:
    """Return a site with a raised charge, with one on the ground, then with walls."""
    first, *others = _walls(site, obstacles)
    ground = Scene({**first.numbers, "raised": 0.0, "on_ground": 1.0}, first.judged)
    return [first, ground, *others]


_POSTS: Final[Ranges] = {
    "solid": (0.2, 0.85),
    "size": (0.05, 0.3),
    "height": (0.08, 0.8),
    "share": (0.1, 0.9),
    "length": (1.0, 4.5),
    "shift": (-0.5, 0.5),
}


def _posts(site: Numbers, obstacles: list[Numbers]) -> list[Scene]:
    box, numbers, up = _facade(site)
    scenes = [Scene(numbers, box, up=up)]
    for drawn in obstacles:
        size = _modules(drawn["size"])
        pitch = max(round(size / drawn["solid"]), size + 1)
        high = _modules(drawn["height"])
        x = min(max(round(drawn["share"] * box.x), _NEAREST), box.x - size - 1)
        count = max(round(drawn["length"] * MODULES / pitch), 2)
        left = -(count * pitch - (pitch - size)) // 2 + round(drawn["shift"] * pitch)
        parts = tuple(Box(x, left + k * pitch, size, size, high) for k in range(count))
        own = _scaled(size=size, height=high, from_charge=x, from_facade=box.x - x - size)
        more = {**own, "solid": size / pitch, **_scaled(length=count * pitch)}
        scenes.append(Scene({**numbers, **more}, box, others=parts, up=up))
    return scenes


_OPPOSITE: Final[Ranges] = {
    "behind": (0.3, 2.5),
    "height": (0.15, 2.0),
    "length": (0.6, 5.0),
    "shift": (-0.4, 0.4),
}


def _opposite(site: Numbers, obstacles: list[Numbers]) -> list[Scene]:
    box, numbers, up = _facade(site)
    scenes = [Scene(numbers, box, up=up)]
    for drawn in obstacles:
        behind = _modules(drawn["behind"], _NEAREST)
        high, length = _modules(drawn["height"], 2), _modules(drawn["length"], 6)
        left = round(drawn["shift"] * length) - length // 2
        other = Box(-behind - 4, left, 4, length, high)
        own = _scaled(behind=behind, height=high, length=length)
        scenes.append(Scene({**numbers, **own}, box, others=(other,), up=up))
    return scenes


_STREET_MODULES: Final = 66
_STREET_BACK: Final = 12

_ALONG: Final[Ranges] = {"away": (0.33, 1.4), "facade_height": (0.5, 2.0)}
_STREET: Final[Ranges] = {
    "other": (0.3, 1.5),
    "height": (0.2, 2.0),
    "crossing": (-1.5, 1.0),
    "crossing_at": (0.3, 2.5),
}


def _street(site: Numbers, obstacles: list[Numbers]) -> list[Scene]:
    """Return a front along a street, alone, then with fronts on the other side, or a crossing."""
    away, high = _modules(site["away"], _NEAREST), _modules(site["facade_height"], 6)
    front = Box(-_STREET_BACK, away, _STREET_MODULES + _STREET_BACK, 4, high)
    numbers = _scaled(away=away, facade_height=high)
    scenes = [Scene(numbers, front, ("south",))]
    for drawn in obstacles:
        other, top = _modules(drawn["other"], _NEAREST), _modules(drawn["height"], 2)
        whole = Box(front.x, -other - 4, front.depth, 4, top)
        parts: tuple[Box, ...] = (whole,)
        crossing = 0
        if drawn["crossing"] > 0.0:
            crossing = _modules(drawn["crossing"], 4)
            at = _modules(drawn["crossing_at"])
            first = at - whole.x
            parts = (
                Box(whole.x, whole.y, first, 4, top),
                Box(at + crossing, whole.y, whole.depth - first - crossing, 4, top),
            )
        own = _scaled(other=other, height=top, width=away + other, crossing=crossing)
        scenes.append(Scene({**numbers, **own}, front, ("south",), parts))
    return scenes


_ENDS: Final[Ranges] = {name: _NEAR[name] for name in ("distance", "facade_height")}
_TEE: Final[Ranges] = {
    "width": (0.7, 2.6),
    "height": (0.2, 2.0),
    "across": (0.1, 1.5),
    "sides": (0.0, 1.0),
}


def _tee(site: Numbers, obstacles: list[Numbers]) -> list[Scene]:
    """Return a facade across the end of a street, alone, then with the street's fronts."""
    box, numbers, _ = _facade({**site, "aside": 0.0})
    scenes = [Scene(numbers, box)]
    for drawn in obstacles:
        half = _modules(0.5 * drawn["width"], _NEAREST)
        high = _modules(drawn["height"], 2)
        end = box.x - min(_modules(drawn["across"]), box.x - 2)
        fronts = (
            Box(-_STREET_BACK, half, end + _STREET_BACK, 4, high),
            Box(-_STREET_BACK, -half - 4, end + _STREET_BACK, 4, high),
        )
        parts = fronts if drawn["sides"] < 0.7 else fronts[:1]
        own = {
            **_scaled(width=2 * half, height=high, across=box.x - end),
            "sides": float(len(parts)),
        }
        scenes.append(Scene({**numbers, **own}, box, others=parts))
    return scenes


_COURT: Final[Ranges] = {
    "distance": (0.9, 3.5),
    "facade_height": (0.5, 2.0),
    "aside": (-1.0, 1.0),
    "width": (1.0, 2.6),
}
_WINGS: Final[Ranges] = {"depth": (0.2, 2.0), "height": (0.3, 1.6), "sides": (0.0, 1.0)}


def _court(site: Numbers, obstacles: list[Numbers]) -> list[Scene]:
    """Return a facade alone, then with wings that reach forward at one end or both."""
    width = 2 * _modules(0.5 * site["width"], 6)
    reach = width // 2 - _NEAREST
    aside = site["aside"] * reach / MODULES
    box, numbers, _ = _facade({**site, "aside": abs(aside)}, width)
    scenes = [Scene({**numbers, "width": width / MODULES}, box)]
    for drawn in obstacles:
        depth = _modules(drawn["depth"], 2)
        high = _modules(drawn["height"], 2)
        wings = (
            Box(box.x - depth, box.y - 6, depth, 6, high),
            Box(box.x - depth, box.y + box.width, depth, 6, high),
        )
        parts = wings if drawn["sides"] < 0.6 else wings[: 1 if drawn["sides"] < 0.8 else None][-1:]
        own = {**_scaled(width=width, depth=depth, height=high), "sides": float(len(parts))}
        scenes.append(Scene({**numbers, **own}, box, others=parts))
    return scenes


_SHADOW: Final[Ranges] = {
    "distance": (1.3, 4.0),
    "height": (0.5, 2.2),
    "depth": (0.5, 2.5),
    "width": (0.5, 2.5),
    "aside": (0.0, 1.2),
}


def _shadow(site: Numbers, _: list[Numbers]) -> list[Scene]:
    """Return a block with loads on all of its walls."""
    distance, high = _modules(site["distance"]), _modules(site["height"], 6)
    depth, width = _modules(site["depth"], 6), _modules(site["width"], 6)
    aside = _modules(site["aside"], 0)
    box = Box(distance, -width // 2 + aside, depth, width, high)
    numbers = _scaled(distance=distance, height=high, depth=depth, width=width, aside=aside)
    return [Scene(numbers, box, ("west", "east", "south", "north"))]


_OPEN: Final[Ranges] = {
    "distance": (1.3, 9.0),
    "facade_height": (0.4, 3.0),
    "aside": (0.0, 4.0),
    "raised": (-0.8, 0.8),
    "width": (0.5, 6.0),
}
_LONG: Final[Ranges] = {
    **_OPEN,
    "distance": (2.0, 12.0),
    "aside": (0.0, 7.0),
    "width": (5.0, 13.0),
}
_BROAD: Final[Ranges] = {
    **_LONG,
    "distance": (1.3, 4.0),
    "facade_height": (0.5, 3.5),
    "aside": (0.0, 5.0),
}
_CLOSE: Final[Ranges] = {
    **_OPEN,
    "distance": (0.33, 1.3),
    "aside": (0.0, 2.5),
    "width": (0.5, 5.0),
}


def _open(site: Numbers, _: list[Numbers]) -> list[Scene]:
    """Return a facade in the open, of any width."""
    box, numbers, up = _facade(site, _modules(site["width"], 6))
    return [Scene({**numbers, "width": box.width / MODULES}, box, up=up)]


_ROWS: Final[Ranges] = {
    "height": (0.3, 1.6),
    "depth": (0.4, 1.6),
    "length": (0.6, 2.5),
    "share": (0.0, 1.0),
    "shift": (-0.8, 0.8),
    "gap": (-0.8, 0.8),
}


def _rows(site: Numbers, obstacles: list[Numbers]) -> list[Scene]:
    """Return a facade alone, then behind a house, or behind two with a gap between them."""
    box, numbers, up = _facade(site)
    scenes = [Scene(numbers, box, up=up)]
    for drawn in obstacles:
        high, length = _modules(drawn["height"], 3), _modules(drawn["length"], 6)
        room = box.x - _NEAREST - 2
        depth = min(_modules(drawn["depth"], 4), room)
        x = _NEAREST + round(drawn["share"] * (room - depth))
        left = round(drawn["shift"] * length) - length // 2
        gap = _modules(drawn["gap"], 0)
        parts: tuple[Box, ...] = (Box(x, left, depth, length, high),)
        if gap > 1:
            parts = (*parts, Box(x, left + length + gap, depth, length, high))
        own = _scaled(
            height=high,
            depth=depth,
            length=length,
            from_charge=x,
            from_facade=box.x - x - depth,
            gap=gap if len(parts) > 1 else 0,
        )
        scenes.append(Scene({**numbers, **own, "houses": float(len(parts))}, box, others=parts))
    return scenes


_CANOPY: Final[Ranges] = {"depth": (0.1, 1.2), "level": (0.25, 0.9), "kind": (0.0, 3.0)}


def _canopy(site: Numbers, obstacles: list[Numbers]) -> list[Scene]:
    """Return a facade alone, then with a canopy, storeys that project, or a podium before it."""
    box, numbers, up = _facade(site)
    scenes = [Scene(numbers, box, up=up)]
    for drawn in obstacles:
        depth = min(_modules(drawn["depth"]), box.x - _NEAREST)
        level = min(max(round(drawn["level"] * box.top), 3), box.top - 1)
        x = box.x - depth
        top, base, kind = level + 1, level, 0.0
        if drawn["kind"] > 1.0:
            top, base, kind = (box.top, level, 1.0) if drawn["kind"] < 2.0 else (level, 0, 2.0)
        own = {**_scaled(depth=depth, level=level), "kind": kind}
        other = Box(x, box.y, depth, box.width, top, base)
        scenes.append(Scene({**numbers, **own}, box, others=(other,), up=up))
    return scenes


_PIECES: Final[Ranges] = {
    "high": (0.15, 0.9),
    "low": (0.1, 1.0),
    "length": (0.25, 1.1),
    "count": (1.0, 6.0),
    "pattern": (0.0, 1.0),
    "share": (0.1, 0.97),
    "shift": (-0.6, 0.6),
    "step": (-1.5, 1.5),
    "second": (-0.8, 1.0),
    "wing": (-1.2, 0.8),
}


def _of_pieces(first: int, drawn: Numbers, pattern: float) -> tuple[Box, ...]:
    """Return a row of wall pieces of two heights, with gaps, every other one a step aside."""
    high, length = _modules(drawn["high"], 2), _modules(drawn["length"], 3)
    heights = (high, high, _modules(drawn["low"] * drawn["high"], 1), 0)
    count, step = int(drawn["count"]), round(drawn["step"])
    left = round((drawn["shift"] - 0.5) * count * length)
    parts: list[Box] = []
    for index in range(count):
        pattern = 4.0 * pattern % 4.0
        top = heights[int(pattern)]
        if top or (index == count - 1 and not parts):
            x = first + (index % 2) * step
            parts.append(Box(x, left + index * length, 1, length, top or high))
    return tuple(parts)


def _pieces(site: Numbers, obstacles: list[Numbers]) -> list[Scene]:
    """Return a facade alone, then behind pieces of two heights in one row or two, with a wing."""
    box, numbers, up = _facade(site)
    scenes = [Scene(numbers, box, up=up)]
    for drawn in obstacles:
        step = abs(round(drawn["step"]))
        room = box.x - 2 - step
        x = min(max(round(drawn["share"] * box.x), _NEAREST + step), room)
        parts = _of_pieces(x, drawn, drawn["pattern"])
        rows = 1
        if drawn["second"] > 0.0:
            other = min(round(x + drawn["second"] * (box.x - x)), room)
            if other > x + 2 * step + 1:
                parts += _of_pieces(other, drawn, 61.0 * drawn["pattern"] % 1.0)
                rows = 2
        if drawn["wing"] > 0.1:  # from the end of the first row back, to the charge's side
            deep = _modules(drawn["wing"])
            y = min(*(part.y for part in parts), 1 - _NEAREST) - 1
            parts += (Box(x - deep, y, deep, 1, _modules(drawn["high"], 2)),)
        own = _scaled(from_charge=x, high=_modules(drawn["high"], 2))
        more = {"rows": float(rows), "pieces": float(len(parts))}
        scenes.append(Scene({**numbers, **own, **more}, box, others=parts, up=up))
    return scenes


_BEYOND: Final[Ranges] = {
    "away": (0.08, 0.7),
    "begin": (0.35, 2.2),
    "length": (1.0, 4.5),
    "facade_height": (0.5, 2.0),
}


def _beyond(site: Numbers, _: list[Numbers]) -> list[Scene]:
    """Return a front in the open that begins beyond the charge, nearly in its line."""
    away, begin = _modules(site["away"]), _modules(site["begin"], _NEAREST)
    high, length = _modules(site["facade_height"], 6), _modules(site["length"], 12)
    front = Box(begin, away, length, 4, high)
    own = _scaled(away=away, begin=begin, facade_height=high, length=length)
    return [Scene(own, front, ("south",))]


_SLANT: Final[Ranges] = {
    "at": (0.33, 3.5),
    "height": (0.08, 1.2),
    "length": (0.2, 1.2),
    "across": (0.0, 1.0),
    "turn": (0.0, 1.0),
}


def _slant(site: Numbers, obstacles: list[Numbers]) -> list[Scene]:
    """Return a front along which the wave comes, alone, then with walls across and along it.

    The front begins beside the charge or farther along.
    """
    away, high = _modules(site["away"], _NEAREST), _modules(site["facade_height"], 6)
    begin = round(site["begin"] * MODULES)
    front = Box(begin, away, _STREET_MODULES - begin, 4, high)
    numbers = _scaled(away=away, facade_height=high, begin=begin)
    scenes = [Scene(numbers, front, ("south",))]
    for drawn in obstacles:
        at, top = _modules(drawn["at"], _NEAREST), _modules(drawn["height"])
        length = _modules(drawn["length"], 2)
        y = min(round(drawn["across"] * away), away - 2)
        # Across the way, up to the front or less, or along it.
        wall = Box(at, y, length, 1, top)
        if drawn["turn"] < 0.6:
            wall = Box(at, y + 1 - length, 1, length, top)
        own = {**_scaled(at=at, height=top, length=length), "turn": drawn["turn"]}
        scenes.append(Scene({**numbers, **own}, front, ("south",), (wall,)))
    return scenes


_LOW_WALL: Final[Ranges] = {
    **_WALL,
    "height": (0.05, 1.0),
    "share": (0.02, 0.95),
    "second": (-1.0, 0.0),
}
_DISTANT: Final[Ranges] = {
    **_PIECES,
    "high": (0.05, 0.8),
    "share": (0.02, 0.6),
    "second": (-0.2, 0.3),
}
_SHAFT: Final[Ranges] = {
    **_PIECES,
    "high": (0.15, 1.2),
    "length": (0.3, 1.8),
    "share": (0.72, 0.99),
    "second": (-3.0, 0.9),
    "wing": (-1.0, 0.0),
}
_YARD: Final[Ranges] = {
    "distance": (0.9, 5.0),
    "facade_height": (0.5, 2.6),
    "width": (0.6, 4.5),
    "aside": (-1.0, 1.0),
    "depth": (0.4, 1.5),
}
_AROUND: Final[Ranges] = {
    "opposite": (-1.5, 1.7),
    "wing": (-1.0, 0.9),
    "next": (-1.8, 1.8),
    "house": (-1.0, 0.6),
    "kind": (0.3, 7.0),
    "share": (0.0, 1.0),
    "draw": (0.0, 1.0),
}
_SECOND: Final[Ranges] = {**_FACADE, "distance": (2.0, 5.0)}
_RAISED: Final[Ranges] = {**_FACADE, "raised": (0.05, 1.2)}
_DEEP: Final[Ranges] = {**_FAR, "raised": (-0.8, 0.0)}
_PAST: Final[Ranges] = {**_ALONG, "begin": (-1.0, 1.5)}

_ALL: Final = (
    Family("wall", "a wall before a facade", _FACADE, _WALL, 12, _walls),
    Family("posts", "posts or planters in a row", _FACADE, _POSTS, 8, _posts),
    Family("opposite", "a front behind the charge", _NEAR, _OPPOSITE, 7, _opposite),
    Family("street", "a front along a street", _ALONG, _STREET, 5, _street),
    Family("tee", "a facade across the end of a street", _ENDS, _TEE, 5, _tee),
    Family("court", "a court or a re-entrant corner", _COURT, _WINGS, 6, _court),
    Family("shadow", "the walls of a block out of sight", _SHADOW, {}, 0, _shadow),
    Family("rows", "a second row of houses", _SECOND, _ROWS, 7, _rows),
    Family("canopy", "a canopy, storeys that project, a podium", _NEAR, _CANOPY, 6, _canopy),
    Family("wide", "a wide facade in the open", _LONG, {}, 0, _open),
    Family("broad", "a wide facade near the charge", _BROAD, {}, 0, _open),
    Family("raised", "a raised charge, without and with a wall", _RAISED, _WALL, 5, _raised),
    Family("open", "a facade in the open", _OPEN, {}, 0, _open),
    Family("far", "a wall before a facade far away", _FAR, _LOW_WALL, 6, _walls),
    Family("distant", "pieces before a facade far away", _DEEP, _DISTANT, 6, _pieces),
    Family("near", "a facade near the charge", _CLOSE, {}, 0, _open),
    Family("pieces", "pieces of two heights, in one row or two", _NEAR, _PIECES, 9, _pieces),
    Family("shaft", "pieces just before a facade", _NEAR, _SHAFT, 9, _pieces),
    Family("beyond", "a facade beside whose end the charge stands", _BEYOND, {}, 0, _beyond),
    Family("slant", "a wall before a front along the way", _PAST, _SLANT, 6, _slant),
    Family("yard", "pieces between several buildings", _YARD, _AROUND, 9, yard_scenes),
)

FAMILIES: Final[Mapping[str, Family]] = MappingProxyType({own.name: own for own in _ALL})
"""The families by name."""
