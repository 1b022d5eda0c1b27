"""Layouts that grow in place: at every step the legal places are those found anew."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blast_env.layout import LayoutState, worst_places
from blast_env.layout.batch import LayoutBatch, PlacementRules, Placements
from blast_env.site import Scenario, load_scenario
from tests.catalogue_sites import yard
from tests.envs.small import restricted_scenario, small_scenario
from tests.site.test_hardening import glazed_yard
from tests.vehicle_sites import gate_site

SITES = (
    *(small_scenario(), restricted_scenario(), yard(), glazed_yard()),
    *map(load_scenario, ("control_room", "government_forecourt")),
)


@pytest.mark.parametrize("scenario", SITES, ids=lambda scenario: scenario.name)
@settings(max_examples=8)
@given(seed=st.integers(0, 2**32 - 1), begun=st.integers(0, 2))
def test_a_layout_grows_as_one_placed_piece_by_piece(
    scenario: Scenario, seed: int, begun: int
) -> None:
    """With stocks, a budget, an access way, terraces and measures; the other layout stays."""
    rng, state = np.random.default_rng(seed), LayoutState.empty(scenario)
    for _ in range(begun):
        legal = np.flatnonzero(state.legal)
        state = state.place(state.catalogue.element(int(rng.choice(legal))))
    start = LayoutState.empty(scenario)
    batch = LayoutBatch(start, PlacementRules.of(start), 2)
    rules = PlacementRules.of(state)
    batch.begin([0], rules, LayoutState.empty(scenario))
    batch.begin([1], rules, state)
    for _ in range(8):
        if state.is_full:
            break
        number = int(rng.choice(np.flatnonzero(state.legal)))
        state = state.place(state.catalogue.element(number))
        batch.place([1], [number])
        found, expected = batch.placements([1]), Placements.of(state)
        assert (found.legal == state.legal).all()
        assert (found.occupancy == state.occupancy).all()
        assert (batch.table[1] == state.catalogue.table(state.layout)).all()
        assert found.layout(0) == expected.layout(0) == state.layout
        assert found.left[0, 0] == state.stock_left
        assert batch.is_full.tolist() == [False, state.is_full]
        left = np.minimum(found.left[:, 1:], found.left[:, :1])
        assert left.tolist() == [list(state.stocks_left)]
        assert found.budget_left.tolist() == expected.budget_left.tolist()
    assert (batch.state(0).legal == LayoutState.empty(scenario).legal).all()


@pytest.mark.parametrize("seed", range(3))
def test_worst_places_against_many_layouts_are_those_against_each(seed: int) -> None:
    scenario = gate_site()
    rng, start = np.random.default_rng(seed), LayoutState.empty(scenario)
    rules = PlacementRules.of(start)
    batch = LayoutBatch(start, rules, 4)
    batch.begin(range(4), rules, start)
    for index in range(4):
        for _ in range(5 * index):
            if not batch.is_full[index]:
                legal = np.flatnonzero(batch.legal[index])
                batch.place([index], [int(rng.choice(legal))])
    layouts = [batch.checked(index) for index in range(4)]
    batch.find_worst({index: (own, scenario.vehicles) for index, own in enumerate(layouts)})
    for own in layouts:
        for vehicle in scenario.vehicles:
            assert own.worst[id(vehicle)] == worst_places(scenario, vehicle, tuple(own))


def test_a_checked_layout_travels_as_a_plain_one() -> None:
    checked = LayoutState.of(small_scenario(), [(0, 0)]).checked
    travelled = pickle.loads(pickle.dumps(checked))
    assert travelled == checked
    assert type(travelled) is tuple
