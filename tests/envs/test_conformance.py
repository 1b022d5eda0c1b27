"""Every id and variant: checkers, specifications, vectors, copies. Warnings are errors."""

import copy
import pickle
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as check_env_for_agents

from blast_env.envs import barrier_env
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.errors import BlastEnvError
from blast_env.site import bundled_scenarios, load_scenario, save_scenario
from tests.envs.small import ThinEngine, make, play, same, small_scenario
from tests.gas_sites import hut
from tests.libraries.ids import BARRIER_IDS, IDS, arguments

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("env_id", BARRIER_IDS)
def test_both_checkers_pass_on_every_id(env_id: str) -> None:
    # Blasts on the default site of gas and on generated sites take seconds, and say nothing more.
    given = arguments(env_id)
    if env_id == "BlastBarrier-v0":
        given = {}
    elif env_id == "BlastBarrierGas-v0":
        site = {"width_m": 18.0, "height_m": 18.0, "air_height_m": 4.0}  # 36 pixels a side
        given = {"scenario": hut(site=site)}
    env = gym.make(env_id, render_mode="rgb_array", **given)
    drawn_elsewhere = env_id != "BlastBarrier-v0"  # families in test_barrier_rendering.py
    check_env(env.unwrapped, skip_render_check=drawn_elsewhere)
    check_env_for_agents(env.unwrapped, skip_render_check=drawn_elsewhere)


def test_each_bundled_site_with_a_build_zone_has_an_environment_with_its_engine() -> None:
    """Without a reset, which runs the blast of the empty site and takes seconds."""
    for name in bundled_scenarios():
        scenario = load_scenario(name)
        if scenario.build_zone is None:
            with pytest.raises(BlastEnvError, match="build zone"):
                gym.make("BlastBarrier-v0", scenario=name)
            continue
        env = gym.make("BlastBarrier-v0", scenario=name)
        assert isinstance(env.unwrapped, barrier_env.BlastBarrierEnv)
        assert env.action_space.nvec.prod() > 100  # type: ignore[attr-defined]
        expected = "gas" if scenario.height_notes else "event"
        assert env.unwrapped.task.engine.name == expected


@pytest.mark.parametrize(
    "chosen",
    [
        *({"observation": name} for name in ("image", "grid", "features", "dict")),
        {"observation": "grid", "reward": "incremental", "threat": "hidden", "threats": 2},
        {"reward": "relative", "threat": "hidden", "threats": 2},
        {"observation": "dict", "action": "dimensions"},
        {"observation": "dict", "action": "item_then_place", "invalid_action": "penalty"},
        {"observation": "dict", "action": "item_then_block"},
        {"observation": "dict", "action": "row"},
        {"observation": "dict", "action": "suggestion"},
        {"observation": "features", "action": "suggestion", "threat": "hidden", "threats": 2},
    ],
)
def test_both_checkers_pass_on_every_variant(chosen: dict[str, Any]) -> None:
    env = make(**chosen)
    check_env(env, skip_render_check=True)
    if chosen.get("observation") != "grid":  # planes of numbers that are no image, it would warn
        check_env_for_agents(env, skip_render_check=True)


# --- Specifications of environments survive JSON, and vectors can be made in every mode.


MODES = ("sync", "async")
IN_PROCESSES = ("BlastBarrierItemSites-v0", "BlastSimulator-v0")
"""Ids that `async` is tried with, beside `BlastBarrier-v0`; processes take seconds to start."""
FINISH = 40


def remade(env: gym.Env | gym.vector.VectorEnv) -> gym.Env:
    assert env.spec is not None
    return gym.make(EnvSpec.from_json(env.spec.to_json()))


@pytest.mark.parametrize("name", IDS)
def test_registered_specs_survive_json(name: str) -> None:
    env = gym.make(EnvSpec.from_json(gym.spec(name).to_json()))
    twin = gym.make(name)
    assert env.observation_space == twin.observation_space
    assert env.action_space == twin.action_space
    assert same(env.reset(seed=3), twin.reset(seed=3))
    again = remade(env)
    assert same(again.reset(seed=3), twin.reset(seed=3))
    assert again.spec == env.spec


def test_a_scenario_survives_json_with_everything_in_it() -> None:
    scenario = small_scenario(stock=3)
    env = gym.make("BlastBarrier-v0", scenario=scenario, realisations=1, threat="hidden", threats=2)
    twin = remade(env)
    assert isinstance(twin.unwrapped, BlastBarrierEnv)
    found = twin.unwrapped.task.source.representative
    assert found == scenario
    assert found.content_hash == scenario.content_hash
    assert same(play(env, 2), play(twin, 2))


def test_paths_and_layouts_survive_json(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    save_scenario(small_scenario(), path)
    wall = ((0, 0), (1, 0))
    env = gym.make("BlastSimulator-v0", scenario=path, layout=wall, engine="event")
    observations = [case.reset(seed=1) for case in (env, remade(env))]
    assert np.argwhere(observations[0][1]["layout"][0]).tolist() == [*map(list, wall)]
    assert same(*observations)


def rollout(mode: str | None, **arguments: Any) -> list[Any]:
    """Return what two environments gave in a dozen steps, over the ends of episodes."""
    defaults = {
        "scenario": small_scenario(),
        "action": "place",
        "engine": ThinEngine(),
        "realisations": 1,
    }
    vector = gym.make_vec(
        "BlastBarrier-v0", num_envs=2, vectorization_mode=mode, **{**defaults, **arguments}
    )
    steps: list[Any] = [vector.reset(seed=5)]
    actions = ((index % 5, FINISH if index % 3 == 1 else index) for index in range(12))
    steps += [vector.step(np.array(both)) for both in actions]
    vector.close()
    return steps


def test_processes_give_the_same() -> None:
    """Over the ends of episodes and the limit of their steps."""
    steps, expected = (rollout(mode, max_episode_steps=2) for mode in ("async", "sync"))
    assert sum(step[2].any() for step in expected[1:]) >= 2
    assert any(step[3].any() for step in expected[1:])
    assert same(steps, expected)


@pytest.mark.parametrize(
    ("name", "mode"),
    [(name, mode) for name in IDS for mode in MODES if mode != "async" or name in IN_PROCESSES],
)
def test_vectors_of_every_id_in_every_mode(name: str, mode: str | None) -> None:
    vector = gym.make_vec(name, num_envs=2, vectorization_mode=mode, **arguments(name))
    observation, _ = vector.reset(seed=0)
    assert observation in vector.observation_space
    vector.action_space.seed(0)
    observation, *_ = vector.step(vector.action_space.sample())
    assert observation in vector.observation_space
    vector.close()


def test_an_autoreset_mode_belongs_to_the_vector() -> None:
    few: dict[str, Any] = {"num_envs": 2, "scenario": small_scenario()}
    with pytest.raises(TypeError, match=r"give make_vec vector_kwargs=\{'autoreset_mode'"):
        gym.make_vec("BlastBarrier-v0", vectorization_mode="sync", autoreset_mode="SameStep", **few)


# --- The barrier environment in vectors, other processes, and pickles.


def test_vectors_of_environments_stack_the_information() -> None:
    envs = gym.make_vec(
        "BlastBarrier-v0",
        num_envs=2,
        vectorization_mode="sync",
        action="place",
        invalid_action="penalty",
        scenario=small_scenario(),
        engine=ThinEngine(),
    )
    _, info = envs.reset(seed=3)
    assert info["action_mask"].shape == (2, FINISH + 1)
    _, _, _, _, info = envs.step(np.array([0, 4 * 5]))
    assert info["invalid_actions"].tolist() == [0, 1]
    _, rewards, ended, _, info = envs.step(np.array([1, FINISH]))
    assert ended.tolist() == [False, True]
    assert info["reduction"][0] == 0.0
    assert info["layout"].sum(axis=(1, 2, 3)).tolist() == [2, 0]
    assert info["reward_terms"]["impulse"][1] == info["reduction"][1]
    assert sum(terms[1] for name, terms in info["reward_terms"].items() if name[0] != "_") == (
        pytest.approx(rewards[1])
    )
    envs.close()


@pytest.mark.usefixtures("drawn")
@pytest.mark.parametrize(
    ("observation", "again"),
    [("grid", lambda env: pickle.loads(pickle.dumps(env))), ("features", copy.deepcopy)],
)
def test_a_copy_in_mid_episode_goes_on_identically(again: Any, observation: str) -> None:
    env = make(reward="incremental", observation=observation, render_mode="rgb_array")
    env.reset(seed=2)
    env.step(11)
    env.render()  # so that there is something that does not pickle
    twin = again(env)
    assert same(env.render(), twin.render())
    for action in (12, 13):
        assert same(env.step(action), twin.step(action))
    assert same(env.reset(), twin.reset())
    assert same(env.step(FINISH), twin.step(FINISH))


@pytest.mark.usefixtures("drawn")
@pytest.mark.parametrize(
    "again",
    [
        lambda env: env,
        copy.deepcopy,
        lambda env: pickle.loads(pickle.dumps(env, protocol=4)),
        lambda env: pickle.loads(pickle.dumps(env, protocol=5)),  # as cloudpickle and Python 3.14
    ],
)
def test_observations_that_somebody_keeps_stay_as_they_are(again: Any) -> None:
    """The memory of those that nobody has any more is used again."""
    env = make(observation="features")
    env.reset(seed=2)
    env.step(11)
    twin = again(env)
    kept: list[Any] = []
    said: list[Any] = []
    for action in (12, 13):
        kept.append(twin.step(action)[0])
        said.append(kept[-1].copy())
    assert not same(*kept)
    assert same(kept, said)


def test_an_episode_after_a_refused_first_reset_is_like_any_other() -> None:
    """Gymnasium's checker (1.4.0) had ended every step in an error of its own."""
    chosen: dict[str, Any] = {"scenario": small_scenario(), "engine": ThinEngine()}
    env, other = (gym.make("BlastBarrier-v0", action="place", **chosen) for _ in range(2))
    with pytest.raises(BlastEnvError, match="tnt_kg"):
        env.reset(options={"tnt_kg": 0.0})
    for own in (env, other):
        own.reset(seed=2)
    assert same(env.step(11), other.step(11))
    assert same(env.step(FINISH), other.step(FINISH))
