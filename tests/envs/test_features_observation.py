"""The vector of the observation `"features"`, value by value."""

import numpy as np
import pytest

from blast_env.envs.observations import FeaturesObservation
from blast_env.errors import BlastEnvError
from blast_env.site import Scenario
from tests.envs.small import make, restricted_scenario, small_document, small_scenario

CELLS = 40


def test_the_vector_has_room_for_structures_and_three_values_a_cell() -> None:
    assert FeaturesObservation().space(small_scenario()).shape == (59 + 3 * CELLS,)


def test_what_is_left_to_build_with() -> None:
    env = make(restricted_scenario(), observation="features")
    first, _ = env.reset(seed=1)
    assert first[:3].tolist() == pytest.approx([1.0, 0.12, 1.0])
    assert env.step(0)[0][:3].tolist() == pytest.approx([11 / 12, 0.11, 11.5 / 14])


def test_a_visible_charge_is_a_point() -> None:
    env = make(observation="features")
    options = {"charge_position_m": (3.8, 9.0), "tnt_kg": 8.0}
    values, _ = env.reset(seed=1, options=options)
    assert values[3:9].tolist() == pytest.approx([0.2, 0.5, 0.2, 0.5, 0.2, 0.2])


def test_a_hidden_charge_is_a_box_around_its_places() -> None:
    env = make(observation="features", threat="hidden", threats=2)
    values, _ = env.reset(seed=1)
    box = [3.0 / 19.0, 6.0 / 18.0, 8.5 / 19.0, 16.0 / 18.0]
    assert values[3:7].tolist() == pytest.approx(box)
    assert values[7:9].tolist() == pytest.approx([0.02 ** (1 / 3), 0.1 ** (1 / 3)])


def test_zone_and_structures_protected_ones_first() -> None:
    values, _ = make(observation="features").reset(seed=1)
    assert values[9:11].tolist() == pytest.approx([7.0 / 19.0, 7.0 / 18.0])
    house, store, shed, *rest = values[11:59].reshape(8, 6).tolist()
    assert house == pytest.approx([14 / 19, 5 / 18, 16 / 19, 11 / 18, 1.0, 1.0])
    assert store == pytest.approx([12 / 19, 1 / 18, 13.5 / 19, 2.5 / 18, 1.0, 0.5])
    assert shed == pytest.approx([11 / 19, 14 / 18, 13 / 19, 15 / 18, 1.0, 0.0])
    assert not np.any(rest)


def test_cells_row_by_row() -> None:
    env = make(observation="features")
    _, info = env.reset(seed=1)
    values, _, _, _, info = env.step(7)
    barrier, free, cost = values[59:].reshape(3, CELLS)
    assert np.flatnonzero(barrier).tolist() == [7]
    assert (free == info["action_mask"][:-1]).all()
    assert (cost == 1.0).all()


def test_costs_are_relative_to_the_highest() -> None:
    values, _ = make(restricted_scenario(), observation="features").reset(seed=1)
    cost = values[-140:].reshape(14, 10)
    assert cost[0, 0] == 1.0
    assert cost[-1, -1] == pytest.approx(1.0 / 2.5)


def test_too_many_structures_are_named() -> None:
    document = small_document()
    shed = document["structures"][0]
    more = [{**shed, "name": f"shed_{n}", "corner_m": (n + 0.0, 0.0)} for n in range(0, 12, 2)]
    document["structures"] = [*more, *document["structures"]]
    env = make(Scenario.model_validate(document), observation="features")
    with pytest.raises(BlastEnvError, match=r"has 9 structures, .* has room for 8: use 'grid'"):
        env.reset(seed=1)
