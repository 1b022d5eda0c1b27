"""The bundled scenarios with heights and a catalogue: that they pose the problem they describe."""

import numpy as np
import pytest

from blast_env import bundled_scenarios, load_scenario
from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.gas import CHECKED_CELLS
from blast_env.geometry import Layout, Piece
from blast_env.layout import LayoutState, worst_places
from blast_env.rules import random_layout
from blast_env.site import Scenario

WITH_HEIGHTS = [name for name in bundled_scenarios() if load_scenario(name).height_notes]
WITH_VEHICLES = (
    *("car_park", "government_forecourt", "hotel_forecourt", "ministry_kerb"),
    *("shopping_street", "street_front"),
)


@pytest.mark.parametrize("name", WITH_HEIGHTS)
def test_it_has_heights_a_catalogue_and_a_budget(name: str) -> None:
    scenario = load_scenario(name)
    assert all(structure.height_m is not None for structure in scenario.structures)
    assert len(scenario.zone.items) >= 2
    assert scenario.calibration is None
    assert {item.height_m for item in scenario.zone.items} != {scenario.zone.items[0].height_m}
    everything = sum(item.cost * item.stock for item in scenario.zone.items)
    everything += sum(measure.cost for measure in scenario.zone.hardening)
    assert scenario.zone.budget is not None
    assert scenario.zone.budget < everything  # or there would be nothing to choose
    assert bool(scenario.vehicles) == (name in WITH_VEHICLES)


@pytest.mark.parametrize("name", WITH_HEIGHTS)
def test_cells_are_as_fine_as_the_charge_was_checked_with(name: str) -> None:
    """Those of 0.5 m; where the response of facades counts, those that judge it."""
    scenario = load_scenario(name)
    cell_m = 0.25 if scenario.objective.is_response else 0.5
    for source in scenario.charge:
        assert np.cbrt(source.tnt_kg) / cell_m >= CHECKED_CELLS


@pytest.mark.parametrize("name", WITH_HEIGHTS)
def test_random_layouts_spend_most_of_the_budget(name: str) -> None:
    scenario = load_scenario(name)
    rng = np.random.default_rng(0)
    placements = [LayoutState.of(scenario, random_layout(scenario, rng)) for _ in range(8)]
    assert all(placement.is_full for placement in placements)
    costs = [placement.cost for placement in placements]
    assert np.mean(costs) > 0.8 * (scenario.zone.budget or np.inf)


def stand_off_m(scenario: Scenario, layout: Layout) -> float:
    (vehicle,) = scenario.vehicles
    return worst_places(scenario, vehicle, layout).stand_off_m


def test_a_barrier_beside_the_gate_keeps_the_vehicle_from_the_hotel() -> None:
    scenario = load_scenario("hotel_forecourt")
    beside = (Piece(8, 5, "concrete_road_barrier", True),)
    LayoutState.of(scenario, beside)  # the fire brigade still gets through
    assert stand_off_m(scenario, ()) == pytest.approx(1.0)
    assert stand_off_m(scenario, beside) > 8.0
    ahead = (Piece(8, 0, "concrete_road_barrier", True),)
    assert stand_off_m(scenario, ahead) == pytest.approx(1.0)  # it drives round that one


def test_one_end_of_the_street_alone_is_closed_in_vain() -> None:
    scenario = load_scenario("shopping_street")
    left, right = Piece(2, 0, "planter_row", True), Piece(2, 36, "planter_row", True)
    LayoutState.of(scenario, (left, right))
    open_m = stand_off_m(scenario, ())
    assert stand_off_m(scenario, (left,)) == stand_off_m(scenario, (right,)) == open_m < 1.5
    assert stand_off_m(scenario, (left, right)) > 6.0


def test_a_wall_at_the_visitor_entrance_screens_the_front() -> None:
    """On the first wave alone, for the sake of time."""
    scenario = load_scenario("visitor_entrance")
    wall = tuple(Piece(row, 5, "t_wall_3_6", True) for row in (7, 14))
    engine = GasEngine(until=0.03)
    unprotected, screened = (
        GasBlast(scenario, layout, 0, engine, None).run().impulse("reception").pa_s
        for layout in ((), wall)
    )
    assert unprotected > 400.0
    assert screened < 0.9 * unprotected
