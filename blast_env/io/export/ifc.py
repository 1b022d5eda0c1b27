"""Barriers of a layout in IFC4, as walls and other pieces of the site, for building models."""

from collections.abc import Iterator, Mapping
from itertools import count
from pathlib import Path
from typing import Any, Final
from uuid import NAMESPACE_URL, uuid5

import shapely

from blast_env.errors import import_extra
from blast_env.evaluation.engines.pieces import rigid_piece
from blast_env.files import write_atomically
from blast_env.geometry import Piece
from blast_env.io.export.bill import MODULE, LayoutPlan, placed_elements
from blast_env.io.importing.ifc import PIECE_SET, STRUCTURE_SET
from blast_env.layout.build_site import barrier_outline, outlines
from blast_env.site.catalogue import Variant
from blast_env.units import MODULE_SIDE_M

with import_extra("ifc", "IFC files"):
    import ifcopenshell
    from ifcopenshell.guid import compress

SCHEMA: Final = "IFC4"

_WALL_RATIO: Final = 3
"""Least length of a wall over its thickness. Bollards, blocks and planters are shorter."""


def write_ifc(plan: LayoutPlan, path: Path) -> None:
    """Write the pieces of a layout, and the structures for orientation.

    A piece is an `IfcWall` of the site if it is three times as long as thick, else an
    `IfcBuildingElementProxy`.

    Lengths are in metres, from the lower left corner of the site, z upwards.
    """
    model = _Model(plan)
    model.add()
    with write_atomically(path) as temporary:
        model.file.write(str(temporary))


def _kind_of(variant: Variant) -> str:
    """Return the class of a piece."""
    thickness, length = sorted((variant.rows, variant.columns))
    return "IfcWall" if length >= _WALL_RATIO * thickness else "IfcBuildingElementProxy"


class _Model:
    """A model of a layout.

    Args:
        plan: The layout on its site.
    """

    def __init__(self, plan: LayoutPlan) -> None:
        self._plan, self._numbers = plan, count()
        self.file: Any = ifcopenshell.file(schema=SCHEMA)
        self._make = self.file.create_entity
        self._context = self._make(
            "IfcGeometricRepresentationContext", None, "Model", 3, 1e-5, self._axes(0.0)
        )
        metre = self._make("IfcSIUnit", None, "LENGTHUNIT", None, "METRE")
        units = [
            metre,
            self._make("IfcSIUnit", None, "AREAUNIT", None, "SQUARE_METRE"),
            self._make("IfcSIUnit", None, "VOLUMEUNIT", None, "CUBIC_METRE"),
            self._make("IfcSIUnit", None, "MASSUNIT", "KILO", "GRAM"),
        ]
        project = self._rooted("IfcProject", plan.scenario.name)
        project.RepresentationContexts = [self._context]
        project.UnitsInContext = self._make("IfcUnitAssignment", units)
        self._site = self._placed("IfcSite", plan.scenario.name)
        self._part_of("IfcRelAggregates", project, [self._site])

    def add(self) -> None:
        """Add the structures and the pieces."""
        scenario = self._plan.scenario
        buildings: dict[str, list[Any]] = {}
        for section, outline in zip(
            scenario.structures_with(self._plan.layout),
            outlines(scenario, self._plan.layout),
            strict=True,
        ):
            bodies = (
                [outline.footprint.polygon]
                if outline.footprint is not None
                else [shapely.box(*box) for box in outline.boxes_m]
            )
            for body in bodies:
                block = self._body("IfcWall", outline.name, body, outline.base_m, outline.height_m)
                block.ObjectType, block.PredefinedType = "block of a structure", "USERDEFINED"
                self._describe(
                    block,
                    STRUCTURE_SET,
                    {"Protected": outline.protected, "Carries": section.carries},
                )
                buildings.setdefault(section.building_name, []).append(block)
        for name, blocks in buildings.items():
            building = self._placed("IfcBuilding", name)
            self._part_of("IfcRelAggregates", self._site, [building])
            self._contain(building, blocks)
        self._contain(self._site, list(self._pieces()))

    def _pieces(self) -> Iterator[Any]:
        """Yield the pieces of the barrier."""
        scenario, layout = self._plan.scenario, self._plan.layout
        if scenario.build_zone is None or not layout:
            return
        # Base and top of a piece are those of its block, which stands on the ground below it.
        blocks = {block.rectangle_m: block for block in barrier_outline(scenario, layout).blocks}
        items = {item.name: item for item in scenario.build_zone.items}
        for placed in placed_elements(self._plan):
            block = blocks[placed.rectangle_m]
            piece = self._body(
                _kind_of(placed.variant),
                placed.name,
                shapely.box(*placed.rectangle_m),
                block.base_m,
                block.height_m,
            )
            item = items.get(placed.element.item) if isinstance(placed.element, Piece) else None
            piece.ObjectType = MODULE if item is None else item.name
            piece.PredefinedType = "USERDEFINED"
            properties: dict[str, Any] = {
                "Item": piece.ObjectType,
                "Cost": placed.cost,
                "StopsVehicles": placed.variant.stops_vehicles,
                "AsHighAsTheAir": block.height_m is None,
            }
            body = rigid_piece(scenario.build_zone, placed.element)
            if body is not None:
                length_m = MODULE_SIDE_M * (1 if item is None else item.length_modules)
                properties["MassKg"] = body.mass_kg_m * length_m
                properties["MassIsStated"] = item is not None and item.mass_kg is not None
            if item is not None:
                properties["Description"] = item.description
            rating = placed.variant.crash_rating
            if rating is not None:
                properties |= {
                    "CrashRating": rating.test,
                    "CrashMassKg": rating.mass_kg,
                    "CrashSpeedKmH": rating.speed_km_h,
                    "CrashPenetrationM": rating.penetration_m,
                }
            self._describe(piece, PIECE_SET, properties)
            yield piece

    def _body(self, kind: str, name: str, plan: Any, base_m: float, height_m: float | None) -> Any:
        """Return an element that is an extruded plan."""
        top_m = self._plan.scenario.air_height_m if height_m is None else height_m
        outer, *inner = (self._ring(ring) for ring in shapely.get_rings(plan))
        words = "IfcArbitraryProfileDefWithVoids" if inner else "IfcArbitraryClosedProfileDef"
        profile = self._make(words, "AREA", None, outer, *([inner] if inner else []))
        up = self._make("IfcDirection", (0.0, 0.0, 1.0))
        solid = self._make("IfcExtrudedAreaSolid", profile, self._axes(0.0), up, top_m - base_m)
        shape = self._make("IfcShapeRepresentation", self._context, "Body", "SweptSolid", [solid])
        element = self._placed(kind, name, base_m)
        element.Representation = self._make("IfcProductDefinitionShape", None, None, [shape])
        return element

    def _ring(self, ring: Any) -> Any:
        points = [self._make("IfcCartesianPoint", place) for place in ring.coords[:-1]]
        return self._make("IfcPolyline", [*points, points[0]])

    def _axes(self, z_m: float) -> Any:
        return self._make(
            "IfcAxis2Placement3D", self._make("IfcCartesianPoint", (0.0, 0.0, float(z_m)))
        )

    def _rooted(self, kind: str, name: str | None = None) -> Any:
        """Return an entity with an id that is the same whenever the layout is."""
        key = f"{self._plan.scenario.content_hash}/{self._plan.layout}/{next(self._numbers)}"
        found = self._make(kind, GlobalId=compress(uuid5(NAMESPACE_URL, key).hex))
        found.Name = name
        return found

    def _placed(self, kind: str, name: str, z_m: float = 0.0) -> Any:
        found = self._rooted(kind, name)
        found.ObjectPlacement = self._make("IfcLocalPlacement", None, self._axes(z_m))
        return found

    def _part_of(self, kind: str, whole: Any, parts: list[Any]) -> None:
        relation = self._rooted(kind)
        relation.RelatingObject, relation.RelatedObjects = whole, parts

    def _contain(self, whole: Any, elements: list[Any]) -> None:
        if elements:
            relation = self._rooted("IfcRelContainedInSpatialStructure")
            relation.RelatingStructure, relation.RelatedElements = whole, elements

    def _describe(self, element: Any, name: str, properties: Mapping[str, Any]) -> None:
        """Give an element a set of properties."""
        values = [
            self._make("IfcPropertySingleValue", key, None, self._value(value), None)
            for key, value in properties.items()
        ]
        found = self._rooted("IfcPropertySet", name)
        found.HasProperties = values
        relation = self._rooted("IfcRelDefinesByProperties")
        relation.RelatedObjects, relation.RelatingPropertyDefinition = [element], found

    def _value(self, value: str | float | bool) -> Any:
        if isinstance(value, bool):
            return self._make("IfcBoolean", value)
        if isinstance(value, float):
            return self._make("IfcReal", value)
        return self._make("IfcLabel", str(value))
