from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from typer.testing import CliRunner

from blast_env.cli import app
from blast_env.layout import write_layout
from blast_env.layout.build_scene import build_site
from blast_env.plots.plan import Kinds, item_colours
from blast_env.plots.site_picture import site_picture
from blast_env.plots.site_plan import draw_outlines
from blast_env.site import Scenario, save_scenario
from tests.catalogue_sites import WALL, yard, yard_document
from tests.gas_sites import column
from tests.vehicle_sites import POSTS, gate_site, site_document

SILO = column("silo", 8.5, 2.0, 2.0)
"""Eight corners in plan; its modules are a cross of three rectangles with twelve corners."""


def test_a_polygon_has_one_outline() -> None:
    document = yard_document()
    document["structures"].append(SILO | {"height_m": 5.0})
    site = Scenario.from_document(document, "yard")
    (plan,) = site_picture(site).axes
    (silo,) = (
        each.get_path()
        for each in plan.patches
        if isinstance(each, PathPatch) and each.get_zorder() == Kinds.STRUCTURE.level
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


def test_items_differ_in_colour() -> None:
    colours = item_colours(yard().zone)
    assert len(set(colours.values())) == len(colours) == 3


def test_vehicles_show_their_reach_entry_and_stand_off() -> None:
    figure = site_picture(gate_site(), POSTS)
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
