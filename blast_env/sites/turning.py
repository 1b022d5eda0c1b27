"""Rotation of sites by right angles."""

from collections.abc import Mapping
from typing import Any, Final

from blast_env.geometry import WallName
from blast_env.sections import PointM
from blast_env.site import AnyScenario, Scenario, find_scenario
from blast_env.units import MODULE_SIDE_M

_DIGITS: Final = 9

_TURNED_WALL: Final[Mapping[WallName, WallName]] = {
    "west": "south",
    "south": "east",
    "east": "north",
    "north": "west",
}

_ACROSS: Final = {"left_right": "bottom_top", "bottom_top": "left_right"}


def turned(scenario: AnyScenario, quarter_turns: int) -> Scenario:
    """Return a scenario turned counterclockwise: its right side becomes its top.

    It is an equivalent problem; the cells of the build zone turn too. The georeference is removed.

    Args:
        scenario: The scenario, or its bundled name or path.
        quarter_turns: Number of right angles.
    """
    scenario = find_scenario(scenario)
    document = scenario.model_dump()
    for _ in range(quarter_turns % 4):
        site = document["site"]
        document = _table(document, site["height_m"])
        document["site"] |= {"width_m": site["height_m"], "height_m": site["width_m"]}
        document["georeference"] = None  # the turned site has no place on the map
    return Scenario.from_document(document, scenario.name)


def _table(table: Mapping[str, Any], height_m: float) -> dict[str, Any]:
    """Return a section, with all below it, after one turn of a site of some height."""
    found = {key: _value(key, value, height_m) for key, value in table.items()}
    if "rows" in table:
        found |= {"rows": table["columns"], "columns": table["rows"]}
    if "corner_m" in table:  # the lower left corner is the upper left one before the turn
        x_m, y_m = table["corner_m"]
        rows = table.get("rows", table.get("side_modules", 0))
        _, up_m = table.get("size_m", (0.0, rows * MODULE_SIDE_M))
        found["corner_m"] = _point((x_m, y_m + up_m), height_m)
    return found


def _value(key: str, value: Any, height_m: float) -> Any:
    if isinstance(value, Mapping):
        return _table(value, height_m)
    if key in ("position_m", "start_m", "end_m"):
        return (*_point(value[:2], height_m), *value[2:])
    if key == "size_m":
        return value[::-1]
    if key == "outline_m":
        return tuple(_vertex(item, height_m) for item in value)
    if key == "courtyards_m":
        return tuple(_value("outline_m", item, height_m) for item in value)
    if key in ("faces", "walls"):
        return tuple(_TURNED_WALL[wall] for wall in value)
    if key == "between":
        return _ACROSS[value]
    if isinstance(value, list | tuple):
        return tuple(_value("", item, height_m) for item in value)
    return value


def _point(point_m: PointM, height_m: float) -> PointM:
    return height_m - point_m[1], point_m[0]


def _vertex(corner_m: PointM, height_m: float) -> PointM:
    """Return the corner of an outline after the turn, without the rounding of the difference."""
    x_m, y_m = _point(corner_m, height_m)
    return round(x_m, _DIGITS), y_m
