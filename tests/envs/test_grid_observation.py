"""The planes of the observation `"grid"`, by channel."""

from typing import Any

import numpy as np
import pytest

from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.envs.observations import GridObservation
from blast_env.site import Scenario
from tests.envs import small
from tests.envs.small import restricted_scenario, small_document, small_scenario

CHANNEL = {name: index for index, name in enumerate(GridObservation.channels)}
FINISH = 40
ZONE = np.s_[14:22, 14:19]  # where the build zone lies on the site, rows and columns


def make(scenario: Scenario | None = None, **arguments: Any) -> BlastBarrierEnv:
    """Return an environment that shows planes, unless another observation is asked for."""
    return small.make(scenario, **({"observation": "grid"} | arguments))


def plane(env: Any, name: str, *, action: int | None = None, **options: Any) -> np.ndarray:
    """Return a plane after `reset`, or after an action."""
    observation, _ = env.reset(seed=1, options=options)
    if action is not None:
        observation = env.step(action)[0]
    assert observation in env.observation_space
    return observation[CHANNEL[name]]


def test_the_shape_is_channels_rows_columns_of_half_metres() -> None:
    space = make().observation_space
    assert space.shape == (9, 36, 38)
    assert space.dtype == np.float32


def test_structures_cover_their_squares_row_0_at_the_bottom() -> None:
    protected, others = plane(make(), "protected"), plane(make(), "other_structures")
    assert (protected[10:22, 28:32] == 1.0).all()  # the house, of weight 2
    assert protected[2:5, 24:27] == pytest.approx(0.5, abs=0.002)  # the store, of weight 1
    assert protected.sum() == pytest.approx(48.0 + 4.5, abs=0.05)
    assert (others[28:30, 22:26] == 1.0).all()
    assert others.sum() == 8.0


def test_a_module_stands_on_its_cell_which_is_free_no_longer() -> None:
    env = make()
    before, after = plane(env, "free"), plane(env, "free", action=5 + 3)
    expected = np.zeros((36, 38))
    expected[ZONE] = 1.0
    expected[18, 14:16] = 0.0  # the hydrant
    assert (before == expected).all()
    expected[14 + 1, 14 + 3] = 0.0
    assert (after == expected).all()
    barrier = plane(env, "barrier", action=5 + 3)
    assert np.argwhere(barrier).tolist() == [[15, 17]]
    assert barrier.max() == 1.0


def test_free_cells_are_the_action_mask() -> None:
    env = make(restricted_scenario())
    observation, info = env.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(4):
        mask = info["action_mask"][:-1]
        in_zone = observation[CHANNEL["free"]][12:26, 14:24] == 1.0
        assert (in_zone.ravel() == mask).all()
        observation, _, _, _, info = env.step(rng.choice(np.flatnonzero(mask)))


def test_stock_and_budget_are_shown_everywhere() -> None:
    env = make(restricted_scenario())
    for name, first, second in (
        ("stock_share", 1.0, 11 / 12),
        ("stock", 0.12, 0.11),
        ("budget_share", 1.0, 11.5 / 14),  # the first cell is rock, which costs 2.5
    ):
        assert plane(env, name) == pytest.approx(first, abs=0.002)
        assert plane(env, name, action=0) == pytest.approx(second, abs=0.002)
    assert (plane(make(), "budget_share", action=0) == 1.0).all()


def test_the_cost_is_relative_to_the_highest() -> None:
    cost = plane(make(restricted_scenario()), "cost")
    assert (cost[12:20, 14:19] == 1.0).all()
    assert cost[20:26, 19:24] == pytest.approx(1.0 / 2.5, abs=0.002)
    cost[12:26, 14:24] = 0.0
    assert not cost.any()


@pytest.mark.parametrize("position_m", [(3.0, 9.0), (3.25, 9.25), (2.9, 8.7)])
@pytest.mark.parametrize("tnt_kg", [20.0, 160.0])
def test_a_visible_charge_shows_its_place_and_mass(position_m: tuple, tnt_kg: float) -> None:
    charge = plane(make(), "charge", charge_position_m=position_m, tnt_kg=tnt_kg)
    assert charge.max() == pytest.approx((tnt_kg / 1000.0) ** (1 / 3), abs=0.002)
    shares = charge**2 / (charge**2).sum()
    rows, columns = np.indices(charge.shape)
    place = [((index + 0.5) * 0.5 * shares).sum() for index in (columns, rows)]
    assert place == pytest.approx(position_m, abs=0.01)
    assert (charge > 0.0).sum() <= 4


def test_heavier_charges_than_the_scale_shows_look_alike() -> None:
    assert plane(make(), "charge", tnt_kg=1000.0).max() == 1.0
    assert plane(make(), "charge", tnt_kg=3000.0).max() == 1.0


def test_a_hidden_charge_shows_all_places_where_it_may_be() -> None:
    charge = plane(make(threat="hidden", threats=2), "charge")
    on_road, at_shed = charge[12:24, 5:7], charge[31:33, 16:18]
    assert on_road.min() > 0.2  # two thirds of the charges, along 6 m
    assert at_shed == pytest.approx((20.0 / 1000.0) ** (1 / 3), abs=0.002)
    assert (on_road == on_road[:, ::-1]).all()  # the road lies between two columns
    charge[11:25, 5:7] = charge[31:33, 16:18] = 0.0
    assert not charge.any()


def test_a_hidden_observation_tells_nothing_about_the_charges_that_were_drawn() -> None:
    for observation in ("grid", "image", "features"):
        env = make(observation=observation, threat="hidden", threats=2)
        first, second = env.reset(seed=1)[0], env.reset(seed=2)[0]
        assert (first == second).all()
        ends = []
        for seed in (1, 2):
            env.reset(seed=seed)
            ends.append(env.step(FINISH)[4]["charges"])
        assert ends[0] != ends[1]


def test_what_lies_off_the_grid_is_shown_by_the_share_of_a_square() -> None:
    document = small_document(corner_m=(7.25, 7.0))
    document["structures"][0]["corner_m"] = (11.0, 14.25)
    env = make(Scenario.model_validate(document))
    others, barrier = plane(env, "other_structures"), plane(env, "barrier", action=0)
    assert others[28:31, 22] == pytest.approx([0.5, 1.0, 0.5], abs=0.003)
    assert barrier[14, 14:16] == pytest.approx([0.5, 0.5], abs=0.003)


def test_scenarios_of_one_size_share_a_space_whatever_stands_on_them() -> None:
    document = small_document(stock=7, budget=5.0)
    document["structures"] = document["structures"][1:]
    document["charge"] = document["charge"][1:]
    variant = Scenario.model_validate(document)
    assert GridObservation().space(variant) == GridObservation().space(small_scenario())


def test_an_observation_is_not_changed_afterwards() -> None:
    env = make()
    first, _ = env.reset(seed=1)
    kept = first.copy()
    env.step(3)
    assert (first == kept).all()
