"""Outlines of lines: lines that nearly close, alone or together, and outlines within outlines."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from shapely.geometry import LineString, Polygon

from blast_env.arrays import FloatArray
from blast_env.io.importing.ledger import Fate, Ledger
from blast_env.io.importing.things import Role, Thing
from blast_env.units import MODULE_SIDE_M

CLOSE_M: Final = 0.1 * MODULE_SIDE_M
"""Largest gap of a line that counts as closed."""

OPEN: Final = "open lines, which close no outline"
JOINED: Final = "lines joined to outlines"
_HAIR_M: Final = 1e-3
_ROUNDING_M: Final = 1e-6
_LEAST_RING: Final = 3
_ALIKE: Final = 0.98


def closed(things: Sequence[Thing], ledger: Ledger) -> list[Thing]:
    """Return things in metres, with outlines in place of the lines that close, alone or together.

    Places of charges may be lines, and remain so. A line that closes no outline has a fault.
    """
    found: list[Thing] = []
    loose: dict[Role, list[Thing]] = {}
    for thing in things:
        if not thing.is_line or thing.role in (Role.CHARGE, Role.NAME):
            found.append(thing)
            continue
        outline = _ring(thing, ledger)
        if outline is None:
            loose.setdefault(thing.role, []).append(thing)
        else:
            found.append(replace(thing, geometry=outline))
    for lines in loose.values():
        found += _joined(lines, ledger)
    return found


def _ring(thing: Thing, ledger: Ledger) -> Polygon | None:
    """Return the outline of a line that ends where it starts, within `CLOSE_M`."""
    if thing.geometry.geom_type != "LineString":
        return None
    places = shapely.get_coordinates(thing.geometry)
    gap_m = float(np.hypot(*(places[-1] - places[0])))
    if len(places) <= _LEAST_RING - (gap_m > _ROUNDING_M) or gap_m > CLOSE_M:
        return None
    ring = Polygon(places[:-1] if gap_m > _ROUNDING_M and len(places) > _LEAST_RING else places)
    if ring.area < CLOSE_M**2:
        return None
    if gap_m > _ROUNDING_M:
        kind, detail = "outlines with a gap", f"{1000.0 * gap_m:.1f} mm"
        ledger.add(Fate.CLOSED, kind, thing.place, thing.name, detail)
    return ring


def _joined(lines: Sequence[Thing], ledger: Ledger) -> list[Thing]:
    """Return the outlines that lines close together, and the other lines with a fault."""
    parts = [
        (index, shapely.get_coordinates(part))
        for index, line in enumerate(lines)
        for part in shapely.get_parts(line.geometry)
    ]
    # 1. Ends that nearly meet, brought together; 2. the faces that the lines enclose.
    owners = np.array([index for index, _ in parts])
    sides, gaps_m = _snapped([places for _, places in parts])
    outlines = shapely.get_parts(shapely.polygonize(sides))
    tree = shapely.STRtree(sides)
    used: dict[int, int] = {}  # line: outline
    found = []
    for outline in outlines:
        # 3. The lines along the rim are the sides of the outline; the first with a name names it.
        near = tree.query(outline, "intersects")
        rim = shapely.buffer(outline.boundary, _HAIR_M)
        of_rim = sorted({int(owners[k]) for k in near if shapely.covers(rim, sides[k])})
        if not of_rim:
            continue
        chief = next((lines[k] for k in of_rim if lines[k].name), lines[of_rim[0]])
        found.append(replace(chief, geometry=outline))
        for k in of_rim:
            used.setdefault(k, len(found) - 1)
    # 4. An entry in the ledger for each line, with the gap that was bridged.
    bridged_m = np.zeros(len(lines))
    np.maximum.at(bridged_m, owners, gaps_m)
    chiefs = {outline.place for outline in found}
    for k, outline in used.items():
        words = f", {1000.0 * bridged_m[k]:.1f} mm bridged" if bridged_m[k] > _ROUNDING_M else ""
        own = lines[k]
        ledger.add(Fate.CLOSED, JOINED, own.place, own.name, f"of {found[outline].place}{words}")
        if own.place not in chiefs:
            detail = f"with {found[outline].place}"
            ledger.add(Fate.MERGED, "sides of outlines", own.place, own.name, detail)
    left = [replace(line, fault=OPEN) for k, line in enumerate(lines) if k not in used]
    return [*found, *left]


def _snapped(sides: Sequence[FloatArray]) -> tuple[list[LineString], FloatArray]:
    """Return lines whose ends meet where they are within `CLOSE_M`, and how far each end moved."""
    ends = np.array([places[k] for places in sides for k in (0, -1)]).reshape(-1, 2)
    # Ends within reach of each other, also by way of others, become one point: the first of them.
    pairs = cKDTree(ends).query_pairs(CLOSE_M, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(ends), len(ends)))
    _, group = connected_components(links, directed=False)
    _, first, of_group = np.unique(group, return_index=True, return_inverse=True)
    met = ends[first][of_group]
    moved_m = np.hypot(*(met - ends).T).reshape(-1, 2).max(axis=1)
    lines = []
    for k, places in enumerate(sides):
        own = places.copy()
        own[0], own[-1] = met[2 * k], met[2 * k + 1]
        lines.append(LineString(own))
    return lines, moved_m


def with_courtyards(things: Sequence[Thing], ledger: Ledger) -> list[Thing]:
    """Return the objects of a drawing, with outlines within outlines of a layer as courtyards.

    An inner outline with a name or another height is a building of its own. The filling of an
    outline is no courtyard, but has them.
    """
    outlines = [
        k
        for k, thing in enumerate(things)
        if thing.role is Role.BUILDING
        and not thing.fault
        and thing.geometry.geom_type == "Polygon"
        and thing.geometry.is_valid
    ]
    texts = shapely.STRtree([thing.geometry for thing in things if thing.role is Role.NAME])
    shapes = np.array([things[k].geometry for k in outlines], dtype=object)
    areas = shapely.area(shapes)
    whole = np.asarray(shapely.area(shapely.polygons(shapely.get_exterior_ring(shapes))))
    # 1. What lies within what: a court if it is clearly smaller, the filling of a border if it is
    # as large but has holes.
    inner, outer = shapely.STRtree(shapes).query(shapes, "within")
    deep: dict[int, list[int]] = {}
    fillings: dict[int, int] = {}
    for low, high in zip(inner, outer, strict=True):
        one, other = things[outlines[low]], things[outlines[high]]
        alike = (one.kind, one.height_m, one.base_m) == (other.kind, other.height_m, other.base_m)
        if low != high and whole[low] < _ALIKE * whole[high] and alike:
            deep.setdefault(int(low), []).append(int(high))
        elif areas[low] < _ALIKE * areas[high] and alike:
            fillings.setdefault(int(high), int(low))
    found, gone = list(things), set()
    # 2. A filled outline takes the shape of its filling.
    for high, low in fillings.items():
        outline, filling = outlines[high], things[outlines[low]]
        if outlines[low] not in gone:
            found[outline] = replace(found[outline], geometry=filling.geometry)
            kind, detail = "fillings of outlines", f"of {found[outline].place}"
            ledger.add(Fate.MERGED, kind, filling.place, filling.name, detail)
            gone.add(outlines[low])
    # 3. Outlines by depth: those within an odd number of others are courts of the smallest, those
    # within an even number are buildings that stand in a court.
    for low, around in sorted(deep.items(), key=lambda pair: len(pair[1])):
        court = things[outlines[low]]
        if outlines[low] in gone:
            continue
        if len(around) % 2 == 0 or court.name or len(texts.query(court.geometry, "contains")):
            continue
        high = outlines[min(around, key=lambda index: areas[index])]
        hole = shapely.difference(found[high].geometry, court.geometry)
        found[high] = replace(found[high], geometry=hole)
        kind, detail = "outlines within outlines, taken as courtyards", found[high].place
        ledger.add(Fate.GUESSED, kind, court.place, court.name, f"of {detail}")
        ledger.add(Fate.MERGED, "courtyards", court.place, court.name, f"with {detail}")
        gone.add(outlines[low])
    return [thing for k, thing in enumerate(found) if k not in gone]
