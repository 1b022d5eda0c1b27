"""When all waves of a blast have passed what a run waits for.

A charge sends more than one wave, and solids throw them back. Between walls that face each other,
as on a street, echoes go to and fro, with a pause before each. A run waits for the first, and looks
back over the pause before it takes a load for complete. Without Numba: costs are told from it, too.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from math import cbrt, hypot, inf
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.physics.gas.settings import SOUND_M_S, SWING_S
from blast_env.physics.scene import BlastSite, StructureOutline

_LOW: Final = 0.5
"""A structure lower than this share of what it stands before throws too little back at it."""


@dataclass(frozen=True)
class Waves:
    """When the last wave comes.

    Attributes:
        passed_s: When all waves have come to what is waited for.
        pause_s: The pause between two echoes that come after the direct waves; 0 without any.
    """

    passed_s: float
    pause_s: float = 0.0


def waves_of(
    site: BlastSite, watched: Sequence[int], places_m: Sequence[tuple[float, ...]] = ()
) -> Waves:
    """Return when all waves have come to some structures and places.

    Only structures that stand with every layout throw waves back, so that all layouts share it.

    Args:
        site: What stands where.
        watched: The structures, by index.
        places_m: The places.
    """
    passed_s = passed_after_s(site, [*corners_m(site, watched), *places_m])
    way_m, round_trip_m = _last_echo(site, watched)
    if way_m <= SOUND_M_S * passed_s:
        return Waves(passed_s)
    return Waves(_swung_s(site, way_m), round_trip_m / SOUND_M_S)


def passed_after_s(site: BlastSite, places_m: Sequence[tuple[float, ...]]) -> float:
    """Return when all waves of the charge have come to some places, if nothing is between."""
    x_m, y_m = site.charge.position_m
    return _swung_s(site, max((hypot(x - x_m, y - y_m) for x, y, *_ in places_m), default=0.0))


def watched_structures(site: BlastSite, until: str | float) -> list[int]:
    """Return the structures that a run waits for: those protected, or else all but the barrier."""
    structures = [k for k, outline in enumerate(site.structures) if outline.cells is None]
    protected = [k for k in structures if site.structures[k].protected]
    return structures if until == "walls" else protected or structures


def corners_m(site: BlastSite, structures: Sequence[int]) -> list[tuple[float, float]]:
    """Return the corners of some structures in plan."""
    return [
        (x, y)
        for left, bottom, right, top in (site.structures[k].rectangle_m for k in structures)
        for x in (left, right)
        for y in (bottom, top)
    ]


def _swung_s(site: BlastSite, way_m: float) -> float:
    return way_m / SOUND_M_S + SWING_S * cbrt(site.charge.tnt_kg / 100.0)


def _last_echo(site: BlastSite, watched: Sequence[int]) -> tuple[float, float]:
    """Return the longest way of an echo to a corner, and from its wall to there and back, m."""
    others = [site.structures[index] for index in watched]
    found = [(0.0, 0.0)]
    for wall in site.structures:
        facing = [each for each in others if each is not wall and _throws_at(wall, each)]
        if facing:
            boxes_m = np.array([each.rectangle_m for each in facing]).reshape(-1, 2, 2)
            found += _thrown_back(wall, boxes_m, site.charge.position_m)
    return max(found)


def _throws_at(wall: StructureOutline, other: StructureOutline) -> bool:
    height_m, least_m = (inf if each.height_m is None else each.height_m for each in (wall, other))
    is_whole = wall.cells is None and wall.is_lasting and wall.base_m <= other.base_m
    return is_whole and (height_m == inf or height_m >= _LOW * least_m)


def _thrown_back(
    wall: StructureOutline, boxes_m: FloatArray, place_m: tuple[float, float]
) -> Iterator[tuple[float, float]]:
    """Yield the longest way from a place by each wall of a structure to corners of others, m.

    Args:
        wall: The structure.
        boxes_m: The others, low and high corner (others, 2, 2).
        place_m: The place.

    Yields:
        The way, and from the wall to the structure of the corner and back.
    """
    sides_m = np.array(wall.rectangle_m).reshape(2, 2)
    for axis, outwards in product((0, 1), (-1.0, 1.0)):
        along, side_m = 1 - axis, sides_m[int(outwards > 0.0), axis]
        charge_m = outwards * (place_m[axis] - side_m)
        before_m = outwards * (boxes_m[:, :, axis] - side_m)
        facing = before_m.min(axis=1) > 0.0
        if charge_m <= 0.0 or not facing.any():
            continue
        # The wave comes from the charge's mirror image, through the wall, to near and far corners
        # (others, 2, 2).
        away_m = charge_m + before_m[facing, :, np.newaxis]
        aside_m = boxes_m[facing, np.newaxis, :, along] - place_m[along]
        through_m = place_m[along] + aside_m * charge_m / away_m
        meets = (through_m >= sides_m[0, along]) & (through_m <= sides_m[1, along])
        ways_m = np.where(meets, np.hypot(aside_m, away_m), 0.0).max(axis=(1, 2))
        last = int(ways_m.argmax())
        yield float(ways_m[last]), 2.0 * float(before_m[facing].min(axis=1)[last])
