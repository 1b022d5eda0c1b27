"""Environments in one batch: the same episodes as single ones, to the last bit."""

import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from blast_env.envs.vector_env import BlastBarrierVectorEnv
from blast_env.errors import BlastEnvError
from blast_env.surrogate import SurrogateEngine
from tests.envs.small import ThinEngine, legal_action, restricted_scenario, same, small_scenario
from tests.envs.test_barrier_env import CountOfModules
from tests.evaluation.engines.shade import ShadeEngine

COUNTS = ("blasts", "cache_hits", "cache_hit_rate")
"""Of all environments together in a batch, of each one otherwise."""

ENVS, STEPS = 3, 14


def uncounted(info: dict[str, Any]) -> dict[str, Any]:
    left = {key: value for key, value in info.items() if key.removeprefix("_") not in COUNTS}
    return left | {"final_info": uncounted(left["final_info"])} if "final_info" in left else left


def rollout(mode: str, how: str, name: str = "BlastBarrier-v0", **chosen: Any) -> list[Any]:
    """Return what environments gave in some steps of random actions, some of them illegal."""
    in_mode: dict[str, Any] = {"autoreset_mode": how}
    if mode == "sync":
        in_mode = {"vector_kwargs": in_mode}
    envs = gym.make_vec(name, ENVS, vectorization_mode=mode, **in_mode, **chosen)
    assert envs.metadata["autoreset_mode"] == AutoresetMode(how)
    assert (mode == "vector_entry_point") == isinstance(envs, BlastBarrierVectorEnv)
    observation, info = envs.reset(seed=5)
    steps: list[Any] = [(observation, info)]
    rng = np.random.default_rng(1)
    for _ in range(STEPS):
        space = envs.single_action_space
        actions = [
            legal_action(space, mask if rng.random() < 0.7 else np.ones_like(mask), rng)
            for mask in info["action_mask"]
        ]
        observation, reward, ended, cut, info = envs.step(np.array(actions))
        assert observation in envs.observation_space
        steps.append((observation, reward, ended, cut, uncounted(info)))
        if how == "Disabled" and (ended | cut).any():
            observation, info = envs.reset(seed=9, options={"reset_mask": ended | cut})
            steps.append((observation, info["action_mask"][ended | cut]))
            info["action_mask"][~(ended | cut)] = 1
    envs.close()
    return steps


def check_same(how: str = "NextStep", least: int = 2, **chosen: Any) -> None:
    expected = rollout("sync", how, **chosen)
    assert sum((value[2] | value[3]).sum() for value in expected if len(value) == 5) >= least
    assert same(rollout("vector_entry_point", how, **chosen), expected)


@pytest.mark.parametrize("observation", ["image", "grid", "features", "dict"])
def test_episodes_are_those_of_single_environments(observation: str) -> None:
    scenario = restricted_scenario()
    check_same(scenario=scenario, observation=observation, engine=ThinEngine(), realisations=1)


@pytest.mark.parametrize("how", [mode.value for mode in AutoresetMode])
def test_every_autoreset_mode(how: str) -> None:
    check_same(how, scenario=small_scenario(), engine=ThinEngine(), realisations=1)


def test_episodes_are_truncated_with_their_last_observation() -> None:
    chosen: dict[str, Any] = {"scenario": small_scenario(), "engine": ThinEngine()}
    check_same("SameStep", max_episode_steps=2, realisations=1, **chosen)


def test_no_limit_of_steps_is_written_as_of_single_environments() -> None:
    chosen: dict[str, Any] = {"scenario": small_scenario(), "engine": ThinEngine()}
    check_same(max_episode_steps=-1, realisations=1, **chosen)


def test_a_refused_reset_leaves_every_episode_as_it_was() -> None:
    """The charge stands clear on the first site drawn, and in a building of another one."""
    envs = BlastBarrierVectorEnv(
        6, observation="features", action="place", scenario="item_sites", engine=ShadeEngine()
    )
    _, info = envs.reset(seed=0)
    envs.step(info["action_mask"].argmax(axis=1))
    masks, finish = envs.action_masks(), np.full(6, envs.one.finish)
    twin = pickle.loads(pickle.dumps(envs))
    with pytest.raises(BlastEnvError, match="charge"):
        envs.reset(options={"charge_position_m": (18.0, 6.0)})
    assert (envs.action_masks() == masks).all()
    ends, expected = envs.step(finish), twin.step(finish)
    assert same((*ends[:4], uncounted(ends[4])), (*expected[:4], uncounted(expected[4])))


def test_a_strategy_without_batches_and_sites_of_an_episode_each() -> None:
    """Observations of one's own are stacked; every episode has a site of its own."""
    check_same(scenario="sites", observation=CountOfModules(), engine=ShadeEngine(), least=1)


@pytest.mark.parametrize(
    "chosen",
    [
        {"scenario": "control_room", "observation": "features"},
        {"scenario": "control_room", "observation": "features", "action": "place"},
        {"scenario": "control_room", "observation": "image", "action": "row"},
        {"scenario": "control_room", "observation": "dict", "action": "item_then_block"},
        {"scenario": "control_room", "observation": "dict", "action": "suggestion"},
        {"scenario": "control_room", "threat": "hidden", "threats": 4, "reward": "relative"},
        {"scenario": "control_room", "reward": "incremental", "invalid_action": "penalty"},
    ],
)
def test_predictions_in_one_pass_are_those_one_by_one(chosen: dict[str, Any]) -> None:
    check_same(engine=SurrogateEngine(), **chosen)


def test_it_takes_what_a_single_environment_takes() -> None:
    with pytest.raises(TypeError, match="scenarios"):
        BlastBarrierVectorEnv(2, scenarios="courtyard")
    with pytest.raises(BlastEnvError, match="autoreset_mode 'Next'"):
        BlastBarrierVectorEnv(2, "Next")
    with pytest.raises(BlastEnvError, match="render_mode is 'human', must be None"):
        BlastBarrierVectorEnv(2, render_mode="human")
    for wrong in (0, -2, 2.5, True):
        with pytest.raises(BlastEnvError, match=f"max_episode_steps is {str(wrong).lower()}, must"):
            BlastBarrierVectorEnv(2, max_episode_steps=wrong)  # type: ignore[arg-type]


def test_wrong_calls_are_refused_and_change_nothing() -> None:
    chosen: dict[str, Any] = {"scenario": small_scenario(), "engine": ThinEngine()}
    envs = BlastBarrierVectorEnv(2, "Disabled", action="place", **chosen)
    with pytest.raises(gym.error.ResetNeeded):
        envs.step([0, 0])
    first, _ = envs.reset(seed=1)
    for wrong, said in (([0], "shape"), ([0, 99], r"\[1\] is 99"), ([0.5, 1.0], "float")):
        with pytest.raises(gym.error.InvalidAction, match=f"{said}.*must be"):
            envs.step(np.array(wrong))
    with pytest.raises(BlastEnvError, match=r"reset_mask has shape \(1,\)"):
        envs.reset(options={"reset_mask": np.array([True])})
    with pytest.raises(BlastEnvError, match="seed has 1 values"):
        envs.reset(seed=[1])
    with pytest.raises(BlastEnvError, match=r"seed is 1\.0, must be an integer or 2 of them"):
        envs.reset(seed=1.0)  # type: ignore[arg-type]
    with pytest.raises(BlastEnvError, match="options is 3, must be a mapping"):
        envs.reset(options=3)  # type: ignore[arg-type]
    assert same(envs.reset(seed=1)[0], first)
    envs.step([40, 0])
    with pytest.raises(gym.error.ResetNeeded, match=r"\[0\]"):
        envs.step([0, 0])


def test_random_numbers_are_those_of_single_environments() -> None:
    """And `make_vec` gives them as its other modes do."""
    chosen: dict[str, Any] = {"scenario": small_scenario(), "engine": ThinEngine()}
    vectors: list[Any] = [
        gym.make_vec("BlastBarrier-v0", 3, vectorization_mode=mode, **chosen)
        for mode in ("vector_entry_point", "sync")
    ]
    for envs in vectors:
        envs.reset(seed=3)
        assert envs.np_random_seed == (3, 4, 5)
    states = [[generator.bit_generator.state for generator in envs.np_random] for envs in vectors]
    assert states[0] == states[1]
    with pytest.raises(AttributeError, match="no setter"):
        vectors[0].unwrapped.np_random = np.random.default_rng(0)
    vectors[0].reset(seed=[7, None, 9])
    assert vectors[0].np_random_seed == (7, 4, 9)
    fresh = BlastBarrierVectorEnv(2, **chosen)
    assert len(set(fresh.np_random_seed)) == 2


def test_observations_that_are_kept_do_not_change() -> None:
    envs = BlastBarrierVectorEnv(
        ENVS, scenario=small_scenario(), engine=ThinEngine(), observation="features", action="place"
    )
    observed, info = envs.reset(seed=0)
    kept, copies = [observed[1:]], [observed[1:].copy()]  # a view keeps the whole
    for _ in range(6):
        observed, *_, info = envs.step(info["action_mask"].argmax(axis=1))
        kept.append(observed)
        copies.append(observed.copy())
    assert same(kept, copies)


def test_a_refused_reset_leaves_the_seeds_of_later_episodes() -> None:
    """Else the episodes after it would be others than without it."""
    chosen: dict[str, Any] = {"scenario": small_scenario(), "engine": ThinEngine()}
    envs = BlastBarrierVectorEnv(2, **chosen)
    envs.reset(seed=1)
    states = [generator.bit_generator.state for generator in envs.np_random]
    wrong: list[tuple[Any, Any]] = [([5, -1], None), (5, {"charge_position_m": (-1.0, 0.0)})]
    for seed, options in wrong:
        with pytest.raises((BlastEnvError, gym.error.Error)):
            envs.reset(seed=seed, options=options)
        assert [generator.bit_generator.state for generator in envs.np_random] == states
        assert envs.np_random_seed == (1, 2)


def test_integers_of_numpy_are_seeds() -> None:
    chosen: dict[str, Any] = {"scenario": small_scenario(), "engine": ThinEngine()}
    envs = BlastBarrierVectorEnv(2, **chosen)
    expected, _ = envs.reset(seed=[3, 8])
    assert same(envs.reset(seed=np.array([3, 8]))[0], expected)  # type: ignore[arg-type]
    mixed: list[Any] = [np.int64(3), 8]
    assert same(envs.reset(seed=mixed)[0], expected)


def test_each_environment_has_options_of_its_own() -> None:
    chosen: dict[str, Any] = {
        "scenario": small_scenario(),
        "engine": ThinEngine(),
        "observation": "features",
    }
    options: list[dict[str, Any]] = [{"tnt_kg": 20.0}, {"layout": [(0, 0)]}, {}]
    envs, one = BlastBarrierVectorEnv(3, **chosen), gym.make("BlastBarrier-v0", **chosen)
    observed, _ = envs.reset(seed=4, options=options)
    expected = [one.reset(seed=4 + index, options=own)[0] for index, own in enumerate(options)]
    assert same([*observed], expected)
    with pytest.raises(BlastEnvError, match="options has 2 values, must have 3"):
        envs.reset(options=options[:2])
