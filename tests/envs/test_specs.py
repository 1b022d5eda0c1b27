"""Specifications of environments survive JSON, and vectors can be made in every mode."""

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.site import Scenario, save_scenario
from blast_env.sites import SiteSource
from tests.envs.small import ThinEngine, play, same, small_scenario
from tests.libraries.ids import IDS, arguments

MODES = ("sync", "async")
IN_PROCESSES = ("BlastBarrierItemSites-v0", "BlastSimulator-v0")
"""Ids that `async` is tried with, beside `BlastBarrier-v0`; processes take seconds to start."""
FINISH = 40


def remade(env: gym.Env | gym.vector.VectorEnv) -> gym.Env:
    assert env.spec is not None
    return gym.make(EnvSpec.from_json(env.spec.to_json()))


def test_there_are_ids() -> None:
    assert len(IDS) <= 8


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
    observations = [each.reset(seed=1) for each in (env, remade(env))]
    assert observations[0][1]["layout"] == wall
    assert same(*observations)


def test_the_spec_is_that_of_what_was_made() -> None:
    env = gym.make("BlastBarrier-v0", scenario=small_scenario())
    assert env.spec is not None
    assert Scenario.from_document(env.spec.kwargs["scenario"], "spec") == small_scenario()
    assert BlastBarrierEnv().spec is None


def test_generated_sites_have_a_name() -> None:
    env = gym.make("BlastBarrier-v0", scenario="sites").unwrapped
    assert isinstance(env, BlastBarrierEnv)
    assert env.task.source == SiteSource.training()


def rollout(mode: str | None, **arguments: Any) -> list[Any]:
    """Return what two environments gave in a dozen steps, over the ends of episodes."""
    defaults = {"scenario": small_scenario(), "engine": ThinEngine(), "realisations": 1}
    vector = gym.make_vec(
        "BlastBarrier-v0", num_envs=2, vectorization_mode=mode, **{**defaults, **arguments}
    )
    steps: list[Any] = [vector.reset(seed=5)]
    actions = ((index % 5, FINISH if index % 3 == 1 else index) for index in range(12))
    steps += [vector.step(np.array(both)) for both in actions]
    vector.close()
    return steps


@pytest.mark.slow
def test_processes_give_the_same() -> None:
    """Over the ends of episodes and the limit of their steps."""
    steps, expected = (rollout(mode, max_episode_steps=2) for mode in ("async", "sync"))
    assert sum(step[2].any() for step in expected[1:]) >= 2
    assert any(step[3].any() for step in expected[1:])
    assert same(steps, expected)


@pytest.mark.slow
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


def test_an_error_in_one_environment_leaves_the_others_usable() -> None:
    vector = gym.make_vec("BlastBarrier-v0", 3, scenario=small_scenario(), engine=ThinEngine())
    first, _ = vector.reset(seed=1)
    with pytest.raises(gym.error.InvalidAction):
        vector.step(np.array([99, 0, 1]))
    assert same(vector.reset(seed=1)[0], first)
    vector.close()
