"""Building models: a house of two storeys with windows, a column and a chair."""

from pathlib import Path
from typing import Any

import pytest

from blast_env.errors import BlastEnvError
from blast_env.io.importing import Fate, ImportOptions, SiteImport, import_site

ifcopenshell = pytest.importorskip("ifcopenshell")

CHARGE: dict[str, Any] = {"charge_at": ((-6.0, 3.0),), "protect": ("Town Hall",)}


class Model:
    """A model in millimetres, or without a unit."""

    def __init__(self, *, units: bool = True) -> None:
        self.file: Any = ifcopenshell.file(schema="IFC4")
        make = self.file.create_entity
        self.origin = make("IfcAxis2Placement3D", self._point(0.0, 0.0, 0.0))
        space = make("IfcGeometricRepresentationContext", None, "Model", 3, 1e-5, self.origin)
        self.body = make(
            "IfcGeometricRepresentationSubContext", "Body", "Model", ParentContext=space
        )
        self.body.TargetView = "MODEL_VIEW"
        length = make("IfcSIUnit", UnitType="LENGTHUNIT", Prefix="MILLI", Name="METRE")
        assignment = make("IfcUnitAssignment", [length]) if units else None
        project = self._rooted("IfcProject", "project")
        project.RepresentationContexts, project.UnitsInContext = [space], assignment
        if not units:
            self.file.remove(length)
        self.building = self._placed("IfcBuilding", "Town Hall")
        self._whole(project, [self.building])
        self.storeys = [self._placed("IfcBuildingStorey", f"floor {k}") for k in range(2)]
        for number, storey in enumerate(self.storeys):
            storey.Elevation = 3000.0 * number
        self._whole(self.building, self.storeys)

    def _point(self, *place: float) -> Any:
        return self.file.create_entity("IfcCartesianPoint", place)

    def _rooted(self, kind: str, name: str) -> Any:
        return self.file.create_entity(kind, GlobalId=ifcopenshell.guid.new(), Name=name)

    def _placed(self, kind: str, name: str) -> Any:
        found = self._rooted(kind, name)
        found.ObjectPlacement = self.file.create_entity("IfcLocalPlacement", None, self.origin)
        return found

    def _whole(self, whole: Any, parts: list[Any]) -> None:
        link = self._rooted("IfcRelAggregates", "")
        link.RelatingObject, link.RelatedObjects = whole, parts

    def box(self, kind: str, storey: int, low: tuple[float, ...], size: tuple[float, ...]) -> Any:
        """Add an element, a box in millimetres; return its id."""
        make = self.file.create_entity
        middle = make("IfcAxis2Placement2D", self._point(0.5 * size[0], 0.5 * size[1]))
        profile = make("IfcRectangleProfileDef", "AREA", None, middle, size[0], size[1])
        up = make("IfcDirection", (0.0, 0.0, 1.0))
        place = make("IfcAxis2Placement3D", self._point(*low))
        solid = make("IfcExtrudedAreaSolid", profile, place, up, size[2])
        form = make("IfcShapeRepresentation", self.body, "Body", "SweptSolid", [solid])
        element = self._placed(kind, kind)
        element.Representation = make("IfcProductDefinitionShape", None, None, [form])
        link = self._rooted("IfcRelContainedInSpatialStructure", "")
        link.RelatedElements, link.RelatingStructure = [element], self.storeys[storey]
        return element.GlobalId

    def imported(self, folder: Path, **options: Any) -> SiteImport:
        path = folder / "house.ifc"
        self.file.write(str(path))
        return import_site(path, ImportOptions(**(CHARGE | options)))


def house(**options: Any) -> Model:
    model = Model(**options)
    for storey in range(2):
        base = 3000.0 * storey
        model.box("IfcSlab", storey, (0.0, 0.0, base - 200.0), (12000.0, 8000.0, 200.0))
        for low, size in (
            ((0.0, 0.0), (12000.0, 200.0)),
            ((0.0, 7800.0), (12000.0, 200.0)),
            ((0.0, 0.0), (200.0, 8000.0)),
            ((11800.0, 0.0), (200.0, 8000.0)),
        ):
            model.box("IfcWall", storey, (*low, base), (*size, 3000.0))
        for left in (1000.0, 5000.0, 9000.0):
            for y in (0.0, 7800.0):
                model.box("IfcWindow", storey, (left, y, base + 900.0), (1200.0, 200.0, 1400.0))
    return model


def test_storeys_and_windows_of_a_model_are_its_facade(tmp_path: Path) -> None:
    site = house().imported(tmp_path)
    (hall,) = site.scenario.structures
    assert (hall.title, hall.height_m) == ("Town Hall", 6.0)
    assert site.buildings[0].outline.area == pytest.approx(96.0, rel=0.01)
    assert hall.facade is not None
    assert hall.facade.storeys == 2
    assert hall.facade.bay_m == pytest.approx(40.0 * 2 / 12, abs=0.1)
    (window,) = site.scenario.components.values()
    assert window.kind == "glazing"
    assert (window.width_m, window.height_m, window.sill_m) == (1.2, 1.4, 0.9)
    (glass,) = site.ledger.of(Fate.GUESSED)
    assert glass.kind == "glass, which IFC does not state"
    assert len(site.ledger.of(Fate.MERGED)) == 2 * (1 + 4 + 6)


def test_everything_left_out_of_a_model_is_named_by_its_id(tmp_path: Path) -> None:
    model = house()
    column = model.box("IfcColumn", 0, (2000.0, -3000.0, 0.0), (400.0, 400.0, 3000.0))
    chair = model.box("IfcFurniture", 0, (3000.0, 3000.0, 0.0), (500.0, 500.0, 900.0))
    left_out = model.imported(tmp_path).ledger.of(Fate.LEFT_OUT)
    assert {entry.place for entry in left_out} == {f"IfcColumn {column}", f"IfcFurniture {chair}"}


def test_a_model_without_a_unit_or_a_building_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BlastEnvError, match=r"house.ifc: states no unit of length, must state one"):
        house(units=False).imported(tmp_path)
    with pytest.raises(BlastEnvError, match=r"house.ifc: has no building"):
        Model().imported(tmp_path)
    (tmp_path / "bad.ifc").write_text("nonsense")
    with pytest.raises(BlastEnvError, match=r"bad.ifc: cannot be read as IFC"):
        import_site(tmp_path / "bad.ifc")
