"""The plan of a site with vehicles: the ground that they reach, and the stand-off in metres."""

import numpy as np
from matplotlib.figure import Figure

from blast_env.rendering.placing import sources_text
from blast_env.rendering.vehicle_plan import draw_vehicles, stand_off_text, vehicle_legend
from blast_env.scenario import Scenario, load_scenario
from blast_env.scenario.build_scene import vehicle_reach
from tests.vehicle_sites import POSTS, gate_site, vehicle_of

SITE = gate_site()


def drawn(scenario: Scenario, layout: tuple[tuple[int, int], ...]) -> Figure:
    figure = Figure()
    axes = figure.add_subplot(xlim=(-1.0, 15.0), ylim=(-1.0, 9.0))
    draw_vehicles(axes, scenario, layout)
    return figure


def test_the_ground_is_where_the_vehicle_gets_to_and_the_view_stays() -> None:
    for layout in ((), POSTS):
        (axes,) = drawn(SITE, layout).axes
        (image,) = axes.images
        shades = np.asarray(image.get_array())
        expected = vehicle_reach(SITE, vehicle_of(SITE), layout).ground(16, 28)
        assert ((shades[..., 3] > 0.0) == expected).all()
        assert tuple(image.get_extent()) == (0.0, 14.0, 0.0, 8.0)
        assert (axes.get_xlim(), axes.get_ylim()) == ((-1.0, 15.0), (-1.0, 9.0))


def test_the_stand_off_is_drawn_with_its_length_to_the_nearest_wall() -> None:
    for layout, text, ends in (
        ((), "1.0 m", [[9.0, 4.0], [10.0, 4.0]]),
        (POSTS, "7.0 m", [[3.0, 4.0], [10.0, 4.0]]),
    ):
        (axes,) = drawn(SITE, layout).axes
        assert [each.get_text() for each in axes.texts] == [text]
        entry, stand_off = axes.lines
        assert np.asarray(entry.get_xydata()).tolist() == [[0.0, 2.0], [0.0, 6.0]]
        assert np.asarray(stand_off.get_xydata()).tolist() == ends


def test_the_words_have_both_stand_offs() -> None:
    assert stand_off_text(SITE, POSTS) == "stand-off 7.0 m, 1.0 m without the barrier"
    assert stand_off_text(SITE, ()) == "stand-off 1.0 m"
    assert sources_text(SITE.charge) == "vehicle with 5 kg TNT"


def test_a_site_without_vehicles_shows_none() -> None:
    courtyard = load_scenario("courtyard")
    (axes,) = drawn(courtyard, ()).axes
    assert not axes.images
    assert not axes.lines
    assert vehicle_legend(courtyard) == []
    assert stand_off_text(courtyard, ()) == ""
    assert len(vehicle_legend(SITE)) == 3
