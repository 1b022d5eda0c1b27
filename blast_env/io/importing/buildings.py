"""Preparation of a map's buildings: sound outlines, heights, parts, and none above another."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Final

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from blast_env.errors import BlastEnvError, named
from blast_env.io.importing.bodies import LEAST_STOREY_M
from blast_env.io.importing.doubles import without_doubles
from blast_env.io.importing.ledger import Fate
from blast_env.io.importing.options import ImportOptions
from blast_env.io.importing.outlines import areas_of, mended
from blast_env.io.importing.placing import SitePlacement
from blast_env.io.importing.things import Role, Thing
from blast_env.io.importing.vertical import on_the_ground
from blast_env.units import MODULE_SIDE_M

_QUARTER_SIDES: Final = 4
"""A circle is a polygon of 16 sides."""

_LEAST_SHARE: Final = 0.1
_LEAST_M2: Final = 1.0
"""Least overlap, of the smaller building: less is inaccuracy of the map."""

_HALF: Final = 0.5  # of a building

_PART_SHARE: Final = 0.5
"""Least share of a part that lies in its building."""

_ROOFS: Final = frozenset({"roof", "canopy", "carport"})
"""Values of `building` for a roof on posts."""

_ROOF_M: Final = 4.5
_LEAST_NEIGHBOURS: Final = 3
_MOST_NEIGHBOURS: Final = 15
_NEIGHBOUR_M: Final = 150.0
_SMALL_M2: Final = 30.0
_LOW_SHARE: Final = 0.25

_STOREYS: Final[Mapping[str, tuple[int, int]]] = MappingProxyType(
    {
        **dict.fromkeys(
            ("garage", "garages", "shed", "hut", "cabin", "kiosk", "greenhouse", "toilets")
            + ("bungalow", "static_caravan", "service", "container", "ruins", "farm_auxiliary"),
            (1, 1),
        ),
        **dict.fromkeys(("house", "detached", "semidetached_house", "terrace", "farm"), (2, 1)),
        **dict.fromkeys(
            ("apartments", "dormitory", "hotel", "office", "commercial", "hospital", "public")
            + ("university", "government", "civic", "residential"),
            (4, 2),
        ),
        **dict.fromkeys(("industrial", "warehouse", "hangar", "barn", "church", "chapel"), (3, 2)),
        **dict.fromkeys(("cathedral", "tower", "water_tower", "silo", "chimney"), (6, 3)),
    }
)
"""Likely and low numbers of storeys by the value of `building` or `man_made`."""

_USUAL: Final = (2, 1)
_FEW: Final = 2
_MOST_STOREYS_LOW: Final = 10
_MOST_STOREYS: Final = 200
_BRIDGE: Final = "bridge"
_GENERAL: Final = ("", "yes")
_SOLID_BELOW: Final = "raised parts, solid to the ground, where their building is drawn below them"
_INTO_TERRACE: Final = "terraces into which buildings reach, without the ground of these"
_ON_TERRACE: Final = "buildings on terraces without an underside, on the top of the terrace"
_HIGH: Final = "too high is on the unsafe side for a building that shields: compare --low-heights"


def prepared(site: SitePlacement) -> SitePlacement:
    """Return a site whose buildings have sound outlines and heights, and do not overlap."""
    others = [thing for thing in site.things if thing.role is not Role.BUILDING]
    buildings = [_sound(site, thing) for thing in site.of_role(Role.BUILDING)]
    single = without_doubles(buildings, site.ledger)
    buildings = on_the_ground(single, site.options.level_height_m, site.ledger)
    buildings = _on_terraces(site, _with_heights(site, _with_parts(site, buildings)))
    buildings = _apart(site, buildings)
    left = {building.place for building in buildings}
    gone = [building for building in single if building.place not in left]
    return replace(site, things=(*others, *buildings), faulty=(*site.faulty, *gone))


def _sound(site: SitePlacement, thing: Thing) -> Thing:
    """Return a building with its outline without self-intersections; a point becomes a circle."""
    if thing.diameter_m is not None:
        radius_m = 0.5 * thing.diameter_m
        circle = shapely.buffer(thing.geometry, radius_m, quad_segs=_QUARTER_SIDES)
        return replace(thing, geometry=circle)
    if shapely.is_valid(thing.geometry) or not shapely.intersects(
        thing.geometry.envelope, site.box
    ):
        return thing
    words = f" ({named(thing.name)})" if thing.name else ""
    what = f"{site.path}: {thing.place}{words}: the outline"
    if not site.options.repair:
        reason = str(shapely.is_valid_reason(thing.geometry)).split("[")[0].strip().lower()
        raise BlastEnvError(f"{what} is not sound: {reason}; --repair corrects such outlines")
    kind = "outlines that cross themselves, corrected"
    site.ledger.add(Fate.GUESSED, kind, thing.place, thing.name)
    return replace(thing, geometry=mended(thing.geometry, what))


def _with_parts(site: SitePlacement, things: Sequence[Thing]) -> list[Thing]:
    """Return buildings and their parts, joined by `part_of`.

    Parts that are small or without a height of their own are not kept; a building without a height
    has that of its lowest part. A part without a building is one.
    """
    # 1. The building of each part: the one that it names, else the smallest that has most of it.
    wholes = [thing for thing in things if not thing.is_part]
    tree = shapely.STRtree([whole.geometry for whole in wholes])
    parts: dict[int, list[Thing]] = {}
    marked = {k for k, whole in enumerate(wholes) if whole.protected}
    found = []
    for part in things:
        if not part.is_part:
            continue
        own = next((k for k, whole in enumerate(wholes) if whole.place == part.part_of), None)
        own = _building_of(part, wholes, tree) if own is None else own
        if own is None:
            found.append(replace(part, is_part=False))
            continue
        marked |= {own} if part.protected else set()
        if part.height_m is None or part.geometry.area < site.options.least_area_m2:
            kind = "parts of buildings, small or without a height"
            site.ledger.add(Fate.MERGED, kind, part.place, part.name, f"with {wholes[own].place}")
        else:
            parts.setdefault(own, []).append(part)
    # 2. Buildings with their parts: one group, which is protected as a whole.
    for index, whole in enumerate(wholes):
        own_parts = parts.get(index, [])
        lowest_m = min(
            (own_part.height_m for own_part in own_parts if own_part.height_m), default=None
        )
        if lowest_m is not None and whole.height_m is None:
            kind, detail = "heights of buildings with parts", f"{lowest_m:g} m, as the lowest"
            site.ledger.add(Fate.GUESSED, kind, whole.place, whole.name, detail)
            whole = replace(whole, height_m=lowest_m)
        group, is_marked = whole.part_of or (whole.place if own_parts else ""), index in marked
        found.append(replace(whole, part_of=group, protected=is_marked))
        found += [
            replace(own, part_of=group, protected=is_marked, name=own.name or whole.name)
            for own in own_parts
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


def _apart(site: SitePlacement, things: Sequence[Thing]) -> list[Thing]:
    """Return buildings without overlaps: the higher one has the ground of both.

    A part has the ground of its own building, whatever its height, and that of others where it is
    higher.
    """
    groups: dict[str, list[Thing]] = {}
    found: list[Thing] = []
    left: list[Thing] = []
    for thing in things:
        if thing.carries:
            found.append(thing)
        elif thing.part_of:
            groups.setdefault(thing.part_of, []).append(thing)
        else:
            left.append(thing)
    # 1. Each building less its own parts; 2. all less what is higher.
    for group in groups.values():
        left += _cut(site, sorted(group, key=lambda own: (-own.is_part, *_highest_first(own))))
    return [*found, *_cut(site, sorted(left, key=_highest_first))]


def _highest_first(building: Thing) -> tuple[float, float]:
    return -(building.height_m or 0.0), -float(building.geometry.area)


def _cut(site: SitePlacement, order: Sequence[Thing]) -> list[Thing]:
    """Return buildings, each less the ground of those before it.

    A building that begins above the base of the one below it begins there where they overlap.
    """
    # Each keeps its ground, and those after it lose what it covers.
    tree = shapely.STRtree([building.geometry for building in order])
    found: list[Thing] = []
    left = list(order)
    for k, thing in enumerate(order):
        shape = thing.geometry
        cut: list[Thing] = []
        least_m2 = max(site.options.least_area_m2, _LEAST_SHARE * shape.area)
        for index in sorted(int(other) for other in tree.query(shape, "intersects")):
            if cut and shape.area < least_m2:
                break
            if index < k and _overlap(thing, order[index]):
                cut.append(order[index])
                shape = areas_of(shapely.difference(shape, order[index].geometry))
                filled = [*_filled(thing, order[index], left, index)]
                if filled and _is_more_than_a_podium(thing, order[index]):
                    part, detail = order[index], f"from {order[index].base_m:g} m"
                    site.ledger.add(Fate.GUESSED, _SOLID_BELOW, part.place, part.name, detail)
                found += filled
        if cut:
            is_own = cut[0].is_part and _are_related(thing, cut[0])
            kind = "parts above their building" if is_own else "buildings over buildings"
            detail = f"by {', '.join(part.place for part in cut)}"
            fate, outcome = Fate.CUT, "overlap left out"
            if shape.area < least_m2:
                fate, outcome, shape = Fate.MERGED, "covered", shapely.Polygon()
            site.ledger.add(fate, f"{kind}, {outcome}", thing.place, thing.name, detail)
        left[k] = replace(thing, geometry=shape)
    return [*found, *(building for building in left if not building.geometry.is_empty)]


def _is_more_than_a_podium(whole: Thing, part: Thing) -> bool:
    """Return whether a building is higher than the underside of a part above it.

    Then its outline may say only what it covers, and the ground below the part may be open.
    """
    is_own = part.is_part and not whole.is_part and _are_related(whole, part)
    return is_own and (whole.height_m or 0.0) > part.base_m + LEAST_STOREY_M


def _are_related(one: Thing, other: Thing) -> bool:
    """Return whether two are parts of one building."""
    return bool(one.part_of) and one.part_of == other.part_of


def _overlap(one: Thing, other: Thing) -> bool:
    """Return whether two buildings overlap by more than the inaccuracy of a map."""
    least = min(one.geometry.area, other.geometry.area)
    share = 0.0 if _are_related(one, other) else _LEAST_SHARE
    return bool(_common(one, other).area > max(share * least, _LEAST_M2))


def _filled(lower: Thing, higher: Thing, left: list[Thing], index: int) -> Iterator[Thing]:
    """Yield the piece of a raised building above a lower one, which reaches down to its base."""
    if lower.base_m >= left[index].base_m or left[index].geometry.is_empty:
        return
    above = shapely.intersection(left[index].geometry, lower.geometry)
    if above.area > _LEAST_M2:
        yield replace(higher, geometry=above, base_m=lower.base_m)
        rest = shapely.difference(left[index].geometry, lower.geometry)
        left[index] = replace(left[index], geometry=areas_of(rest))


def _with_heights(site: SitePlacement, buildings: Sequence[Thing]) -> list[Thing]:
    """Return buildings, each with a height; the ledger gets the guesses.

    A height is guessed from the known ones of the nearest buildings of the kind, then from the
    kind, and from those of all neighbours if the kind says nothing. A roof on posts is open below.
    """
    guess = _Guess(buildings, site.options)
    found = []
    for thing in buildings:
        has_underside = thing.base_m > 0.0 or thing.kind in _ROOFS
        if thing.carries and (thing.height_m is None or has_underside):
            words = "open below" if has_underside else "without a height"
            kind = f"terraces {words}, on which nothing stands"
            site.ledger.add(Fate.GUESSED, kind, thing.place, thing.name)
            thing = replace(thing, carries=False)
        if thing.height_m is None:
            height_m, kind, detail = guess.of(thing)
            site.ledger.add(Fate.GUESSED, kind, thing.place, thing.name, detail)
            thing = replace(thing, height_m=height_m)
        if thing.kind in _ROOFS and thing.base_m == 0.0 and thing.height_m is not None:
            base_m = max(thing.height_m - MODULE_SIDE_M, 0.0)
            kind = "roofs on posts, open below"
            site.ledger.add(Fate.GUESSED, kind, thing.place, thing.name, f"from {base_m:g} m")
            thing = replace(thing, base_m=base_m)
        _check_height(site, thing)
        found.append(thing)
    return found


def _on_terraces(site: SitePlacement, buildings: Sequence[Thing]) -> list[Thing]:
    """Return buildings, those without an underside on the terraces below them.

    Tags count from there, so that the top rises; coordinates of models and drawings stay.
    """
    terraces = [thing for thing in buildings if thing.carries and thing.height_m]
    tree = shapely.STRtree([terrace.geometry for terrace in terraces])
    found = []
    for thing in buildings:
        below = [terraces[index] for index in tree.query(thing.geometry, "intersects").tolist()]
        tops_m = [
            terrace.height_m or 0.0
            for terrace in below
            if _common(thing, terrace).area > _HALF * thing.geometry.area
        ]
        top_m = max(tops_m, default=0.0)
        if thing.carries or thing.base_m or not top_m:
            found.append(thing)
            continue
        rise_m = 0.0 if thing.has_z else top_m
        height_m = None if thing.height_m is None else thing.height_m + rise_m
        if height_m is not None and height_m <= top_m:
            found.append(thing)
            continue
        detail = f"from {top_m:g} m"
        site.ledger.add(Fate.GUESSED, _ON_TERRACE, thing.place, thing.name, detail)
        found.append(replace(thing, base_m=top_m, height_m=height_m))
    return [_beside_buildings(site, thing, found) if thing.carries else thing for thing in found]


def _beside_buildings(site: SitePlacement, terrace: Thing, buildings: Sequence[Thing]) -> Thing:
    """Return a terrace without the ground of the buildings that do not stand on it."""
    into = [
        thing.geometry
        for thing in buildings
        if not thing.carries
        and thing.base_m < (terrace.height_m or 0.0)
        and _common(thing, terrace).area > 0.0
    ]
    if not into:
        return terrace
    site.ledger.add(Fate.CUT, _INTO_TERRACE, terrace.place, terrace.name)
    left = shapely.difference(terrace.geometry, shapely.union_all(into))
    return replace(terrace, geometry=areas_of(left))


def _check_height(site: SitePlacement, thing: Thing) -> None:
    """Enter a height that hardly any building of the kind has, and a bridge without an underside.

    More than ten storeys of a kind that has one or two as a rule, and more than 200 of others, are
    assumed to be in another unit.
    """
    height_m = thing.height_m or 0.0
    low = thing.kind in _STOREYS and _STOREYS[thing.kind][0] <= _FEW
    most_m = (_MOST_STOREYS_LOW if low else _MOST_STOREYS) * site.options.level_height_m
    if height_m > most_m:
        kind = "heights that hardly any building has: are they in metres? (--height-unit)"
        detail = f"{height_m:g} m, {named(thing.kind or 'building')}, at most {most_m:g} m expected"
        site.ledger.add(Fate.GUESSED, kind, thing.place, thing.name, detail)
    if thing.kind == _BRIDGE and not thing.base_m:
        kind = "buildings that are bridges, solid to the ground without a min_height"
        site.ledger.add(Fate.GUESSED, kind, thing.place, thing.name)


class _Guess:
    """Guesses heights of buildings.

    Args:
        buildings: All buildings, in metres.
        options: Options of the import.
    """

    def __init__(self, buildings: Sequence[Thing], options: ImportOptions) -> None:
        self._options = options
        self._known = [building for building in buildings if building.height_m is not None]
        self._tree = shapely.STRtree([building.geometry for building in self._known])

    def of(self, thing: Thing) -> tuple[float, str, str]:
        """Return a height, m, with the kind of the guess and its words."""
        if self._options.default_height_m is not None:
            height_m = self._options.default_height_m
            return height_m, "heights not in the file, --default-height", f"{height_m:g} m"
        likely_m, low_m, by = next(self._guesses(thing))
        if self._options.low_heights:
            return low_m, "heights not in the file, low guess", f"{low_m:.1f} m {by}"
        return (
            likely_m,
            f"heights not in the file ({_HIGH})",
            (f"{likely_m:.1f} m {by}, low {low_m:.1f} m"),
        )

    def _guesses(self, thing: Thing) -> Iterator[tuple[float, float, str]]:
        """Yield likely and low heights, m, and their reason, the best first."""
        if thing.kind in _ROOFS:
            yield _ROOF_M, _ROOF_M, "as a roof"
        level_m = self._options.level_height_m
        if thing.kind in _GENERAL and thing.geometry.area < _SMALL_M2:
            yield level_m, level_m, "as a small building"
        near = self._near(thing)
        alike = [
            building.height_m
            for building in near
            if building.kind == thing.kind and building.height_m
        ]
        if len(alike) >= _LEAST_NEIGHBOURS:
            yield (*_middle(alike), f"as {len(alike)} neighbours")
        storeys = _STOREYS.get(thing.kind)
        if storeys is not None:
            yield storeys[0] * level_m, storeys[1] * level_m, "by its kind"
        around = [building.height_m for building in near if building.height_m]
        if len(around) >= _LEAST_NEIGHBOURS:
            yield (*_middle(around), f"as {len(around)} neighbours")
        yield _USUAL[0] * level_m, _USUAL[1] * level_m, "as usual"

    def _near(self, thing: Thing) -> list[Thing]:
        """Return the buildings of known height around one, the nearest first."""
        around = self._tree.query(thing.geometry, "dwithin", distance=_NEIGHBOUR_M)
        near = [self._known[index] for index in around]
        near.sort(key=lambda building: float(building.geometry.distance(thing.geometry)))
        return near[:_MOST_NEIGHBOURS]


def _middle(heights_m: Sequence[float]) -> tuple[float, float]:
    """Return the median and the lower quartile."""
    return float(np.median(heights_m)), float(np.quantile(heights_m, _LOW_SHARE))
