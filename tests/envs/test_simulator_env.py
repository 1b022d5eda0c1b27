"""The bare simulator as an environment, on particles and on gas dynamics."""

import pickle
from math import fsum
from typing import Any

import gymnasium as gym
import numpy as np
import pandas as pd
import pytest
from gymnasium import spaces
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as check_env_for_agents

import blast_env
from blast_env.envs.simulator_env import BlastSimulatorEnv
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import BlastResult
from blast_env.evaluation.engines.gas import GasResult
from blast_env.site import Scenario, ScenarioError
from tests.agents.training_runs import small_scenario
from tests.envs.small import watch
from tests.gas_sites import WALL, glazed_hut, hut

pytestmark = pytest.mark.slow

SPARSE = small_scenario()
LAYOUT = ((4, 0), (5, 0), (6, 0))


def make(**arguments: Any) -> BlastSimulatorEnv:
    """Return an environment on a small site in sparse air, unless other arguments are given."""
    arguments = {"scenario": SPARSE} | arguments
    env = gym.make("BlastSimulator-v0", **arguments).unwrapped
    assert isinstance(env, BlastSimulatorEnv)
    return env


def test_both_checkers_pass_without_a_warning() -> None:
    env = make(engine="event", step_s=0.05, render_mode="rgb_array")
    check_env(env)
    check_env_for_agents(env)


def test_it_is_made_for_the_courtyard_and_pymunk_unless_told_otherwise() -> None:
    env = gym.make("BlastSimulator-v0").unwrapped
    assert isinstance(env, BlastSimulatorEnv)
    assert (env.scenario, env.engine) == (blast_env.load_scenario("courtyard"), "pymunk")
    env.reset(seed=0)
    assert env.observation_space.contains(env.step(0)[0])


@pytest.mark.parametrize(
    ("scenario", "engine", "step_s"),
    [
        (SPARSE, "pymunk", 0.0017),  # shorter than most time steps
        (SPARSE, "pymunk", 10.0),
        ("courtyard", "event", 0.01),
    ],
)
def test_an_episode_adds_up_to_the_blast_exactly(
    scenario: str | Scenario, engine: str, step_s: float
) -> None:
    env = make(scenario=scenario, engine=engine, step_s=step_s)
    result = blast_env.simulate(env.scenario, LAYOUT, 5, engine)
    observation, info = env.reset(seed=5, options={"layout": LAYOUT})
    total, records, ended = 0.0, [], False
    while not ended:
        observation, reward, ended, _, info = env.step(0)
        total += reward
        records += env.get_wrapper_attr("collisions")
    assert total == -result.impulse_sim("building")
    assert info["impulse_sim"] == result.impulse_sim("building")
    assert info["digest"] == result.digest
    assert info["end_reason"] == str(result.end_reason)
    building = result.modules[result.modules.structure == "building"]
    assert (observation["module_impulses"] == building.impulse_sim).all()
    columns = [name for name in result.collisions if name != "transferred_impulse_sim"]
    pd.testing.assert_frame_equal(
        pd.DataFrame(records)[columns], result.collisions[columns], check_exact=True
    )


def test_time_passes_in_steps_of_the_given_length() -> None:
    observations, *_ = watch(make(step_s=0.01), seed=1)
    times = np.array([observation["time_s"][0] for observation in observations])
    expected = 0.01 * np.arange(len(times))
    assert ((times >= expected) | (times == times[-1])).all()
    assert (times[:-1] < expected[:-1] + 0.002).all()
    assert times[0] == 0.0
    counts = np.array([observation["particle_counts"] for observation in observations])
    assert counts[0, 0] == 720
    assert counts[0, 1] > 20
    assert (np.diff(counts, axis=0) <= 0).all()


def test_one_seed_repeats_exactly_in_two_environments_and_after_a_reset() -> None:
    one, other = make(step_s=0.02), make(step_s=0.02)
    first, second, again = watch(one, 3), watch(other, 3), watch(one, 3)
    for episode in (second, again):
        assert episode[1] == first[1]
        assert episode[2]["digest"] == first[2]["digest"]
        for a, b in zip(first[0], episode[0], strict=True):
            assert all((a[key] == b[key]).all() for key in a)
    assert watch(one, 4)[2]["digest"] != first[2]["digest"]


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"layuot": ()}, BlastEnvError, "'layuot', did you mean 'layout'"),
        ({"charge_position_m": (15.0, 7.0)}, ScenarioError, "building"),
    ],
)
def test_bad_options_are_named(options: dict, error: type, words: str) -> None:
    env = make()
    with pytest.raises(error) as caught:
        env.reset(seed=0, options=options)
    assert words in str(caught.value)


def test_bad_arguments_are_named() -> None:
    with pytest.raises(BlastEnvError, match="step_s is 0"):
        make(step_s=0)
    with pytest.raises(BlastEnvError, match="did you mean 'courtyard'"):
        make(scenario="cortyard")
    with pytest.raises(BlastEnvError, match="'layuot', did you mean 'layout'"):
        make(layuot=())
    with pytest.raises(BlastEnvError, match="render mode 'rgb'"):
        BlastSimulatorEnv(render_mode="rgb")


def test_stepping_before_reset_and_after_the_end_is_refused() -> None:
    env = make(step_s=10.0)
    with pytest.raises(gym.error.ResetNeeded):
        BlastSimulatorEnv().step(0)
    with pytest.raises(gym.error.InvalidAction, match="action is 1"):
        BlastSimulatorEnv().step(1)
    watch(env, 0)
    with pytest.raises(gym.error.ResetNeeded):
        env.step(0)


@pytest.mark.parametrize("engine", ["pymunk", "event"])
def test_it_pickles_in_the_middle_of_a_blast_that_is_drawn(engine: str) -> None:
    """A pymunk space has no form in bytes: the copy runs its blast again up to then."""
    env = make(engine=engine, step_s=0.01, render_mode="rgb_array")
    env.reset(seed=3)
    env.step(0)
    env.render()
    copy = pickle.loads(pickle.dumps(env))
    ended = False
    while not ended:
        observation, reward, ended, _, info = env.step(0)
        other = copy.step(0)
        assert observation["time_s"] == other[0]["time_s"]
        assert (observation["module_impulses"] == other[0]["module_impulses"]).all()
        assert (reward, info.get("digest")) == (other[1], other[4].get("digest"))
    assert pickle.loads(pickle.dumps(env)).result().digest == info["digest"]


def test_weights_count_in_the_reward() -> None:
    env = make(scenario="street_junction", engine="event", step_s=10.0)
    _, rewards, _ = watch(env, 2)
    result = env.result()
    assert isinstance(result, BlastResult)
    assert fsum(rewards) == -2.0 * result.impulse_sim("block_north_east")


@pytest.mark.parametrize("position_m", [(3.0, 15.0), (5.0, 15.0)])
def test_observations_are_in_bounds_for_every_charge(position_m: tuple[float, float]) -> None:
    """The number of balls of a charge and its time limit may depend on its mass."""
    document = blast_env.load_scenario("courtyard").model_dump()
    document["charge"] = [
        {"kind": "point", "position_m": (3.0, 15.0), "tnt_kg": 20.0},
        {"kind": "point", "position_m": (5.0, 15.0), "tnt_kg": 1000.0},
    ]
    document["simulation"] = {"preset": "collisional"}
    scenario = blast_env.Scenario.from_document(document, "two charges")
    env = make(scenario=scenario, step_s=0.01, engine="event")
    seeds = (s for s in range(99) if env.reset(seed=s)[1]["charge_position_m"] == position_m)
    observation, info = env.reset(seed=next(seeds))
    assert env.observation_space.contains(observation)
    balls = int(observation["particle_counts"][0])
    assert balls == {20.0: 658, 1000.0: 2424}[info["charge_tnt_kg"]]


# --- The bare simulator on gas dynamics: the same rules as with particles, loads in Pa s.


HUT = hut()


def gas(**arguments: Any) -> BlastSimulatorEnv:
    arguments = {**dict[str, Any](scenario=HUT, engine="gas", step_s=0.01), **arguments}
    env = gym.make("BlastSimulator-v0", **arguments).unwrapped
    assert isinstance(env, BlastSimulatorEnv)
    return env


@pytest.fixture(scope="module")
def gas_episode() -> tuple[list[Any], list[float], dict]:
    return watch(gas(), 3, layout=WALL)


def test_an_episode_adds_up_to_the_blast(gas_episode: tuple[list[Any], list[float], dict]) -> None:
    observations, rewards, info = gas_episode
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


def test_a_facade_has_the_time_to_respond_and_its_bays_are_recorded() -> None:
    env = gas(scenario=glazed_hut(), step_s=0.1)
    info = watch(env, 3, layout=WALL)[2]
    result = blast_env.simulate(glazed_hut(), WALL, 3, engine="gas")
    assert info["digest"] == result.digest
    watched = env.result()
    assert isinstance(watched, GasResult)
    pd.testing.assert_frame_equal(watched.bays, result.bays)


def test_what_is_seen_spreads_from_the_charge(
    gas_episode: tuple[list[Any], list[float], dict],
) -> None:
    """On the site alone: 10 m x 8 m are 16 x 20 cells. The wall is in columns 8 and 9."""
    observations, rewards, _ = gas_episode
    planes = [observation["overpressure"] for observation in observations]
    assert planes[0].shape == (16, 20)
    assert planes[0].max() > 10_000.0
    assert not planes[0][:, 12:].any()  # still air behind the wall
    assert planes[2][:, 16:].any()
    assert not planes[2][6:10, 12:16].any()  # the hut is solid
    assert max(rewards) <= 0.0
    assert (np.diff([observation["time_s"][0] for observation in observations]) > 0.0).all()


def test_gas_repeats_exactly_and_pickles(gas_episode: tuple[list[Any], list[float], dict]) -> None:
    copy = pickle.loads(pickle.dumps(gas()))
    observations, rewards, info = watch(copy, 3, layout=WALL)
    assert (rewards, info["digest"]) == (gas_episode[1], gas_episode[2]["digest"])
    for one, other in zip(observations, gas_episode[0], strict=True):
        assert all((one[name] == other[name]).all() for name in one)


@pytest.mark.usefixtures("drawn")
def test_it_keeps_gymnasium_s_rules_and_shows_the_overpressure() -> None:
    env = gas(render_mode="rgb_array", step_s=0.05)
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
    finer = gas(cell_m=0.25).observation_space
    assert isinstance(finer, spaces.Dict)
    assert finer["overpressure"].shape == (32, 40)


def test_the_charge_can_be_placed() -> None:
    _, info = gas().reset(seed=0, options={"charge_position_m": (2.5, 3.0)})
    assert info["charge_position_m"] == (2.5, 3.0)
    assert info["charge_tnt_kg"] == 5.0
    with pytest.raises(ScenarioError, match="hut"):
        gas().reset(seed=0, options={"charge_position_m": (6.5, 4.0)})


def test_cells_are_for_gas_alone_and_results_for_blasts_that_have_ended() -> None:
    with pytest.raises(BlastEnvError, match="engine 'event' has no cells"):
        gas(engine="event", cell_m=0.5)
    env = gas()
    env.reset(seed=0)
    with pytest.raises(ValueError, match="has not ended"):
        env.result()
