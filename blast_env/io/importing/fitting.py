"""Polygons of a map's buildings on a site."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from blast_env.errors import BlastEnvError, import_extra
from blast_env.geometry import Rectangle
from blast_env.io.importing.cells import Deviation, check_outlines
from blast_env.io.importing.ledger import Deed, Ledger
from blast_env.io.importing.options import ImportOptions
from blast_env.io.importing.placing import OUTSIDE, PlacedSite
from blast_env.io.importing.things import Role, Thing
from blast_env.site.footprint import Footprint, footprint_of
from blast_env.units import MODULE_SIDE_M

with import_extra("maps", "maps and drawings"):
    import shapely
    from anyascii import anyascii
    from shapely.geometry.base import BaseGeometry

MOST_STRUCTURES: Final = 100
"""Most structures of a scenario."""

_MOST_NAME: Final = 34  # characters, which leaves room for the letters of parts
_BARRIER: Final = "barrier"
_DIGITS: Final = (3, 6)  # of coordinates; more where millimetres make modules overlap
_JOINED_M: Final = 0.05  # gap between buildings that is closed
_MUCH_AREA: Final = 0.2
_FAR_M: Final = 1.0
_LEAST_PART_M2: Final = 0.5 * MODULE_SIDE_M**2
_THIN: Final = "buildings below others, or that cover the centre of no module"


@dataclass(frozen=True)
class FittedBuilding:
    """A building as polygons.

    Attributes:
        name: Its name in the scenario.
        title: Its name on the map, or an empty string.
        place: Its place in the file.
        outline: Its outline in site metres, cut at the site's border.
        polygons: The polygons of its structures: several if the border cuts it apart.
        height_m: Its height, m; `None` for the height of the air.
        base_m: Height of its underside above the ground, m.
        protected: Whether its load counts.
        carries: Whether it is a terrace.
        part_of: Place in the file of the building of which it is a part, or an empty string.
        deviation: Deviation of the modules from the outline.
        is_cut: Whether the site's border cuts it.
        facade: Its storeys and windows, see `Thing`.
    """

    name: str
    title: str
    place: str
    outline: BaseGeometry
    polygons: tuple[Footprint, ...]
    height_m: float | None
    base_m: float
    protected: bool
    carries: bool
    part_of: str
    deviation: Deviation
    is_cut: bool
    facade: Mapping[str, float]

    @property
    def part_names(self) -> tuple[str, ...]:
        """Names of the structures: the building's name, with letters if there are several."""
        if len(self.polygons) == 1:
            return (self.name,)
        joint = "" if self.name[-1].isdigit() else "_"
        return tuple(
            f"{self.name}{joint}{_letters(number)}" for number in range(len(self.polygons))
        )

    @property
    def record(self) -> dict[str, Any]:
        """The building and its deviation from the outline as plain data."""
        return {
            "name": self.name,
            "title": self.title,
            "place": self.place,
            "structures": list(self.part_names),
            "protected": self.protected,
            "height_m": self.height_m,
            "area_m2": self.outline.area,
            "modules_m2": self.area_m2,
            "area_deviation": self.deviation.area_share,
            "outline_deviation_m": self.deviation.outline_m,
            "is_cut": self.is_cut,
        }

    @property
    def group(self) -> str:
        """Place in the file of the whole building."""
        return self.part_of or self.place

    @property
    def wall_height_m(self) -> float:
        """Height of its walls, m; 1 if it is as high as the air."""
        return 1.0 if self.height_m is None else self.height_m - self.base_m

    @property
    def boxes_m(self) -> tuple[Rectangle, ...]:
        """The modules in rectangles, site metres."""
        return tuple(box for each in self.polygons for box in each.boxes_m)

    @property
    def area_m2(self) -> float:
        """Area of the modules."""
        return MODULE_SIDE_M**2 * sum(len(each.cells) for each in self.polygons)


def fit_buildings(
    site: PlacedSite, options: ImportOptions, ledger: Ledger
) -> tuple[tuple[FittedBuilding, ...], tuple[Thing, ...]]:
    """Return the buildings of a site as polygons, and those that are left out.

    Raises:
        BlastEnvError: If there is no building, or there are too many.
    """
    kept, left_out = _kept(site, options, ledger)
    if not kept:
        raise BlastEnvError(f"{site.path}: there is no building on the site{_hint(site)}")
    kept.sort(key=lambda each: (each.carries, -each.geometry.area))
    polygons = _polygons(kept)
    for each, own in zip(kept, polygons, strict=True):
        if not own:
            ledger.add(Deed.LEFT_OUT, _THIN, each.place, each.name)
            left_out.append(replace(each, fault=_THIN))
    kept = [each for each, own in zip(kept, polygons, strict=True) if own]
    polygons = [own for own in polygons if own]
    count = sum(map(len, polygons))
    if count > MOST_STRUCTURES:
        raise _too_many(site, f"the buildings take {count} structures, must take")
    heights = [_height_m(each) for each in kept]
    titles = [each.name for each in kept]
    buildings = [
        FittedBuilding(
            name=name,
            title=thing.name,
            place=thing.place,
            outline=thing.geometry,
            polygons=own,
            height_m=height_m,
            base_m=_base_m(thing, height_m),
            protected=thing.protected,
            carries=thing.carries,
            part_of=thing.part_of,
            deviation=Deviation.between(thing.geometry, _modules(own)),
            is_cut=_touches_border(thing.geometry, site),
            facade=thing.facade,
        )
        for name, thing, own, height_m in zip(_names(titles), kept, polygons, heights, strict=True)
    ]
    _enter_far_off(buildings, ledger)
    return tuple(buildings), tuple(left_out)


def _kept(
    site: PlacedSite, options: ImportOptions, ledger: Ledger
) -> tuple[list[Thing], list[Thing]]:
    """Return the large enough buildings on the site, cut at its border, and those left out.

    Raises:
        BlastEnvError: If there are too many buildings, or their outlines are too long.
    """
    things = site.of_role(Role.BUILDING)
    outlines = np.array([each.geometry for each in things], dtype=object)
    outlines[~shapely.intersects(shapely.envelope(outlines), site.box)] = shapely.Point()
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
    left_out = []
    for thing, shape, area_m2 in zip(things, inside, areas_m2, strict=True):
        if shape.is_empty:
            ledger.add(Deed.PASSED, OUTSIDE, thing.place, thing.name)
        elif area_m2 < options.least_area_m2:
            kind = f"buildings of less than {options.least_area_m2:g} m2 (--least-area)"
            detail = f"{area_m2:.1f} m2 on the site"
            ledger.add(Deed.LEFT_OUT, kind, thing.place, thing.name, detail)
            left_out.append(replace(thing, fault=kind))
    return kept, left_out


def _together(parts: NDArray[np.object_]) -> BaseGeometry:
    geometry: BaseGeometry = parts[0] if len(parts) == 1 else shapely.MultiPolygon(list(parts))
    return geometry


def _too_many(site: PlacedSite, what: str) -> BlastEnvError:
    return BlastEnvError(
        f"{site.path}: {what} at most {MOST_STRUCTURES}, as many structures as a scenario has: "
        "make the site smaller (--size), or leave out small buildings (--least-area)"
    )


def _written_in(site: PlacedSite, outline: BaseGeometry) -> str:
    """Return the text inside an outline of a drawing; an empty string unless it is unique."""
    texts = site.of_role(Role.NAME)
    shapely.prepare(outline)
    inside = shapely.covers(outline, [each.geometry for each in texts])
    words = {texts[index].name for index in np.flatnonzero(inside)}
    return words.pop() if len(words) == 1 else ""


def _polygons(kept: Sequence[Thing]) -> list[tuple[Footprint, ...]]:
    """Return the polygons of buildings, none of whose modules overlap; empty for a lost building.

    Buildings and terraces are separate: a building on a terrace takes no ground from it.
    """
    apart: list[BaseGeometry] = []
    for number, thing in enumerate(kept):
        others = [
            before
            for before, other in zip(apart, kept[:number], strict=False)
            if other.carries == thing.carries and before.distance(thing.geometry) <= _JOINED_M
        ]
        apart.append(_beside(thing.geometry, shapely.union_all(others)))
    polygons: list[tuple[Footprint, ...]] = []
    for digits in _DIGITS:
        polygons = [_footprints(each, digits) for each in apart]
        levels = (
            [own for own, each in zip(polygons, kept, strict=True) if each.carries == carries]
            for carries in (False, True)
        )
        if not any(map(_overlap, levels)):
            break
    return polygons


def _beside(outline: BaseGeometry, others: BaseGeometry) -> BaseGeometry:
    """Return an outline without the ground of others; a narrow gap between them is closed."""
    if shapely.is_empty(others):
        return outline
    joined = shapely.snap(outline, others, _JOINED_M)
    sound = joined if shapely.is_valid(joined) else outline
    return shapely.difference(sound, others)


def _footprints(outline: BaseGeometry, digits: int) -> tuple[Footprint, ...]:
    """Return the polygons of an outline that cover a module, with rounded coordinates."""
    found = []
    for part in shapely.get_parts(shapely.set_precision(outline, 10.0**-digits)):
        if part.geom_type == "Polygon" and part.area >= _LEAST_PART_M2:
            rings = [
                tuple((round(x, digits), round(y, digits)) for x, y in ring.coords[:-1])
                for ring in (part.exterior, *part.interiors)
                if shapely.Polygon(ring).area >= _LEAST_PART_M2
            ]
            found.append(footprint_of(rings[0], tuple(rings[1:])))
    return tuple(each for each in found if each.cells)


def _overlap(buildings: Iterable[Sequence[Footprint]]) -> bool:
    """Return whether modules of buildings overlap."""
    boxes = [shapely.box(*box) for own in buildings for each in own for box in each.boxes_m]
    area_m2 = float(shapely.area(boxes).sum())
    return bool(area_m2 > shapely.area(shapely.union_all(boxes)) + 0.5 * MODULE_SIDE_M**2)


def _modules(polygons: Sequence[Footprint]) -> BaseGeometry:
    """Return the outline of the modules of polygons in site metres."""
    return shapely.union_all([shapely.box(*box) for each in polygons for box in each.boxes_m])


def _enter_far_off(buildings: Iterable[FittedBuilding], ledger: Ledger) -> None:
    """Enter in the ledger the buildings that modules cannot show well, such as thin walls."""
    for each in buildings:
        own = each.deviation
        if own.area_share > _MUCH_AREA or own.outline_m > _FAR_M:
            detail = f"{own.area_share:.1%} of its area, {own.outline_m:.2f} m of its outline"
            kind = "shapes of buildings that modules miss by much"
            ledger.add(Deed.GUESSED, kind, each.place, each.title or each.name, detail)


def _height_m(thing: Thing) -> float | None:
    """Return the height of a building, m, in whole modules; `None` if it is unknown."""
    if thing.height_m is None:
        return None
    return max(round(thing.height_m / MODULE_SIDE_M), 1) * MODULE_SIDE_M


def _base_m(thing: Thing, height_m: float | None) -> float:
    """Return the base of a building, m, in whole modules, at least one module below its top."""
    base_m = round(thing.base_m / MODULE_SIDE_M) * MODULE_SIDE_M
    return base_m if height_m is None else max(min(base_m, height_m - MODULE_SIDE_M), 0.0)


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
    """Return a title in the letters of names: `Lodz_Sad`, `b_1st_National`; empty without any."""
    name = re.sub(r"[^A-Za-z0-9-]+", "_", anyascii(title).replace("'", "")).strip("_-")
    return (f"b_{name}" if name[:1].isdigit() else name)[:_MOST_NAME].rstrip("_-")


def _letters(number: int) -> str:
    """Return a, b, ... z, aa, ab, ..."""
    text = ""
    number += 1
    while number:
        number, letter = divmod(number - 1, 26)
        text = chr(ord("a") + letter) + text
    return text


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
