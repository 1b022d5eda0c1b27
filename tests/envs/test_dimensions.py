"""Actions as vectors of variant, row and column: the same placements, masks, both batches."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from sb3_contrib import MaskablePPO

from blast_env.envs.barrier_env import BlastBarrierEnv
from tests.envs.small import batch_as_singles, make, same
from tests.evaluation.engines.shade import ShadeEngine


def both(scenario: str) -> tuple[BlastBarrierEnv, BlastBarrierEnv]:
    kinds = ("place", "dimensions")
    flat, by_parts = (
        BlastBarrierEnv(scenario, action=kind, observation="features", engine=ShadeEngine())
        for kind in kinds
    )
    return flat, by_parts


@pytest.mark.parametrize("scenario", ["courtyard", "hotel_forecourt"])
def test_the_same_placements_make_the_same_episode(scenario: str) -> None:
    flat, by_parts = both(scenario)
    catalogue, rng = flat.task.source.representative.zone.catalogue, np.random.default_rng(0)
    shape = (len(catalogue.variants), *catalogue.shape)
    assert by_parts.action_space == gym.spaces.MultiDiscrete([shape[0], shape[1] + 1, shape[2]])
    flat.reset(seed=3)
    by_parts.reset(seed=3)
    ended = False
    while not ended:
        number = int(rng.choice(np.flatnonzero(flat.action_masks())))
        parts: Any = by_parts.finish
        if number < catalogue.finish:
            parts = np.unravel_index(number, shape)
        one, reward, ended, _, _ = flat.step(number)
        other, same_reward, same_end, _, info = by_parts.step(np.array(parts))
        assert same(one, other)
        assert (reward, ended) == (same_reward, same_end)
    assert same(flat.placement.layout, by_parts.placement.layout)
    assert info["placed"] > 0


@pytest.mark.parametrize("scenario", ["courtyard", "hotel_forecourt"])
def test_the_mask_has_each_value_of_some_legal_placement(scenario: str) -> None:
    flat, by_parts = both(scenario)
    catalogue = flat.task.source.representative.zone.catalogue
    flat.reset(seed=3)
    by_parts.reset(seed=3)
    legal = flat.action_masks()[:-1].reshape(-1, *catalogue.shape)
    variants, rows, columns = (sorted({*axis}) for axis in legal.nonzero())
    count, height = len(catalogue.variants), catalogue.shape[0]
    of_variants, of_rows, of_columns = np.split(
        by_parts.action_masks(), [count, count + height + 1]
    )
    assert np.flatnonzero(of_variants).tolist() == variants
    assert np.flatnonzero(of_rows).tolist() == [*rows, height]
    assert np.flatnonzero(of_columns).tolist() == columns
    by_parts.step(by_parts.finish)
    after = by_parts.action_masks()
    assert np.flatnonzero(~after).tolist() == [*range(count, count + height)]


def test_parts_that_are_illegal_together_take_the_nearest_place() -> None:
    env = make(action="dimensions")
    env.reset(seed=1)
    hydrant = np.array([0, 4, 0])  # no module may stand on it
    env.step(hydrant)
    assert env.placement.layout in (((3, 0),), ((5, 0),), ((4, 1),), ((4, 2),))


def test_a_batch_plays_what_single_environments_play() -> None:
    batch = batch_as_singles(
        scenario="control_room",
        engine=ShadeEngine(),
        observation="features",
        action="dimensions",
    )
    with pytest.raises(gym.error.InvalidAction, match=r"must be \(3, 3\) integers"):
        batch.step(np.zeros(3, dtype=np.int64))


def test_whatever_the_variant_and_the_column_the_last_row_finishes() -> None:
    env = make(action="dimensions")
    assert env.action_space == gym.spaces.MultiDiscrete([1, 9, 5])
    for column in range(5):
        env.reset(seed=1)
        _, _, ended, _, info = env.step((0, 8, column))
        assert (ended, info["placed"], info["invalid_actions"]) == (True, 0, 0)


def test_actions_that_are_drawn_at_random_place_most_of_the_stock() -> None:
    """So that a policy which has learnt nothing yet meets whole layouts."""
    env = BlastBarrierEnv("courtyard", engine=ShadeEngine())
    env.action_space.seed(0)
    placed = []
    for seed in range(32):
        env.reset(seed=seed)
        ended = False
        while not ended:
            _, _, ended, _, info = env.step(env.action_space.sample())
        placed.append(info["placed"])
    assert np.mean(placed) > 0.5 * env.task.source.representative.zone.stock


def test_maskable_ppo_takes_the_masks() -> None:
    env = make(action="dimensions", observation="features")
    agent = MaskablePPO("MlpPolicy", env, n_steps=32, batch_size=16, n_epochs=1, seed=0)
    agent.learn(64)
    observation, _ = env.reset(seed=2)
    action, _ = agent.predict(observation, action_masks=env.action_masks())
    assert env.action_space.contains(action)
