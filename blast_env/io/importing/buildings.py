"""Preparation of a map's buildings: sound outlines, heights, parts, and none above another."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from blast_env.errors import BlastEnvError, import_extra, shortened
from blast_env.io.importing.cells import mended
from blast_env.io.importing.heights import with_heights
from blast_env.io.importing.ledger import Deed, Ledger
from blast_env.io.importing.options import ImportOptions
from blast_env.io.importing.placing import PlacedSite
from blast_env.io.importing.things import Role, Thing

with import_extra("maps", "maps and drawings"):
    import shapely
    from shapely.geometry.base import BaseGeometry

_QUARTER_SIDES: Final = 4
"""A circle is a polygon of 16 sides."""

_LEAST_SHARE: Final = 0.1
_LEAST_M2: Final = 1.0
"""Least overlap, of the smaller building: less is inaccuracy of the map."""

_PART_SHARE: Final = 0.5
"""Least share of a part that lies in its building."""


def prepared(site: PlacedSite, options: ImportOptions, ledger: Ledger) -> PlacedSite:
    """Return a site whose buildings have sound outlines and heights, and do not overlap.

    Raises:
        BlastEnvError: If an outline is not sound, and may not be or cannot be repaired.
    """
    others = [each for each in site.things if each.role is not Role.BUILDING]
    buildings = [_sound(site, each, options, ledger) for each in site.of_role(Role.BUILDING)]
    buildings = _with_parts(buildings, options, ledger)
    buildings = list(with_heights(buildings, options, ledger))
    return replace(site, things=(*others, *_apart(buildings, options, ledger)))


def _sound(site: PlacedSite, thing: Thing, options: ImportOptions, ledger: Ledger) -> Thing:
    """Return a building with its outline without self-intersections; a point becomes a circle.

    Raises:
        BlastEnvError: If `repair` is off, or it crosses itself too often.
    """
    if thing.diameter_m is not None:
        radius_m = 0.5 * thing.diameter_m
        circle = shapely.buffer(thing.geometry, radius_m, quad_segs=_QUARTER_SIDES)
        return replace(thing, geometry=circle)
    if shapely.is_valid(thing.geometry) or not shapely.intersects(
        thing.geometry.envelope, site.box
    ):
        return thing
    words = f" ({shortened(thing.name)})" if thing.name else ""
    what = f"{site.path}: {thing.place}{words}: the outline"
    if not options.repair:
        reason = str(shapely.is_valid_reason(thing.geometry)).split("[")[0].strip().lower()
        raise BlastEnvError(f"{what} is not sound: {reason}; --repair corrects such outlines")
    kind = "outlines that cross themselves, corrected"
    ledger.add(Deed.GUESSED, kind, thing.place, thing.name)
    return replace(thing, geometry=mended(thing.geometry, what))


def _with_parts(things: Sequence[Thing], options: ImportOptions, ledger: Ledger) -> list[Thing]:
    """Return buildings and their parts, joined by `part_of`.

    Parts that are small or without a height of their own are not kept; a building without a height
    has that of its lowest part. A part without a building is one.
    """
    wholes = [each for each in things if not each.is_part]
    tree = shapely.STRtree([each.geometry for each in wholes])
    parts: dict[int, list[Thing]] = {}
    found = []
    for part in things:
        if not part.is_part:
            continue
        own = _building_of(part, wholes, tree)
        if own is None:
            found.append(replace(part, is_part=False))
        elif part.height_m is None or part.geometry.area < options.least_area_m2:
            kind = "parts of buildings, small or without a height"
            ledger.add(Deed.MERGED, kind, part.place, part.name, f"with {wholes[own].place}")
        else:
            parts.setdefault(own, []).append(part)
    for index, whole in enumerate(wholes):
        own_parts = parts.get(index, [])
        lowest_m = min((each.height_m for each in own_parts if each.height_m), default=None)
        if lowest_m is not None and whole.height_m is None:
            kind, detail = "heights of buildings with parts", f"{lowest_m:g} m, as the lowest"
            ledger.add(Deed.GUESSED, kind, whole.place, whole.name, detail)
            whole = replace(whole, height_m=lowest_m)
        group = whole.place if own_parts else ""
        found.append(replace(whole, part_of=group))
        found += [
            replace(each, part_of=group, protected=whole.protected, name=each.name or whole.name)
            for each in own_parts
        ]
    return found


def _building_of(part: Thing, wholes: Sequence[Thing], tree: shapely.STRtree) -> int | None:
    """Return the index of the smallest building that has most of a part."""
    least = _PART_SHARE * part.geometry.area
    around = [
        int(index)
        for index in tree.query(part.geometry, "intersects")
        if _common(part, wholes[index]).area >= least
    ]
    return min(around, key=lambda index: float(wholes[index].geometry.area), default=None)


def _common(one: Thing, other: Thing) -> BaseGeometry:
    if not (one.geometry.is_valid and other.geometry.is_valid):  # outside the site
        return shapely.Point()
    return shapely.intersection(one.geometry, other.geometry)


def _apart(things: Sequence[Thing], options: ImportOptions, ledger: Ledger) -> list[Thing]:
    """Return buildings without overlaps: the higher one has the ground of both.

    A part comes before its building. A higher building that begins above the lower one's base
    begins there where they overlap.
    """
    order = sorted(
        (each for each in things if not each.carries),
        key=lambda each: (-bool(each.is_part), -(each.height_m or 0.0), -each.geometry.area),
    )
    tree = shapely.STRtree([each.geometry for each in order])
    found = [each for each in things if each.carries]
    left = list(order)
    for k, thing in enumerate(order):
        shape = thing.geometry
        cut: list[Thing] = []
        least_m2 = max(options.least_area_m2, _LEAST_SHARE * shape.area)
        for index in sorted(int(other) for other in tree.query(shape, "intersects")):
            if cut and shape.area < least_m2:
                break
            if index < k and _overlap(thing, order[index]):
                cut.append(order[index])
                shape = _areas_of(shapely.difference(shape, order[index].geometry))
                found += _filled(thing, order[index], left, index)
        if cut:
            kind = "parts above their building" if cut[0].is_part else "buildings over buildings"
            detail = f"by {', '.join(each.place for each in cut)}"
            if shape.area < least_m2:
                kind, shape = f"{kind}, covered", shapely.Polygon()
            else:
                kind = f"{kind}, overlap left out"
            ledger.add(Deed.MERGED, kind, thing.place, thing.name, detail)
        left[k] = replace(thing, geometry=shape)
    return [*found, *(each for each in left if not each.geometry.is_empty)]


def _overlap(one: Thing, other: Thing) -> bool:
    """Return whether two buildings overlap by more than the inaccuracy of a map."""
    least = min(one.geometry.area, other.geometry.area)
    related = bool(one.part_of) and one.part_of == other.part_of
    share = 0.0 if related else _LEAST_SHARE
    return bool(_common(one, other).area > max(share * least, _LEAST_M2))


def _filled(lower: Thing, higher: Thing, left: list[Thing], index: int) -> Iterator[Thing]:
    """Yield the piece of a raised building above a lower one, which reaches down to its base."""
    if lower.base_m >= left[index].base_m or left[index].geometry.is_empty:
        return
    above = shapely.intersection(left[index].geometry, lower.geometry)
    if above.area > _LEAST_M2:
        yield replace(higher, geometry=above, base_m=lower.base_m)
        rest = shapely.difference(left[index].geometry, lower.geometry)
        left[index] = replace(left[index], geometry=_areas_of(rest))


def _areas_of(shape: BaseGeometry) -> BaseGeometry:
    """Return the areas of a geometry, without its lines and points."""
    parts = shapely.get_parts(shape)
    areas = parts[shapely.get_dimensions(parts) == 2]
    return areas[0] if len(areas) == 1 else shapely.MultiPolygon(list(np.asarray(areas)))
