"""Drawings in space: each case is one form in which real drawings have a building."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ezdxf.entities.insert import Insert
from ezdxf.filemanagement import new, readfile

from blast_env.errors import BlastEnvError
from blast_env.io.importing import FATES, Fate, ImportOptions, SiteImport, import_site
from tests.io.importing.found import boxes
from tests.io.importing.maps import rectangle

CASES = Path(__file__).parent / "cases"
IN_AIR = "undersides more than a storey above the ground"
GROUND = "ground under buildings"


def drawn(path: Path, **options: Any) -> SiteImport:
    asked: dict[str, Any] = {"buildings_from": ("BLD",), "charge_at": ((-5.0, -5.0),)}
    return import_site(path, ImportOptions(**asked | {"protect_near": (10.0, 5.0)} | options))


def case(name: str, **options: Any) -> SiteImport:
    return drawn(CASES / f"d_{name}.dxf", **options)


def kinds(site: SiteImport, fate: Fate) -> list[str]:
    return [entry.kind for entry in site.ledger.of(fate)]


class Drawing:
    """A drawing in metres with extruded outlines on the layer BLD."""

    def __init__(self) -> None:
        self.document = new(units=6)
        self.space = self.document.modelspace()

    def house(self, left: float, base: float, rise: float, width: float = 20.0) -> None:
        attributes = {"layer": "BLD", "elevation": base, "thickness": rise}
        self.space.add_lwpolyline(rectangle(left, 0, width, 10), close=True, dxfattribs=attributes)

    def imported(self, folder: Path, **options: Any) -> SiteImport:
        self.document.saveas(folder / "drawing.dxf")
        return drawn(folder / "drawing.dxf", **options)


def test_a_negative_thickness_goes_down() -> None:
    assert boxes(case("thickness_down")) == [(200.0, 0.0, 9.0)]


def test_heights_above_the_sea_count_from_the_ground() -> None:
    site = case("absolute_z")
    assert boxes(site) == [(200.0, 0.0, 9.0)]
    (line,) = site.ledger.of(Fate.GUESSED)
    assert (line.kind.startswith(GROUND), line.detail) == (True, "431 m")
    with pytest.raises(BlastEnvError, match=r"ground under buildings.*431 m"):
        case("absolute_z", strict=True)


def test_hidden_entities_are_no_houses() -> None:
    site = case("invisible")
    assert [box[0] for box in boxes(site)] == [200.0]
    assert kinds(site, Fate.LEFT_OUT) == ["entities that are not shown"]


def test_a_house_beyond_a_layer_called_site_is_left_out_by_name() -> None:
    site = case("layer_site2")
    assert [box[0] for box in boxes(site)] == [200.0]
    (line,) = site.ledger.of(Fate.LEFT_OUT)
    assert line.kind.startswith("outside the outline of the site in the file")
    with pytest.raises(BlastEnvError, match="outside the outline of the site"):
        case("layer_site2", strict=True, default_height_m=6.0)


def test_faces_that_meet_are_a_body() -> None:
    site = case("3dfaces")
    assert boxes(site) == [(200.0, 0.0, 9.0)]
    assert kinds(site, Fate.MERGED) == ["faces of a body"] * 2


def test_mirrored_text_names_the_house_that_it_stands_in() -> None:
    assert [building.title for building in case("text_ocs").buildings] == ["Court"]


def test_a_tower_on_a_podium_stands_on_it(tmp_path: Path) -> None:
    """An extrusion from 6 m on another up to 6 m is supported, above any zero."""
    for zero in (0.0, 431.0):
        drawing = Drawing()
        drawing.house(0, zero, 6, width=60)
        drawing.house(0, zero + 6, 54)
        site = drawing.imported(tmp_path)
        assert boxes(site) == [(400.0, 0.0, 6.0), (200.0, 0.0, 60.0)]
        assert IN_AIR not in str(kinds(site, Fate.GUESSED))


def test_houses_on_a_slope_stand_on_their_own_ground(tmp_path: Path) -> None:
    drawing = Drawing()
    drawing.house(0, 431, 9)
    drawing.house(40, 436, 6)
    site = drawing.imported(tmp_path)
    assert boxes(site) == [(200.0, 0.0, 9.0), (200.0, 0.0, 6.0)]
    assert [entry.detail for entry in site.ledger.of(Fate.GUESSED)] == ["431 m", "436 m"]


@pytest.mark.parametrize(
    ("base", "rise", "expected", "words"),
    [
        (2.5, 6.5, (200.0, 2.5, 9.0), ""),  # a storey over a passage
        (5.0, 0.5, (200.0, 5.0, 5.5), IN_AIR),  # a canopy
        (12.0, 9.0, (200.0, 0.0, 9.0), GROUND),  # on a hill
        (-3.0, 12.0, (200.0, 0.0, 9.0), ""),  # with a cellar
    ],
)
def test_what_stands_on_nothing_is_raised_or_on_ground_of_its_own(
    base: float,
    rise: float,
    expected: tuple[float, float, float],
    words: str,
    tmp_path: Path,
) -> None:
    drawing = Drawing()
    drawing.house(0, 0, 9, width=10)
    drawing.house(40, base, rise)
    site = drawing.imported(tmp_path)
    assert boxes(site)[0] == expected
    assert [kind[: len(words)] for kind in kinds(site, Fate.GUESSED)] == [words] * bool(words)
    assert bool(kinds(site, Fate.CUT)) == (base < 0)


def test_a_bridge_between_houses_stays_up_and_is_said(tmp_path: Path) -> None:
    drawing = Drawing()
    for left in (0, 30):
        drawing.house(left, 400, 12)
    drawing.house(20, 406, 3, width=10)
    site = drawing.imported(tmp_path)
    assert boxes(site) == [(200.0, 0.0, 12.0), (200.0, 0.0, 12.0), (100.0, 6.0, 9.0)]
    assert any(IN_AIR in kind for kind in kinds(site, Fate.GUESSED))


def test_what_lies_below_the_ground_is_left_out(tmp_path: Path) -> None:
    drawing = Drawing()
    drawing.house(0, 0, 9)
    drawing.house(40, -6, 4)
    site = drawing.imported(tmp_path)
    assert boxes(site) == [(200.0, 0.0, 9.0)]
    assert kinds(site, Fate.LEFT_OUT) == ["buildings below the ground"]


def test_an_outline_extruded_aside_covers_what_it_sweeps(tmp_path: Path) -> None:
    drawing = Drawing()
    drawing.house(40, 0, 9)
    attributes = {"layer": "BLD", "extrusion": (1.0, 0.0, 0.0), "thickness": 20.0}
    gable = [(0.0, 0.0), (10.0, 0.0), (10.0, 6.0), (0.0, 6.0)]  # y, z
    drawing.space.add_lwpolyline(gable, close=True, dxfattribs=attributes)
    assert boxes(drawing.imported(tmp_path)) == [(200.0, 0.0, 9.0), (200.0, 0.0, 6.0)]


def test_layers_that_are_off_are_read_and_said(tmp_path: Path) -> None:
    drawing = Drawing()
    drawing.house(0, 0, 9)
    drawing.document.layers.add("BLD").freeze()
    site = drawing.imported(tmp_path)
    assert boxes(site) == [(200.0, 0.0, 9.0)]
    assert kinds(site, Fate.NOTED) == ["layers that are off or frozen, read as others"]


@pytest.mark.parametrize("name", sorted(path.stem[2:] for path in CASES.glob("d_*.dxf")))
def test_every_entity_of_a_drawing_has_one_fate(name: str) -> None:
    count = 0
    for entity in readfile(CASES / f"d_{name}.dxf").modelspace():
        block = entity.block() if isinstance(entity, Insert) else None
        count += 1 if block is None else len(list(block))
    assert len(case(name).ledger.of(*FATES)) == count


def test_a_stretched_tower_keeps_its_height(tmp_path: Path) -> None:
    """A stretched circle or arc is an ellipse, which has no thickness."""
    drawing = Drawing()
    block = drawing.document.blocks.new("TOWER")
    place = {"layer": "0", "thickness": 12.0}
    block.add_circle((5, 5, 1), 5.0, dxfattribs=place)
    rounded = [(20, 0, 0), (30, 0, 1), (30, 10, 0), (20, 10, 0)]
    block.add_lwpolyline(rounded, format="xyb", close=True, dxfattribs=place)
    scales = {"xscale": 2.0, "yscale": 1.0, "zscale": 1.5, "layer": "BLD"}
    drawing.space.add_blockref("TOWER", (0, 0), dxfattribs=scales)
    drawing.house(100.0, 0.0, 9.0)
    oval, house, half = sorted(
        (building.outline.area, building.base_m, building.height_m)
        for building in drawing.imported(tmp_path, protect_near=(110.0, 5.0)).buildings
    )
    assert oval == pytest.approx((np.pi * 50.0, 1.5, 19.5), rel=0.01)
    assert house == (200.0, 0.0, 9.0)
    assert half == pytest.approx((200.0 + np.pi * 25.0, 0.0, 18.0), rel=0.01)
