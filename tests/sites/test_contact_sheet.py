"""The picture of many sites."""

import numpy as np
from matplotlib.patches import FancyArrowPatch, PathPatch

from blast_env.site import RectangleSource, Scenario, load_scenario
from studies.check_sites import contact_sheet


def test_everything_on_a_site_is_drawn_where_it_is(sites: tuple[Scenario, ...]) -> None:
    for site in sites[:8]:
        (axes,) = (axes for axes in contact_sheet([site]).axes if axes.get_visible())
        zone = site.zone
        areas = [zone, *zone.keep_outs, *zone.cost_areas, *site.structures]
        drawn = [
            {(x, y) for x, y in np.asarray(polygon).tolist()}
            for patch in axes.patches
            if isinstance(patch, PathPatch)
            for polygon in patch.get_path().to_polygons()
        ]
        for area in areas:
            left, bottom, right, top = area.rectangle_m
            assert {(left, bottom), (right, bottom), (right, top), (left, top)} in drawn
        wide = [source for source in site.charge if isinstance(source, RectangleSource)]
        assert len(drawn) == len(areas) + len(wide) + 1  # the ground
        ways = [patch for patch in axes.patches if isinstance(patch, FancyArrowPatch)]
        assert len(ways) == (zone.access_way is not None)


def test_heights_items_and_entries_of_vehicles_are_shown() -> None:
    site = load_scenario("hotel_forecourt")
    figure = contact_sheet([site])
    (axes,) = (axes for axes in figure.axes if axes.get_visible())
    assert axes.get_title() == ("hotel_forecourt: 4 items, budget 54\n100 kg TNT, clearance 0 m")
    assert {text.get_text() for text in axes.texts} >= {"9 m"}
    (legend,) = figure.legends
    assert "entry of a vehicle" in {text.get_text() for text in legend.get_texts()}


def test_the_access_way_is_drawn_where_no_structure_stands(sites: tuple[Scenario, ...]) -> None:
    with_way = [site for site in sites if site.build_zone and site.build_zone.access_way]
    assert len(with_way) > 10
    for site in with_way[:5]:
        (axes,) = (axes for axes in contact_sheet([site]).axes if axes.get_visible())
        (way,) = (patch for patch in axes.patches if isinstance(patch, FancyArrowPatch))
        ends = np.asarray(way.get_path().vertices)[[0, 2]].tolist()
        start, end = ((x, y) for x, y in ends)
        for structure in site.structures:
            assert not structure.rectangle_m.intersects_segment(start, end)
