"""Wrong arguments and options of the barrier environment are named."""

import pickle

import gymnasium as gym
import numpy as np
import pytest

from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.errors import BlastEnvError, LayoutError, UnknownNameError
from blast_env.site import ScenarioError
from tests.envs.small import ThinEngine, make, small_scenario


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"layuot": ()}, UnknownNameError, "'layuot', did you mean 'layout'"),
        ({"charge_position_m": (8.0,)}, BlastEnvError, "charge_position_m is (8.0)"),
        ({"charge_position_m": (np.nan, 1.0)}, BlastEnvError, "charge_position_m is (nan"),
        ({"charge_position_m": (15.0, 8.0)}, ScenarioError, "house"),
        ({"charge_position_m": (-1.0, 8.0)}, ScenarioError, "position_m"),
        ({"charge_height_m": "high"}, BlastEnvError, "charge_height_m is 'high'"),
        ({"layout": [(40, 0)]}, LayoutError, "(40, 0)"),
        ({"layout": [(4, 0)]}, LayoutError, "hydrant"),
        ({"blast_seed": -1}, BlastEnvError, "blast_seed is -1"),
        ({"blast_seed": 1.0}, BlastEnvError, "blast_seed is 1.0"),
    ],
)
def test_bad_options_are_named(options: dict, error: type, words: str) -> None:
    env = make()
    with pytest.raises(error) as caught:
        env.reset(seed=0, options=options)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"scenario": "cortyard"}, "did you mean 'courtyard'"),
        ({"scenario": "free_field"}, "'free_field' has no build zone"),
        ({"reward": "teminal"}, "no reward 'teminal', did you mean 'terminal'"),
        ({"observation": "feature"}, "did you mean 'features'"),
        ({"threat": "hiden"}, "no threat 'hiden', did you mean 'hidden'"),
        ({"threat": "hidden", "threats": 0}, "threats is 0, must be an integer from 1"),
        ({"realisations": 1.0}, "realisations is 1.0, must be an integer from 1"),
        ({"risk": "cvra"}, "no risk 'cvra', did you mean 'cvar'"),
        ({"risk": "cvar", "cvar_level": 1.0}, "cvar_level is 1, must be"),
        ({"invalid_action_cost": -1.0}, "invalid_action_cost is -1, must be a number from 0"),
        ({"invalid_action_limit": 0}, "invalid_action_limit is 0, must be an integer from 1"),
        ({"scenario": 3}, "scenario is 3, must be a name, a path, a Scenario"),
        ({"scenario": "kerb_sites"}, "takes one of them, as of blast_env.sites.kerb_site(seed)"),
        (
            {"reward": 3},
            "reward is 3, must be one of 'incremental', 'relative', 'terminal', or have",
        ),
        (
            {"risk": 3},
            "risk is 3, must be one of 'cvar', 'mean', 'worst', or have the method __call__",
        ),
        ({"observation": None}, "or have the method episode"),
    ],
)
def test_bad_arguments_are_named(arguments: dict, words: str) -> None:
    with pytest.raises(BlastEnvError) as caught:
        gym.make("BlastBarrier-v0", **arguments)
    assert words in str(caught.value)


@pytest.mark.parametrize("name", ["BlastBarrier-v0", "BlastSimulator-v0"])
def test_unknown_arguments_are_what_gymnasium_s_users_expect(name: str) -> None:
    """Wrappers and libraries look for Python's words in a `TypeError`; people for the name."""
    with pytest.raises(TypeError) as caught:
        gym.make(name, scenaro="courtyard")
    words = "got an unexpected keyword argument 'scenaro', did you mean 'scenario'?; known: "
    assert words in str(caught.value)
    assert isinstance(caught.value, BlastEnvError)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
    with pytest.raises(TypeError, match="unexpected keyword argument 'frameskip'; known"):
        gym.make_vec(name, num_envs=2, frameskip=4)


def test_an_unknown_render_mode_is_named() -> None:
    with pytest.raises(UnknownNameError, match="'rgb_aray', did you mean 'rgb_array'"):
        BlastBarrierEnv(render_mode="rgb_aray")


def test_a_scenario_without_calibration_is_refused_at_once() -> None:
    scenario = small_scenario().model_copy(update={"calibration": None})
    with pytest.raises(BlastEnvError, match="names no calibration"):
        make(scenario)


def test_the_engine_is_passed_on() -> None:
    with pytest.raises(BlastEnvError, match="another engine"):
        make(engine=ThinEngine(name="another engine"))  # there is no calibration for it
