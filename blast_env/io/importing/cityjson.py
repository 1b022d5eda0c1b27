"""Reading of city models in CityJSON: buildings with their heights, and roads."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
import shapely
from pyproj import CRS
from shapely.geometry.base import BaseGeometry

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError, value_text
from blast_env.io.importing.bodies import LEAST_STOREY_M, BodyPart, Faces
from blast_env.io.importing.city_objects import CityGeometry, CityObject, Surface, city_objects
from blast_env.io.importing.geojson import LOCAL
from blast_env.io.importing.ledger import Fate
from blast_env.io.importing.options import FOOT_M, UNITS_M
from blast_env.io.importing.placing import OUTSIDE
from blast_env.io.importing.plane import Plane, plane_around, unit_of
from blast_env.io.importing.site_map import MapFeature, SiteMap, Tags, code_of, errors_of

_BODIES: Final = ("Building", "BuildingPart")
_ATTACHED: Final = ("BuildingInstallation", "BuildingConstructiveElement")
_INSIDE: Final = ("BuildingRoom", "BuildingStorey", "BuildingUnit", "BuildingFurniture")
_ROADS: Final = ("Road", "TransportSquare")
_FLAT: Final = ("LandUse", "PlantCover", "WaterBody", "Railway", "Waterway", "CityObjectGroup")
_RELIEF: Final = "TINRelief"

_GROUND: Final = "GroundSurface"
_TRAFFIC: Final = "TrafficArea"
_CLOSURE: Final = "ClosureSurface"
_INNER: Final = ("InteriorWallSurface", "CeilingSurface", "FloorSurface")

_DETAILED: Final = 3.0
"""The level of detail from which models have openings, and may have rooms."""

_GONE: Final = ("declined", "demolished", "projected", "underconstruction")
"""Values of `conditionOfConstruction` in CityGML 3.0 of what does not stand."""

_NEAR_FOOT_M: Final = 1e-5  # the feet of several countries
_FLAT_M: Final = 1e-3
_LEAST_M2: Final = 1.0
_NARROW: Final = "eaves, balconies and other narrow or low pieces of buildings"
_FAR: Final = 2.0  # diagonals of a site
_NOWHERE: Final = shapely.Point()

_Chosen = Mapping[str, tuple[CityGeometry, ...]]


def read_cityjson(site_map: SiteMap, documents: Sequence[Mapping[str, Any]]) -> None:
    """Read a city model into a map: each building with the heights of its parts, from its surfaces.

    Of several levels of detail, the highest below 3 is read. The ground under a building is its
    `GroundSurface`. Roads and squares are places of charges.
    """
    path, options = site_map.path, site_map.options
    options.refuse("CityJSON, whose coordinates --crs is about", "units")
    objects = city_objects(path, documents)
    chosen: _Chosen = {key: _chosen(item.geometries) for key, item in objects.items()}
    if not any(chosen.values()):
        raise BlastEnvError(f"{path}: has no object with a geometry")
    system = _System.of(site_map, documents[0])
    site_map.crs = system.crs
    if system.is_north_first and _is_exchanged(site_map, chosen):
        chosen = _moved(chosen, lambda places: places[:, [1, 0, 2]])
    plane = plane_around(system.crs, 1.0, _reference(site_map, chosen))
    chosen = _moved(
        chosen,
        lambda places: np.column_stack(
            (plane.to_metres(places[:, :2]), system.height_m * places[:, 2])
        ),
    )
    _Model(site_map, objects, chosen, plane).read()
    levels = Counter(own[0].lod for own in chosen.values() if own)
    detail = ", ".join(f"{count} of {lod:g}" for lod, count in sorted(levels.items()))
    site_map.ledger.add(Fate.NOTED, "objects by level of detail", path.name, detail=detail)


def _reference(site_map: SiteMap, chosen: _Chosen) -> tuple[float, float]:
    """Return a place of the model near the site: that of the options, or the middle."""
    asked = site_map.options.origin or site_map.options.centre
    if asked is not None:
        return asked
    places = np.concatenate(_rings(chosen))[:, :2]
    x, y = 0.5 * (places.min(axis=0) + places.max(axis=0))
    return float(x), float(y)


def _rings(chosen: _Chosen) -> list[FloatArray]:
    """Return all rings and lines, each (n, 3)."""
    return [ring for own in chosen.values() for geometry in own for ring in geometry.rings]


def _moved(chosen: _Chosen, move: Callable[[FloatArray], FloatArray]) -> _Chosen:
    """Return geometries with their places moved, all at once."""
    rings = _rings(chosen)
    moved = iter(np.split(move(np.concatenate(rings)), np.cumsum([len(ring) for ring in rings])))
    return {
        key: tuple(geometry.with_rings(moved) for geometry in own) for key, own in chosen.items()
    }


def _chosen(geometries: Sequence[CityGeometry]) -> tuple[CityGeometry, ...]:
    """Return the geometries of the level of detail that is read: the highest below 3, if any."""
    levels = {geometry.lod for geometry in geometries if geometry.surfaces or geometry.lines}
    if not levels:
        return ()
    simple = [lod for lod in levels if lod < _DETAILED]
    # A footprint, of level 0, has no height; a detailed model has.
    best = max(simple, default=0.0)
    if best < 1.0 and max(levels) >= _DETAILED:
        best = min(lod for lod in levels if lod >= _DETAILED)
    return tuple(geometry for geometry in geometries if geometry.lod == best)


@dataclass(frozen=True)
class _System:
    """The reference system of a city model.

    Attributes:
        crs: That of its plan, as pyproj reads it; `None` for a place that is not on the Earth.
        height_m: Length of the unit of heights, m; below 0 for depths.
        is_north_first: Whether it lists northing or latitude first.
    """

    crs: str | None
    height_m: float
    is_north_first: bool

    @classmethod
    def of(cls, site_map: SiteMap, document: Mapping[str, Any]) -> "_System":
        path, options = site_map.path, site_map.options
        text = _stated(document) if options.crs is None else options.crs
        if text is None:
            raise BlastEnvError(
                f"{path}: metadata has no referenceSystem: say --crs, local for plain metres"
            )
        asked = None if options.height_unit is None else UNITS_M[options.height_unit]
        if text == LOCAL:
            return cls(None, 1.0 if asked is None else asked, is_north_first=False)
        with errors_of("pyproj", path, f"a model in {value_text(text)}"):
            system = CRS.from_user_input(text)
        plan = system.sub_crs_list[0] if system.is_compound else system.to_2d()
        crs = code_of(path, plan.to_wkt())
        # The unit of heights: as the system says, else as asked, else a guess.
        upward = [axis for axis in system.axis_info if axis.direction in ("up", "down")]
        if upward:
            options.refuse(f"a model in {text}, which has a unit of heights", "height_unit")
            sign = 1.0 if upward[0].direction == "up" else -1.0
            height_m = sign * upward[0].unit_conversion_factor
        elif asked is not None:
            height_m = asked
        else:
            unit_m = unit_of(crs)
            height_m = unit_m if abs(unit_m - FOOT_M) < _NEAR_FOOT_M else 1.0
            if height_m != 1.0:
                kind = "heights in feet, as the coordinates of the file (--height-unit)"
                site_map.ledger.add(Fate.GUESSED, kind, path.name)
        return cls(crs, height_m, is_north_first=plan.axis_info[0].direction == "north")


def _stated(document: Mapping[str, Any]) -> str | None:
    """Return the reference system that a file states, by a URL of the OGC."""
    metadata = document.get("metadata")
    stated = metadata.get("referenceSystem") if isinstance(metadata, dict) else None
    return stated if isinstance(stated, str) and stated else None


def _is_exchanged(site_map: SiteMap, chosen: _Chosen) -> bool:
    """Return whether x of a model is northing or latitude.

    A reference system may list northing first, and writers differ. With the axes exchanged a model
    is mirrored, so that the volume within its surfaces, which are seen from outside, is below 0.
    """
    rings = [
        surface.rings[0]
        for own in chosen.values()
        for geometry in own
        for surface in geometry.surfaces
    ]
    lowest = min((float(ring[:, 2].min()) for ring in rings), default=0.0)
    volume = sum(_volume(ring, lowest) for ring in rings)
    words = "x as northing or latitude" if volume < 0.0 else "x as easting or longitude"
    fate = Fate.NOTED if volume else Fate.GUESSED
    site_map.ledger.add(
        fate,
        "axes of the model, by the side from which surfaces are seen",
        site_map.path.name,
        detail=words,
    )
    return bool(volume < 0.0)


def _volume(ring: FloatArray, lowest: float) -> float:
    """Return a surface's part of the volume within a body: that below it, over the lowest z."""
    x, y = (ring[:, :2] - ring[0, :2]).T
    area = 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    return area * (float(ring[:, 2].mean()) - lowest)


@dataclass(frozen=True, eq=False)
class _Body:
    """The surfaces of an object in metres.

    Attributes:
        surfaces: Its surfaces, without those of rooms.
    """

    surfaces: tuple[Surface, ...]

    @cached_property
    def faces(self) -> Faces:
        """The surfaces as they are seen from above."""
        return Faces.of_rings([surface.rings for surface in self.surfaces])

    @cached_property
    def is_ground(self) -> Any:
        """Which of them are on the ground."""
        return np.array([surface.kind == _GROUND for surface in self.surfaces], dtype=bool)

    @property
    def ground_m(self) -> float | None:
        """The lowest height of those on the ground."""
        return float(self.faces.low_m[self.is_ground].min()) if self.is_ground.any() else None

    @property
    def eaves_m(self) -> float | None:
        """The lowest height of roofs that slope by more than a storey; `None` without them."""
        faces, kinds = self.faces, np.array([surface.kind for surface in self.surfaces])
        slopes = faces.is_area & (faces.high_m > faces.low_m + LEAST_STOREY_M)
        slopes &= (kinds == "RoofSurface") | (kinds == "")
        return float(faces.low_m[slopes].min()) if slopes.any() else None

    def parts(self, ground_m: float, least_m2: float) -> list[BodyPart]:
        """Return its parts above the ground."""
        faces = self.faces
        stands = self.is_ground | (faces.low_m <= ground_m + LEAST_STOREY_M)
        parts = faces.parts(ground_m, list(faces.plans[stands]), least_m2)
        shadow = faces.shadow
        if parts or shadow.is_empty:
            return parts
        return [BodyPart(shadow, float(faces.low_m.min()), float(faces.high_m.max()))]


class _Model:
    """The objects of a city model by their buildings.

    Args:
        site_map: The map that they are added to.
        objects: All objects.
        chosen: The geometries of each that are read, m.
        plane: The plane in which they are measured.
    """

    def __init__(
        self,
        site_map: SiteMap,
        objects: Mapping[str, CityObject],
        chosen: _Chosen,
        plane: Plane,
    ) -> None:
        self._map, self._objects, self._chosen, self._plane = site_map, objects, chosen, plane
        options = site_map.options
        self._has_selectors = any(
            (
                options.zone_from,
                options.keep_outs_from,
                options.charges_from,
                options.buildings_from,
            )
        )
        asked = options.origin or options.centre
        self._middle_m = None if asked is None else plane.to_metres(np.array([asked]))[0]
        self._near_m = _FAR * float(np.hypot(*(options.size_m or (0.0, 0.0))))
        self._families: dict[str, list[CityObject]] = {}
        for item in objects.values():
            if item.kind in (*_BODIES, *_ATTACHED):
                self._families.setdefault(self._whole(item).key, []).append(item)

    def read(self) -> None:
        """Add all objects, or enter why not."""
        for key, members in self._families.items():
            self._add_building(self._objects[key], members)
        for item in self._objects.values():
            if item.kind in _INSIDE:
                self._map.ledger.add(Fate.PASSED, "insides of buildings", item.place)
            elif item.kind not in (*_BODIES, *_ATTACHED):
                self._add_other(item)

    def _whole(self, item: CityObject) -> CityObject:
        """Return the building of which an object is a part, or itself."""
        seen = {item.key}
        while item.parents and item.parents[0] in self._objects:
            above = self._objects[item.parents[0]]
            if above.key in seen or above.kind not in (*_BODIES, *_ATTACHED):
                break
            seen.add(above.key)
            item = above
        return item

    def _add_building(self, whole: CityObject, members: Sequence[CityObject]) -> None:
        """Add the parts of a building: its own body, and those of its `BuildingPart`s."""
        if self._is_far(members):
            for item in members:
                if self._chosen[item.key]:
                    self._add_bounds(item, self._tags(item, whole))
                else:
                    self._map.ledger.add(Fate.PASSED, OUTSIDE, item.place)
            return
        bodies = [item for item in members if item.kind in _BODIES]
        levels = {
            item.key: max((geometry.lod for geometry in self._chosen[item.key]), default=-1.0)
            for item in bodies
        }
        parts = [item for item in bodies if item is not whole and levels[item.key] >= 0.0]
        # A building that has parts of a higher level of detail has them instead of its own body.
        is_body = not parts or levels.get(whole.key, -1.0) >= max(levels[p.key] for p in parts)
        read = [item for item in bodies if item is not whole or is_body]
        if whole.kind in _BODIES and not is_body:
            self._map.ledger.add(Fate.MERGED, "buildings, read by their parts", whole.place)
        attached = [item for item in members if item.kind in _ATTACHED]
        grounds_m = [body.ground_m for item in read if (body := self._body([item])).surfaces]
        stated_m = min((ground_m for ground_m in grounds_m if ground_m is not None), default=None)
        for item in read:
            own = [part for part in attached if self._owner(part, read, whole) is item]
            self._add_body(item, own, whole, len(read) > 1, stated_m)
            for part in own:
                kind, detail = "installations of buildings", f"of {item.place}"
                self._map.ledger.add(Fate.MERGED, kind, part.place, detail=detail)
        if not read:
            for part in attached:
                self._leave(part, "parts of buildings that are not there")

    def _owner(self, part: CityObject, read: Sequence[CityObject], whole: CityObject) -> CityObject:
        """Return the body at which an installation is: its parent, or the first of the building."""
        near = next((item for item in read if item.key in part.parents), None)
        return near or next((item for item in read if item is whole), read[0])

    def _body(self, items: Sequence[CityObject]) -> _Body:
        surfaces = [
            surface
            for item in items
            for geometry in self._chosen[item.key]
            for surface in geometry.surfaces
            if surface.kind not in _INNER
        ]
        return _Body(tuple(surfaces))

    def _add_body(
        self,
        item: CityObject,
        attached: Sequence[CityObject],
        whole: CityObject,
        has_parts: bool,
        stated_m: float | None,
    ) -> None:
        """Add the body of a building or part, with what is attached to it."""
        body, tags = self._body([item, *attached]), self._tags(item, whole)
        if not body.surfaces:
            self._leave(item, "buildings without a geometry")
            return
        faces = body.faces
        if faces.shadow.is_empty:
            self._leave(item, "buildings without an area in plan")
            return
        part_of = whole.place if has_parts else ""
        low_m, high_m = float(faces.low_m.min()), float(faces.high_m.max())
        self._note(item, body)
        if high_m - low_m < _FLAT_M:  # a footprint or a roof alone
            outline = self._in_source(faces.shadow)
            self._map.add(MapFeature(outline, tags, item.place, part_of=part_of))
            return
        own_m = body.ground_m
        ground_m = stated_m if own_m is None else own_m
        parts = body.parts(low_m if ground_m is None else ground_m, self._map.options.least_area_m2)
        for part in parts:
            self._map.add(
                MapFeature(
                    self._in_source(part.outline),
                    tags,
                    item.place,
                    extent_m=(part.base_m, part.top_m),
                    part_of=part_of or (item.place if len(parts) > 1 else ""),
                    ground_m=ground_m,
                    is_levelled=True,
                )
            )
        self._note_lost(item, faces, parts)
        if ground_m is not None:
            kind, detail = "ground under buildings of a model", f"at {ground_m:g} m"
            self._map.ledger.add(Fate.NOTED, kind, item.place, detail=detail)

    def _tags(self, item: CityObject, whole: CityObject) -> Tags:
        """Return the tags of a building or part; it has the name of its building."""
        tags: dict[str, str | float | bool] = {**whole.tags, **item.tags, "building": "yes"}
        condition = str(tags.get("conditionOfConstruction", "")).lower()
        if condition in _GONE:
            tags["building"] = "construction"
        return {**tags, "cityjson": item.kind}

    def _note(self, item: CityObject, body: _Body) -> None:
        """Enter what a body has that the site has not."""
        ledger, place = self._map.ledger, item.place
        eaves_m = body.eaves_m
        if eaves_m is not None:
            kind = "roofs that slope, flat at the height of their ridge"
            top_m = float(body.faces.high_m.max())
            ledger.add(Fate.NOTED, kind, place, detail=f"eaves {top_m - eaves_m:.1f} m lower")
        closures = sum(surface.kind == _CLOSURE for surface in body.surfaces)
        if closures:
            kind = "openings of buildings, closed by the model"
            ledger.add(Fate.GUESSED, kind, place, detail=f"{closures} surfaces")
        for geometry in self._chosen[item.key]:
            if geometry.lod >= _DETAILED:
                kind = "windows and doors of models, in no facade"
                ledger.add(Fate.NOTED, kind, place, detail=f"level of detail {geometry.lod:g}")
            if geometry.cavities:
                ledger.add(Fate.CUT, "hollows in solids", place, detail=f"{geometry.cavities}")
            if geometry.crumbs:
                kind = "surfaces with fewer than three corners"
                ledger.add(Fate.CUT, kind, place, detail=f"{geometry.crumbs}")

    def _note_lost(self, item: CityObject, faces: Faces, parts: Sequence[BodyPart]) -> None:
        """Enter what is too narrow or small for a part: eaves, and tops as of chimneys."""
        ledger, place = self._map.ledger, item.place
        lost_m2 = faces.shadow.area - shapely.union_all([part.outline for part in parts]).area
        if lost_m2 > _LEAST_M2:
            ledger.add(Fate.CUT, _NARROW, place, detail=f"{lost_m2:.1f} m2")
        top_m = max((part.top_m for part in parts), default=0.0)
        above_m = float(faces.high_m.max()) - top_m
        if parts and above_m > LEAST_STOREY_M:
            ledger.add(Fate.CUT, "small tops of buildings", place, detail=f"{above_m:.1f} m")

    def _add_other(self, item: CityObject) -> None:
        """Add an object that is no building: a road, or one that only the options choose."""
        tags: dict[str, str | float | bool] = {**item.tags, "cityjson": item.kind}
        geometries = self._chosen[item.key]
        surfaces = [surface for geometry in geometries for surface in geometry.surfaces]
        if item.kind in _ROADS:
            tags["highway"] = "road"
            traffic = [surface for surface in surfaces if surface.kind == _TRAFFIC]
            surfaces = traffic or surfaces
        lines = [line for geometry in geometries for line in geometry.lines]
        is_flat = item.kind in (*_ROADS, *_FLAT)
        is_of_use = self._has_selectors or item.kind in _ROADS
        if lines and not surfaces:
            line = shapely.MultiLineString([line[:, :2] for line in lines])
            self._map.add(MapFeature(self._in_source(line), tags, item.place))
        elif not surfaces:
            self._map.ledger.add(Fate.PASSED, "objects without a geometry", item.place)
        elif not is_of_use or item.kind == _RELIEF or self._is_far([item]):
            self._add_bounds(item, tags)
        else:
            for part in self._outlines(_Body(tuple(surfaces)), is_flat):
                self._map.add(
                    MapFeature(
                        self._in_source(part.outline),
                        tags,
                        item.place,
                        extent_m=None if is_flat else (part.base_m, part.top_m),
                        is_levelled=not is_flat,
                    )
                )

    def _bounds_m(self, items: Sequence[CityObject]) -> FloatArray | None:
        """Return the lowest and highest place of objects, (2, 2); `None` without a geometry."""
        rings = [
            ring for item in items for geometry in self._chosen[item.key] for ring in geometry.rings
        ]
        if not rings:
            return None
        places = np.concatenate(rings)[:, :2]
        return np.array([places.min(axis=0), places.max(axis=0)])

    def _is_far(self, items: Sequence[CityObject]) -> bool:
        """Return whether objects are far from the site that is asked for."""
        bounds_m = self._bounds_m(items)
        if bounds_m is None or self._middle_m is None:
            return False
        beyond_m = np.maximum(bounds_m[0] - self._middle_m, self._middle_m - bounds_m[1])
        return bool(np.hypot(*np.maximum(beyond_m, 0.0)) > self._near_m)

    def _add_bounds(self, item: CityObject, tags: Tags) -> None:
        """Add an object of no use to the site by the box around it."""
        bounds_m = self._bounds_m([item])
        assert bounds_m is not None
        outline = self._in_source(shapely.box(*bounds_m.ravel()))
        self._map.add(MapFeature(outline, tags, item.place))

    def _outlines(self, body: _Body, is_flat: bool) -> Iterator[BodyPart]:
        """Yield the outline of an object that is no building, or its parts if it may be chosen."""
        faces = body.faces
        low_m, high_m = float(faces.low_m.min()), float(faces.high_m.max())
        if is_flat or high_m - low_m < _FLAT_M or faces.shadow.is_empty:
            yield BodyPart(faces.shadow, low_m, high_m)
        else:
            yield from body.parts(low_m, self._map.options.least_area_m2)

    def _leave(self, item: CityObject, fault: str) -> None:
        self._map.add(MapFeature(_NOWHERE, self._tags(item, item), item.place, fault))

    def _in_source(self, outline: BaseGeometry) -> BaseGeometry:
        """Return an outline in metres of the plane in the coordinates of the file."""
        return shapely.transform(outline, self._plane.to_source)
