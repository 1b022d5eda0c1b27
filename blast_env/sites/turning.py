"""Rotation of sites by right angles."""

from collections.abc import Mapping
from typing import Any, Final, TypeVar

from blast_env.geometry import Rectangle
from blast_env.site import (
    AccessWay,
    AnyScenario,
    AnySource,
    AnyStructure,
    BuildZone,
    GaugeSection,
    PointSource,
    Scenario,
    SegmentSource,
    VehicleSource,
    find_scenario,
)
from blast_env.site.catalogue import Hardening
from blast_env.site.scene import WallName
from blast_env.site.sections import (
    Entry,
    FacadePart,
    Ground,
    ModularObstacleSection,
    PointM,
    PolygonSection,
)

_Covering = TypeVar("_Covering", FacadePart, Hardening)

_DIGITS: Final = 9

_TURNED_WALL: Final[Mapping[WallName, WallName]] = {
    "west": "south",
    "south": "east",
    "east": "north",
    "north": "west",
}


def turned(scenario: AnyScenario, quarter_turns: int) -> Scenario:
    """Return a scenario turned counterclockwise: its right side becomes its top.

    It is an equivalent problem; the cells of the build zone turn too. The georeference is removed.

    Args:
        scenario: The scenario, or its bundled name or path.
        quarter_turns: Number of right angles.
    """
    scenario = find_scenario(scenario)
    for _ in range(quarter_turns % 4):
        scenario = _turned_once(scenario)
    return Scenario.from_document(scenario.model_dump(), scenario.name)


def _turned_once(scenario: Scenario) -> Scenario:
    """Return a scenario turned by one right angle, without checking its sections again."""
    site, zone = scenario.site, scenario.build_zone
    changes: dict[str, Any] = {
        "site": site.model_copy(update={"width_m": site.height_m, "height_m": site.width_m}),
        "charge": tuple(_source(each, site.height_m) for each in scenario.charge),
        "structures": tuple(_structure(each, site.height_m) for each in scenario.structures),
        "gauges": tuple(_gauge(each, site.height_m) for each in scenario.gauges),
        "build_zone": None if zone is None else _zone(zone, site.height_m),
        "georeference": None,  # the turned site has no place on the map
    }
    return scenario.model_copy(update=changes)


def _point(point_m: PointM, height_m: float) -> PointM:
    return height_m - point_m[1], point_m[0]


def _vertex(corner_m: PointM, height_m: float) -> PointM:
    """Return the corner of an outline after the turn, without the rounding of the difference."""
    x_m, y_m = _point(corner_m, height_m)
    return round(x_m, _DIGITS), y_m


def _corner(rectangle_m: Rectangle, height_m: float) -> PointM:
    """Return the lower left corner after the turn: the upper left one before it."""
    return _point((rectangle_m.left, rectangle_m.top), height_m)


def _source(source: AnySource, height_m: float) -> AnySource:
    if isinstance(source, PointSource):
        return source.model_copy(update={"position_m": _point(source.position_m, height_m)})
    if isinstance(source, SegmentSource):
        start_m, end_m = (_point(each, height_m) for each in source.segment_m)
        return source.model_copy(update={"start_m": start_m, "end_m": end_m})
    if isinstance(source, VehicleSource):
        changes: dict[str, Any] = {
            "entries": tuple(_entry(each, height_m) for each in source.entries),
            "drivable": tuple(_ground(each, height_m) for each in source.drivable),
            "keep_outs": tuple(_ground(each, height_m) for each in source.keep_outs),
        }
        return source.model_copy(update=changes)
    corner_m = _corner(source.rectangle_m, height_m)
    return source.model_copy(update={"corner_m": corner_m, "size_m": source.size_m[::-1]})


def _entry(entry: Entry, height_m: float) -> Entry:
    ends_m = {"start_m": _point(entry.start_m, height_m), "end_m": _point(entry.end_m, height_m)}
    return entry.model_copy(update=ends_m)


def _structure(structure: AnyStructure, height_m: float) -> AnyStructure:
    changes: dict[str, Any] = {"faces": tuple(_TURNED_WALL[wall] for wall in structure.faces)}
    if isinstance(structure, PolygonSection):
        rings = (structure.outline_m, *structure.courtyards_m)
        outline, *courtyards = (tuple(_vertex(each, height_m) for each in ring) for ring in rings)
        changes |= {"outline_m": outline, "courtyards_m": tuple(courtyards)}
    else:
        changes["corner_m"] = _corner(structure.rectangle_m, height_m)
    if isinstance(structure, ModularObstacleSection):
        changes |= {"rows": structure.columns, "columns": structure.rows}
    if structure.facade is not None:
        parts = tuple(map(_with_walls, structure.facade.parts))
        changes["facade"] = structure.facade.model_copy(update={"parts": parts})
    return structure.model_copy(update=changes)


def _with_walls(part: _Covering) -> _Covering:
    """Return a part of a facade or a hardening measure on the turned walls."""
    return part.model_copy(update={"walls": tuple(_TURNED_WALL[wall] for wall in part.walls)})


def _gauge(gauge: GaugeSection, height_m: float) -> GaugeSection:
    x_m, y_m, z_m = gauge.position_m
    return gauge.model_copy(update={"position_m": (*_point((x_m, y_m), height_m), z_m)})


def _zone(zone: BuildZone, height_m: float) -> BuildZone:
    changes: dict[str, Any] = {
        "corner_m": _corner(zone.rectangle_m, height_m),
        "rows": zone.columns,
        "columns": zone.rows,
        "keep_outs": tuple(_ground(each, height_m) for each in zone.keep_outs),
        "cost_areas": tuple(_ground(each, height_m) for each in zone.cost_areas),
        "hardening": tuple(map(_with_walls, zone.hardening)),
        "access_way": None if zone.access_way is None else _way(zone.access_way, height_m),
    }
    return zone.model_copy(update=changes)


def _ground(ground: Ground, height_m: float) -> Ground:
    corner_m = _corner(ground.rectangle_m, height_m)
    return ground.model_copy(update={"corner_m": corner_m, "size_m": ground.size_m[::-1]})


def _way(way: AccessWay, height_m: float) -> AccessWay:
    across = "bottom_top" if way.between == "left_right" else "left_right"
    gate = None if way.gate is None else _ground(way.gate, height_m)
    return way.model_copy(update={"between": across, "gate": gate})
