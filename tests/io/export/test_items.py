"""Layouts of pieces for other programs: names, heights and costs, read back by their readers."""

import json
import re
from pathlib import Path
from typing import Any

import pandas as pd
from ezdxf.entities.lwpolyline import LWPolyline
from ezdxf.filemanagement import readfile

from blast_env import load_scenario
from blast_env.io.export import BILL_COLUMNS, PIECE_COLUMNS, LayoutPlan, export_layout
from blast_env.layout import LayoutState, build_site
from blast_env.particles import obstacle_of
from blast_env.site import Charge, Scenario
from tests.catalogue_sites import WALL, yard

DUCT: dict[str, Any] = {
    "corner_m": (3.5, 2.5),
    "size_m": (3.0, 3.5),
    "reason": "duct",
    "cost_factor": 2.0,
}
"""Under the post and the two lower modules of the first wall."""

NAMES = ["wall_x4.250_y5.750", "wall_x4.250_y7.250", "post_x4.250_y4.750"]


def plan(scenario: Scenario | None = None) -> LayoutPlan:
    chosen = scenario or yard()
    return LayoutPlan(chosen, WALL, Charge((2.0, 6.0), 5.0), {"method": "by hand", "seed": 3})


def read(path: Path) -> pd.DataFrame:
    return pd.read_csv(path, keep_default_na=True)


def test_csv_has_every_piece_in_metres(tmp_path: Path) -> None:
    table = read(export_layout(plan(), tmp_path / "layout.csv"))
    assert list(table.columns) == [column.name for column in PIECE_COLUMNS]
    assert list(table["piece"]) == NAMES
    wall = table.iloc[0]
    assert tuple(wall[["item", "row", "column", "turned"]]) == ("wall", 5, 1, True)
    assert tuple(wall[["corner_x_m", "corner_y_m", "centre_x_m"]]) == (4.0, 5.0, 4.25)
    assert tuple(wall[["length_m", "thickness_m", "height_m", "cost"]]) == (1.5, 0.5, 2.0, 6.0)


def test_pieces_have_the_names_of_the_blast_s_tables(tmp_path: Path) -> None:
    parts = obstacle_of(build_site(yard(), WALL).structures[-1]).parts
    table = read(export_layout(plan(), tmp_path / "layout.csv"))
    assert list(table["piece"]) == list(dict.fromkeys(part.piece for part in parts))


def test_the_bill_counts_and_adds_up_at_the_places_prices(tmp_path: Path) -> None:
    dear = plan(yard(cost_areas=[DUCT], budget=30.0))
    bill = read(export_layout(dear, tmp_path / "layout.bill.csv")).set_index("item")
    assert list(bill.columns) == [column.name for column in BILL_COLUMNS[1:]]
    assert list(bill.index) == ["wall", "post", "total"]
    assert list(bill["count"]) == [2, 1, 3]
    assert list(bill["in_stock"].dropna()) == [3, 4]
    assert list(bill["cost"]) == [10.0 + 6.0, 2.0, 18.0]
    assert bill.loc["total", "cost"] == LayoutState.of(dear.scenario, WALL).cost
    assert tuple(bill.loc["wall", ["length_m", "height_m", "unit_cost"]]) == (1.5, 2.0, 6.0)
    assert bill.loc["wall", "description"] == "half of a T-wall"


def test_the_bill_of_single_modules_has_one_line(tmp_path: Path) -> None:
    courtyard = LayoutPlan(load_scenario("courtyard"), ((10, 0), (11, 0)))
    bill = read(export_layout(courtyard, tmp_path / "layout.bill.csv"))
    assert list(bill["item"]) == ["module", "total"]
    assert list(bill["cost"]) == [2.0, 2.0]


def test_geojson_has_pieces_with_item_height_and_cost(tmp_path: Path) -> None:
    content = json.loads(export_layout(plan(), tmp_path / "layout.geojson").read_text())
    of_kind: dict[str, list[dict[str, Any]]] = {}
    for feature in content["features"]:
        of_kind.setdefault(feature["properties"]["kind"], []).append(feature["properties"])
    pieces = of_kind["barrier"]
    assert [piece["name"] for piece in pieces] == NAMES
    assert [(piece["item"], piece["height_m"]) for piece in pieces] == [
        ("wall", 2.0),
        ("wall", 2.0),
        ("post", 1.0),
    ]
    assert pieces[0]["unit_cost"] == 6.0
    assert pieces[0]["stops_vehicles"] is True
    assert of_kind["protected_structure"][0]["height_m"] == 2.5
    assert of_kind["build_zone"][0]["items"] == "3 wall, 2 basket, 4 post"


def test_dxf_has_pieces_as_high_as_they_are_with_their_names(tmp_path: Path) -> None:
    document = readfile(export_layout(plan(), tmp_path / "layout.dxf"))
    assert not document.audit().has_issues
    space = document.modelspace()
    barriers = [
        entity
        for entity in space
        if isinstance(entity, LWPolyline) and entity.dxf.layer == "BARRIER"
    ]
    assert [barrier.dxf.thickness for barrier in barriers] == [2.0, 2.0, 1.0]
    said = [[tag.value for tag in barrier.get_xdata("BLAST_ENV")] for barrier in barriers]
    assert said[0] == [NAMES[0], "item=wall", "height_m=2"]
    texts = [
        (entity.dxf.text, entity.dxf.rotation) for entity in space.query('TEXT[layer=="ITEMS"]')
    ]
    assert texts == [("wall 2 m", 90.0), ("wall 2 m", 90.0), ("post 1 m", 0.0)]
    (notes,) = space.query('*[layer=="NOTES"]')
    lines = " ".join(notes.plain_text(split=True))  # type: ignore[attr-defined]
    assert "wall: 2 of a stock of 3, 1.5 m x 0.5 m, 2 m high" in lines
    assert "Budget: 20, of which the layout takes 13" in lines


def test_a_description_that_looks_like_a_formula_is_a_text_in_the_bill(tmp_path: Path) -> None:
    document = yard().model_dump(mode="json", exclude_none=True)
    for item in document["build_zone"]["items"]:
        item["description"] = "=HYPERLINK(1)"
    site = Scenario.from_document(document, "yard")
    bill = export_layout(plan(site), tmp_path / "yard.bill.csv")
    assert "'=HYPERLINK(1)" in bill.read_text()
    assert not re.search(r'(^|[,"])=', bill.read_text(), re.MULTILINE)
