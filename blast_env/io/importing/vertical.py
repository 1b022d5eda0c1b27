"""The vertical place of buildings: their heights relative to the ground under them.

Tags state heights above the ground. The coordinates of a drawing or model count from a zero that
may be the sea; there, what stands on nothing else stands on the ground.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import shapely

from blast_env.io.importing.bodies import LEAST_STOREY_M
from blast_env.io.importing.ledger import Fate, Ledger
from blast_env.io.importing.things import Thing

_GROUND: Final = "ground under buildings, not at the zero of the file"
_IN_AIR: Final = "undersides more than a storey above the ground, with nothing below"
_CELLARS: Final = "parts of buildings below the ground"
_BELOW: Final = "buildings below the ground"

_LEAST_SHARE: Final = 0.1
_LEAST_M2: Final = 1.0
"""Least common area of a building and one that it stands on, or less: this share of the smaller."""

_BESIDE_M: Final = 0.5
_GAP_M: Final = 0.5
"""Largest gap between a building and what it stands on, a module."""

_MOST_STOREYS: Final = 10
"""Storeys above the ground at which nothing that is tagged hangs alone."""

_ON_POSTS: Final = ("roof", "canopy", "carport", "bridge")


def on_the_ground(things: Sequence[Thing], level_m: float, ledger: Ledger) -> list[Thing]:
    """Return buildings with their heights relative to the ground under them.

    0. Where the file states the ground under a building, it is there.
    1. A building stands on those below it. One that stands on no other is on the ground.
    2. In a file with buildings near its zero that zero is the ground, and a building within a
       storey of it is raised by as much.
    3. What is higher stands on ground of its own, unless another building or posts carry it.

    The ledger gets the ground found and undersides in the air. Buildings below the ground are left
    out.

    Args:
        things: Buildings with sound outlines, m.
        ledger: The ledger of the import.
    """
    place = _Places(things, level_m)
    found = []
    for thing, (ground_m, kind) in zip(things, place.grounds(), strict=True):
        height_m = None if thing.height_m is None else thing.height_m - ground_m
        base_m = thing.base_m - ground_m
        if height_m is not None and height_m <= 0.0:
            ledger.add(Fate.LEFT_OUT, _BELOW, thing.place, thing.name, f"to {height_m:g} m")
            continue
        if base_m < -_GAP_M:
            ledger.add(Fate.CUT, _CELLARS, thing.place, thing.name, f"from {base_m:g} m")
        if kind:
            detail = f"{ground_m:g} m" if kind == _GROUND else f"at {base_m:g} m"
            fate = Fate.GUESSED if thing.has_z or kind == _GROUND else Fate.NOTED
            ledger.add(fate, kind, thing.place, thing.name, detail)
        found.append(replace(thing, height_m=height_m, base_m=max(base_m, 0.0)))
    return found


class _Places:
    """Finds the ground under buildings.

    Args:
        things: The buildings.
        level_m: Height of a storey.
    """

    def __init__(self, things: Sequence[Thing], level_m: float) -> None:
        self._things, self._level_m = things, level_m
        self._tree = shapely.STRtree([thing.geometry for thing in things])
        self._below = [self._support(k) for k in range(len(things))]
        # The zero of a file means the ground if anything that stands alone is near it.
        roots = [
            thing
            for thing, below in zip(things, self._below, strict=True)
            if below is None and thing.height_m is not None
        ]
        self._has_zero = any(not root.has_z or self._is_near_zero(root) for root in roots)

    def grounds(self) -> list[tuple[float, str]]:
        """Return the height of the ground under each building, and what the ledger says of it."""
        found: dict[int, tuple[float, str]] = {}
        # From below: a building has the ground of the one that it stands on.
        for k in sorted(range(len(self._things)), key=lambda k: self._things[k].base_m):
            found[k] = self._ground(k, found)
        return [found[k] for k in range(len(self._things))]

    def _ground(self, k: int, lower: Mapping[int, tuple[float, str]]) -> tuple[float, str]:
        """Return the same of one building, from those of the buildings with lower undersides."""
        thing, below = self._things[k], self._below[k]
        if thing.ground_m is not None:
            return thing.ground_m, ""
        if below is not None:
            ground_m, kind = lower[below]
            return ground_m, kind if kind == _GROUND else ""
        # It stands on no other. 1. Near the zero of its file: on the ground.
        base_m, height_m = thing.base_m, self._top_m(thing)
        if self._is_near_zero(thing) if thing.has_z else base_m <= self._level_m:
            return 0.0, ""
        if height_m <= 0.0:
            return (0.0, "") if self._has_zero else (base_m, _GROUND)
        # 2. Carried at its side, or by posts: in the air.
        is_tag = not thing.has_z
        beside = self._beside(k)
        if beside is not None:
            return (0.0 if is_tag else lower[beside][0]), _IN_AIR
        if is_tag and thing.kind in _ON_POSTS and base_m <= _MOST_STOREYS * self._level_m:
            return 0.0, ""
        # 3. A roof without walls, or storeys that are missing below: in the air. 4. Else the ground
        # is higher there.
        is_thin = height_m - base_m < LEAST_STOREY_M
        if (self._has_zero and is_thin) or (is_tag and base_m <= _MOST_STOREYS * self._level_m):
            return 0.0, _IN_AIR
        return base_m, _GROUND

    def _top_m(self, thing: Thing) -> float:
        """Return the top of a building, at least a storey above its underside if it is unknown."""
        return thing.base_m + self._level_m if thing.height_m is None else thing.height_m

    def _is_near_zero(self, thing: Thing) -> bool:
        """Return whether a building begins within a storey of the zero of its file, or across.

        The zero of a height above the sea is none of these.
        """
        if thing.is_levelled:
            return False
        return abs(thing.base_m) <= self._level_m or thing.base_m < 0.0 < (thing.height_m or 0.0)

    def _support(self, k: int) -> int | None:
        """Return the index of the building on which one stands, with the largest common area."""
        thing = self._things[k]
        if (thing.base_m <= 0.0 and not thing.has_z) or not thing.geometry.is_valid:
            return None
        best, most_m2 = None, 0.0
        for index, other in self._around(k, 0.0):
            top_m = thing.base_m if other.height_m is None else other.height_m
            reaches = other.base_m < thing.base_m - _GAP_M and top_m >= thing.base_m - _GAP_M
            if not reaches or not other.geometry.is_valid:
                continue
            common_m2 = shapely.intersection(thing.geometry, other.geometry).area
            least_m2 = min(thing.geometry.area, other.geometry.area)
            if common_m2 > max(most_m2, min(_LEAST_SHARE * least_m2, _LEAST_M2)):
                best, most_m2 = index, common_m2
        return best

    def _beside(self, k: int) -> int | None:
        """Return the index of a building that carries one at its side, a storey lower at least."""
        thing = self._things[k]
        lower_m = thing.base_m - self._level_m
        for index, other in self._around(k, _BESIDE_M):
            if other.base_m < lower_m and (other.height_m or thing.base_m) > thing.base_m:
                return index
        return None

    def _around(self, k: int, within_m: float) -> Iterator[tuple[int, Thing]]:
        near = self._tree.query(self._things[k].geometry, "dwithin", distance=within_m)
        for index in np.sort(near).tolist():
            if index != k:
                yield index, self._things[index]
