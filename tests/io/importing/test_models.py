"""Building models: each case is one form in which real models have a building."""

from pathlib import Path
from typing import Any

import pytest

from blast_env.errors import BlastEnvError
from blast_env.io.importing import FATES, Fate, ImportOptions, SiteImport, import_site
from tests.io.importing.found import boxes
from tests.io.importing.models import Model

ifcopenshell = pytest.importorskip("ifcopenshell")

CASES = Path(__file__).parent / "cases"


def case(name: str, **options: Any) -> SiteImport:
    asked = {"protect": ("Court",), "charge_at": ((-6.0, 3.0),)}
    return import_site(CASES / f"i_{name}.ifc", ImportOptions(**asked | options))


def pane_m(site: SiteImport) -> tuple[float, float, float]:
    (window,) = site.scenario.components.values()
    assert window.kind == "glazing"
    return window.width_m, window.height_m, window.sill_m


def said(site: SiteImport, fate: Fate, words: str) -> list[str]:
    """Return the details of the lines of the ledger whose kind has these words."""
    return [entry.detail for entry in site.ledger.of(fate) if words in entry.kind]


def test_a_tower_on_a_podium_has_two_heights() -> None:
    site = case("tower_podium")
    assert boxes(site) == [(400.0, 0.0, 6.0), (200.0, 0.0, 60.0)]
    assert all(building.protected for building in site.buildings)
    assert sum(structure.weight for structure in site.scenario.structures) == pytest.approx(
        1.0, abs=1e-5
    )


def test_heights_count_from_the_lowest_storey_where_a_model_stands_above_the_sea() -> None:
    site = case("absolute_storeys")
    assert boxes(site) == [(200.0, 0.0, 12.0)]
    assert said(site, Fate.GUESSED, "ground under buildings") == ["at 431 m, its lowest storey"]
    with pytest.raises(BlastEnvError, match="at 431 m, its lowest storey"):
        case("absolute_storeys", strict=True)


def test_the_ground_of_every_building_of_a_model_is_said() -> None:
    site = case("two_and_site_wall")
    assert said(site, Fate.NOTED, "ground under buildings") == ["at 0 m, where it is placed"] * 2


def test_paving_is_no_building() -> None:
    site = case("paving")
    assert boxes(site) == [(200.0, 0.0, 12.0)]
    (slab,) = site.ledger.of(Fate.LEFT_OUT)
    assert slab.kind == "IfcSlab lower than a storey"


def test_a_wall_of_the_site_stands() -> None:
    site = case("two_and_site_wall")
    assert boxes(site) == [(200.0, 0.0, 12.0), (200.0, 0.0, 12.0), (6.0, 0.0, 9.0)]
    assert {building.title for building in site.buildings} == {"Court", "B1", "IfcWall"}


def test_windows_are_those_of_outer_walls() -> None:
    site = case("inner_windows")
    assert pane_m(site) == (2.4, 1.8, 1.0)
    (detail,) = said(site, Fate.NOTED, "outer windows")
    assert detail.startswith("8 with 34.6 m2 of glass")
    assert len(said(site, Fate.MERGED, "windows of inner walls")) == 12


def test_a_window_without_a_depth_has_its_size() -> None:
    assert pane_m(case("flat_window")) == (1.2, 1.5, 1.0)


def test_levels_between_floors_are_no_storeys() -> None:
    site = case("helper_levels")
    (court,) = site.scenario.structures
    assert court.facade is not None
    assert court.facade.storeys == 4
    assert pane_m(site) == (1.2, 1.5, 1.0)


def test_the_glass_of_a_curtain_wall_is_said() -> None:
    site = case("curtain")
    assert boxes(site) == [(200.0, 0.0, 12.0)]
    assert said(site, Fate.GUESSED, "glass of curtain walls") == ["16.00 x 8.00 m"]


def test_the_north_of_a_model_is_said() -> None:
    words = "30.0 degrees clockwise from its y axis"
    assert said(case("true_north"), Fate.NOTED, "north of the model") == [words]


@pytest.mark.parametrize("name", sorted(path.stem[2:] for path in CASES.glob("i_*.ifc")))
def test_every_element_of_a_model_has_one_fate(name: str) -> None:
    model = ifcopenshell.open(str(CASES / f"i_{name}.ifc"))
    objects = [*model.by_type("IfcElement"), *model.by_type("IfcBuilding")]
    places = sorted(entry.place for entry in case(name).ledger.of(*FATES))
    assert places == sorted(f"{entry.is_a()} {entry.GlobalId}" for entry in objects)


def plain_model() -> Model:
    """Return a model in millimetres with nothing on its site."""
    return Model("mm", 0.0, 0.0, "IFC4", ("plain",))


def test_storeys_and_windows_of_a_model_are_its_facade(tmp_path: Path) -> None:
    """What is before the house, and in it, is left out by name."""
    model = plain_model()
    levels = model.building([0.0, 3.0], "Town Hall")
    for level in levels:
        model.slab(level, 0.0, (12.0, 8.0), 0.0)
        model.walls(level, 0.0, (12.0, 8.0, 3.0))
        for left in (1.0, 5.0, 9.0):
            for y in (0.0, 7.7):
                model.box("IfcWindow", level, (left, y, 0.9), (1.2, 0.3, 1.4), Fate.MERGED)
    model.box("IfcColumn", levels[0], (2.0, -3.0, 0.0), (0.4, 0.4, 3.0), Fate.LEFT_OUT)
    model.box("IfcFurniture", levels[0], (3.0, 3.0, 0.0), (0.5, 0.5, 0.9), Fate.LEFT_OUT)
    site = model.imported(tmp_path)
    assert {entry.place: entry.fate for entry in site.ledger.of(*FATES)} == model.fates
    (hall,) = site.scenario.structures
    assert (hall.title, hall.height_m) == ("Town Hall", 6.0)
    assert site.buildings[0].outline.area == pytest.approx(96.0, rel=0.01)
    assert hall.facade is not None
    assert hall.facade.storeys == 2
    assert hall.facade.bay_m == pytest.approx(40.0 * 2 / 12, abs=0.1)
    assert pane_m(site) == (1.2, 1.4, 0.9)
    (glass,) = site.ledger.of(Fate.GUESSED)
    assert glass.kind == "glass, which IFC does not state"


def test_a_model_without_a_unit_or_a_building_is_refused(tmp_path: Path) -> None:
    model = plain_model()
    with pytest.raises(BlastEnvError, match=r"model.ifc: has no IfcBuilding"):
        model.imported(tmp_path)
    model.building([0.0], "Town Hall")
    with pytest.raises(BlastEnvError, match=r"model.ifc: has no building"):
        model.imported(tmp_path)
    model.file.by_type("IfcProject")[0].UnitsInContext = None
    with pytest.raises(BlastEnvError, match=r"model.ifc: states no unit of length, must state one"):
        model.imported(tmp_path)
    (tmp_path / "bad.ifc").write_text("nonsense")
    with pytest.raises(BlastEnvError, match=r"bad.ifc: cannot be read as IFC"):
        import_site(tmp_path / "bad.ifc")
