"""Both libraries' checkers, on every id and every variant; warnings are errors."""

from typing import Any

import gymnasium as gym
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as check_env_for_agents

from blast_env.envs import barrier_env
from blast_env.errors import BlastEnvError
from blast_env.site import bundled_scenarios, load_scenario
from tests.envs.small import make
from tests.gas_sites import hut

pytestmark = pytest.mark.slow

IDS = sorted(name for name in gym.registry if name.startswith("BlastBarrier"))


@pytest.mark.parametrize("env_id", IDS)
def test_both_checkers_pass_on_every_id(env_id: str) -> None:
    # A blast of gas on the default site takes seconds, and says nothing more.
    arguments: dict[str, Any] = {}
    if env_id == "BlastBarrierGas-v0":
        site = {"width_m": 18.0, "height_m": 18.0, "air_height_m": 4.0}  # 36 pixels a side
        arguments["scenario"] = hut(site=site)
    elif env_id in ("BlastBarrierItemSites-v0", "BlastBarrierLargeSites-v0"):
        arguments = {"engine": "event", "realisations": 1}
    env = gym.make(env_id, render_mode="rgb_array", **arguments)
    check_env(env.unwrapped)
    check_env_for_agents(env.unwrapped)


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
        assert env.action_space.n > 100  # type: ignore[attr-defined]
        expected = "gas" if scenario.height_notes else "event"
        assert env.unwrapped.task.evaluators.engine.name == expected


@pytest.mark.parametrize(
    ("observation", "reward", "threat"),
    [
        *((each, "terminal", "visible") for each in ("image", "grid", "features", "dict")),
        ("grid", "incremental", "hidden"),
        ("image", "relative", "hidden"),
    ],
)
def test_both_checkers_pass_on_every_variant(observation: str, reward: str, threat: str) -> None:
    threats = None if threat == "visible" else 2
    env = make(observation=observation, reward=reward, threat=threat, threats=threats)
    check_env(env, skip_render_check=True)
    if not observation.startswith("grid"):  # planes of numbers that are no image, it would warn
        check_env_for_agents(env, skip_render_check=True)


@pytest.mark.parametrize(
    ("action", "invalid_action"),
    [
        *(("place", "nearest"), ("item_then_place", "penalty"), ("item_then_block", "nearest")),
        ("row", "nearest"),
    ],
)
def test_both_checkers_pass_on_every_action_space(action: str, invalid_action: str) -> None:
    env = make(observation="dict", action=action, invalid_action=invalid_action)
    check_env(env, skip_render_check=True)
    check_env_for_agents(env, skip_render_check=True)
