"""Buildings that a map has twice: as a way and a relation, or in two layers."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from blast_env.io.importing.ledger import Fate, Ledger
from blast_env.io.importing.things import Thing

_TWICE: Final = "buildings drawn twice, covered by the other"
_ALIKE: Final = 0.98
"""Least common area of two borders of one building, as a share of their union."""

_GENERAL: Final = ("", "yes")


def without_doubles(buildings: Sequence[Thing], ledger: Ledger) -> list[Thing]:
    """Return buildings in metres, each once: of two with one border, the one with the courtyards.

    Two of different heights are no doubles: a tower may stand on a podium. A building takes over
    what only its double says, such as a name.
    """
    found, gone = list(buildings), set[int]()
    usable = [
        k
        for k, thing in enumerate(found)
        if not thing.is_part
        and not thing.carries
        and thing.geometry.area
        and thing.geometry.is_valid
    ]
    shapes = np.array([found[k].geometry for k in usable], dtype=object)
    for first, second in sorted(shapely.STRtree(shapes).query(shapes, "intersects").T.tolist()):
        one, other = usable[first], usable[second]
        if first >= second or {one, other} & gone or not _may_be_one(found[one], found[other]):
            continue
        # The one with more parts, or with courtyards, says more and stays.
        ranks = [_rank(found[k].geometry) for k in (one, other)]
        kept, double = (other, one) if ranks[1] > ranks[0] else (one, other)
        if not _has_border(found[kept].geometry, found[double].geometry):
            continue
        gone.add(double)
        ledger.add(
            Fate.MERGED, _TWICE, found[double].place, found[double].name, f"by {found[kept].place}"
        )
        found[kept] = _with_words_of(found[kept], found[double])
    return [thing for k, thing in enumerate(found) if k not in gone]


def _may_be_one(one: Thing, other: Thing) -> bool:
    """Return whether nothing but their outlines speaks against two things being one building."""
    alike = one.height_m is None or other.height_m is None or one.height_m == other.height_m
    return alike and (one.base_m, one.part_of) == (other.base_m, other.part_of)


def _rank(shape: BaseGeometry) -> tuple[int, float]:
    """Return the number of parts and the area of courtyards: the larger outline of two stays."""
    parts = shapely.get_parts(shape)
    return len(parts), sum(_filled(part).area - part.area for part in parts)


def _has_border(shape: BaseGeometry, double: BaseGeometry) -> bool:
    """Return whether the border of a double, in one part, is one of an outline."""
    if double.geom_type != "Polygon":
        return False
    border = _filled(double)
    for part in shapely.get_parts(shape):
        whole = _filled(part)
        if whole.intersection(border).area >= _ALIKE * whole.union(border).area:
            return True
    return False


def _filled(part: BaseGeometry) -> BaseGeometry:
    """Return a polygon without its courtyards."""
    return shapely.polygons(shapely.get_exterior_ring(part))


def _with_words_of(building: Thing, double: Thing) -> Thing:
    return replace(
        building,
        name=building.name or double.name,
        kind=double.kind if building.kind in _GENERAL else building.kind,
        height_m=double.height_m if building.height_m is None else building.height_m,
        protected=building.protected or double.protected,
    )
