"""The rules against vehicles: where the line of posts stands, and what the wall adds."""

from typing import Any

import pytest

from blast_env.design.bollards import line_of_posts, posts_and_wall
from blast_env.errors import BlastEnvError
from blast_env.geometry import Layout, Piece
from blast_env.layout import LayoutState
from blast_env.layout.build_scene import worst_places
from blast_env.site import Scenario, load_scenario
from tests.vehicle_sites import POSTS, gate_site, site_document, vehicle_document, vehicle_of


def stand_off_m(scenario: Scenario, layout: Layout) -> float:
    return worst_places(scenario, vehicle_of(scenario), layout).stand_off_m


def with_zone(**changes: Any) -> Scenario:
    return gate_site(build_zone=site_document()["build_zone"] | changes)


def open_site(stock: int) -> Scenario:
    """A hut in the middle of a site on which the vehicle can drive all around it."""
    hut = site_document()["structures"][0] | {"corner_m": [10.0, 9.0], "rows": 6}
    return gate_site(
        vehicle_document(
            entries=[{"start_m": [x_m, 2.0], "end_m": [x_m, 18.0]} for x_m in (0.0, 22.0)]
        ),
        site={"width_m": 22.0, "height_m": 20.0},
        build_zone={"corner_m": [3.0, 1.0], "rows": 36, "columns": 36, "stock": stock},
        structures=[hut],
    )


def test_across_a_strip_it_is_the_column_next_to_the_entry_with_gaps_that_just_hold() -> None:
    scenario = gate_site()
    posts = line_of_posts(scenario)
    # Four posts make five gaps of at most 1.5 m on 8 m; three would leave 1.6 m or more in one.
    assert posts == ((3, 0), (7, 0), (11, 0), (15, 0))
    assert stand_off_m(scenario, posts) == stand_off_m(scenario, POSTS) == pytest.approx(7.0)
    for post in posts:
        fewer = tuple(cell for cell in posts if cell != post)
        assert stand_off_m(scenario, fewer) < 7.0


def test_a_line_that_the_stock_does_not_close_is_not_begun() -> None:
    assert line_of_posts(with_zone(stock=3)) == ()
    assert len(line_of_posts(with_zone(stock=4))) == 4


def test_around_a_building_the_ring_is_as_far_out_as_the_stock_reaches() -> None:
    stand_offs_m = []
    for stock in (12, 20, 28, 36):
        scenario = open_site(stock)
        posts = line_of_posts(scenario)
        assert len(posts) <= stock
        assert LayoutState.of(scenario, posts)
        stand_offs_m.append(stand_off_m(scenario, posts))
    assert stand_offs_m == sorted(stand_offs_m)
    assert stand_offs_m[0] < stand_offs_m[-1] - 2.0


def test_an_access_way_without_a_gate_leaves_no_line_and_one_with_a_gate_does() -> None:
    way: dict[str, Any] = {"width_m": 2.0, "between": "left_right"}
    assert line_of_posts(with_zone(access_way=way)) == ()
    gate = {"corner_m": [4.0, 3.0], "size_m": [0.5, 2.0]}
    gated = with_zone(access_way=way | {"gate": gate})
    posts = line_of_posts(gated)
    assert stand_off_m(gated, posts) == pytest.approx(7.0)
    assert not any(6 <= row < 10 for row, column, *_ in posts if column == 0)


def test_with_a_catalogue_the_posts_are_the_cheapest_item_that_closes_the_line() -> None:
    hedge = {"name": "hedge", "length_modules": 4, "height_m": 2.0, "cost": 0.1, "stock": 9}
    post = {"name": "post", "length_modules": 1, "height_m": 1.0, "cost": 2.0, "stock": 4}
    zone = {"corner_m": [4.0, 0.0], "rows": 16, "columns": 4}

    def posts_of(kerb_cost: float) -> Layout:
        kerb = {"name": "kerb", "length_modules": 4, "height_m": 0.5, "stock": 9}
        items = [hedge | {"stops_vehicles": False}, kerb | {"cost": kerb_cost}, post]
        scenario = gate_site(build_zone=zone | {"items": items})
        layout = line_of_posts(scenario)
        assert stand_off_m(scenario, layout) == pytest.approx(7.0)
        return layout

    # Two kerbs of 2 m leave gaps of 1.5 m, 1.5 m and 1 m; posts leave as narrow ones between four.
    assert posts_of(3.0) == (Piece(3, 0, "kerb", True), Piece(10, 0, "kerb", True))
    assert posts_of(5.0) == tuple(Piece(row, 0, "post") for row in (3, 7, 11, 15))


def test_the_wall_is_added_to_the_posts_and_keeps_the_stand_off() -> None:
    scenario = with_zone(stock=9)
    posts, both = line_of_posts(scenario), posts_and_wall(scenario)
    assert both[: len(posts)] == posts
    assert len(both) == 9
    assert stand_off_m(scenario, both) >= stand_off_m(scenario, posts)
    assert LayoutState.of(scenario, both)


def test_without_a_vehicle_there_is_no_line_of_posts() -> None:
    with pytest.raises(BlastEnvError, match="courtyard has no vehicle"):
        line_of_posts(load_scenario("courtyard"))
