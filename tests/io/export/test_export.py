"""Layout files for other programs, read back by the programs' own readers."""

import json
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from ezdxf import units
from ezdxf.entities.lwpolyline import LWPolyline
from ezdxf.filemanagement import readfile
from ezdxf.layouts.layout import Modelspace

from blast_env import load_scenario
from blast_env.errors import BlastEnvError
from blast_env.io.export import PIECE_COLUMNS, SUFFIXES, LayoutPlan, export_layout, export_to
from blast_env.layout import LayoutFile, load_layout
from blast_env.particles import build_scene
from blast_env.plots import SITE_KINDS
from blast_env.site import Charge, Scenario

COURTYARD = load_scenario("courtyard")
LAYOUT = ((12, 3), (10, 0), (11, 0))  # not sorted: the order of placing is kept
CHARGE = Charge((5.0, 11.25), 100.0)
BUILDING_M = [[27.0, 10.0], [31.0, 10.0], [31.0, 20.0], [27.0, 20.0]]


def plan(
    scenario: Scenario = COURTYARD,
    layout: tuple[tuple[int, int], ...] = LAYOUT,
    charge: Charge | None = CHARGE,
) -> LayoutPlan:
    return LayoutPlan(scenario, layout, charge, {"method": "by hand"})


def squares_m(layout: tuple[tuple[int, int], ...]) -> list[tuple[float, ...]]:
    return [tuple(COURTYARD.zone.cell_rectangle_m(cell)) for cell in layout]


def outlines(space: Modelspace, layer: str) -> list[LWPolyline]:
    """Return the closed outlines of a layer."""
    found = [
        entity for entity in space if isinstance(entity, LWPolyline) and entity.dxf.layer == layer
    ]
    assert all(case.closed for case in found)
    return found


def corners_m(outline: LWPolyline) -> list[list[float]]:
    return [[x, y] for x, y in outline.vertices()]


def test_json_is_a_layout_file_with_the_charge(tmp_path: Path) -> None:
    path = export_layout(plan(), tmp_path / "layout.json")
    assert load_layout(path, COURTYARD) == LAYOUT
    assert LayoutFile.load(path).provenance == {
        "method": "by hand",
        "charge": {"position_m": [5.0, 11.25], "tnt_kg": 100.0},
    }


def test_csv_has_every_module_in_metres(tmp_path: Path) -> None:
    table = pd.read_csv(export_layout(plan(), tmp_path / "layout.csv"))
    assert list(table.columns) == [column.name for column in PIECE_COLUMNS]
    assert list(zip(table["row"], table["column"], strict=True)) == list(LAYOUT)
    barrier = build_scene(COURTYARD, LAYOUT).obstacles()[-1]
    assert list(table["piece"]) == [part.module_id for part in barrier.parts]
    for row, (left, bottom, right, top) in zip(
        table.to_dict("records"), squares_m(LAYOUT), strict=True
    ):
        assert (row["corner_x_m"], row["corner_y_m"]) == (left, bottom)
        assert row["corner_x_m"] + row["length_m"] == right
        assert (row["centre_x_m"], row["centre_y_m"]) == ((left + right) / 2, (bottom + top) / 2)


def test_geojson_has_closed_counterclockwise_polygons_in_site_metres(tmp_path: Path) -> None:
    content = json.loads(export_layout(plan(), tmp_path / "layout.geojson").read_text())
    assert content["type"] == "FeatureCollection"
    assert "not WGS 84" in content["coordinate_system"]
    by_kind: dict[str, list[dict]] = {}
    for feature in content["features"]:
        assert feature["type"] == "Feature"
        assert "not WGS 84" in feature["properties"]["coordinate_system"]
        by_kind.setdefault(feature["properties"]["kind"], []).append(feature)
        if feature["geometry"]["type"] == "Polygon":
            (ring,) = feature["geometry"]["coordinates"]
            x, y = np.array(ring).T
            assert ring[0] == ring[-1]
            assert (x[:-1] * y[1:] - x[1:] * y[:-1]).sum() > 0.0
    (building,) = by_kind["protected_structure"]
    assert building["geometry"]["coordinates"] == [[*BUILDING_M, BUILDING_M[0]]]
    (road,) = by_kind["charge_place"]
    assert road["geometry"] == {"type": "LineString", "coordinates": [[5.0, 6.0], [5.0, 24.0]]}
    (charge,) = by_kind["charge"]
    assert charge["geometry"] == {"type": "Point", "coordinates": [5.0, 11.25]}
    assert [case["properties"]["name"] for case in by_kind["keep_out"]] == [
        keep_out.reason for keep_out in COURTYARD.zone.keep_outs
    ]
    assert len(by_kind["build_zone"]) == len(by_kind["site"]) == 1
    modules = [np.array(case["geometry"]["coordinates"][0]) for case in by_kind["barrier"]]
    assert [(*ring.min(axis=0), *ring.max(axis=0)) for ring in modules] == squares_m(LAYOUT)


def test_dxf_is_in_metres_with_a_layer_a_kind(tmp_path: Path) -> None:
    document = readfile(export_layout(plan(), tmp_path / "layout.dxf"))
    assert document.units == units.M
    assert not document.audit().has_issues
    assert {kind.name.upper() for kind in SITE_KINDS} <= {
        layer.dxf.name for layer in document.layers
    }
    space = document.modelspace()
    modules = outlines(space, "BARRIER")
    corners = [np.array(corners_m(module)) for module in modules]
    assert [(*c.min(axis=0), *c.max(axis=0)) for c in corners] == squares_m(LAYOUT)
    identifiers = [module.get_xdata("BLAST_ENV")[0].value for module in modules]
    parts = build_scene(COURTYARD, LAYOUT).obstacles()[-1].parts
    assert identifiers == [part.module_id for part in parts]
    (building,) = outlines(space, "PROTECTED_STRUCTURE")
    assert corners_m(building) == BUILDING_M
    (charge,) = space.query("POINT")
    assert tuple(charge.dxf.location) == (5.0, 11.25, 0.0)
    (name,) = space.query('TEXT[layer=="PROTECTED_STRUCTURE"]')
    assert name.dxf.text == "building"


@pytest.mark.parametrize("name", ["courtyard", "perimeter_gate", "street_junction"])
def test_every_part_of_a_site_is_in_every_drawing(name: str, tmp_path: Path) -> None:
    """Nothing of a site is forgotten, with several sources, structures, costs or conditions."""
    scenario = load_scenario(name)
    zone = scenario.zone
    empty = plan(scenario, (), None)
    expected = Counter(
        {
            "site": 1,
            "build_zone": 1,
            "keep_out": len(zone.keep_outs),
            "cost_area": len(zone.cost_areas),
            "access_way": int(zone.access_way is not None),
            "protected_structure": sum(structure.protected for structure in scenario.structures),
            "structure": sum(not structure.protected for structure in scenario.structures),
            "charge_place": len(scenario.charge),
        }
    )
    content = json.loads(export_layout(empty, tmp_path / "site.geojson").read_text())
    assert Counter(feature["properties"]["kind"] for feature in content["features"]) == expected
    space = readfile(export_layout(empty, tmp_path / "site.dxf")).modelspace()
    drawn = Counter(entity.dxf.layer.lower() for entity in space if entity.dxftype() != "TEXT")
    drawn -= Counter({"notes": 1, "clearance": drawn["clearance"]})  # about the site, not on it
    assert drawn == expected
    assert pd.read_csv(export_layout(empty, tmp_path / "site.csv")).empty


def test_a_reason_with_a_line_break_leaves_the_drawing_whole(tmp_path: Path) -> None:
    document = COURTYARD.model_dump()
    document["build_zone"]["keep_outs"][0]["reason"] = "a door\nand 0\nEOF, {größer}"
    scenario = Scenario.from_document(document, "courtyard")
    drawing = readfile(export_layout(plan(scenario), tmp_path / "layout.dxf"))
    (notes,) = drawing.modelspace().query('MTEXT[layer=="NOTES"]')
    lines = notes.plain_text(split=True)  # type: ignore[attr-defined]
    assert "A: a door and 0 EOF, {größer}" in lines


def test_a_folder_gets_a_layout_in_every_form(tmp_path: Path) -> None:
    written = export_to(plan(layout=((0, 0),)), tmp_path / "a" / "b")
    asked = {suffix for suffix in SUFFIXES if suffix != ".ifc"}  # its extra is large
    assert {path.name for path in written} == {f"layout{suffix}" for suffix in asked}
    assert all(path.stat().st_size > 0 for path in written)
    assert load_layout(tmp_path / "a" / "b" / "layout.json", COURTYARD) == ((0, 0),)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("layout.geojsn", "did you mean '.geojson'"),
        (
            "layout.dwg",
            "must be .json, .csv, .bill.csv, .geojson, .dxf, .glb or .ifc, or nothing for a folder",
        ),
        ("file", "cannot be a folder"),
    ],
)
def test_a_target_of_no_use_is_refused(name: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("taken")
    with pytest.raises(BlastEnvError, match=words):
        export_to(plan(), tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_without_ezdxf_the_message_says_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The other forms need nothing but the package itself."""
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    monkeypatch.delitem(sys.modules, "blast_env.io.export.dxf", raising=False)
    with pytest.raises(BlastEnvError, match=r"'ezdxf': pip install blast-env\[export\]"):
        export_layout(plan(), tmp_path / "layout.dxf")
    for suffix in set(SUFFIXES) - {".dxf", ".ifc"}:
        assert export_layout(plan(), tmp_path / f"layout{suffix}").exists()
