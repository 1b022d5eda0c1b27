"""The bare simulator on gas dynamics: the same rules as with particles, loads in Pa s."""

import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.utils.env_checker import check_env

import blast_env
from blast_env.envs.simulator_env import BlastSimulatorEnv
from blast_env.errors import BlastEnvError
from blast_env.site import ScenarioError
from tests.gas_sites import WALL, hut

HUT = hut()


def make(**arguments: Any) -> BlastSimulatorEnv:
    arguments = {**dict[str, Any](scenario=HUT, engine="gas", step_s=0.01), **arguments}
    env = gym.make("BlastSimulator-v0", **arguments).unwrapped
    assert isinstance(env, BlastSimulatorEnv)
    return env


def play(env: BlastSimulatorEnv, **options: object) -> tuple[list[Any], list[float], dict]:
    observation, info = env.reset(seed=3, options=options)
    observations, rewards, ended = [observation], [], False
    while not ended:
        observation, reward, ended, _, info = env.step(0)
        observations.append(observation)
        rewards.append(reward)
    return observations, rewards, info


@pytest.fixture(scope="module")
def episode() -> tuple[list[Any], list[float], dict]:
    return play(make(), layout=WALL)


def test_an_episode_adds_up_to_the_blast(episode: tuple[list[Any], list[float], dict]) -> None:
    observations, rewards, info = episode
    result = blast_env.simulate(HUT, WALL, 3, engine="gas")
    assert sum(rewards) == pytest.approx(-result.impulse("hut").pa_s)
    assert info["impulse_pa_s"] == pytest.approx(result.impulse("hut").pa_s)
    assert info["digest"] == result.digest
    assert info["end_reason"] == str(result.end_reason)
    last = observations[-1]
    assert (last["module_impulses"] == result.module_impulse_n_s).all()
    assert last["structure_impulses"] == pytest.approx([result.impulse("hut").pa_s])
    ends = [result.history(name)["overpressure_pa"].iloc[-1] for name in ("front", "behind")]
    assert last["gauges"] == pytest.approx(ends)
    assert last["time_s"] == [result.time_s]


def test_what_is_seen_spreads_from_the_charge(episode: tuple[list[Any], list[float], dict]) -> None:
    """On the site alone: 10 m x 8 m are 16 x 20 cells. The wall is in columns 8 and 9."""
    observations, rewards, _ = episode
    planes = [observation["overpressure"] for observation in observations]
    assert planes[0].shape == (16, 20)
    assert planes[0].max() > 10_000.0
    assert not planes[0][:, 12:].any()  # still air behind the wall
    assert planes[2][:, 16:].any()
    assert not planes[2][6:10, 12:16].any()  # the hut is solid
    assert max(rewards) <= 0.0
    assert (np.diff([each["time_s"][0] for each in observations]) > 0.0).all()


def test_it_repeats_exactly_and_pickles(episode: tuple[list[Any], list[float], dict]) -> None:
    copy = pickle.loads(pickle.dumps(make()))
    observations, rewards, info = play(copy, layout=WALL)
    assert (rewards, info["digest"]) == (episode[1], episode[2]["digest"])
    for one, other in zip(observations, episode[0], strict=True):
        assert all((one[name] == other[name]).all() for name in one)


def test_it_keeps_gymnasium_s_rules_and_shows_the_overpressure() -> None:
    env = make(render_mode="rgb_array", step_s=0.05)
    check_env(env, skip_render_check=True)
    env.reset(seed=0)
    first = env.render()
    env.step(0)
    second = env.render()
    assert first is not None
    assert second is not None
    assert first.dtype == np.uint8
    assert first.shape == second.shape
    assert (first != second).any()
    finer = make(cell_m=0.25).observation_space
    assert isinstance(finer, spaces.Dict)
    assert finer["overpressure"].shape == (32, 40)


def test_the_charge_can_be_placed() -> None:
    _, info = make().reset(seed=0, options={"charge_position_m": (2.5, 3.0)})
    assert info["charge_position_m"] == (2.5, 3.0)
    assert info["charge_tnt_kg"] == 5.0
    with pytest.raises(ScenarioError, match="hut"):
        make().reset(seed=0, options={"charge_position_m": (6.5, 4.0)})


def test_cells_are_for_gas_alone_and_results_for_blasts_that_have_ended() -> None:
    with pytest.raises(BlastEnvError, match="engine 'event' has no cells"):
        make(engine="event", cell_m=0.5)
    env = make()
    env.reset(seed=0)
    with pytest.raises(ValueError, match="has not ended"):
        env.result()
