"""Places of charges on an imported site."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from blast_env.errors import BlastEnvError, import_extra
from blast_env.geometry import fewest_runs
from blast_env.io.importing.cells import check_outlines, covered_shares, in_blocks, mended
from blast_env.io.importing.fitting import FittedBuilding
from blast_env.io.importing.ledger import Deed, Ledger
from blast_env.io.importing.options import ImportOptions
from blast_env.io.importing.placing import OUTSIDE, PlacedSite
from blast_env.io.importing.things import Role, Thing
from blast_env.units import MODULE_SIDE_M

with import_extra("maps", "maps and drawings"):
    import shapely
    from shapely.geometry.base import BaseGeometry

MOST_SOURCES: Final = 100
"""Most charges of a scenario."""

_SIMPLER_M: Final = (0.1, 0.25, 0.5, 1.0, 2.0)  # tolerances of the simplification of streets
_LEAST_LENGTH_M: Final = 1.0
_CLEAR_M: Final = 0.01  # more than the charge's radius, for rounding
_DIGITS: Final = 3
_AREA_BLOCK: Final = 4  # modules: scale of the blocks of an area, per m of tolerance
_BUILT_OVER: Final = "places of charges that are built over, or too near to a building or border"
_POINT_SHARE_M: Final = 5.0


def charge_sources(
    site: PlacedSite,
    buildings: Sequence[FittedBuilding],
    radius_m: float,
    options: ImportOptions,
    ledger: Ledger,
) -> tuple[list[dict[str, Any]], frozenset[str]]:
    """Return the places of charges, as the charges of a scenario, and their places in the file.

    Streets become segments along both kerbs, weighted by length, so that every metre is equally
    likely; areas become rectangles weighted by area; points remain points with the weight of 5 m
    of street. All keep clear of buildings and border by the charge's radius.

    Args:
        site: The site.
        buildings: Its buildings.
        radius_m: Radius of the charge, m.
        options: Mass of the charges, and further places.
        ledger: The ledger of the import.

    Raises:
        BlastEnvError: If there is no place for a charge, or there are too many.
    """
    free = _free(site, buildings, radius_m)
    things = _without_crossings(site)
    asked = list(_asked(site, free, options))
    most = MOST_SOURCES - len(asked)
    sources, kerbs = _fewest(things, free, most, options), True
    if len(sources) > most and any(each.width_m for each in things):
        kerbs = False
        things = [replace(each, width_m=None) for each in things]
        sources = _fewest(things, free, most, options)
    if len(sources) > most:
        raise BlastEnvError(
            f"{site.path}: charges may be at {len(sources) + len(asked)} places, must be at most "
            f"{MOST_SOURCES}: make the site smaller (--size), or choose fewer places "
            "(--charges-from)"
        )
    if not sources and not asked:
        raise BlastEnvError(
            f"{site.path}: there is no place for a charge on the site clear of buildings: say "
            "--charge-at X,Y, with --charges-from where one may be, or --margin for more ground"
        )
    used = frozenset(place for place, _ in sources)
    for each in site.of_role(Role.CHARGE):
        if each.place not in used:
            on_site = shapely.intersects(each.geometry, site.box)
            deed, kind = (Deed.LEFT_OUT, _BUILT_OVER) if on_site else (Deed.PASSED, OUTSIDE)
            ledger.add(deed, kind, each.place, each.name)
        elif each.width_m is not None and not kerbs:
            kind = "streets of too many bends, with charges on the centre line instead of the kerbs"
            ledger.add(Deed.GUESSED, kind, each.place, each.name)
    return [*asked, *(source for _, source in sources)], used


def _fewest(
    things: Sequence[Thing], free: BaseGeometry, most: int, options: ImportOptions
) -> list[tuple[str, dict[str, Any]]]:
    """Return the sources of things with their places, in the finest form of at most `most`."""
    for tolerance_m in _SIMPLER_M:
        sources = [
            (each.place, source)
            for each in things
            for source in _sources(each, free, tolerance_m, options)
        ]
        if len(sources) <= most:
            break
    return sources


def _without_crossings(site: PlacedSite) -> list[Thing]:
    """Return the places of charges, with the outlines of areas repaired.

    Raises:
        BlastEnvError: If the outlines are too long, or one crosses itself too often.
    """
    things, areas = [], []
    for thing in site.of_role(Role.CHARGE):
        if shapely.get_dimensions(thing.geometry) == 2:
            outline = mended(thing.geometry, f"{site.path}: {thing.place}: the outline")
            areas.append(shapely.intersection(outline, site.box))
            thing = replace(thing, geometry=areas[-1])
        things.append(thing)
    check_outlines(areas, f"{site.path}: areas of charges")
    return things


def _free(site: PlacedSite, buildings: Sequence[FittedBuilding], radius_m: float) -> BaseGeometry:
    """Return the area of possible centres of a charge."""
    width_m, height_m = site.size_m
    gap_m = radius_m + _CLEAR_M
    inside = shapely.box(gap_m, gap_m, width_m - gap_m, height_m - gap_m)
    built = shapely.union_all(
        [shapely.box(*each.grown(gap_m)) for building in buildings for each in building.boxes_m]
    )
    return shapely.difference(inside, built)


def _asked(
    site: PlacedSite, free: BaseGeometry, options: ImportOptions
) -> Iterator[dict[str, Any]]:
    """Yield the points of `charge_at`."""
    for place in options.charge_at:
        x_m, y_m = site.to_site(np.array([place]))[0]
        if not shapely.intersects(free, shapely.Point(x_m, y_m)):
            raise BlastEnvError(
                f"--charge-at is {place[0]:.10g},{place[1]:.10g}, which is at ({x_m:.2f}, "
                f"{y_m:.2f}) m of the site: outside, in a building, or too near to one"
                f"{site.hint_of_exchange(place)}"
            )
        yield _point(float(x_m), float(y_m), options.tnt_kg)


def _sources(
    thing: Thing, free: BaseGeometry, tolerance_m: float, options: ImportOptions
) -> Iterator[dict[str, Any]]:
    tnt_kg = thing.tnt_kg or options.tnt_kg
    for part in shapely.get_parts(thing.geometry):
        if part.geom_type == "Polygon":
            yield from _areas(part, free, tolerance_m, tnt_kg)
        elif part.geom_type == "Point":
            if shapely.intersects(free, part):
                yield _point(part.x, part.y, tnt_kg)
        else:
            for line in replace(thing, geometry=part).kerbs:
                yield from _segments(line, free, tolerance_m, tnt_kg)


def _segments(
    line: BaseGeometry, free: BaseGeometry, tolerance_m: float, tnt_kg: float
) -> Iterator[dict[str, Any]]:
    places = shapely.get_coordinates(shapely.simplify(line, tolerance_m))
    pieces = shapely.linestrings(np.stack((places[:-1], places[1:]), axis=1))
    parts = shapely.get_parts(shapely.intersection(pieces, free))
    for part in parts[shapely.length(parts) >= _LEAST_LENGTH_M]:
        ends = shapely.get_coordinates(part)[[0, -1]].round(_DIGITS).tolist()
        yield {
            "kind": "segment",
            "start_m": ends[0],
            "end_m": ends[1],
            "tnt_kg": tnt_kg,
            "weight": round(float(part.length), _DIGITS),
        }


def _areas(
    area: BaseGeometry, free: BaseGeometry, tolerance_m: float, tnt_kg: float
) -> Iterator[dict[str, Any]]:
    """Yield the blocks of an area; their side grows with the tolerance."""
    inside = shapely.intersection(area, free)
    if inside.is_empty or inside.area == 0.0:
        return
    _, _, right, top = inside.bounds
    shape = (int(np.ceil(2.0 * top)) + 1, int(np.ceil(2.0 * right)) + 1)
    (rows, columns), shares = covered_shares(inside, shape)
    cells = np.zeros(shape, dtype=bool)
    # Whole cells only, so that the blocks keep as clear as the area does.
    cells[rows, columns] = shares > 1.0 - 1e-6
    blocks = in_blocks(cells, 1 + int(_AREA_BLOCK * tolerance_m)) & cells
    for row, column, *count in fewest_runs(blocks).tolist():
        height_m, width_m = (MODULE_SIDE_M * each for each in count)
        yield {
            "kind": "rectangle",
            "corner_m": [MODULE_SIDE_M * column, MODULE_SIDE_M * row],
            "size_m": [width_m, height_m],
            "tnt_kg": tnt_kg,
            "weight": width_m * height_m,
        }


def _point(x_m: float, y_m: float, tnt_kg: float) -> dict[str, Any]:
    return {
        "kind": "point",
        "position_m": [round(float(x_m), _DIGITS), round(float(y_m), _DIGITS)],
        "tnt_kg": tnt_kg,
        "weight": _POINT_SHARE_M,
    }
