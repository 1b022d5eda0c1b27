"""What is on a site: every picture and drawing shows all of it."""

import re
from collections.abc import Sequence
from itertools import combinations
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from typer.testing import CliRunner

import blast_env.plots.plan
from blast_env.app.plan import PixelView, plan_svg
from blast_env.cli import app
from blast_env.geometry import Rectangle
from blast_env.io.export import LayoutPlan, drawing, feature_collection
from blast_env.layout import LayoutState, build_site, vehicle_reach, write_layout
from blast_env.plots import (
    Feature,
    FeatureKind,
    Kinds,
    Label,
    Look,
    PlacingPainter,
    area_feature,
    draw_outlines,
    labels_of,
    outline_path,
    rectangles_of,
    settled_labels,
    site_features,
    sources_text,
    stand_off_text,
    vehicle_features,
)
from blast_env.plots.site_picture import site_picture
from blast_env.site import BuildZone, Scenario, load_scenario, save_scenario
from tests.catalogue_sites import WALL, yard, yard_document
from tests.gas_sites import column
from tests.office_park import office_park
from tests.vehicle_sites import POSTS, gate_site, site_document, vehicle_of

COLOUR = (1, 2, 250)
SOFT = FeatureKind("soft_ground", "soft ground", 1.55, Look(COLOUR, fill=COLOUR, cad_colour=4))
PLACE = Rectangle(14.0, 6.0, 16.0, 8.0)


@pytest.fixture
def _soft_ground(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the zone say one more thing, as a new condition of it would."""
    known = blast_env.plots.plan.zone_features

    def more(zone: BuildZone, *avoided_m: Sequence[Rectangle]) -> list[Feature]:
        return [*known(zone, *avoided_m), area_feature(SOFT, PLACE, "a bog")]

    monkeypatch.setattr(blast_env.plots.plan, "zone_features", more)


@pytest.mark.usefixtures("_soft_ground")
def test_a_new_condition_of_the_zone_is_in_all_pictures_and_drawings() -> None:
    site = load_scenario("courtyard")
    figure = site_picture(site)
    assert "soft ground" in [text.get_text() for text in figure.legends[0].get_texts()]
    fills = [patch.get_facecolor()[:3] for patch in figure.axes[0].patches]
    assert tuple(np.array(COLOUR) / 255.0) in fills
    frame = PlacingPainter(site, site.charge).paint(LayoutState.empty(site))
    assert (frame == COLOUR).all(axis=2).sum() > 1000
    svg = plan_svg(PixelView.of(site, 600, 400), site, (), None)
    assert 'fill="#0102fa"' in svg
    plan = LayoutPlan(site, ())
    (outline,) = drawing(plan).modelspace().query('LWPOLYLINE[layer=="SOFT_GROUND"]')
    assert outline.dxf.layer == "SOFT_GROUND"
    kinds = [feature["properties"]["kind"] for feature in feature_collection(plan)["features"]]
    assert kinds.count("soft_ground") == 1


def test_what_lies_on_top_comes_last() -> None:
    for name in ("courtyard", "hotel_forecourt"):
        levels = [feature.kind.level for feature in site_features(load_scenario(name))]
        assert levels == sorted(levels)


def test_a_building_in_parts_has_one_label_and_charges_in_one_place_share_theirs() -> None:
    texts = [label.text for label in labels_of(site_features(office_park()))]
    assert [text for text in texts if text.startswith("office")] == ["office\n13 m"]
    assert "charge 1: 100 kg\ncharge 2: 500 kg" in texts
    assert "door\ndoor_upper_floor" in texts
    same = Feature(Kinds.CHARGE, ((1.0, 2.0),), "a", label="T1")
    assert [label.text for label in labels_of([same, same])] == ["T1"]


def overlapping(boxes: Sequence[Rectangle]) -> int:
    return sum(one.overlaps(other, tolerance=0.5) for one, other in combinations(boxes, 2))


def test_charges_of_a_street_share_a_label_and_no_name_lies_on_another_building() -> None:
    """Fifteen parking places had fifteen labels; a shed was named in the yard of a block."""
    block: dict[str, Any] = {"kind": "polygon", "name": "block", "height_m": 9.0, "protected": True}
    block |= {"outline_m": [[10.0, 10.0], [40.0, 10.0], [40.0, 40.0], [10.0, 40.0]]}
    block |= {"courtyards_m": [[[15.0, 15.0], [35.0, 15.0], [35.0, 35.0], [15.0, 35.0]]]}
    shed = {"kind": "ModularObstacle", "name": "a_rather_long_name_of_a_shed", "height_m": 3.0}
    shed |= {"corner_m": [41.0, 24.0], "rows": 4, "columns": 4}
    points = [
        {"kind": "point", "position_m": [4.0 * number + 2.0, 4.0], "tnt_kg": 100.0}
        for number in range(15)
    ]
    document = office_park().model_dump(mode="json", exclude_none=True, exclude={"build_zone"})
    document |= {"structures": [block, shed], "charge": points, "gauges": []}
    document["site"] = {"width_m": 64.0, "height_m": 50.0}
    site = Scenario.from_document(document, "street")
    texts = [
        site_feature.label
        for site_feature in blast_env.plots.plan.site_features(site)
        if site_feature.label
    ]
    assert [text for text in texts if "kg" in text] == ["15 charges: 100 kg"]
    view = PixelView.of(site, 680, 560)
    svg = plan_svg(view, site, (), None)
    (x,) = re.findall(r'<text x="([\d.]+)"[^>]*>a_rather_long_name_of_a_shed<', svg)
    assert float(x) - 60.0 > view.pixel(35.0, 0.0)[0]


@pytest.mark.usefixtures("laid_out")
def test_no_label_of_a_crowded_site_lies_on_another_in_a_figure() -> None:
    figure = site_picture(office_park())
    figure.draw_without_rendering()
    for axes in figure.axes:
        texts = [text for text in axes.texts if text.get_text() and text.get_clip_on()]
        assert {"kerb", "office\n13 m"} <= {text.get_text() for text in texts}
        boxes = [Rectangle(*text.get_window_extent().extents) for text in texts]
        assert overlapping(boxes) == 0


def places_of_texts(
    owns: list[Rectangle], size: tuple[float, float], within: Rectangle, *, inside: bool
) -> list[Rectangle]:
    """Return where texts of structures stand."""
    features = [area_feature(Kinds.STRUCTURE, own, "a structure") for own in owns]
    settled = settled_labels(
        features,
        [Label(feature.name, feature) for feature in features],
        [size] * len(owns),
        lambda label: label.bounds_m,
        lambda label: label.bounds_m if inside else None,
        within,
        gap=4.0,
        far=inf,
    )
    return [thing.place for thing in settled]


@given(st.lists(st.tuples(st.integers(50, 550), st.integers(50, 350)), min_size=1, max_size=8))
def test_texts_have_places_of_their_own_wherever_their_things_are(
    places: list[tuple[int, int]],
) -> None:
    owns = [Rectangle(x, y, x, y).grown(8.0) for x, y in places]
    within = Rectangle(0.0, 0.0, 600.0, 400.0)
    boxes = places_of_texts(owns, (90.0, 15.0), within, inside=False)
    assert overlapping(boxes) == 0
    assert not any(box.overlaps(own, tolerance=0.5) for box in boxes for own in owns)
    assert all(within.contains(box) for box in boxes)


def test_a_text_stands_inside_its_own_where_there_is_room() -> None:
    house, shed = Rectangle(0.0, 0.0, 100.0, 40.0), Rectangle(200.0, 0.0, 210.0, 10.0)
    within = Rectangle(-50.0, -50.0, 400.0, 100.0)
    first, second = places_of_texts([house, shed], (60.0, 12.0), within, inside=True)
    assert house.contains(first)
    assert not shed.overlaps(second)
    assert abs(second.centre[0] - 205.0) < 40.0


@given(st.integers(1, 8), st.integers(1, 8), st.integers(0, 2**32))
def test_rectangles_cover_exactly_the_squares_that_they_should(
    rows: int, columns: int, seed: int
) -> None:
    squares = np.random.default_rng(seed).random((rows, columns)) < 0.6
    covered = np.zeros((rows, columns), dtype=int)
    for left, bottom, right, top in rectangles_of(squares, (3.0, 5.0), 1.0):
        covered[int(bottom) - 5 : int(top) - 5, int(left) - 3 : int(right) - 3] += 1
    assert (covered == squares).all()


def test_the_ground_is_where_the_vehicle_gets_to() -> None:
    site = gate_site()
    for layout in ((), POSTS):
        expected = vehicle_reach(site, vehicle_of(site), layout).ground(16, 28)
        features = vehicle_features(site, layout)
        reached = [feature.bounds_m for feature in features if feature.kind is Kinds.REACHED]
        y, x = (0.5 * (np.argwhere(expected).T + 0.5)).tolist()
        assert sum((r.right - r.left) * (r.top - r.bottom) for r in reached) == 0.25 * len(x)
        for place in zip(x, y, strict=True):
            assert any(r.left < place[0] < r.right and r.bottom < place[1] < r.top for r in reached)


def test_the_stand_off_has_its_length_to_the_nearest_wall() -> None:
    for layout, label, ends in (
        ((), "stand-off 1.0 m", ((9.0, 4.0), (10.0, 4.0))),
        (POSTS, "stand-off 7.0 m", ((3.0, 4.0), (10.0, 4.0))),
    ):
        features = vehicle_features(gate_site(), layout)
        (line,) = (feature for feature in features if feature.kind is Kinds.STAND_OFF)
        (star,) = (feature for feature in features if feature.kind is Kinds.CHARGE)
        assert (line.label, line.places_m) == (label, ends)
        assert star.places_m == ends[:1]


def test_the_words_have_both_stand_offs() -> None:
    site, courtyard = gate_site(), load_scenario("courtyard")
    assert stand_off_text(site, POSTS) == "stand-off 7.0 m, 1.0 m without the barrier"
    assert stand_off_text(site, ()) == "stand-off 1.0 m"
    assert sources_text(site.charge) == "vehicle with 5 kg TNT"
    assert vehicle_features(courtyard) == ()
    assert stand_off_text(courtyard, ()) == ""


# ---


def windings(ring: Any, x: float, y: float) -> int:
    """How often a ring runs counterclockwise round a place: its sides right of it that go up."""
    sides = zip(ring[:-1].tolist(), ring[1:].tolist(), strict=True)
    beside = [(a[1], b[1]) for a, b in sides if a[0] == b[0] > x]
    return sum(int(low < y < high) - int(high < y < low) for low, high in beside)


def test_outlines_are_round_what_is_filled_and_have_no_corner_too_many() -> None:
    """Of cells at random, with holes, islands in these, and cells that meet in a corner."""
    generator = np.random.default_rng(3)
    for share in (0.1, 0.3, 0.5, 0.7, 0.9) * 12:
        cells = generator.random((6, 7)) < share
        rings: list[Any] = outline_path(rectangles_of(cells)).to_polygons()
        found = [
            [
                abs(sum(windings(ring, 0.5 * x + 0.25, 0.5 * y + 0.25) for ring in rings))
                for x in range(7)
            ]
            for y in range(6)
        ]
        assert (np.array(found) == cells).all()
        around = np.pad(cells, 1).astype(int)
        fours = around[1:, 1:] + around[:-1, 1:] + around[1:, :-1] + around[:-1, :-1]
        crossed = (around[1:, 1:] == around[:-1, :-1]) & (fours == 2)
        corners = (fours % 2 == 1).sum() + 2 * crossed.sum()
        assert sum(len(ring) - 1 for ring in rings) == corners


SILO = column("silo", 8.5, 2.0, 2.0)
"""Eight corners in plan; its modules are a cross of three rectangles with twelve corners."""


def test_a_polygon_has_one_outline() -> None:
    document = yard_document()
    document["structures"].append(SILO | {"height_m": 5.0})
    site = Scenario.from_document(document, "yard")
    (plan,) = site_picture(site).axes
    (silo,) = (
        patch.get_path()
        for patch in plan.patches
        if isinstance(patch, PathPatch) and patch.get_zorder() == Kinds.STRUCTURE.level
    )
    ends = np.asarray(silo.vertices).round(6).tolist()
    assert len({tuple(place) for place in ends}) == 8
    assert len(draw_outlines(plan, build_site(site).structures)) == 2


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_legend_counts_what_stands_by_item() -> None:
    words = legend(site_picture(yard(), WALL))
    assert {"wall, 2 m: 2 of 3", "basket, 1.5 m: 0 of 2", "post, 1 m: 1 of 4"} <= set(words)
    assert "barrier module, 1 m: 6 of 16" in legend(site_picture(gate_site(), POSTS))


def test_conditions_of_the_zone_are_drawn() -> None:
    zone = site_document()["build_zone"] | {
        "access_way": {
            "width_m": 2.0,
            "between": "left_right",
            "gate": {"corner_m": [4.5, 3.0], "size_m": [0.5, 2.0]},
        },
        "cost_areas": [
            {"corner_m": [4.0, 0.0], "size_m": [1.0, 2.0], "reason": "duct", "module_cost": 2.0}
        ],
        "keep_outs": [{"corner_m": [5.0, 6.0], "size_m": [1.0, 1.0], "reason": "hydrant"}],
    }
    words = legend(site_picture(gate_site(build_zone=zone)))
    assert {
        "building has another cost",
        "access way that stays open",
        "gate of the access way",
        "no-build area",
    } <= set(words)


def test_an_access_way_is_drawn_beside_the_barriers_that_leave_it() -> None:
    """Modules stand across the middle of the zone, where the way would be drawn without them."""
    zone = site_document()["build_zone"] | {"access_way": {"width_m": 1.0, "between": "left_right"}}
    site = gate_site(build_zone=zone)
    rows, _ = site.zone.shape
    layout = [(row, 1) for row in range(rows // 4 - 1, rows - 2)]

    def arrow_of(layout: Sequence[tuple[int, int]]) -> tuple[tuple[float, float], ...]:
        features = site_features(site, layout)
        (way,) = (feature for feature in features if feature.kind is Kinds.ACCESS_WAY)
        return way.places_m

    pieces_m = [site.zone.element_rectangle_m(cell).grown(0.2) for cell in layout]
    assert any(piece_m.intersects_segment(*arrow_of(())) for piece_m in pieces_m)
    assert not any(piece_m.intersects_segment(*arrow_of(layout)) for piece_m in pieces_m)


def test_north_is_marked_where_it_is_known() -> None:
    place = {"kind": "map", "longitude_deg": 10.0, "latitude_deg": 50.0, "rotation_deg": 30.0}
    site = Scenario.from_document(yard_document() | {"georeference": place}, "yard")
    marks = [text.get_text() for axes in site_picture(site).axes for text in axes.texts]
    assert marks.count("N") == 1
    assert "N" not in [text.get_text() for axes in site_picture(yard()).axes for text in axes.texts]


def test_the_command_draws_a_layout_from_a_file(tmp_path: Path) -> None:
    scenario, layout, out = (tmp_path / name for name in ("yard.toml", "wall.json", "site.svg"))
    save_scenario(yard(), scenario)
    write_layout(layout, yard(), WALL)
    arguments = ["draw", str(scenario), "--layout", str(layout), "--out", str(out)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert out.read_text(encoding="utf-8").count("<svg") == 1


@pytest.mark.usefixtures("laid_out")
def test_no_name_lies_on_a_star() -> None:
    figure = site_picture("hotel_forecourt")
    (plan,) = figure.axes
    figure.draw_without_rendering()
    (name,) = (text for text in plan.texts if text.get_text() == "hotel\n9 m")
    (star,) = (line for line in plan.lines if line.get_marker() == "*")
    assert not name.get_window_extent().overlaps(star.get_window_extent())
