"""What a drawing says beside its lines, read back as a CAD program reads it."""

from itertools import combinations, pairwise
from math import hypot
from pathlib import Path

import numpy as np
import pytest
from ezdxf.document import Drawing
from ezdxf.entities.lwpolyline import LWPolyline
from ezdxf.entities.mtext import MText
from ezdxf.filemanagement import readfile

from blast_env import load_scenario
from blast_env.geometry import Rectangle
from blast_env.io.export import LayoutPlan, export_layout, key_of, note_lines, texts_of
from blast_env.layout import LayoutState
from blast_env.plots import Kinds
from blast_env.rules import random_layout
from blast_env.site import Charge, Scenario

GATE = load_scenario("perimeter_gate")  # a clearance and an access way
JUNCTION = load_scenario("street_junction")  # a budget
CLEARANCE_M = 1.5

PointM = tuple[float, float]


def some_cells(scenario: Scenario, count: int) -> tuple[tuple[int, int], ...]:
    placement = LayoutState.empty(scenario)
    for _ in range(count):
        row, column = np.argwhere(placement.free)[0]
        placement = placement.place((int(row), int(column)))
    return placement.cells


def drawn(plan: LayoutPlan, folder: Path) -> Drawing:
    document = readfile(export_layout(plan, folder / "layout.dxf"))
    assert not document.audit().has_issues
    return document


def notes_of(document: Drawing) -> MText:
    (notes,) = document.modelspace().query('*[layer=="NOTES"]')
    assert isinstance(notes, MText)
    return notes


def outlines_of(document: Drawing, *layers: str) -> list[LWPolyline]:
    """Return the outlines on some layers."""
    polylines = [entity for entity in document.modelspace() if isinstance(entity, LWPolyline)]
    return [polyline for polyline in polylines if polyline.dxf.layer in layers]


def points_of(outline: LWPolyline) -> list[PointM]:
    """Return points on the sides of an outline, twenty apiece."""
    corners = list(outline.get_points("xy"))
    assert outline.closed
    shares = np.linspace(0.0, 1.0, 20)
    return [
        (x0 + s * (x1 - x0), y0 + s * (y1 - y0))
        for (x0, y0), (x1, y1) in pairwise([*corners, corners[0]])
        for s in shares
    ]


def distance_m(point: PointM, rectangle: Rectangle) -> float:
    x, y = point
    gap_x = max(rectangle.left - x, 0.0, x - rectangle.right)
    gap_y = max(rectangle.bottom - y, 0.0, y - rectangle.top)
    return hypot(gap_x, gap_y)


def test_notes_say_what_has_no_place_on_the_site(tmp_path: Path) -> None:
    plan = LayoutPlan(GATE, some_cells(GATE, 3), Charge((15.0, 20.5), 500.0))
    assert notes_of(drawn(plan, tmp_path)).plain_text(split=True) == [
        "Scenario: perimeter_gate",
        "Units: metres, from the lower left corner of the site",
        "Charge: 500 kg TNT at (15.00, 20.50)",
        "module: 3 of a stock of 16, 0.5 m x 0.5 m",
        "Clearance: 1.5 m at least between modules and structures",
        "Access way: 6 m wide, from left to right of the build zone, to be kept open",
        "A: the lane through the gap, and room to wait for the check",
        "B: the lane turns off to the car park here",
        "C: build zone",
        "D: charge of 500 kg TNT may be here",
        "E: charge of 100 kg TNT may be here",
        "F: access way of 6 m from left to right",
        "G: charge of 500 kg TNT",
    ]


def test_the_budget_is_there_with_what_the_modules_take(tmp_path: Path) -> None:
    plan = LayoutPlan(JUNCTION, some_cells(JUNCTION, 4))
    cost = LayoutState.of(JUNCTION, plan.layout).cost
    lines = notes_of(drawn(plan, tmp_path)).plain_text(split=True)
    budget = lines.index(f"Budget: 16, of which the layout takes {cost:g}")
    assert lines[budget - 2 : budget] == ["Clearance: none required", "Access way: none required"]


def test_without_a_charge_the_notes_name_every_mass_that_there_may_be() -> None:
    masses = {source.tnt_kg for source in GATE.charge}
    assert masses == {100.0, 500.0}
    assert "Charge: 100 or 500 kg TNT, anywhere on the layer CHARGE_PLACE" in note_lines(
        LayoutPlan(GATE, ())
    )


def test_a_site_without_a_build_zone_has_nothing_to_say_of_modules() -> None:
    subjects = [
        line.split(":")[0] for line in note_lines(LayoutPlan(load_scenario("free_field"), ()))
    ]
    assert subjects == ["Scenario", "Units", "Charge"]


@pytest.mark.parametrize("name", ["free_field", "perimeter_gate"])
def test_notes_are_above_everything_and_in_the_first_view(name: str, tmp_path: Path) -> None:
    """Whoever opens the drawing sees the notes, and they cover nothing."""
    scenario = load_scenario(name)
    document = drawn(LayoutPlan(scenario, ()), tmp_path)
    notes = notes_of(document)
    assert notes.dxf.attachment_point == 7  # bottom left: further lines grow upwards
    left_m, bottom_m = notes.dxf.insert.x, notes.dxf.insert.y
    outlines = outlines_of(document, "SITE", "CLEARANCE")
    tops = [y for outline in outlines for _, y in points_of(outline)]
    assert bottom_m > max(tops) + notes.dxf.char_height
    assert left_m == 0.0
    assert notes.dxf.width == scenario.site.width_m
    assert notes.dxf.char_height >= 0.4  # as high as the names on the site
    lines = notes.plain_text(split=True)
    assert notes.dxf.char_height * max(map(len, lines)) <= scenario.site.width_m + 1e-6
    top_m = bottom_m + len(lines) * 5.0 / 3.0 * notes.dxf.char_height
    (view,) = document.viewports.get_config("*Active")
    assert view.dxf.center.y + view.dxf.height / 2.0 > top_m
    assert view.dxf.center.y - view.dxf.height / 2.0 < 0.0


def test_notes_on_a_narrow_site_are_readable_all_the_same(tmp_path: Path) -> None:
    """Lines are broken rather than shrunk, and the first view has room for that."""
    document = load_scenario("free_field").model_dump()
    document["site"] = {"width_m": 8.0, "height_m": 8.0}
    document["charge"] = [{"kind": "point", "position_m": (2.0, 4.0), "tnt_kg": 100.0}]
    document["structures"][0]["corner_m"] = (5.0, 3.0)
    document["structures"][0]["side_modules"] = 4
    drawing = drawn(LayoutPlan(Scenario.from_document(document, "narrow"), ()), tmp_path)
    notes = notes_of(drawing)
    assert notes.dxf.char_height == 0.4
    lines = notes.plain_text(split=True)
    assert max(map(len, lines)) * notes.dxf.char_height <= 8.0
    assert lines[1:4] == ["Units: metres, from", "the lower left", "corner of the site"]
    (view,) = drawing.viewports.get_config("*Active")
    wrapped_m = notes.dxf.insert.y + len(lines) * 5.0 / 3.0 * 0.4
    assert view.dxf.center.y + view.dxf.height / 2.0 > wrapped_m


@pytest.mark.parametrize("name", ["hotel_forecourt", "perimeter_gate", "school_and_clinic"])
def test_no_text_covers_another_or_a_module(name: str) -> None:
    scenario = load_scenario(name)
    layout = random_layout(scenario, np.random.default_rng(0)) if scenario.build_zone else ()
    plan = LayoutPlan(scenario, layout)
    labels = texts_of(plan, 0.6)
    for one, other in combinations([label.box_m for label in labels], 2):
        assert not one.overlaps(other)
    pieces = [feature for feature in plan.features if feature.kind is Kinds.BARRIER]
    for label in labels:
        if label.feature not in pieces:
            outlines = [Rectangle(*piece.places_m[0], *piece.places_m[2]) for piece in pieces]
            assert not any(label.box_m.overlaps(outline) for outline in outlines)
        elif label.text:
            outline = Rectangle(*label.feature.places_m[0], *label.feature.places_m[2])
            assert outline.contains(label.box_m)


def test_every_letter_is_explained_once() -> None:
    plan = LayoutPlan(load_scenario("control_room"), ())  # three places of one charge
    key = key_of(plan)
    letters = [label.text for label in texts_of(plan, 0.5) if len(label.text) == 1]
    assert set(letters) == set(key.values())
    assert letters.count(key["charge of 100 kg TNT may be here"]) == 3


def test_the_clearance_is_a_dashed_line_at_its_distance_from_every_structure(
    tmp_path: Path,
) -> None:
    """Every point of the line, also at corners, is at the distance."""
    document = drawn(LayoutPlan(GATE, ()), tmp_path)
    assert document.layers.get("CLEARANCE").dxf.linetype == "DASHED"
    outlines = outlines_of(document, "CLEARANCE")
    assert len(outlines) == len(GATE.structures) == 4
    for outline, structure in zip(outlines, GATE.structures, strict=True):
        points = points_of(outline)
        distances = [distance_m(point, structure.rectangle_m) for point in points]
        assert distances == pytest.approx([CLEARANCE_M] * len(points), rel=2e-3)
        x = [x for x, _ in points]
        assert (min(x), max(x)) == pytest.approx(
            structure.rectangle_m.grown(CLEARANCE_M)[0::2]
        )  # the line goes all the way round
