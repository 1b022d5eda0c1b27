"""The buildings of a site as polygons: their names, deviations and protection."""

import re
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from blast_env.errors import BlastEnvError, import_extra, named, quoted, shortened
from blast_env.geometry import Rectangle
from blast_env.io.importing.ledger import Fate
from blast_env.io.importing.outlines import areas_of, check_outlines, walls_of
from blast_env.io.importing.panes import fitted
from blast_env.io.importing.placing import SitePlacement
from blast_env.io.importing.things import Role, Thing
from blast_env.site.footprint import Footprint, footprint_of
from blast_env.units import MODULE_SIDE_M
from blast_env.values import letters

with import_extra("maps", "maps and drawings"):
    from anyascii import anyascii

MOST_STRUCTURES: Final = 100
"""Most structures of a scenario."""

MOST_TITLE: Final = 100
"""Most characters of a title of a scenario; longer names of a map are cut."""

_MOST_NAME: Final = 34  # characters, which leaves room for the letters of parts
_BARRIER: Final = "barrier"
_CUT: Final = "buildings across the border of the site, with a wall there that they do not have"
_LEAST_CUT_M2: Final = 0.5 * MODULE_SIDE_M**2
_DIGITS: Final = (3, 6)  # of coordinates; more where millimetres make modules overlap
_JOINED_M: Final = 0.05  # gap between buildings that is closed
_MUCH_AREA: Final = 0.2
_FAR_M: Final = 1.0
_LEAST_PART_M2: Final = 0.5 * MODULE_SIDE_M**2
_LINE_STEP_M: Final = 0.1  # sampling step for distances between outlines
_LINE_POINTS: Final = 50_000
_MOST_LISTED: Final = 20


@dataclass(frozen=True)
class Deviation:
    """Deviation of modules from an outline.

    Attributes:
        area_share: Area of the symmetric difference, as a share of the outline's area.
        outline_m: Hausdorff distance of the two boundaries: the largest distance of a point of
            one to the nearest point of the other.
    """

    area_share: float
    outline_m: float

    @classmethod
    def between(cls, outline: BaseGeometry, modules: BaseGeometry) -> "Deviation":
        """Return the deviation of modules from an outline."""
        area = shapely.area(shapely.symmetric_difference(outline, modules))
        outline_m = max(_farthest_m(outline, modules), _farthest_m(modules, outline))
        return cls(float(area / outline.area), outline_m)


def _farthest_m(outline: BaseGeometry, other: BaseGeometry) -> float:
    """Return the largest distance of a point of an outline from another outline."""
    step_m = max(_LINE_STEP_M, outline.length / _LINE_POINTS)
    line = shapely.segmentize(outline.boundary, step_m)
    tree = shapely.STRtree(walls_of(other))
    points = shapely.points(shapely.get_coordinates(line))
    _, distances_m = tree.query_nearest(points, return_distance=True, all_matches=False)
    return float(distances_m.max())


@dataclass(frozen=True)
class BuildingFit:
    """A building as polygons.

    Attributes:
        name: Its name in the scenario.
        title: Its name on the map, cut to `MOST_TITLE` characters, or an empty string.
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
        facade: Its storeys and windows, see `MapFeature`.
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
            f"{self.name}{joint}{letters(number).lower()}" for number in range(len(self.polygons))
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
        return tuple(box for polygon in self.polygons for box in polygon.boxes_m)

    @property
    def area_m2(self) -> float:
        """Area of the modules."""
        return MODULE_SIDE_M**2 * sum(len(polygon.cells) for polygon in self.polygons)


def fit_buildings(site: SitePlacement) -> tuple[BuildingFit, ...]:
    """Return the buildings of a site as polygons, with those protected that are to be."""
    kept = _kept(site)
    if not kept:
        raise _no_building(site)
    # The largest building first: it keeps its outline, and its neighbours fit to that.
    kept.sort(key=lambda thing: (thing.carries, -thing.geometry.area))
    fitted = []
    for thing, own in zip(kept, _polygons(kept), strict=True):
        if own:
            fitted.append((thing, own))
        else:
            kind = "buildings below others, or that cover the centre of no module"
            site.ledger.add(Fate.LEFT_OUT, kind, thing.place, thing.name)
    count = sum(len(own) for _, own in fitted)
    if count > MOST_STRUCTURES:
        raise _too_many(site, f"the buildings take {count} structures, must take")
    names = _names([thing.name for thing, _ in fitted])
    buildings = [
        _fitted(site, name, thing, own) for name, (thing, own) in zip(names, fitted, strict=True)
    ]
    return _with_protected(site, buildings)


def _fitted(
    site: SitePlacement, name: str, thing: Thing, polygons: tuple[Footprint, ...]
) -> BuildingFit:
    """Return a building with its heights in whole modules.

    The ledger gets a building that modules cannot show well, such as thin walls.
    """
    modules = shapely.union_all([shapely.box(*box) for own in polygons for box in own.boxes_m])
    off = Deviation.between(thing.geometry, modules)
    if off.area_share > _MUCH_AREA or off.outline_m > _FAR_M:
        detail = f"{off.area_share:.1%} of its area, {off.outline_m:.2f} m of its outline"
        kind = "shapes of buildings that modules miss by much"
        site.ledger.add(Fate.GUESSED, kind, thing.place, thing.name or name, detail)
    height_m = None
    # Heights in whole modules, at least one of them.
    base_m = round(thing.base_m / MODULE_SIDE_M) * MODULE_SIDE_M
    if thing.height_m is not None:
        height_m = max(round(thing.height_m / MODULE_SIDE_M), 1) * MODULE_SIDE_M
        base_m = max(min(base_m, height_m - MODULE_SIDE_M), 0.0)
    walls_m = [wall.length_m for own in polygons for wall in own.walls]
    rise_m = 0.0 if height_m is None else height_m - base_m
    return BuildingFit(
        name=name,
        title=shortened(thing.name, MOST_TITLE),
        place=thing.place,
        outline=thing.geometry,
        polygons=polygons,
        height_m=height_m,
        base_m=base_m,
        protected=thing.protected,
        carries=thing.carries,
        part_of=thing.part_of,
        deviation=off,
        is_cut=any(
            entry.kind == _CUT and entry.place == thing.place for entry in site.ledger.of(Fate.CUT)
        ),
        facade=fitted(thing.facade, walls_m, rise_m, thing.place, site.ledger),
    )


def _kept(site: SitePlacement) -> list[Thing]:
    """Return the large enough buildings on the site, cut at its border."""
    least_m2 = site.options.least_area_m2
    outlines = np.array([thing.geometry for thing in site.of_role(Role.BUILDING)], dtype=object)
    outlines[~shapely.intersects(shapely.envelope(outlines), site.box)] = shapely.Point()
    kept = []
    inside = shapely.intersection(outlines, site.box)
    for thing, outline, shape in zip(site.of_role(Role.BUILDING), outlines, inside, strict=True):
        area = areas_of(shape)
        if shape.is_empty:
            site.ledger.add(*site.beyond, thing.place, thing.name)
        elif area.area < least_m2:
            kind = f"buildings of less than {least_m2:g} m2 (--least-area)"
            detail = f"{area.area:.1f} m2 on the site"
            site.ledger.add(Fate.LEFT_OUT, kind, thing.place, thing.name, detail)
        else:
            _note_cut(site, thing, area)
            kept.append((replace(thing, geometry=area), outline))
    if len(kept) > MOST_STRUCTURES:
        raise _too_many(site, f"there are {len(kept)} buildings on the site, must be")
    check_outlines([thing.geometry for thing, _ in kept], f"{site.path}: the buildings")
    return [replace(thing, name=thing.name or _written_in(site, whole)) for thing, whole in kept]


def _note_cut(site: SitePlacement, thing: Thing, area: BaseGeometry) -> None:
    """Enter a building of which the border of the site leaves a part."""
    whole_m2 = thing.geometry.area
    if whole_m2 - area.area > _LEAST_CUT_M2:
        detail = f"{area.area:.1f} of {whole_m2:.1f} m2"
        site.ledger.add(Fate.CUT, _CUT, thing.place, thing.name, detail)


def _too_many(site: SitePlacement, what: str) -> BlastEnvError:
    return BlastEnvError(
        f"{site.path}: {what} at most {MOST_STRUCTURES}, as many structures as a scenario has: "
        "make the site smaller (--size), or leave out small buildings (--least-area)"
    )


def _written_in(site: SitePlacement, outline: BaseGeometry) -> str:
    """Return the text inside an outline of a drawing; an empty string unless it is unique."""
    texts = site.of_role(Role.NAME)
    shapely.prepare(outline)
    inside = shapely.covers(outline, [text.geometry for text in texts])
    words = {texts[index].name for index in np.flatnonzero(inside)}
    return words.pop() if len(words) == 1 else ""


def _polygons(kept: Sequence[Thing]) -> list[tuple[Footprint, ...]]:
    """Return the polygons of buildings, none of whose modules overlap; empty for a lost building.

    Buildings and terraces are separate: a building on a terrace takes no ground from it.
    """
    # 1. Outlines apart: each without the ground of the larger ones before it.
    apart: list[BaseGeometry] = []
    for number, thing in enumerate(kept):
        others = [
            before
            for before, other in zip(apart, kept[:number], strict=False)
            if other.carries == thing.carries and before.distance(thing.geometry) <= _JOINED_M
        ]
        apart.append(_beside(thing.geometry, shapely.union_all(others)))
    # 2. Short coordinates, with more digits only if rounding makes modules overlap.
    polygons: list[tuple[Footprint, ...]] = []
    for digits in _DIGITS:
        polygons = [_footprints(part, digits) for part in apart]
        levels = (
            [own for own, thing in zip(polygons, kept, strict=True) if thing.carries == carries]
            for carries in (False, True)
        )
        if not any(map(_overlap, levels)):
            break
    return polygons


def _beside(outline: BaseGeometry, others: BaseGeometry) -> BaseGeometry:
    """Return an outline without the ground of others; a narrow gap between them is closed."""
    if shapely.is_empty(others):
        return outline
    # Snapping may fold an outline: then a gap is better than an outline that crosses itself.
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
    return tuple(footprint for footprint in found if footprint.cells)


def _overlap(buildings: Iterable[Sequence[Footprint]]) -> bool:
    """Return whether modules of buildings overlap."""
    boxes = [shapely.box(*box) for own in buildings for part in own for box in part.boxes_m]
    # The union loses what is covered twice; half a module is room for rounding.
    area_m2 = float(shapely.area(boxes).sum())
    return bool(area_m2 > shapely.area(shapely.union_all(boxes)) + 0.5 * MODULE_SIDE_M**2)


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
    name = re.sub(r"[^A-Za-z0-9-]+", "_", anyascii(title[:MOST_TITLE]).replace("'", "")).strip("_-")
    return (f"b_{name}" if name[:1].isdigit() else name)[:_MOST_NAME].rstrip("_-")


def _no_building(site: SitePlacement) -> BlastEnvError:
    """Return the error of a site without buildings."""
    hint = ": the file has none; define them with --buildings-from"
    if site.layers:
        layers = ", ".join(map(named, site.layers[:_MOST_LISTED]))
        hint = f": name their layer with --buildings-from; the file has {layers}"
    elif site.of_role(Role.BUILDING):
        hint = ": buildings of the file lie elsewhere, or are smaller than --least-area"
    return BlastEnvError(f"{site.path}: there is no building on the site{hint}")


def _with_protected(
    site: SitePlacement, buildings: Sequence[BuildingFit]
) -> tuple[BuildingFit, ...]:
    """Return the buildings, with those protected that the user named, or else the file marks.

    All parts of a building are protected with it.
    """
    chosen = {index for name in site.options.protect for index in _named(site, buildings, name)}
    if site.options.protect_near is not None:
        chosen.add(_nearest(site, buildings, site.options.protect_near))
    if not chosen:
        known = {place for building in buildings for place in (building.place, building.group)}
        _check_marked(site, known)
        chosen = {index for index, building in enumerate(buildings) if building.protected}
    if not chosen:
        raise BlastEnvError(
            "no building is protected: say --protect NAME or --protect-near X,Y; there are "
            f"{_listed(buildings)}"
        )
    groups = {buildings[index].group for index in chosen}
    return tuple(replace(building, protected=building.group in groups) for building in buildings)


def _check_marked(site: SitePlacement, known: Set[str]) -> None:
    """Refuse a file that marks a building on the site as protected which is not kept.

    Args:
        known: Places in the file of the buildings that are, and of those of which parts are.
    """
    fates = {entry.place: entry for entry in site.ledger.of(Fate.LEFT_OUT, Fate.MERGED)}
    for thing in (*site.of_role(Role.BUILDING), *site.faulty):
        entry = fates.get(thing.place)
        if thing.protected and entry is not None and thing.place not in known:
            raise BlastEnvError(
                f"{site.path}: marks a building as protected that is {entry.fate}: {entry.kind}: "
                f"{entry.words}; with --protect or --protect-near no mark counts"
            )


def _named(site: SitePlacement, buildings: Sequence[BuildingFit], name: str) -> list[int]:
    """Return the indices of the buildings of a name, the map's or the scenario's.

    A map may have a name several times, as that of a school of several houses.
    """
    asked = shortened(name, MOST_TITLE).casefold()
    for key in ("title", "name"):
        found = [
            index
            for index, building in enumerate(buildings)
            if asked and getattr(building, key).casefold() == asked
        ]
        if found:
            return found
    for lost in site.ledger.of(Fate.LEFT_OUT):
        if lost.name.casefold() == name.casefold():
            raise BlastEnvError(
                f"--protect is {quoted(name)}, which is left out: {lost.place}: {lost.kind}"
            )
    raise BlastEnvError(f"--protect is {quoted(name)}, but there are {_listed(buildings)}")


def _nearest(
    site: SitePlacement, buildings: Sequence[BuildingFit], place: tuple[float, float]
) -> int:
    """Return the index of the building nearest to a place of the map."""
    x_m, y_m = site.to_site(np.array([place]))[0]
    point = shapely.Point(x_m, y_m)
    distances_m = [building.outline.distance(point) for building in buildings]
    best, known = int(np.argmin(distances_m)), {building.place for building in buildings}
    reasons = {entry.place: entry.kind for entry in site.ledger.of(Fate.LEFT_OUT)}
    reasons = {key: reason for key, reason in reasons.items() if key not in known}
    for thing in (*site.of_role(Role.BUILDING), *site.faulty):
        if thing.place not in reasons or thing.role is not Role.BUILDING or thing.geometry.is_empty:
            continue
        if thing.geometry.convex_hull.distance(point) < distances_m[best]:
            words = f" ({named(thing.name)})" if thing.name else ""
            raise BlastEnvError(
                f"--protect-near is {place[0]:.10g},{place[1]:.10g}: the building nearest to it "
                f"is {thing.place}{words}, which is left out: {reasons[thing.place]}"
            )
    if not shapely.intersects(point, site.box):
        raise BlastEnvError(
            f"--protect-near is {place[0]:.10g},{place[1]:.10g}, which is at ({x_m:,.1f}, "
            f"{y_m:,.1f}) m of the site, outside of it{site.hint_of_exchange(place)}"
        )
    return best


def _listed(buildings: Sequence[BuildingFit]) -> str:
    """Return the names of some buildings, those with names on the map first."""
    titled = sorted(buildings, key=lambda building: not building.title)
    shown = [
        building.name
        if "_".join(building.title.split()) in ("", building.name)
        else f"{building.name} ({named(building.title)})"
        for building in titled[:_MOST_LISTED]
    ]
    more = len(buildings) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more else "")
