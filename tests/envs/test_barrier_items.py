"""Episodes in a zone with a catalogue: actions, masks, observations and what is told."""

import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.envs.observations import FeaturesObservation, GridObservation, Observable
from blast_env.envs.strategies import check_size
from blast_env.errors import BlastEnvError
from blast_env.layout import LayoutState
from tests.catalogue_sites import ITEMS, WALL, item, yard


def yard_env(**arguments: Any) -> BlastBarrierEnv:
    return BlastBarrierEnv(scenario=yard(), engine="gas", **arguments)


def test_actions_place_pieces_and_the_charge_goes_off() -> None:
    env = yard_env()
    catalogue = yard().zone.catalogue
    assert env.action_space == gym.spaces.Discrete(4 * 14 * 6 + 1)
    env.reset(seed=0)
    rewards = []
    for piece in WALL:
        _, reward, ended, _, info = env.step(catalogue.action(piece))
        assert (ended, info["invalid_actions"]) == (False, 0)
        rewards.append(reward)
    _, reward, ended, _, info = env.step(catalogue.finish)
    assert (ended, info["layout"]) == (True, WALL)
    assert rewards[0] < 0.0 == sum(rewards[1:])  # the deposit
    assert sum(rewards) + reward == pytest.approx(-info["impulse_psi_s"], rel=1e-9)
    assert 0.1 < info["reduction"] < 1.0


def test_an_episode_can_begin_with_pieces() -> None:
    env = yard_env(render_mode="ansi")
    env.reset(seed=0, options={"layout": WALL})
    assert env.placement.layout == WALL
    text = env.render()
    assert "6 of 9 pieces left" in text
    assert "budget: 7 of 20 left" in text
    assert text.count("M") >= 7
    env.reset(seed=0)
    assert pickle.loads(pickle.dumps(env)).placement.layout == ()


# --- Observations.

CHANNELS = GridObservation().channels_of(yard())


def planes(placement: LayoutState) -> dict[str, np.ndarray]:
    """Return the planes of an observation on the cells of the build zone, from 0 to 1."""
    scenario = placement.scenario
    episode = GridObservation().episode(Observable(scenario, scenario.charge))
    observed = episode.observe(placement)
    assert GridObservation().space(scenario).contains(observed)
    # The zone begins at 3.5 m and 2.5 m.
    zone = observed[:, 5 : 5 + 14, 7 : 7 + 6]
    return dict(zip(CHANNELS, zone, strict=True))


def test_planes_of_other_zones_stay_as_they_were() -> None:
    assert CHANNELS[:9] == GridObservation.channels
    assert CHANNELS[9:] == (
        "structure_height",
        *("wall:height", "basket:height", "post:height"),
        *("wall:cost", "basket:cost", "post:cost"),
        *("barrier_height", "stops_vehicles"),
        *("wall:left", "basket:left", "post:left"),
        *("wall:legal", "wall:turned:legal", "basket:legal", "post:legal"),
    )


def test_planes_show_heights_items_and_where_they_may_go() -> None:
    placement = LayoutState.of(yard(), WALL)
    seen = planes(placement)
    taken = np.zeros((14, 6), dtype=bool)
    taken[5:11, 1] = taken[4, 1] = True
    assert np.array_equal(seen["barrier"] == 1.0, taken)
    assert np.array_equal(seen["stops_vehicles"] == 1.0, taken)
    assert seen["barrier_height"][6, 1] == pytest.approx(2.0 / 12.0, abs=0.002)
    assert seen["barrier_height"][4, 1] == pytest.approx(1.0 / 12.0, abs=0.002)
    assert seen["barrier_height"][0, 0] == 0.0
    assert seen["wall:height"] == pytest.approx(2.0 / 12.0, abs=0.002)
    assert seen["wall:cost"] == pytest.approx(6.0 / 20.0, abs=0.002)
    left = {name: seen[f"{name}:left"][0, 0] for name in ("wall", "basket", "post")}
    assert left == pytest.approx({"wall": 1 / 3, "basket": 1.0, "post": 0.75}, abs=0.002)
    shown = [seen[name] for name in CHANNELS[-4:]]
    assert np.array_equal(np.array(shown) == 1.0, placement.legal)
    assert np.array_equal(seen["free"] == 1.0, placement.free)


def test_structures_show_their_heights() -> None:
    episode = GridObservation().episode(Observable(yard(), yard().charge))
    height = episode.observe(LayoutState.empty(yard()))[CHANNELS.index("structure_height")]
    assert height[9:15, 15:21] == pytest.approx(2.5 / 12.0, abs=0.002)
    assert height.max() == height[9, 15]


def test_features_end_with_what_pieces_may_go_where() -> None:
    placement = LayoutState.of(yard(), WALL)
    episode = FeaturesObservation().episode(Observable(yard(), yard().charge))
    values, cells = episode.observe(placement), 14 * 6
    space = FeaturesObservation().space(yard())
    assert space.shape == (59 + 3 * cells + 8 + 9 + 6 * cells,)
    assert space.contains(values)
    more = values[59 + 3 * cells :]
    assert more[:2] == pytest.approx([2.5 / 12.0, 0.0])
    assert more[8:11] == pytest.approx([2.0 / 12.0, 1.5 / 12.0, 1.0 / 12.0])
    assert more[11:14] == pytest.approx([0.3, 0.15, 0.05])
    assert more[14:17] == pytest.approx([1 / 3, 1.0, 0.75])
    heights = more[17 : 17 + cells].reshape(14, 6)
    assert heights[5:11, 1] == pytest.approx(2.0 / 12.0)
    assert np.array_equal(more[17 + 2 * cells :] == 1.0, placement.legal.ravel())


def test_scenarios_of_one_source_share_items_but_not_their_costs() -> None:
    dearer = [{**each, "cost": 2.0, "height_m": 3.0} for each in ITEMS]
    check_size(yard(items=dearer), yard())
    with pytest.raises(BlastEnvError, match=r"the catalogue \(item, turned, size\) is"):
        check_size(yard(items=[*ITEMS[:2], item("stone", 1, 1, 1.0)]), yard())
