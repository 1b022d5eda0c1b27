"""Streets that lead through buildings: where they enter, a charge may be."""

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from blast_env.arrays import FloatArray
from blast_env.io.importing.fitting import BuildingFit
from blast_env.io.importing.ledger import Fate
from blast_env.io.importing.options import PlaceXY
from blast_env.io.importing.placing import SitePlacement
from blast_env.io.importing.things import Role, Thing

_SOLID: Final = "streets through buildings, which are solid on the site: charges at the mouths"
_RAISED: Final = "streets below raised buildings, with charges beside them only"
_LEAST_M: Final = 1.0
"""Shortest way through a building: less is inaccuracy of the map."""

_AT_BORDER_M: Final = 0.05
_STEP_M: Final = 0.1
_MOST_AHEAD_M: Final = 3.0
"""Farthest place of a charge before a mouth."""

Mouths = dict[str, list[PlaceXY]]


def mouths_of(site: SitePlacement, buildings: Sequence[BuildingFit], free: BaseGeometry) -> Mouths:
    """Return places of charges before the mouths of streets in buildings, by places in the file.

    The ledger gets the streets.

    Args:
        free: The area of possible centres of a charge.
    """
    outlines = np.array([building.outline for building in buildings], dtype=object)
    tree = shapely.STRtree(outlines)
    found: Mouths = {}
    for street in site.of_role(Role.CHARGE):
        if not street.is_line:
            continue
        # 1. The buildings that a street really crosses.
        crossed = [
            buildings[index]
            for index in sorted(tree.query(street.geometry, "intersects").tolist())
            if _inside(street, buildings[index].outline).length > _LEAST_M
        ]
        if not crossed:
            continue
        is_solid = any(not building.base_m for building in crossed)
        detail = f"through {', '.join(building.name for building in crossed)}"
        kind = _SOLID if is_solid else _RAISED
        site.ledger.add(Fate.GUESSED, kind, street.place, street.name, detail)
        # 2. Where it leaves them, taken together, and a free place before each mouth.
        built = shapely.union_all([building.outline for building in crossed])
        ends = _ends(_inside(street, built), built)
        ahead = (_ahead(end, way, free) for end, way in ends)
        found[street.place] = [place for place in ahead if place is not None]
    return found


def _inside(street: Thing, built: BaseGeometry) -> BaseGeometry:
    return shapely.line_merge(shapely.intersection(street.geometry, built))


def _ends(inside: BaseGeometry, built: BaseGeometry) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield the mouths of the parts of a street in a building, and the directions out of it."""
    for part in shapely.get_parts(inside):
        if part.geom_type != "LineString" or part.length < _LEAST_M:
            continue
        for end, before in ((0.0, _STEP_M), (part.length, part.length - _STEP_M)):
            mouth, within = part.interpolate(end), part.interpolate(before)
            if built.boundary.distance(mouth) <= _AT_BORDER_M:
                way = np.array([mouth.x - within.x, mouth.y - within.y])
                yield np.array([mouth.x, mouth.y]), way / max(np.hypot(*way), _STEP_M * 1e-6)


def _ahead(mouth: FloatArray, way: FloatArray, free: BaseGeometry) -> tuple[float, float] | None:
    """Return the nearest place for a charge before a mouth, `None` if it is built up."""
    for far_m in np.arange(_STEP_M, _MOST_AHEAD_M + _STEP_M, _STEP_M):
        x, y = mouth + far_m * way
        if shapely.intersects_xy(free, x, y):
            return float(x), float(y)
    return None
