from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from typer.testing import CliRunner

from blast_env.cli import app
from blast_env.errors import UnknownNameError
from blast_env.geometry import Rectangle
from blast_env.layout import write_layout
from blast_env.layout.build_scene import build_site
from blast_env.plots.oblique import (
    CORNERS,
    ObliqueView,
    boxes_of,
    corner_towards,
    draw_oblique,
    painted_order,
)
from blast_env.plots.plan import Kinds, item_colours
from blast_env.plots.site_picture import site_picture
from blast_env.plots.site_plan import draw_outlines
from blast_env.site import Scenario, save_scenario
from tests.catalogue_sites import WALL, yard, yard_document
from tests.gas_sites import column
from tests.vehicle_sites import POSTS, gate_site, site_document

SITE = Rectangle(0.0, 0.0, 20.0, 12.0)


@pytest.mark.parametrize("corner", CORNERS)
def test_all_three_axes_have_one_scale(corner: str) -> None:
    view = ObliqueView(SITE, corner)
    ends = view.places(np.array([(5, 5, 0), (6, 5, 0), (5, 6, 0), (5, 5, 1)], dtype=float))
    assert np.hypot(*(ends[1:] - ends[0]).T) == pytest.approx([1.0, 1.0, 1.0])
    assert ends[3, 0] == ends[0, 0]
    assert ends[3, 1] > ends[0, 1]


def test_the_corner_that_one_looks_over_is_at_the_bottom_and_the_axes_turn_to_the_left() -> None:
    corners = np.array([(0, 0, 0), (20, 0, 0), (20, 12, 0), (0, 12, 0)], dtype=float)
    for number, corner in enumerate(CORNERS):
        places = ObliqueView(SITE, corner).places(corners)
        assert places[:, 1].argmin() == number
        # From above, y is to the left of x; a mirrored picture would have it on the right.
        (ax, ay), (bx, by) = places[1] - places[0], places[3] - places[0]
        assert ax * by - ay * bx > 0.0


def covers(first: Rectangle, second: Rectangle, way: np.ndarray) -> bool:
    """Whether a line of sight meets `first` and later `second`, told from many lines."""
    shares = np.linspace(0.01, 0.99, 15)
    x = first.left + shares * (first.right - first.left)
    y = first.bottom + shares * (first.top - first.bottom)
    starts = np.array(np.meshgrid(x, y)).reshape(2, -1).T
    far = starts + 100.0 * way
    return any(
        second.meets_segment((a, b), (c, d)) for (a, b), (c, d) in zip(starts, far, strict=True)
    )


@st.composite
def apart(draw: st.DrawFn) -> list[Rectangle]:
    """Rectangles on a grid that do not overlap."""
    found: list[Rectangle] = []
    for _ in range(draw(st.integers(2, 7))):
        left, bottom = draw(st.integers(0, 8)), draw(st.integers(0, 8))
        width, height = draw(st.integers(1, 5)), draw(st.integers(1, 5))
        new = Rectangle(left, bottom, left + width, bottom + height)
        if not any(new.overlaps(other) for other in found):
            found.append(new)
    return found


@settings(max_examples=25, deadline=None)
@given(apart(), st.sampled_from(CORNERS))
def test_nothing_is_painted_over_what_stands_before_it(
    rectangles: list[Rectangle], corner: str
) -> None:
    view = ObliqueView(SITE, corner)
    order = painted_order(view, rectangles)
    assert sorted(order) == list(range(len(rectangles)))
    # Into the picture, on the ground: away from the near corner along both axes.
    sign_x, sign_y = {"southwest": (1, 1), "southeast": (-1, 1)}.get(
        corner, (-1, -1) if corner == "northeast" else (1, -1)
    )
    way = np.array([sign_x, sign_y]) / np.sqrt(2.0)
    for earlier, painted in enumerate(order):
        for later in order[earlier + 1 :]:
            # What is painted later may hide what is painted before, never the other way round.
            assert not covers(rectangles[painted], rectangles[later], way)


def faces(figure: Figure) -> Sequence[np.ndarray]:
    """Return the faces of the boxes, each with its first corner again; not their lines."""
    return [shape for shape in shapes(figure.axes[0]) if len(shape) == 5]


def shapes(axes: Axes) -> Sequence[np.ndarray]:
    found = (each for each in axes.collections if isinstance(each, PolyCollection))
    return [np.asarray(path.vertices) for each in found for path in each.get_paths()]


def test_heights_of_structures_and_pieces_are_to_scale() -> None:
    figure = Figure()
    draw_oblique(figure.subplots(), yard(), WALL)
    drawn = faces(figure)
    assert len(drawn) == 3 * 4  # hut, two walls, post
    heights = sorted(
        round(float(face[3, 1] - face[0, 1]), 6)
        for number, face in enumerate(drawn)
        if number % 3 < 2
    )
    assert heights == [1.0, 1.0, 2.0, 2.0, 2.0, 2.0, 2.5, 2.5]


SILO = column("silo", 8.5, 2.0, 2.0)
"""Eight corners in plan; its modules are a cross of three rectangles with twelve corners."""


def test_a_polygon_has_one_outline() -> None:
    document = yard_document()
    document["structures"].append(SILO | {"height_m": 5.0})
    site = Scenario.from_document(document, "yard")
    plan, oblique = site_picture(site, corner="southwest").axes
    (silo,) = (
        each.get_path()
        for each in plan.patches
        if isinstance(each, PathPatch) and each.get_zorder() == Kinds.STRUCTURE.level
    )
    ends = np.asarray(silo.vertices).round(6).tolist()
    assert len({tuple(place) for place in ends}) == 8
    assert len(draw_outlines(plan, build_site(site).structures)) == 2
    lines = [shape for shape in shapes(oblique) if len(shape) == 3]
    hut = 4 + 2 + 3  # round the roof, below the walls that are seen, and between walls
    silo_lines = 12 + 6 + 9
    assert len({tuple(each.round(6).ravel()) for each in lines}) == hut + silo_lines


def test_what_has_no_height_is_as_high_as_the_air() -> None:
    document = yard_document()
    del document["structures"][0]["height_m"]
    site = Scenario.from_document(document, "yard")
    assert boxes_of(site)[0].height_m == site.air_height_m == 5.0
    (line,) = (
        text.get_text()
        for text in site_picture(site).findobj()
        if hasattr(text, "get_text") and "as high as the air, 5 m" in text.get_text()
    )
    assert line.startswith("5 kg TNT, no barrier")


def test_one_looks_from_the_side_of_the_charge() -> None:
    assert corner_towards(yard()) == "southwest"
    document = yard_document()
    document["charge"][0]["position_m"] = [11.5, 11.5]
    assert corner_towards(Scenario.from_document(document, "yard")) == "northeast"


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_legend_counts_what_stands_by_item() -> None:
    words = legend(site_picture(yard(), WALL))
    assert {"wall, 2 m: 2 of 3", "basket, 1.5 m: 0 of 2", "post, 1 m: 1 of 4"} <= set(words)
    assert "barrier module, 1 m: 6 of 16" in legend(site_picture(gate_site(), POSTS))


def test_items_differ_in_colour_and_keep_it_in_both_views() -> None:
    colours = item_colours(yard().zone)
    assert len(set(colours.values())) == len(colours) == 3
    boxes = boxes_of(yard(), WALL)
    drawn = [tuple(round(255 * part) for part in box.colour) for box in boxes[1:]]
    assert drawn == [colours[each] for each in ("wall", "wall", "post")]


def test_vehicles_show_their_reach_entry_and_stand_off_in_the_oblique_view() -> None:
    figure = site_picture(gate_site(), POSTS, view="oblique")
    assert len(figure.axes) == 1
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert "stand-off 7.0 m" in texts
    assert {
        "ground that a vehicle reaches",
        "entry of a vehicle",
        "worst place of a vehicle",
    } <= set(legend(figure))


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


def test_north_is_marked_where_it_is_known() -> None:
    place = {"kind": "map", "longitude_deg": 10.0, "latitude_deg": 50.0, "rotation_deg": 30.0}
    site = Scenario.from_document(yard_document() | {"georeference": place}, "yard")
    marks = [text.get_text() for axes in site_picture(site).axes for text in axes.texts]
    assert marks.count("N") == 2
    assert "N" not in [text.get_text() for axes in site_picture(yard()).axes for text in axes.texts]


def test_views_and_corners_that_do_not_exist_are_named() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'oblique'"):
        site_picture(yard(), view="obliqe")
    with pytest.raises(UnknownNameError, match="did you mean 'southwest'"):
        site_picture(yard(), corner="soutwest")


def test_the_command_draws_a_layout_from_a_file(tmp_path: Path) -> None:
    scenario, layout, out = (tmp_path / name for name in ("yard.toml", "wall.json", "site.svg"))
    save_scenario(yard(), scenario)
    write_layout(layout, yard(), WALL)
    arguments = ["draw", str(scenario), "--layout", str(layout), "--out", str(out)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert out.read_text(encoding="utf-8").count("<svg") == 1
    result = CliRunner().invoke(app, [*arguments[:-1], str(tmp_path / "up.svg"), "--from", "up"])
    assert result.exit_code == 2
    assert "no corner 'up'" in result.output


@pytest.mark.usefixtures("laid_out")
def test_a_high_building_at_the_back_is_drawn_whole() -> None:
    """Its roof is the highest thing in the picture, and no name lies on a star."""
    figure = site_picture("hotel_forecourt")
    plan, oblique = figure.axes
    paths = [path for each in oblique.collections for path in each.get_paths()]
    assert max(np.asarray(path.vertices)[:, 1].max() for path in paths) < oblique.get_ylim()[1]
    figure.draw_without_rendering()
    (name,) = (text for text in plan.texts if text.get_text() == "hotel\n9 m")
    (star,) = (line for line in plan.lines if line.get_marker() == "*")
    assert not name.get_window_extent().overlaps(star.get_window_extent())
