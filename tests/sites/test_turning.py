"""A turned site is the same problem."""

import numpy as np
import pytest

from blast_env.layout import usable_cells
from blast_env.site import Scenario, bundled_scenarios, load_scenario
from blast_env.sites import Visibility, generate_site, turned
from tests.site.documents import full_document, tall_document

WITH_ZONE = ("courtyard", "perimeter_gate", "street_junction")


@pytest.mark.parametrize("name", bundled_scenarios())
def test_four_right_angles_are_none(name: str) -> None:
    scenario = load_scenario(name).model_copy(update={"georeference": None})  # which turning drops
    assert turned(scenario, 4) == scenario
    assert turned(turned(scenario, 1), 3) == scenario
    assert turned(scenario, -1) == turned(scenario, 3)


@pytest.mark.parametrize("name", WITH_ZONE)
def test_cells_turn_with_the_site(name: str) -> None:
    scenario = load_scenario(name)
    # Row 0 is the lowest one, so what NumPy calls a turn to the left is one to the right.
    for turns in range(4):
        expected = np.rot90(usable_cells(scenario), -turns)
        assert np.array_equal(usable_cells(turned(scenario, turns)), expected)


def test_the_left_becomes_the_bottom() -> None:
    courtyard = load_scenario("courtyard")
    once = turned(courtyard, 1)
    assert (once.site.width_m, once.site.height_m) == (30.0, 40.0)
    (road,) = once.charge
    assert road.kind == "segment"
    assert {road.start_m, road.end_m} == {(24.0, 5.0), (6.0, 5.0)}
    (building,) = once.structures
    assert building.rectangle_m == (10.0, 27.0, 20.0, 31.0)


def test_every_part_of_a_scenario_turns() -> None:
    scenario = Scenario.model_validate(full_document())
    once, zone = turned(scenario, 1), scenario.build_zone
    assert once.build_zone is not None
    assert zone is not None
    assert once.build_zone.access_way is not None
    assert once.build_zone.access_way.between == "bottom_top"
    for before, after in zip(
        (zone, *zone.keep_outs, *zone.cost_areas, *scenario.structures),
        (
            once.build_zone,
            *once.build_zone.keep_outs,
            *once.build_zone.cost_areas,
            *once.structures,
        ),
        strict=True,
    ):
        left, bottom, right, top = before.rectangle_m
        assert after.rectangle_m == (20.0 - top, left, 20.0 - bottom, right)
    assert turned(once, 3) == scenario


def test_faces_and_gauges_turn_and_heights_stay() -> None:
    scenario = Scenario.model_validate(tall_document())
    once = turned(scenario, 1)
    assert once.structures[0].faces == ("east", "south")  # they were south and west
    assert once.structures[0].height_m == 6.0
    assert [gauge.position_m for gauge in once.gauges] == [(10.0, 19.75, 1.5), (10.0, 20.25, 6.5)]
    assert (once.charge[0].height_m, once.zone.height_m, once.air_height_m) == (1.0, 3.0, 14.0)
    assert once.georeference is None  # what was north on the map is not any more
    assert turned(once, 3) == scenario.model_copy(update={"georeference": None})


@pytest.mark.parametrize("seed", range(3))
def test_a_layout_turned_with_its_site_cuts_as_many_lines_of_sight(seed: int) -> None:
    site = generate_site(seed)
    rows = site.build_zone.rows if site.build_zone is not None else 0
    rng = np.random.default_rng(seed)
    layout = [(int(r), int(c)) for r, c in rng.permutation(np.argwhere(usable_cells(site)))[:12]]
    turned_layout = [(column, rows - 1 - row) for row, column in layout]
    before, after = Visibility.of(site), Visibility.of(turned(site, 1))
    assert after.open_share == pytest.approx(before.open_share, abs=0.01)
    assert after.cut_share(turned_layout) == pytest.approx(before.cut_share(layout), abs=0.01)
