"""Reading of building models in IFC: walls, slabs, roofs, storeys and windows."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError, import_extra, named
from blast_env.io.importing.ledger import Fate
from blast_env.io.importing.site_map import (
    MOST_FEATURES,
    MapFeature,
    SiteMap,
    check_count,
    errors_of,
)

with import_extra("ifc", "building models"):
    import ifcopenshell
    import ifcopenshell.geom
    from ifcopenshell.util import element as relations
    from ifcopenshell.util import placement
    from ifcopenshell.util.unit import calculate_unit_scale

_SHAPED: Final = ("IfcWall", "IfcSlab", "IfcRoof", "IfcCurtainWall", "IfcPlate", "IfcWindow")
_GAP_M: Final = 0.3
"""Gap between walls and slabs that is closed."""

_GLASS: Final = "glass, which IFC does not state"
_GROUND_M: Final = 0.5
_LEAST_STOREY_M: Final = 1.5
_BAYS_M: Final = (1.0, 50.0)
_NOWHERE: Final = shapely.Point()


@dataclass(frozen=True)
class _Solid:
    """An element with its extent, m.

    Attributes:
        element: The element.
        ground: The area below it.
        low_m: Its lowest height.
        high_m: Its highest one.
    """

    element: Any
    ground: BaseGeometry
    low_m: float
    high_m: float


def read_ifc(site_map: SiteMap) -> None:
    """Read the buildings of an IFC model, in metres, each with its height, storeys and windows.

    A building is what its walls, slabs and roofs cover. Everything else is on the ledger.

    Raises:
        BlastEnvError: If the file cannot be read, states no unit of length, or has no building.
    """
    path, options, ledger = site_map.path, site_map.options, site_map.ledger
    options.refuse("IFC, which states its unit", "units", "height_unit")
    options.refuse("IFC, which is in metres of its own", "crs")
    with errors_of("ifcopenshell", path, "IFC"):
        model = ifcopenshell.open(str(path))
        lengths = [each for each in model.by_type("IfcNamedUnit") if each.UnitType == "LENGTHUNIT"]
        if not lengths:
            raise BlastEnvError(f"{path}: states no unit of length, must state one")
        products = [each for each in model.by_type("IfcElement") if each.Representation]
        check_count(path, len(products), MOST_FEATURES, "outlines and lines")
        buildings = model.by_type("IfcBuilding")
        if not buildings:
            raise BlastEnvError(f"{path}: has no IfcBuilding")
        chosen = [each for each in products if any(map(each.is_a, _SHAPED))]
        solids = {each.element.id(): each for each in _solids(model, chosen)}
        owners = {each.id(): _building_of(each, buildings) for each in chosen}
        for building in buildings:
            own = [each for key, each in solids.items() if owners[key] == building]
            found = _building(model, building, own)
            if found is None:
                continue
            site_map.add(found)
            for each in own:
                detail = f"of {found.place}"
                ledger.add(Fate.MERGED, "parts of a building", _place(each.element), detail=detail)
            if found.facade:
                ledger.add(Fate.GUESSED, _GLASS, found.place, detail="annealed 6 mm")
    for each in products:
        if each.id() not in solids:
            tags: dict[str, str | float | bool] = {each.is_a(): True, "building": "part"}
            site_map.add(MapFeature(_NOWHERE, tags, _place(each), _reason(each)))


def _reason(element: Any) -> str:
    is_used = any(map(element.is_a, _SHAPED))
    return f"{element.is_a()} {'without a shape' if is_used else 'of buildings'}"


def _place(element: Any) -> str:
    return f"{element.is_a()} {named(str(element.GlobalId))}"


def _solids(model: Any, elements: list[Any]) -> Iterator[_Solid]:
    """Yield the elements that have a shape."""
    settings = ifcopenshell.geom.settings()
    settings.set("use-world-coords", True)
    if not elements:
        return
    iterator = ifcopenshell.geom.iterator(settings, model, include=elements)
    more = iterator.initialize()
    while more:
        shape = iterator.get()
        corners = np.reshape(shape.geometry.verts, (-1, 3))
        faces = corners[np.reshape(shape.geometry.faces, (-1, 3))]
        areas = np.asarray(shapely.polygons(faces[:, :, :2]))
        ground = shapely.union_all(areas[shapely.area(areas) > 0.0], grid_size=1e-4)
        heights_m = corners[:, 2]
        yield _Solid(model.by_id(shape.id), ground, heights_m.min(), heights_m.max())
        more = iterator.next()


def _building_of(element: Any, buildings: list[Any]) -> Any:
    """Return the building that holds an element; the only one of a file holds all."""
    found = relations.get_container(element)
    while found is not None and not found.is_a("IfcBuilding"):
        found = relations.get_aggregate(found)
    return buildings[0] if found is None and len(buildings) == 1 else found


def _building(model: Any, building: Any, solids: list[_Solid]) -> MapFeature | None:
    """Return the outline of a building, its height, storeys and windows; `None` without walls."""
    scale = calculate_unit_scale(model)
    ground_m = 0.0
    if building.ObjectPlacement is not None:
        ground_m = scale * float(placement.get_local_placement(building.ObjectPlacement)[2, 3])
    windows = [each for each in solids if each.element.is_a("IfcWindow")]
    above = [each for each in solids if each.high_m > ground_m and each not in windows]
    if not above:
        return None
    outline = shapely.union_all([each.ground.buffer(0.5 * _GAP_M) for each in above])
    outline = outline.buffer(-0.5 * _GAP_M, join_style="mitre")
    height_m = max(each.high_m for each in above) - ground_m
    floors_m = [
        scale * float(each.Elevation or 0.0)
        for each in model.by_type("IfcBuildingStorey")
        if _building_of(each, [building]) == building
    ]
    storeys = sum(-_GROUND_M <= each <= height_m - _LEAST_STOREY_M for each in floors_m)
    tags: dict[str, str | float | bool] = {"building": "yes", "height": float(height_m)}
    if building.Name:
        tags["name"] = str(building.Name)
    facade: dict[str, float] = {}
    if windows:
        facade = _facade(outline, windows, max(storeys, 1), np.sort(floors_m) + ground_m)
    return MapFeature(outline, tags, _place(building), facade=facade)


def _facade(
    outline: BaseGeometry, windows: list[_Solid], storeys: int, floors_m: FloatArray
) -> dict[str, float]:
    """Return the facade of a building: its storeys, and the commonest window and its spacing."""
    sizes = Counter(
        (round(_width_m(each), 1), round(each.high_m - each.low_m, 1)) for each in windows
    )
    (width_m, height_m), _ = sizes.most_common(1)[0]
    sills_m = [
        each.low_m - max((floor for floor in floors_m if floor <= each.low_m), default=each.low_m)
        for each in windows
    ]
    apart_m = max(outline.length * storeys / len(windows), 1.1 * width_m)
    return {
        "storeys": float(storeys),
        "width": width_m,
        "height": height_m,
        "sill": round(float(np.median(sills_m)), 2),
        "bay": round(float(np.clip(apart_m, *_BAYS_M)), 1),
    }


def _width_m(window: _Solid) -> float:
    """Return the longer side of a window in plan, m."""
    corners = shapely.get_coordinates(window.ground.minimum_rotated_rectangle)
    return float(np.hypot(*np.diff(corners, axis=0).T).max())
