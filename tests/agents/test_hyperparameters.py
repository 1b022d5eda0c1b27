"""The YAML files fit the scenarios and RL Zoo, and a wrong value is refused with its bound."""

import inspect
import sys
from importlib import import_module
from pathlib import Path
from typing import Any, get_args

import gymnasium as gym
import pytest
import yaml
from blast_agents.training import PolicyAgent, load_archive
from blast_agents.training.hyperparameters import (
    ALGORITHMS,
    Hyperparameters,
    WrapperName,
    hyperparameter_file,
    hyperparameter_keys,
    load_hyperparameters,
    parse_options,
    schedule,
)
from blast_agents.training.run_folder import environment_id
from sb3_contrib import MaskablePPO
from stable_baselines3 import PPO

from blast_env import load_scenario
from blast_env.envs.strategies import scenario_source
from blast_env.errors import BlastEnvError

SCENARIOS = ("sites", "courtyard")
MODELS = {"ppo": PPO, "maskable_ppo": MaskablePPO}
OF_RL_ZOO = {"n_timesteps", "n_envs", "env_wrapper", "normalize"}
"""Keys that RL Zoo takes out before it hands the others to the algorithm."""


ELSEWHERE = """
from blast_agents.policies.spatial import SpatialPolicy

class Schedule:
    def __call__(self, progress_remaining):
        return 3e-3 * progress_remaining

class Policy(SpatialPolicy):
    pass
"""
"""A package that is installed where an archive is written, and missing where it is read."""


def sections(algorithm: str) -> dict[str, dict]:
    content: dict[str, dict] = yaml.safe_load(hyperparameter_file(algorithm).read_text())
    return content


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_every_scenario_has_a_section_for_its_zone(algorithm: str, scenario: str) -> None:
    """RL Zoo cannot fill in rows and columns, so the file must have the right ones."""
    section = sections(algorithm)[environment_id(scenario)]
    zone = scenario_source(scenario).representative.zone
    arguments = section["policy_kwargs"]
    assert (arguments["rows"], arguments["columns"]) == (zone.rows, zone.columns)
    load_hyperparameters(algorithm, environment_id(scenario))


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_rl_zoo_can_use_every_section(algorithm: str) -> None:
    """Its keys go to the algorithm as they are; policy and wrappers are imported by name."""
    accepted = set(inspect.signature(MODELS[algorithm]).parameters)
    for env_id, section in sections(algorithm).items():
        assert env_id in gym.registry
        assert set(section) - OF_RL_ZOO <= accepted
        for name in (section["policy"], *get_args(WrapperName)):
            module, _, attribute = name.rpartition(".")
            assert hasattr(import_module(module), attribute)


def archived(archive: Path, monkeypatch: pytest.MonkeyPatch, policy: str) -> PPO:
    """Write an untrained model as RL Zoo does, whose schedules are objects of its own classes."""
    (archive.parent / "elsewhere.py").write_text(ELSEWHERE)
    environment = gym.make("BlastBarrier-v0", observation="grid", action="place")
    with monkeypatch.context() as installed:
        installed.syspath_prepend(archive.parent)
        module, _, attribute = policy.rpartition(".")
        schedule_there = import_module("elsewhere").Schedule()
        model = PPO(
            getattr(import_module(module), attribute),
            environment,
            learning_rate=schedule_there,
            clip_range=schedule_there,
            clip_range_vf=schedule_there,
            policy_kwargs=sections("ppo")["BlastBarrier-v0"]["policy_kwargs"],
            n_steps=16,
            batch_size=16,
            device="cpu",
        )
        model.save(archive)
    environment.close()
    del sys.modules["elsewhere"]
    return model


def test_an_archive_of_rl_zoo_is_read_where_rl_zoo_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    archive = tmp_path / "model.zip"
    model = archived(archive, monkeypatch, sections("ppo")["BlastBarrier-v0"]["policy"])
    with pytest.raises(ModuleNotFoundError, match="elsewhere"):
        PPO.load(archive)  # so the archive does need what is missing
    scenario = load_scenario("courtyard")
    agent = load_archive(archive, "ppo", scenario, trust_archive=True)
    layout = agent.propose(scenario)
    assert layout
    assert layout == PolicyAgent(model.policy, scenario).propose(scenario)


def test_options_are_read_as_json_or_text_and_reach_the_policy() -> None:
    options = ["ent_coef=0.02", "learning_rate=lin_3e-4", "policy_kwargs.width=16", "gamma=9e-1"]
    changes = parse_options(options, hyperparameter_keys())
    chosen = load_hyperparameters("maskable_ppo", "BlastBarrier-v0", changes)
    assert isinstance(chosen, Hyperparameters)
    assert (chosen.ent_coef, chosen.gamma, chosen.policy_kwargs.width) == (0.02, 0.9, 16)
    rate = schedule(chosen.learning_rate)
    assert callable(rate)
    assert rate(0.5) == pytest.approx(1.5e-4)


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ("ent_coeff=0.1", "did you mean 'ent_coef'"),
        ("policy_kwargs.widht=3", "did you mean 'policy_kwargs.width'"),
        ("ent_coef", "must be key=value"),
        ("ent_coef=[", "valid number"),
        ("ent_coef=-1", "ent_coef is -1: Input should be greater than or equal to 0"),
        ("gamma=1.5", "less than or equal to 1"),
        ("learning_rate=lin_fast", "'lin_' and a number"),
        ("learning_rate=0", "above 0"),
        ("batch_size=100", "must divide n_steps * n_envs = 512"),
        ("policy=MlpPolcy", "CnnPolicy"),
        ("policy_kwargs.rows=3", "no hyperparameter|no setting"),
        ('env_wrapper=[{"os.system": {"size": 1}}]', "ThreatPool"),
    ],
)
def test_a_wrong_option_is_refused_with_the_reason(option: str, words: str) -> None:
    with pytest.raises(BlastEnvError, match=words.replace("*", r"\*")):
        load_hyperparameters(
            "maskable_ppo",
            "BlastBarrier-v0",
            parse_options([option], hyperparameter_keys()),
        )


def test_arguments_that_a_policy_does_not_take_are_refused() -> None:
    """The run's configuration would say a width that its network does not have."""
    changes: dict[str, Any] = {"policy": "MlpPolicy", "policy_kwargs.width": 8}
    with pytest.raises(BlastEnvError, match=r"policy_kwargs\.width has no effect on MlpPolicy"):
        load_hyperparameters("ppo", "BlastBarrier-v0", changes)


def test_an_unknown_algorithm_is_refused_with_the_nearest() -> None:
    with pytest.raises(BlastEnvError, match="did you mean 'maskable_ppo'"):
        load_hyperparameters("maskable-ppo", "BlastBarrier-v0")
