"""Every element of a random building model has the fate that it must have, once, and its solid.

`pytest tests/io/importing/test_random_models.py --hypothesis-profile many` imports 2,000 models.
"""

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from blast_env.io.importing import ImportedSite, ImportOptions, import_site
from blast_env.io.importing.ledger import FATES, Fate

ifcopenshell = pytest.importorskip("ifcopenshell")

LOT_M = 70.0
WALL_M = 0.3
UNITS = {"m": 1.0, "mm": 1000.0, "ft": 1.0 / 0.3048}
"""How many units a metre has."""

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
    """

    def __init__(self, unit: str, site_m: float, storeys_m: float, schema: str) -> None:
        self.file: Any = ifcopenshell.file(schema=schema)
        self.scale, self.storeys_m = UNITS[unit], storeys_m
        self.fates: dict[str, Fate] = {}
        self.boxes: list[Box] = []
        self.panes: list[tuple[int, float, float]] = []
        self.lots = 0
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
        scaled = [float(self.scale * each) for each in place]
        return self.file.create_entity("IfcCartesianPoint", scaled)

    def _axes(self, place: Place) -> Any:
        return self.file.create_entity("IfcAxis2Placement3D", self._point(*place))

    def _rooted(self, kind: str, name: str) -> Any:
        return self.file.create_entity(kind, GlobalId=ifcopenshell.guid.new(), Name=name)

    def _placed(self, kind: str, within: Any, place: Place, name: str = "") -> Any:
        found = self._rooted(kind, name or kind)
        above = None if within is None else within.ObjectPlacement
        found.ObjectPlacement = self.file.create_entity(
            "IfcLocalPlacement", above, self._axes(place)
        )
        return found

    def _whole(self, whole: Any, parts: list[Any]) -> None:
        link = self._rooted("IfcRelAggregates", "")
        link.RelatingObject, link.RelatedObjects = whole, parts

    def building(self, storeys: list[float], name: str = "") -> list[Any]:
        """Add a building on the next lot with storeys at heights above the ground, m."""
        name = name or f"House {self.lots}"
        found = self._placed("IfcBuilding", self.site, (LOT_M * self.lots, 0.0, 0.0), name)
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
        """Add an element in a storey or the site, its place relative to that."""
        element = self._placed(kind, level, low)
        solid = self._prism(size) if size[1] > 0.0 else self._sheet(size)
        form = self.file.create_entity("IfcShapeRepresentation", self.body, "Body", *solid)
        element.Representation = self.file.create_entity(
            "IfcProductDefinitionShape", None, None, [form]
        )
        for key, value in more.items():
            setattr(element, key, value)
        link = self._rooted("IfcRelContainedInSpatialStructure", "")
        link.RelatedElements, link.RelatingStructure = [element], level
        if fate is not None:
            self.fates[f"{kind} {element.GlobalId}"] = fate
        return element

    def _prism(self, size: Place) -> tuple[str, list[Any]]:
        make = self.file.create_entity
        middle = make("IfcAxis2Placement2D", self._point(0.5 * size[0], 0.5 * size[1]))
        sides = self.scale * size[0], self.scale * size[1]
        profile = make("IfcRectangleProfileDef", "AREA", None, middle, *sides)
        up = make("IfcDirection", (0.0, 0.0, 1.0))
        origin = self._axes((0.0, 0.0, 0.0))
        solid = make("IfcExtrudedAreaSolid", profile, origin, up, self.scale * size[2])
        return "SweptSolid", [solid]

    def _sheet(self, size: Place) -> tuple[str, list[Any]]:
        make = self.file.create_entity
        x, _, z = size
        corners = [(0.0, 0.0, 0.0), (x, 0.0, 0.0), (x, 0.0, z), (0.0, 0.0, z)]
        loop = make("IfcPolyLoop", [self._point(*each) for each in corners])
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

    def write(self, folder: Path) -> Path:
        self.file.write(str(folder / "model.ifc"))
        return folder / "model.ifc"


Maker = Callable[[Model, Any], None]
MAKERS: list[Maker] = []


def maker(function: Maker) -> Maker:
    MAKERS.append(function)
    return function


def house(model: Model, draw: Any, name: str = "") -> None:
    """Add a house of storeys with windows, outer and inner ones, and levels between them."""
    count, rise = draw(st.integers(1, 5)), draw(st.sampled_from((3.0, 3.5, 4.0)))
    x, y = draw(st.integers(12, 30)), draw(st.integers(8, 20))
    between = [rise * (k + 0.5) for k in range(count)] if draw(st.booleans()) else []
    floors = [rise * k for k in range(count)]
    levels = model.building([*floors, *between], name)[:count]
    has_roof, is_whole = draw(st.booleans()) or count == 1, draw(st.booleans())
    if is_whole:
        model.walls(levels[0], 0.0, (x, y, rise * count))
    large, small = draw(st.booleans()), draw(st.booleans())
    for number, level in enumerate(levels):
        if not is_whole:
            model.walls(level, 0.0, (x, y, rise))
        if number:
            model.slab(level, 0.0, (x, y), 0.0)
        depth = draw(st.sampled_from((0.0, 0.1, 0.3)))
        if large:
            model.box("IfcWindow", level, (2.0, 0.0, 0.8), (2.4, depth, 1.8), Fate.MERGED)
        if small:
            model.box("IfcWindow", level, (6.0, 0.0, 1.0), (0.8, depth, 0.8), Fate.MERGED)
        if draw(st.booleans()):
            place = (3.0, 0.5 * y, 0.5)
            model.box("IfcWindow", level, place, (5.0, 0.1, 2.0), Fate.MERGED)
    if has_roof:
        model.slab(levels[-1], 0.0, (x, y), rise)
    model.boxes.append((x * y, 0.0, rise * count))
    if large or small:
        model.panes.append((count, 2.4, 1.8) if large else (count, 0.8, 0.8))


MAKERS.append(house)


@maker
def tower(model: Model, draw: Any) -> None:
    """A tower on a podium, in one building."""
    (level,) = model.building([0.0])
    low, high = draw(st.integers(6, 16)) / 2.0, draw(st.integers(24, 90)) / 2.0
    model.walls(level, 0.0, (16.0, 12.0, high))
    model.slab(level, 0.0, (16.0, 12.0), high)
    model.walls(level, 16.0, (20.0, 12.0, low))
    model.slab(level, 16.0, (20.0, 12.0), low)
    model.boxes += [(192.0, 0.0, high), (240.0, 0.0, low)]
    if draw(st.booleans()):
        model.box("IfcWindow", level, (36.0 - WALL_M, 3.0, 1.0), (0.1, 1.5, 1.2), Fate.MERGED)
        model.panes.append((1, 1.5, 1.2))


@maker
def passage(model: Model, draw: Any) -> None:
    """Two blocks with storeys over a passage between them."""
    (level,) = model.building([0.0])
    base, top = draw(st.integers(7, 10)) / 2.0, draw(st.integers(16, 30)) / 2.0
    for left in (0.0, 18.0):
        model.walls(level, left, (10.0, 12.0, top))
    model.box("IfcSlab", level, (10.0, 0.0, base), (8.0, 12.0, 0.2), Fate.MERGED)
    model.slab(level, 0.0, (28.0, 12.0), top)
    model.boxes += [(120.0, 0.0, top), (120.0, 0.0, top), (96.0, base, top)]


@maker
def eaves(model: Model, draw: Any) -> None:
    """A house whose roof reaches beyond its walls, with a chimney and a slab in front of it."""
    (level,) = model.building([0.0])
    top = draw(st.integers(6, 16)) / 2.0
    model.walls(level, 0.0, (20.0, 10.0, top))
    low = (-0.6, -0.6, top - 0.2)
    model.box("IfcSlab", level, low, (21.2, 11.2, 0.2), Fate.MERGED)
    model.box("IfcWall", level, (5.0, 5.0, top), (1.0, 1.0, 3.0), Fate.MERGED)
    model.box("IfcSlab", level, (-5.0, -15.0, -0.2), (30.0, 13.0, 0.25), Fate.LEFT_OUT)
    model.boxes.append((200.0, 0.0, top))


@maker
def lived_in(model: Model, draw: Any) -> None:
    """A house with what is no part of it, a basement, and a curtain wall before it."""
    _, level = model.building([-3.0, 0.0])
    model.walls(level, 0.0, (20.0, 10.0, 12.0), low=-3.0)
    model.slab(level, 0.0, (20.0, 10.0), 9.0)
    model.box("IfcColumn", level, (5.0, 5.0, 0.0), (0.4, 0.4, 9.0), Fate.LEFT_OUT)
    model.box("IfcFurnishingElement", level, (5.0, 3.0, 0.0), (0.4, 0.4, 0.9), Fate.LEFT_OUT)
    model.box("IfcSpace", level, (1.0, 1.0, 0.0), (18.0, 8.0, 3.0), Fate.PASSED)
    model.box("IfcDoor", level, (5.0, 0.0, 0.0), (1.0, 0.2, 2.0), Fate.LEFT_OUT)
    model.box("IfcCurtainWall", level, (2.0, -0.1, 0.5), (16.0, 0.1, 8.0), Fate.MERGED)
    hole = model.box("IfcOpeningElement", level, (7.0, 0.0, 1.0), (1.0, 0.3, 1.0), Fate.PASSED)
    wall = model.file.by_type("IfcWall")[-4]
    link = model._rooted("IfcRelVoidsElement", "")
    link.RelatingBuildingElement, link.RelatedOpeningElement = wall, hole
    model.boxes.append((200.0, 0.0, 9.0))


@maker
def window_of_parts(model: Model, draw: Any) -> None:
    """A window without a shape of its own, as of a frame and a pane."""
    (level,) = model.building([0.0])
    model.walls(level, 0.0, (20.0, 10.0, 6.0))
    model.slab(level, 0.0, (20.0, 10.0), 6.0)
    window = model.box("IfcWindow", level, (0.0, 0.0, 0.0), (1.0, 0.1, 1.0), Fate.MERGED)
    window.Representation = None
    parts = [
        model.box("IfcMember", level, (3.0, 0.0, 1.0), (0.1, 0.1, 2.0), Fate.MERGED),
        model.box("IfcPlate", level, (3.1, 0.0, 1.0), (1.4, 0.1, 2.0), Fate.MERGED),
    ]
    for part in parts:
        model.file.remove(part.ContainedInStructure[0])
    model._whole(window, parts)
    model.boxes.append((200.0, 0.0, 6.0))
    model.panes.append((1, 1.5, 2.0))


@maker
def walls_of_the_site(model: Model, draw: Any) -> None:
    height = draw(st.integers(2, 12)) / 2.0
    left = LOT_M * model.lots
    model.lots += 1
    zero = (left, 0.0, model.storeys_m)
    model.box("IfcWall", model.site, zero, (20.0, 1.0, height), Fate.READ)
    model.boxes.append((20.0, 0.0, height))


@st.composite
def models(draw: Any) -> Model:
    """Return a model of a house and some of the makers."""
    site_m, storeys_m = draw(
        st.sampled_from(((0.0, 0.0), (431.0, 0.0), (0.0, 431.0), (0.0, -40.0)))
    )
    schema = draw(st.sampled_from(("IFC2X3", "IFC4", "IFC4X3")))
    found = Model(draw(st.sampled_from(sorted(UNITS))), site_m, storeys_m, schema)
    house(found, draw, "Town Hall")
    for make in draw(st.lists(st.sampled_from(MAKERS), max_size=3)):
        if make is lived_in and storeys_m:
            continue  # with a basement, the lowest storey is not the ground
        make(found, draw)
    return found


def imported(model: Model, folder: Path) -> ImportedSite:
    options = ImportOptions(charge_at=((-6.0, 3.0),), protect=("Town Hall",))
    return import_site(model.write(folder), options)


@given(models())
@settings(deadline=None, derandomize=True)
def test_every_element_has_its_fate_and_every_building_its_solid(
    tmp_path_factory: pytest.TempPathFactory, model: Model
) -> None:
    site = imported(model, tmp_path_factory.mktemp("models"))
    entries = site.ledger.of(*FATES)
    assert Counter(each.place for each in entries).most_common(1)[0][1] == 1
    assert {each.place: each.fate for each in entries} == model.fates
    solids = sorted(
        (round(part.area, 1), each.base_m, each.height_m)
        for each in site.buildings
        for part in shapely.get_parts(each.outline)
    )
    expected = sorted(model.boxes)
    assert [each[1:] for each in solids] == [each[1:] for each in expected]
    assert [each[0] for each in solids] == pytest.approx([each[0] for each in expected], rel=0.01)
    panes = sorted(
        (int(each.facade["storeys"]), each.facade["width"], each.facade["height"])
        for each in site.buildings
        if each.facade
    )
    assert panes == sorted(model.panes)


@given(models())
@settings(max_examples=10, deadline=None, derandomize=True)
def test_models_read_by_ifcopenshell_alone_agree(
    tmp_path_factory: pytest.TempPathFactory, model: Model
) -> None:
    """Hold each building against the box around its walls, as ifcopenshell places their corners."""
    import ifcopenshell.geom
    from ifcopenshell.util.placement import get_local_placement

    folder = tmp_path_factory.mktemp("models")
    site = imported(model, folder)
    read = ifcopenshell.open(str(folder / "model.ifc"))
    settings_ = ifcopenshell.geom.settings()
    settings_.set("use-world-coords", True)
    for entity in read.by_type("IfcBuilding"):
        own = [each for each in site.buildings if each.place.endswith(entity.GlobalId)]
        levels = {part.id() for link in entity.IsDecomposedBy for part in link.RelatedObjects}
        walls = [
            each
            for each in read.by_type("IfcWall")
            if each.ContainedInStructure[0].RelatingStructure.id() in levels
            and not each.HasOpenings
        ]
        shapes = [ifcopenshell.geom.create_shape(settings_, each) for each in walls]
        boxes = [np.reshape(each.geometry.verts, (-1, 3)) for each in shapes]
        boxes = [each for each in boxes if np.ptp(each[:, 0]) != pytest.approx(1.0)]  # chimneys
        low = np.min([each.min(axis=0) for each in boxes], axis=0)
        high = np.max([each.max(axis=0) for each in boxes], axis=0)
        left, bottom, right, top = shapely.total_bounds([each.outline for each in own])
        assert (right - left, top - bottom) == pytest.approx(tuple(high - low)[:2], abs=0.11)
        ground_m = get_local_placement(entity.ObjectPlacement)[2, 3] / model.scale
        rise_m = high[2] - ground_m - model.storeys_m
        assert max(each.height_m or 0.0 for each in own) == pytest.approx(rise_m)
