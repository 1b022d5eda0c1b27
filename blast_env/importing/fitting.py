"""Fitting of a map's buildings with rectangles of modules on the grid of a site."""

import re
import unicodedata
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.errors import BlastEnvError, import_extra, shortened
from blast_env.importing.cells import (
    COARSER,
    CellRectangle,
    Deviation,
    check_outlines,
    in_blocks,
    mended,
    outline_of,
    owners,
    rectangles_of,
)
from blast_env.importing.options import ImportOptions
from blast_env.importing.placing import PlacedSite
from blast_env.importing.roles import Role, Thing
from blast_env.units import MODULE_SIDE_M

with import_extra("maps", "maps and drawings"):
    import shapely
    from shapely.geometry.base import BaseGeometry

MOST_STRUCTURES: Final = 100
"""Most structures of a scenario."""

_MOST_NAME: Final = 34  # characters, which leaves room for the letters of parts
_BARRIER: Final = "barrier"
_QUARTER_SIDES: Final = 4
"""A circle is a polygon of 16 sides."""


@dataclass(frozen=True)
class FittedBuilding:
    """A building as modules.

    Attributes:
        name: Its name in the scenario.
        title: Its name on the map, or an empty string.
        place: Its place in the file.
        outline: Its outline in site metres, cut at the site's border.
        rectangles: The modules.
        wall_shares: Share of each rectangle in the building's exposed wall area.
        height_m: Its height, m; `None` for the height of the air.
        base_m: Height of its underside above the ground, m.
        protected: Whether its load counts.
        carries: Whether it is a terrace.
        deviation: Deviation of the modules from the outline.
        block_m: Side of its blocks, m; a module's side, unless that takes too many rectangles.
        is_cut: Whether the site's border cuts it.
    """

    name: str
    title: str
    place: str
    outline: BaseGeometry
    rectangles: tuple[CellRectangle, ...]
    wall_shares: tuple[float, ...]
    height_m: float | None
    base_m: float
    protected: bool
    carries: bool
    deviation: Deviation
    block_m: float
    is_cut: bool

    @property
    def part_names(self) -> tuple[str, ...]:
        """Names of the rectangles: the building's name, with letters if there are several."""
        if len(self.rectangles) == 1:
            return (self.name,)
        joint = "" if self.name[-1].isdigit() else "_"
        return tuple(
            f"{self.name}{joint}{_letters(number)}" for number in range(len(self.rectangles))
        )

    @property
    def modules(self) -> BaseGeometry:
        """The outline of the modules in site metres."""
        return outline_of(self.rectangles)

    @property
    def area_m2(self) -> float:
        """Area of the modules."""
        return float(self.modules.area)


def fit_buildings(
    site: PlacedSite, options: ImportOptions
) -> tuple[tuple[FittedBuilding, ...], tuple[str, ...]]:
    """Return the buildings of a site as modules, and notes on omissions.

    Raises:
        BlastEnvError: If there is no building, one deviates too far from its outline, or they
            take too many rectangles.
    """
    kept, notes = _kept(site, options)
    if not kept:
        raise BlastEnvError(f"{site.path}: there is no building on the site{_hint(site)}")
    said = sum(each.carries for each in kept)
    kept = [
        replace(each, carries=each.carries and _height_m(each, options) is not None)
        for each in kept
    ]
    topless = said - sum(each.carries for each in kept)
    if topless:
        notes.append(f"terraces without a height, on which nothing stands: {topless}")
    kept.sort(key=lambda each: (each.carries, -each.geometry.area))
    cut = []
    for carries in (False, True):  # a building on a terrace takes no ground from it
        level = [each for each in kept if each.carries == carries]
        owner = owners([each.geometry for each in level], site.shape)
        cut += [_cut(site, index, thing, owner, options) for index, thing in enumerate(level)]
    count = sum(len(rectangles) for rectangles, _ in cut)
    if count > MOST_STRUCTURES:
        raise _too_many(site, f"the buildings take {count} rectangles, must take")
    heights = [_height_m(each, options) for each in kept]
    titles = [each.name for each in kept]
    walls = _wall_areas([rectangles for rectangles, _ in cut], heights, site.shape)
    buildings = [
        FittedBuilding(
            name=name,
            title=thing.name,
            place=thing.place,
            outline=thing.geometry,
            rectangles=rectangles,
            wall_shares=shares,
            height_m=height_m,
            base_m=_base_m(thing, height_m),
            protected=thing.protected,
            carries=thing.carries,
            deviation=Deviation.between(thing.geometry, outline_of(rectangles)),
            block_m=block * MODULE_SIDE_M,
            is_cut=_touches_border(thing.geometry, site),
        )
        for name, thing, (rectangles, block), shares, height_m in zip(
            _names(titles), kept, cut, walls, heights, strict=True
        )
    ]
    for building in buildings:
        _check_deviation(site, building, options)
    without = sum(height_m is None for height_m in heights)
    if without:
        notes.append(
            "buildings without a height in the file, which are as high as the air "
            f"(--default-height): {without} of {len(heights)}"
        )
    return tuple(buildings), tuple(notes)


def protected_as_asked(
    buildings: Sequence[FittedBuilding], site: PlacedSite, options: ImportOptions
) -> tuple[FittedBuilding, ...]:
    """Return the buildings, with those protected that the user named, or else the file marks.

    Raises:
        BlastEnvError: If there is no building of a name, or no building is protected.
    """
    chosen = {_found(buildings, name) for name in options.protect}
    if options.protect_near is not None:
        place = shapely.Point(site.to_site(np.array([options.protect_near]))[0])
        chosen.add(int(np.argmin([each.outline.distance(place) for each in buildings])))
    if not chosen:
        chosen = {index for index, each in enumerate(buildings) if each.protected}
    if not chosen:
        raise BlastEnvError(
            "no building is protected: say --protect NAME or --protect-near X Y; there are "
            f"{_listed(buildings)}"
        )
    return tuple(replace(each, protected=index in chosen) for index, each in enumerate(buildings))


def _kept(site: PlacedSite, options: ImportOptions) -> tuple[list[Thing], list[str]]:
    """Return the large enough buildings on the site, cut at its border, and notes.

    Raises:
        BlastEnvError: If an outline is invalid, there are too many buildings, or their outlines
            are too long.
    """
    things = site.of_role(Role.BUILDING)
    outlines = np.array(list(map(_outline, things)), dtype=object)
    unsound = np.flatnonzero(~shapely.is_valid(outlines))
    for index in unsound:
        outlines[index] = _put_right(site, things[index], options)
    inside = shapely.intersection(outlines, site.box)
    parts, owner = shapely.get_parts(inside, return_index=True)
    is_area = shapely.get_type_id(parts) == shapely.GeometryType.POLYGON
    areas_m2 = np.bincount(owner[is_area], shapely.area(parts[is_area]), len(things))
    chosen = np.flatnonzero(areas_m2 >= options.least_area_m2)
    if len(chosen) > MOST_STRUCTURES:
        raise _too_many(site, f"there are {len(chosen)} buildings on the site, must be")
    geometries = [_together(parts[is_area & (owner == index)]) for index in chosen]
    check_outlines(geometries, f"{site.path}: the buildings")
    kept = [
        replace(
            things[index],
            geometry=geometry,
            name=things[index].name or _written_in(site, outlines[index]),
        )
        for index, geometry in zip(chosen, geometries, strict=True)
    ]
    small = int((~shapely.is_empty(inside)).sum()) - len(chosen)
    notes = []
    if small:
        notes.append(
            f"buildings of less than {options.least_area_m2:g} m2 on the site, which were left "
            f"out (--least-area): {small}"
        )
    if len(unsound):
        notes.append(f"outlines that cross themselves, corrected: {len(unsound)}")
    return kept, notes


def _outline(thing: Thing) -> BaseGeometry:
    """Return the outline of a building in site metres; a point with a diameter is a circle."""
    if thing.diameter_m is None:
        return thing.geometry
    return shapely.buffer(thing.geometry, 0.5 * thing.diameter_m, quad_segs=_QUARTER_SIDES)


def _together(parts: NDArray[np.object_]) -> BaseGeometry:
    geometry: BaseGeometry = parts[0] if len(parts) == 1 else shapely.MultiPolygon(list(parts))
    return geometry


def _too_many(site: PlacedSite, what: str) -> BlastEnvError:
    return BlastEnvError(
        f"{site.path}: {what} at most {MOST_STRUCTURES}, as many structures as a scenario has: "
        "make the site smaller (--size), leave out small buildings (--least-area), or take fewer "
        "rectangles for each (--most-rectangles)"
    )


def _put_right(site: PlacedSite, thing: Thing, options: ImportOptions) -> BaseGeometry:
    """Return an outline without its self-intersections.

    Raises:
        BlastEnvError: If `repair` is off, or it crosses itself too often.
    """
    words = f" ({shortened(thing.name)})" if thing.name else ""
    what = f"{site.path}: {thing.place}{words}: the outline"
    if not options.repair:
        reason = str(shapely.is_valid_reason(thing.geometry)).split("[")[0].strip().lower()
        raise BlastEnvError(f"{what} is not sound: {reason}; --repair corrects such outlines")
    return mended(thing.geometry, what)


def _written_in(site: PlacedSite, outline: BaseGeometry) -> str:
    """Return the text inside an outline of a drawing; an empty string unless it is unique."""
    texts = site.of_role(Role.NAME)
    shapely.prepare(outline)
    inside = shapely.covers(outline, [each.geometry for each in texts])
    words = {texts[index].name for index in np.flatnonzero(inside)}
    return words.pop() if len(words) == 1 else ""


def _cut(
    site: PlacedSite,
    index: int,
    thing: Thing,
    owner: NDArray[np.int32],
    options: ImportOptions,
) -> tuple[tuple[CellRectangle, ...], int]:
    """Return a building as rectangles, and the side of its blocks in modules.

    The blocks are as fine as `most_rectangles` allows. Cells of the building outside its blocks
    become air; blocks take no cells of other buildings.

    Raises:
        BlastEnvError: If the outline covers no module, or takes too many rectangles.
    """
    own = owner == index
    if not own.any():
        raise BlastEnvError(
            f"{site.path}: {thing.place}: covers half of no module, or lies under another "
            "building: leave it out with --least-area"
        )
    least = 0
    for side in COARSER:
        cells = in_blocks(own, side) & (own | (owner == -1))
        table = rectangles_of(cells)
        if 0 < len(table) <= options.most_rectangles:
            owner[own & ~cells] = -1
            owner[cells] = index
            return CellRectangle.each(table), side
        least = min(least, len(table)) or len(table)
    words = f" ({shortened(thing.name)})" if thing.name else ""
    raise BlastEnvError(
        f"{site.path}: {thing.place}{words}: takes {least} rectangles even in blocks of "
        f"{COARSER[-1] * MODULE_SIDE_M:g} m, must take at most {options.most_rectangles} "
        "(--most-rectangles)"
    )


def _check_deviation(site: PlacedSite, building: FittedBuilding, options: ImportOptions) -> None:
    """Refuse a building whose modules deviate too far from its outline.

    Raises:
        BlastEnvError: If the deviation of area or outline is above its limit.
    """
    deviation = building.deviation
    words = f"{site.path}: {building.place}: {shortened(building.title) or building.name}"
    if deviation.area_share > options.most_area_deviation:
        raise BlastEnvError(
            f"{words}: modules miss {deviation.area_share:.1%} of its area, must miss at most "
            f"{options.most_area_deviation:.1%} (--most-area-deviation, --most-rectangles)"
        )
    if deviation.outline_m > options.most_outline_deviation_m:
        raise BlastEnvError(
            f"{words}: the outline of its modules is {deviation.outline_m:.2f} m off, must be at "
            f"most {options.most_outline_deviation_m:g} m off (--most-outline-deviation, "
            "--most-rectangles)"
        )


def _height_m(thing: Thing, options: ImportOptions) -> float | None:
    """Return the height of a building, m, in whole modules; `None` if it is unknown."""
    height_m = thing.height_m or options.default_height_m
    return None if height_m is None else max(round(height_m / MODULE_SIDE_M), 1) * MODULE_SIDE_M


def _base_m(thing: Thing, height_m: float | None) -> float:
    """Return the base of a building, m, in whole modules, at least one module below its top."""
    base_m = round(thing.base_m / MODULE_SIDE_M) * MODULE_SIDE_M
    return base_m if height_m is None else max(min(base_m, height_m - MODULE_SIDE_M), 0.0)


def _wall_areas(
    parts: Sequence[Sequence[CellRectangle]],
    heights: Sequence[float | None],
    shape: tuple[int, int],
) -> list[tuple[float, ...]]:
    """Return the share of each rectangle in its building's exposed wall area.

    A wall beside a lower building is exposed above that building's roof.
    """
    # A building as high as the air is the highest.
    known = [height_m for height_m in heights if height_m is not None]
    tops_m = [max(known, default=0.0) + 1.0 if each is None else each for each in heights]
    height = np.zeros((shape[0] + 2, shape[1] + 2), dtype=np.float32)
    for rectangles, top_m in zip(parts, tops_m, strict=True):
        for each in rectangles:
            here = height[1:-1, 1:-1][each.cells]
            np.maximum(here, top_m, out=here)
    shares = []
    for rectangles, top_m in zip(parts, tops_m, strict=True):
        areas = np.array([_open_m2(each, top_m, height) for each in rectangles])
        shares.append(tuple(float(area) for area in areas / (areas.sum() or 1.0)))
    return shares


def _open_m2(each: CellRectangle, top_m: float, height: NDArray[np.float32]) -> float:
    """Return the exposed wall area of a rectangle, in module sides times metres.

    Args:
        each: The rectangle.
        top_m: Its height, m.
        height: Height of the buildings, m, on each cell and on a frame of one cell (rows + 2,
            columns + 2).
    """
    rows, columns = (slice(each.start + 1, each.stop + 1) for each in each.cells)
    beside = (
        height[rows, columns.start - 1],
        height[rows, columns.stop],
        height[rows.start - 1, columns],
        height[rows.stop, columns],
    )
    return float(sum(np.maximum(top_m - side, 0.0).sum(dtype=np.float64) for side in beside))


def _touches_border(outline: BaseGeometry, site: PlacedSite) -> bool:
    return bool(shapely.intersects(outline, site.box.boundary))


def _names(titles: Sequence[str]) -> list[str]:
    """Return a valid and unique name for each building."""
    names: list[str] = []
    number = 0
    for title in titles:
        name = plain_name(title)
        if name in ("", _BARRIER):
            number += 1
            name = f"building_{number}"
        while name in names:
            number += 1
            name = f"{plain_name(title) or 'building'}_{number}"
        names.append(name)
    return names


def plain_name(title: str) -> str:
    """Return the characters of a title that are valid in names; an empty string if none are."""
    plain = unicodedata.normalize("NFKD", title.replace("ß", "ss"))
    letters = plain.encode("ascii", "ignore").decode()
    return re.sub(r"[^A-Za-z0-9-]+", "_", letters).lstrip("_-0123456789").rstrip("_")[:_MOST_NAME]


def _letters(number: int) -> str:
    """Return a, b, ... z, aa, ab, ..."""
    text = ""
    number += 1
    while number:
        number, letter = divmod(number - 1, 26)
        text = chr(ord("a") + letter) + text
    return text


def _found(buildings: Sequence[FittedBuilding], name: str) -> int:
    """Return the index of the building of a name, the scenario's or the map's."""
    for index, each in enumerate(buildings):
        if name.casefold() in (each.name.casefold(), each.title.casefold()):
            return index
    raise BlastEnvError(f"--protect is {name!r}, but there are {_listed(buildings)}")


def _listed(buildings: Sequence[FittedBuilding]) -> str:
    """Return the names of up to 20 buildings, and the number of further ones."""
    shown = [each.name for each in buildings[:20]]
    more = len(buildings) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more else "")


def _hint(site: PlacedSite) -> str:
    """Return advice for a site without buildings."""
    return "".join(_hints(site))


def _hints(site: PlacedSite) -> Iterator[str]:
    if site.layers:
        layers = ", ".join(site.layers[:20])
        yield f": name their layer with --buildings-from; the file has {layers}"
    elif site.of_role(Role.BUILDING):
        yield ": buildings of the file lie elsewhere, or are smaller than --least-area"
    else:
        yield ": the file has none; define them with --buildings-from"
