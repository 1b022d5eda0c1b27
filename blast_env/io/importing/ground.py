"""The ground of a site: where charges may be, and where barriers may stand.

Areas of the map become modules, and these few rectangles.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain
from math import dist
from typing import Any, Final

import numpy as np
import shapely
from shapely.affinity import translate
from shapely.geometry.base import BaseGeometry

from blast_env.arrays import BoolArray
from blast_env.errors import BlastEnvError
from blast_env.geometry import Rectangle, fewest_runs
from blast_env.io.importing.fitting import BuildingFit
from blast_env.io.importing.ledger import Fate
from blast_env.io.importing.options import PlaceXY
from blast_env.io.importing.outlines import check_outlines, mended
from blast_env.io.importing.passages import Mouths, mouths_of
from blast_env.io.importing.placing import SitePlacement
from blast_env.io.importing.things import VEHICLES, Role, Thing
from blast_env.units import MODULE_SIDE_M

MOST_SOURCES: Final = 100
"""Most charges of a scenario."""

MOST_KEEP_OUTS: Final = 100
"""Most no-build areas of a scenario."""

MOST_AREAS: Final = 1000
"""Most outlines of a zone, of no-build areas, or of places of charges."""

_COARSER: Final = (1, 2, 3, 4, 6, 8)
"""Candidate sides of the blocks of no-build areas, in modules."""

_SIMPLER_M: Final = (0.1, 0.25, 0.5, 1.0, 2.0)  # tolerances of the simplification of streets
_AREA_BLOCK: Final = 4  # modules: scale of the blocks of an area, per m of tolerance
_LEAST_LENGTH_M: Final = 1.0
_CLEAR_M: Final = 0.01  # more than the charge's radius, for rounding
_DIGITS: Final = 3
_WEIGHTS: Final = (1e-6, 1e6)
_BUILT_OVER: Final = "places of charges that are built over, or too near to a building or border"
_POINT_SHARE_M: Final = 5.0
_AT_MOUTH_M: Final = 0.5
_CLEARANCE_M: Final = 1.0  # of barriers from structures
_HALF: Final = 0.5  # of a block
_ANY: Final = 1e-3  # of a block: a single module suffices
_HAIR_M: Final = 1e-6
_TOUCHED_M: Final = 0.025  # an outline that reaches less far into a module is rounding of the map
_MOST_REASON: Final = 200
_OUTSIDE: Final = "outside the build zone of the map"


def charge_sources(
    site: SitePlacement, buildings: Sequence[BuildingFit], radius_m: float
) -> tuple[list[dict[str, Any]], frozenset[str]]:
    """Return the places of charges, as the charges of a scenario, and their places in the file.

    Streets become segments along both kerbs, weighted by length, so that every metre is equally
    likely; areas become rectangles weighted by area; points remain points with the weight of 5 m
    of street. All keep clear of buildings and border by the charge's radius.
    """
    free = _free(site, buildings, radius_m)
    # 1. Places asked for, and the mouths of passages; 2. streets and areas, in coarser lines until
    # they are few enough; 3. if not even then, streets by their centre lines.
    asked, mouths = list(_asked(site, free)), mouths_of(site, buildings, free)
    things, most = _on_site(site, Role.CHARGE), MOST_SOURCES - len(asked)
    sources, has_kerbs = _fewest(site, things, free, mouths, most), True
    if len(sources) > most and any(thing.width_m for thing in things):
        has_kerbs = False
        things = [replace(thing, width_m=None) for thing in things]
        sources = _fewest(site, things, free, mouths, most)
    if len(sources) > most:
        raise BlastEnvError(
            f"{site.path}: charges may be at {len(sources) + len(asked)} places, must be at most "
            f"{MOST_SOURCES}: make the site smaller (--size), or choose fewer places "
            "(--charges-from)"
        )
    if not sources and not asked:
        has_vehicle = any(thing.fault == VEHICLES for thing in site.faulty)
        words = f"{VEHICLES}; " if has_vehicle else ""
        raise BlastEnvError(
            f"{site.path}: {words}there is no place for a charge on the site clear of buildings: "
            "say --charge-at X,Y, with --charges-from where one may be, or --margin for more ground"
        )
    used = frozenset(place for place, _ in sources)
    for thing in site.of_role(Role.CHARGE):
        if thing.place not in used:
            on_site = shapely.intersects(thing.geometry, site.box)
            fate, kind = (Fate.LEFT_OUT, _BUILT_OVER) if on_site else site.beyond
            site.ledger.add(fate, kind, thing.place, thing.name)
        elif thing.width_m is not None and not has_kerbs:
            kind = "streets of too many bends, with charges on the centre line instead of the kerbs"
            site.ledger.add(Fate.GUESSED, kind, thing.place, thing.name)
    return [*asked, *(source for _, source in sources)], used


def _free(site: SitePlacement, buildings: Sequence[BuildingFit], radius_m: float) -> BaseGeometry:
    """Return the area of possible centres of a charge."""
    width_m, height_m = site.size_m
    gap_m = radius_m + _CLEAR_M
    inside = shapely.box(gap_m, gap_m, width_m - gap_m, height_m - gap_m)
    built = shapely.union_all(
        [shapely.box(*box_m.grown(gap_m)) for building in buildings for box_m in building.boxes_m]
    )
    return shapely.difference(inside, built)


def _fewest(
    site: SitePlacement, things: Sequence[Thing], free: BaseGeometry, mouths: Mouths, most: int
) -> list[tuple[str, dict[str, Any]]]:
    """Return the sources of things with their places, in the finest form of at most `most`."""
    for tolerance_m in _SIMPLER_M:
        sources = [
            (thing.place, source)
            for thing in things
            for source in _charged(
                site,
                thing,
                _with_mouths(
                    list(_sources(site, thing, free, tolerance_m)), mouths.get(thing.place, ())
                ),
            )
        ]
        if len(sources) <= most:
            break
    return sources


def _charged(
    site: SitePlacement, thing: Thing, sources: Iterable[dict[str, Any]]
) -> Iterator[dict[str, Any]]:
    """Yield the sources of a thing with its mass and height; together they have its weight."""
    charge = {"tnt_kg": thing.tnt_kg or site.options.tnt_kg}
    charge |= {"height_m": thing.above_m} if thing.above_m else {}
    own = list(sources)
    whole = sum(source["weight"] for source in own)
    for source in own:
        share = {}
        if thing.weight is not None:
            weight = thing.weight * source["weight"] / whole
            share = {"weight": float(np.clip(weight, *_WEIGHTS))}
        yield source | charge | share


def _with_mouths(
    sources: list[dict[str, Any]], mouths: Sequence[PlaceXY]
) -> Iterator[dict[str, Any]]:
    """Yield the places of a charge of a street, and its mouths to which it does not lead."""
    yield from sources
    ends = [end for source in sources if source["kind"] == "segment" for end in _ends_of(source)]
    for place in mouths:
        if all(dist(place, end) > _AT_MOUTH_M for end in ends):
            yield _point(*place)


def _ends_of(segment: dict[str, Any]) -> tuple[PlaceXY, PlaceXY]:
    return segment["start_m"], segment["end_m"]


def _asked(site: SitePlacement, free: BaseGeometry) -> Iterator[dict[str, Any]]:
    """Yield the points of `charge_at`."""
    for place in site.options.charge_at:
        x_m, y_m = site.to_site(np.array([place]))[0]
        if not shapely.intersects(free, shapely.Point(x_m, y_m)):
            raise BlastEnvError(
                f"--charge-at is {place[0]:.10g},{place[1]:.10g}, which is at ({x_m:.2f}, "
                f"{y_m:.2f}) m of the site: outside, in a building, or too near to one"
                f"{site.hint_of_exchange(place)}"
            )
        yield _point(float(x_m), float(y_m)) | {"tnt_kg": site.options.tnt_kg}


def _sources(
    site: SitePlacement, thing: Thing, free: BaseGeometry, tolerance_m: float
) -> Iterator[dict[str, Any]]:
    """Yield the places of a charge as a scenario has them, without its mass."""
    for part in shapely.get_parts(thing.geometry):
        if part.geom_type == "Polygon":
            yield from _areas(site, shapely.intersection(part, free), tolerance_m)
        elif part.geom_type == "Point":
            if shapely.intersects(free, part):
                yield _point(part.x, part.y)
        else:
            for line in replace(thing, geometry=part).kerbs:
                yield from _segments(line, free, tolerance_m)


def _segments(
    line: BaseGeometry, free: BaseGeometry, tolerance_m: float
) -> Iterator[dict[str, Any]]:
    # Straight pieces, less what is too near to buildings or the border; crumbs are dropped.
    places = shapely.get_coordinates(shapely.simplify(line, tolerance_m))
    pieces = shapely.linestrings(np.stack((places[:-1], places[1:]), axis=1))
    parts = shapely.get_parts(shapely.intersection(pieces, free))
    for part in parts[shapely.length(parts) >= _LEAST_LENGTH_M]:
        ends = shapely.get_coordinates(part)[[0, -1]].round(_DIGITS).tolist()
        weight = round(float(part.length), _DIGITS)
        yield {"kind": "segment", "start_m": ends[0], "end_m": ends[1], "weight": weight}


def _areas(site: SitePlacement, area: BaseGeometry, tolerance_m: float) -> Iterator[dict[str, Any]]:
    """Yield the blocks of an area; their side grows with the tolerance."""
    # Whole modules only, so that the blocks keep as clear as the area does.
    reach_m = 0.5 * MODULE_SIDE_M - _HAIR_M
    corners = [translate(area, x, y) for x in (-reach_m, reach_m) for y in (-reach_m, reach_m)]
    cells = cells_of(shapely.intersection_all(corners), site.shape)
    blocks = in_blocks(cells, 1 + int(_AREA_BLOCK * tolerance_m), _HALF) & cells
    for corner_m, size_m in _rectangles(blocks):
        weight = size_m[0] * size_m[1]
        yield {"kind": "rectangle", "corner_m": corner_m, "size_m": size_m, "weight": weight}


def _point(x_m: float, y_m: float) -> dict[str, Any]:
    position_m = [round(float(x_m), _DIGITS), round(float(y_m), _DIGITS)]
    return {"kind": "point", "position_m": position_m, "weight": _POINT_SHARE_M}


def build_zone(site: SitePlacement, buildings: Sequence[BuildingFit]) -> dict[str, Any] | None:
    """Return the build zone in the form of a scenario; `None` if neither map nor options have one.

    A zone that is not a rectangle becomes its bounding box, with no-build areas for the rest.
    """
    options = site.options
    inside = np.zeros(site.shape, dtype=bool)
    if options.zone_m is not None:
        left, bottom, width, height = options.zone_m
        area_m = Rectangle(left, bottom, left + width, bottom + height)
        inside[_window(site, area_m, "--zone")] = True
    elif options.zone_around_m is not None:
        chosen = [box_m for own in buildings if own.protected for box_m in own.boxes_m]
        around = Rectangle.around(chosen).grown(options.zone_around_m)
        cut = Rectangle(*shapely.intersection(shapely.box(*around), site.box).bounds)
        inside[_window(site, cut, "--zone-around")] = True
    elif site.of_role(Role.ZONE):
        for thing in _on_site(site, Role.ZONE):
            inside |= cells_of(thing.geometry, site.shape)
    elif options.zone_from:
        raise BlastEnvError(
            f"{site.path}: nothing on the site is chosen by --zone-from {options.zone_from}"
        )
    else:
        return None
    if not inside.any():
        raise BlastEnvError(f"{site.path}: the build zone is not on the site")
    # A zone is a rectangle: the bounding box, with no-build areas where the wanted area is not.
    rows, columns = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
    low_row, left_column = int(rows[0]), int(columns[0])
    window = slice(low_row, int(rows[-1]) + 1), slice(left_column, int(columns[-1]) + 1)
    return {
        "corner_m": [left_column * MODULE_SIDE_M, low_row * MODULE_SIDE_M],
        "rows": window[0].stop - low_row,
        "columns": window[1].stop - left_column,
        "stock": options.stock,
        "height_m": options.wall_height_m,
        "clearance_m": _CLEARANCE_M,
        "keep_outs": _keep_outs(site, inside, window),
    }


def _keep_outs(
    site: SitePlacement, inside: BoolArray, window: tuple[slice, slice]
) -> list[dict[str, Any]]:
    """Return the no-build areas, in the finest blocks within the limit of a scenario."""
    reach_m = 0.5 * MODULE_SIDE_M - _TOUCHED_M
    areas = [
        (
            (thing.name or "no-build area of the map")[:_MOST_REASON],
            thing.geometry.buffer(reach_m, join_style="mitre"),
        )
        for thing in _on_site(site, Role.KEEP_OUT)
        if thing.geometry.area
    ]
    # Larger and larger blocks, each closed if any of it is: the zone only ever gets smaller.
    first = window[0].start, window[1].start
    for side in _COARSER:
        touched = ((reason, cells_of(area, site.shape)[window]) for reason, area in areas)
        found = [
            {"corner_m": corner_m, "size_m": size_m, "reason": reason}
            for reason, cells in chain([(_OUTSIDE, ~inside[window])], touched)
            for corner_m, size_m in _rectangles(in_blocks(cells, side, _ANY), first)
        ]
        if len(found) <= MOST_KEEP_OUTS:
            return found
    raise BlastEnvError(
        f"{site.path}: areas that must stay empty take {len(found)} rectangles even in blocks of "
        f"{_COARSER[-1] * MODULE_SIDE_M:g} m, must take at most {MOST_KEEP_OUTS}: make the zone "
        "smaller or simpler"
    )


def _on_site(site: SitePlacement, role: Role) -> list[Thing]:
    """Return the objects of a role, areas with sound outlines that are cut at the border."""
    things, areas = [], []
    for thing in site.of_role(role):
        if shapely.get_dimensions(thing.geometry) == 2:
            outline = mended(thing.geometry, f"{site.path}: {thing.place}: the outline")
            thing = replace(thing, geometry=shapely.intersection(outline, site.box))
            areas += [thing.geometry] if thing.geometry.area else []
        things.append(thing)
    if len(areas) > MOST_AREAS:
        raise BlastEnvError(
            f"{site.path}: there are {len(areas)} outlines of a {role} on the site, must be at "
            f"most {MOST_AREAS}"
        )
    check_outlines(areas, f"{site.path}: outlines of a {role}")
    return things


def _window(site: SitePlacement, area_m: Rectangle, option: str) -> tuple[slice, slice]:
    """Return the rows and columns of a rectangle, which must lie on the site."""
    width_m, height_m = site.size_m
    if not Rectangle(0.0, 0.0, width_m, height_m).contains(area_m) or not (
        area_m.left < area_m.right and area_m.bottom < area_m.top
    ):
        left, bottom, right, top = area_m
        raise BlastEnvError(
            f"{option} is x {left:g} to {right:g} m, y {bottom:g} to {top:g} m, must lie on the "
            f"site (x 0 to {width_m:g} m, y 0 to {height_m:g} m)"
        )
    left, bottom, right, top = (round(side_m / MODULE_SIDE_M) for side_m in area_m)
    return slice(bottom, max(top, bottom + 1)), slice(left, max(right, left + 1))


def cells_of(outline: BaseGeometry, shape: tuple[int, int]) -> BoolArray:
    """Return where an outline, in m from the grid's corner, has the centre of a module."""
    cells = np.zeros(shape, dtype=bool)
    if not outline.area:
        return cells
    bounds = np.array(outline.bounds) / MODULE_SIDE_M
    left, bottom, right, top = (max(int(bound), 0) for bound in (*bounds[:2], *np.ceil(bounds[2:])))
    window = cells[bottom:top, left:right]
    rows, columns = window.shape
    x_m = MODULE_SIDE_M * (left + np.arange(columns) + 0.5)
    y_m = MODULE_SIDE_M * (bottom + np.arange(rows) + 0.5)
    shapely.prepare(outline)
    window[:] = shapely.intersects_xy(outline, x_m, y_m[:, np.newaxis])
    return cells


def _rectangles(
    cells: BoolArray, first: tuple[int, int] = (0, 0)
) -> Iterator[tuple[list[float], list[float]]]:
    """Yield corner and size in m of the few rectangles that modules make, from a row and column."""
    for row, column, rows, columns in fewest_runs(cells).tolist():
        corner_m = [(first[1] + column) * MODULE_SIDE_M, (first[0] + row) * MODULE_SIDE_M]
        yield corner_m, [columns * MODULE_SIDE_M, rows * MODULE_SIDE_M]


def in_blocks(cells: BoolArray, side: int, least: float) -> BoolArray:
    """Return cells in whole blocks of side x side: those of which a share `least` is set."""
    if side == 1:
        return cells
    rows, columns = (-(-count // side) * side for count in cells.shape)
    padded = np.zeros((rows, columns), dtype=bool)
    padded[: cells.shape[0], : cells.shape[1]] = cells
    blocks = padded.reshape(rows // side, side, columns // side, side).mean(axis=(1, 3))
    whole = np.repeat(np.repeat(blocks >= least, side, axis=0), side, axis=1)
    return whole[: cells.shape[0], : cells.shape[1]]
