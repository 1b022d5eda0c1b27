"""What training changes about the environment: the reward, and which episodes there are."""

import gymnasium as gym
import joblib
import numpy as np
import pytest
from blast_agents.training import TrainingSettings, load_hyperparameters
from blast_agents.training.environments import EnvironmentMaker, ThreatPool, make_environments
from blast_agents.training.hyperparameters import SITES_SECTION
from blast_agents.training.run_folder import RunConfiguration
from stable_baselines3.common.vec_env import DummyVecEnv

import blast_env  # noqa: F401
from blast_env.envs.strategies import scenario_source
from blast_env.errors import BlastEnvError
from blast_env.evaluation import SeedRange, draw_threats
from blast_env.sites import SiteSource
from tests.agents.training_runs import small_scenario


def environment() -> gym.Env:
    return gym.make(
        "BlastBarrier-v0",
        scenario=small_scenario(),
        action="place",
        engine="event",
        realisations=1,
        disable_env_checker=True,
    )


def test_training_pays_the_reduction() -> None:
    """The second action means the nearest legal cell, and the fourth module is the last one."""
    configuration = RunConfiguration(
        settings=TrainingSettings(algorithm="ppo", scenario="small", steps=1),
        hyperparameters=load_hyperparameters("ppo", "default", {}),
        scenario_hash="0" * 64,
    )
    env = EnvironmentMaker(configuration, scenario_source(small_scenario()), 0)()
    env.reset(seed=0)
    rewards = [env.step(np.int64(action)) for action in (3, 3, 5, 6)]
    assert [float(reward[1]) for reward in rewards] == [0.0, 0.0, 0.0, rewards[-1][4]["reduction"]]


def test_a_pool_repeats_its_threats_so_that_half_of_the_blasts_are_known() -> None:
    env = ThreatPool(environment(), size=2, seed=5)
    charges = set()
    for seed in range(8):
        env.reset(seed=seed)
        *_, info = env.step(env.action_space.n - 1)  # type: ignore[attr-defined]
        charges.add(info["charges"])
    assert len(charges) == 2
    assert info["blasts"] == 2  # nothing was built, so there is one blast a charge


def test_training_remembers_more_sites_than_an_environment_by_itself() -> None:
    """The blast without a barrier is there when a site of the pool comes again, however late."""
    hyperparameters = load_hyperparameters("maskable_ppo", SITES_SECTION)
    pool = [{"blast_agents.training.environments.ThreatPool": {"size": 6}}]
    configuration = RunConfiguration(
        settings=TrainingSettings(
            algorithm="maskable_ppo", scenario="sites", steps=1, threat="hidden", hidden_threats=1
        ),
        hyperparameters=hyperparameters.model_copy(update={"env_wrapper": pool}),
        scenario_hash="0" * 64,
    )
    env = EnvironmentMaker(configuration, SiteSource.training(), 0)()
    scenarios, blasts = set(), 0
    for seed in range(25):
        env.reset(seed=seed)
        *_, info = env.step(env.action_space.n - 1)  # type: ignore[attr-defined]
        scenarios.add(info["scenario_hash"])
        blasts = info["blasts"]
    assert len(scenarios) == blasts == 6


def test_pools_of_other_seeds_are_other_threats_and_the_same_seed_the_same() -> None:
    seeds = [ThreatPool(environment(), size=4, seed=seed).seeds for seed in (0, 1, 0)]
    assert seeds[0] == seeds[2]
    assert not set(seeds[0]) & set(seeds[1])


def test_no_episode_of_a_pool_is_a_held_out_threat() -> None:
    """A number of a pool may be that of a test: charges are drawn from another stream."""
    scenario, env = small_scenario(), ThreatPool(environment(), size=16)
    held_out = [seed for seed in env.seeds if seed in SeedRange.TEST.value]
    assert held_out
    for seed in held_out:
        env.env.reset(seed=seed)
        *_, info = env.step(env.get_wrapper_attr("finish"))
        assert info["charges"][0] != draw_threats(scenario, [seed])[0].charge
        drawn = np.ravel(info["blast_seeds"]).tolist()
        assert all(blast in SeedRange.TRAINING.value for blast in drawn)


def test_the_seed_of_a_reset_decides_the_episodes_that_follow() -> None:
    env = ThreatPool(environment(), size=16)
    drawn = []
    for _ in range(2):
        env.reset(seed=3)
        drawn.append([env.reset()[0] for _ in range(3)])
    np.testing.assert_array_equal(drawn[0], drawn[1])


def test_bounds_are_named() -> None:
    with pytest.raises(BlastEnvError, match="size is 0, must be an integer from 1"):
        ThreatPool(environment(), size=0)


def test_environments_whose_blasts_run_together_are_those_that_run_their_own() -> None:
    """Over several episodes: observations, rewards and information, to the last bit."""
    pool = [{"blast_agents.training.environments.ThreatPool": {"size": 2}}]
    hyperparameters = load_hyperparameters("maskable_ppo", "default", {"n_envs": 3})
    configuration = RunConfiguration(
        settings=TrainingSettings(algorithm="maskable_ppo", scenario="small", steps=1),
        hyperparameters=hyperparameters.model_copy(update={"env_wrapper": pool}),
        scenario_hash="0" * 64,
    )
    source = scenario_source(small_scenario())
    alone = DummyVecEnv([EnvironmentMaker(configuration, source, index) for index in range(3)])
    with joblib.parallel_config("threading", n_jobs=2):
        together = make_environments(configuration, source)
        assert not isinstance(together, DummyVecEnv)
        for env in (alone, together):
            env.seed(7)
        np.testing.assert_array_equal(alone.reset(), together.reset())
        rng, ended = np.random.default_rng(0), 0
        for _ in range(14):
            masks = together.env_method("action_masks")
            actions = np.array([rng.choice(np.flatnonzero(mask)) for mask in masks])
            actions[0] = 0  # illegal after the first step
            for one, other in zip(alone.step(actions), together.step(actions), strict=True):
                np.testing.assert_equal(_without_clock(one), _without_clock(other))
            ended += int(alone.buf_dones.sum())
    assert ended >= 6


def _without_clock(part: object) -> object:
    """Return one part of what a step gives, without the seconds and the counts of blasts."""
    if not isinstance(part, list | tuple):
        return part
    uncounted = {"episode", "blasts", "cache_hits", "cache_hit_rate"}
    return [{key: info[key] for key in info.keys() - uncounted} for info in part]
