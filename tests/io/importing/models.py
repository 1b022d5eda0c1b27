"""A building model in IFC, written with ifcopenshell, with what is known of it."""

from collections.abc import Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from shapely.affinity import rotate, scale

from blast_env.io.importing import Fate, ImportOptions, SiteImport, import_site

ifcopenshell = pytest.importorskip("ifcopenshell")

LOT_M = 70.0
WALL_M = 0.3
UNITS = {"m": 1.0, "mm": 1000.0, "ft": 1.0 / 0.3048}
"""How many units a metre has."""

TURNS_DEG = (0.0, 90.0, 30.0, 217.0)
MIDDLE = (18.0, 6.0)
"""Where a building turns, from its own zero."""

WAYS = ("plain", "turned", "scaled", "mirrored")
"""How an element is drawn: also with a turned placement, or as a mapped item."""

ORIGIN = (1.0, 2.0, 0.5)
"""Origin of the forms of mapped items, m."""

Place = tuple[float, float, float]
Box = tuple[float, float, float]
"""Area in m2, underside and top in m above the ground."""


class Model:
    """A model with what is known of it, its buildings on lots in a row.

    Args:
        unit: Unit of the file.
        site_m: Height at which the site is placed.
        storeys_m: Height at which storeys are placed in their buildings, more than they should.
        schema: Schema of the file.
        ways: How elements are drawn, in turns; see `WAYS`.
    """

    def __init__(
        self, unit: str, site_m: float, storeys_m: float, schema: str, ways: Sequence[str]
    ) -> None:
        self.file: Any = ifcopenshell.file(schema=schema)
        self.scale, self.storeys_m = UNITS[unit], storeys_m
        self.fates: dict[str, Fate] = {}
        self.boxes: list[Box] = []
        self.panes: list[tuple[int, float, float]] = []
        self.lots = 0
        self.charge_at = (-6.0, 3.0)
        self.ways = cycle(ways)
        make = self.file.create_entity
        self.body = make(
            "IfcGeometricRepresentationContext", None, "Model", 3, 1e-5, self._axes((0.0, 0.0, 0.0))
        )
        project = self._rooted("IfcProject", "project")
        project.RepresentationContexts = [self.body]
        project.UnitsInContext = make("IfcUnitAssignment", [self._unit(unit)])
        self.site = self._placed("IfcSite", None, (0.0, 0.0, site_m))
        self._whole(project, [self.site])

    def _unit(self, unit: str) -> Any:
        make = self.file.create_entity
        if unit != "ft":
            prefix = "MILLI" if unit == "mm" else None
            return make("IfcSIUnit", UnitType="LENGTHUNIT", Prefix=prefix, Name="METRE")
        metre = make("IfcSIUnit", UnitType="LENGTHUNIT", Name="METRE")
        value = self.file.create_entity(
            "IfcMeasureWithUnit", make("IfcLengthMeasure", 0.3048), metre
        )
        size = make("IfcDimensionalExponents", 1, 0, 0, 0, 0, 0, 0)
        return make("IfcConversionBasedUnit", size, "LENGTHUNIT", "FOOT", value)

    def _point(self, *place: float) -> Any:
        scaled = [float(self.scale * shift_m) for shift_m in place]
        return self.file.create_entity("IfcCartesianPoint", scaled)

    def _axes(self, place: Place, turn_deg: float = 0.0) -> Any:
        make = self.file.create_entity
        if not turn_deg:
            return make("IfcAxis2Placement3D", self._point(*place))
        ahead = self._direction(*turned((1.0, 0.0), turn_deg), 0.0)
        return make("IfcAxis2Placement3D", self._point(*place), self._direction(0, 0, 1), ahead)

    def _direction(self, *ratios: float) -> Any:
        return self.file.create_entity("IfcDirection", [float(ratio) for ratio in ratios])

    def _rooted(self, kind: str, name: str) -> Any:
        return self.file.create_entity(kind, GlobalId=ifcopenshell.guid.new(), Name=name)

    def _placed(
        self, kind: str, within: Any, place: Place, name: str = "", turn_deg: float = 0.0
    ) -> Any:
        found = self._rooted(kind, name or kind)
        above = None if within is None else within.ObjectPlacement
        found.ObjectPlacement = self.file.create_entity(
            "IfcLocalPlacement", above, self._axes(place, turn_deg)
        )
        return found

    def _whole(self, whole: Any, parts: list[Any]) -> None:
        link = self._rooted("IfcRelAggregates", "")
        link.RelatingObject, link.RelatedObjects = whole, parts

    def building(self, storeys: list[float], name: str = "", turn_deg: float = 0.0) -> list[Any]:
        """Add a building on the next lot, turned about its middle; return its storeys.

        Args:
            storeys: Their heights above the ground, m.
            name: Name of the building.
            turn_deg: Its turn; that of the first one turns the charge too.
        """
        name = name or f"House {self.lots}"
        x, y = np.subtract(MIDDLE, turned(MIDDLE, turn_deg))
        place = (float(x) + LOT_M * self.lots, float(y), 0.0)
        found = self._placed("IfcBuilding", self.site, place, name, turn_deg)
        if not self.lots:
            a, b = turned(self.charge_at, turn_deg)
            self.charge_at = (a + float(x), b + float(y))
        self.lots += 1
        self._whole(self.site, [found])
        levels = []
        for height in storeys:
            level = self._placed("IfcBuildingStorey", found, (0.0, 0.0, height + self.storeys_m))
            level.Elevation = self.scale * (height + self.storeys_m)
            levels.append(level)
        self._whole(found, levels)
        self.fates[f"IfcBuilding {found.GlobalId}"] = Fate.READ
        return levels

    def box(
        self, kind: str, level: Any, low: Place, size: Place, fate: Fate | None, **more: Any
    ) -> Any:
        """Add a box, or a sheet of no depth, in a storey or the site, its place relative to it."""
        way, turn_deg = next(self.ways), 0.0
        x, y, z = size
        if way == "turned":  # about its corner, which is another one then
            low = (low[0] + x, low[1], low[2])
            turn_deg, size = (90.0, (y, x, z)) if y else (180.0, size)
        drawn = self._prism if size[1] > 0.0 else self._sheet
        if way == "scaled":
            form = self._mapped(drawn(halved(size)), 1.0, 2.0)
        elif way == "mirrored":
            form = self._mapped(drawn(size), -1.0, 1.0, x)
        else:
            form = self._form(*drawn(size))
        element = self._element(kind, level, low, turn_deg, form, fate)
        for key, value in more.items():
            setattr(element, key, value)
        return element

    def prism(
        self, kind: str, level: Any, outline: shapely.Polygon, low_m: float, high_m: float
    ) -> Any:
        """Add an element of any outline in a storey."""
        way, turn_deg, rise_m = next(self.ways), 0.0, high_m - low_m
        if way == "turned":
            outline, turn_deg = rotate(outline, -90.0, origin=(0.0, 0.0)), 90.0
        if way == "scaled":
            small = scale(outline, 0.5, 0.5, origin=(0.0, 0.0))
            form = self._mapped(self._extruded(small, 0.5 * rise_m), 1.0, 2.0)
        elif way == "mirrored":
            other = scale(outline, -1.0, 1.0, origin=(0.0, 0.0))
            form = self._mapped(self._extruded(other, rise_m), -1.0, 1.0)
        else:
            form = self._form(*self._extruded(outline, rise_m))
        return self._element(kind, level, (0.0, 0.0, low_m), turn_deg, form, Fate.MERGED)

    def _element(
        self, kind: str, level: Any, low: Place, turn_deg: float, form: Any, fate: Fate | None
    ) -> Any:
        element = self._placed(kind, level, low, turn_deg=turn_deg)
        element.Representation = self.file.create_entity(
            "IfcProductDefinitionShape", None, None, [form]
        )
        link = self._rooted("IfcRelContainedInSpatialStructure", "")
        link.RelatedElements, link.RelatingStructure = [element], level
        if fate is not None:
            self.fates[f"{kind} {element.GlobalId}"] = fate
        return element

    def _form(self, kind: str, items: list[Any]) -> Any:
        return self.file.create_entity("IfcShapeRepresentation", self.body, "Body", kind, items)

    def _mapped(
        self, drawn: tuple[str, list[Any]], ahead: float, times: float, left: float = 0.0
    ) -> Any:
        """Return a form that maps another to `left`: its x axis turned, all of it scaled."""
        make = self.file.create_entity
        source = make("IfcRepresentationMap", self._axes(ORIGIN), self._form(*drawn))
        # The origin is where the form lies before it is mapped.
        at = left - ahead * times * ORIGIN[0], -times * ORIGIN[1], -times * ORIGIN[2]
        target = make(
            "IfcCartesianTransformationOperator3D",
            self._direction(ahead, 0, 0),
            self._direction(0, 1, 0),
            self._point(*at),
            times,
            self._direction(0, 0, 1),
        )
        return self._form("MappedRepresentation", [make("IfcMappedItem", source, target)])

    def _prism(self, size: Place) -> tuple[str, list[Any]]:
        make = self.file.create_entity
        middle = make("IfcAxis2Placement2D", self._point(0.5 * size[0], 0.5 * size[1]))
        sides = self.scale * size[0], self.scale * size[1]
        return self._up(make("IfcRectangleProfileDef", "AREA", None, middle, *sides), size[2])

    def _extruded(self, outline: shapely.Polygon, rise_m: float) -> tuple[str, list[Any]]:
        rings = (outline.exterior, *outline.interiors)
        lines = [
            self.file.create_entity(
                "IfcPolyline", [self._point(*corner_m) for corner_m in ring.coords]
            )
            for ring in rings
        ]
        kind = "IfcArbitraryProfileDefWithVoids" if lines[1:] else "IfcArbitraryClosedProfileDef"
        voids = [lines[1:]] if lines[1:] else []
        profile = self.file.create_entity(kind, "AREA", None, lines[0], *voids)
        return self._up(profile, rise_m)

    def _up(self, profile: Any, rise_m: float) -> tuple[str, list[Any]]:
        origin, up = self._axes((0.0, 0.0, 0.0)), self._direction(0, 0, 1)
        rise = self.scale * rise_m
        solid = self.file.create_entity("IfcExtrudedAreaSolid", profile, origin, up, rise)
        return "SweptSolid", [solid]

    def _sheet(self, size: Place) -> tuple[str, list[Any]]:
        make = self.file.create_entity
        x, _, z = size
        corners = [(0.0, 0.0, 0.0), (x, 0.0, 0.0), (x, 0.0, z), (0.0, 0.0, z)]
        loop = make("IfcPolyLoop", [self._point(*corner_m) for corner_m in corners])
        face = make("IfcFace", [make("IfcFaceOuterBound", loop, True)])
        shell = make("IfcOpenShell", [face])
        return "SurfaceModel", [make("IfcShellBasedSurfaceModel", [shell])]

    def walls(self, level: Any, left: float, size: Place, low: float = 0.0) -> None:
        """Add four walls around a plan."""
        x, y, z = size
        for place, sides in (
            ((left, 0.0), (x, WALL_M)),
            ((left, y - WALL_M), (x, WALL_M)),
            ((left, 0.0), (WALL_M, y)),
            ((left + x - WALL_M, 0.0), (WALL_M, y)),
        ):
            self.box("IfcWall", level, (*place, low), (*sides, z), Fate.MERGED)

    def slab(self, level: Any, left: float, size: tuple[float, float], top: float) -> None:
        self.box("IfcSlab", level, (left, 0.0, top - 0.2), (*size, 0.2), Fate.MERGED)

    def imported(self, folder: Path) -> SiteImport:
        """Import the model with a charge beside it."""
        options = ImportOptions(charge_at=(self.charge_at,), protect=("Town Hall",))
        return import_site(self.write(folder), options)

    def write(self, folder: Path) -> Path:
        self.file.write(str(folder / "model.ifc"))
        return folder / "model.ifc"


def halved(size: Place) -> Place:
    x, y, z = size
    return 0.5 * x, 0.5 * y, 0.5 * z


def turned(place: tuple[float, float], turn_deg: float) -> tuple[float, float]:
    """Return a place turned about zero."""
    found = complex(*place) * np.exp(1j * np.radians(turn_deg))
    return float(found.real), float(found.imag)
