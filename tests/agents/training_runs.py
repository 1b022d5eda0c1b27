"""A site and hyperparameters with which a training takes about a second."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from blast_agents.training import TrainingSettings, load_hyperparameters
from blast_agents.training.hyperparameters import Hyperparameters

from blast_env.site import Scenario, save_scenario
from tests.builders import site, square, zone

SMALL: dict[str, Any] = {
    "n_envs": 1,
    "n_steps": 16,
    "batch_size": 16,
    "n_epochs": 2,
    "policy_kwargs.width": 8,
    "policy_kwargs.critic_width": 8,
}
ROLLOUT = 16
STEPS = 3 * ROLLOUT


def small_scenario(stock: int = 4) -> Scenario:
    """Return a site of 20 m x 14 m with a road, a building, and a zone of 8 x 6 cells."""
    road = {"kind": "segment", "start_m": (2.0, 5.0), "end_m": (2.0, 9.0), "tnt_kg": 100.0}
    return site(
        "small",
        (20.0, 14.0),
        road,
        square("building", 14.0, 5.0, 8, protected=True),
        build_zone=zone(6.0, 5.0, 8, 6, stock=stock),
        calibration="ballistic_kb_100kg",
        simulation={"preset": "ballistic"},
    )


def scenario_file(folder: Path) -> Path:
    """Write the small scenario to a file."""
    path = folder / "small.toml"
    save_scenario(small_scenario(), path)
    return path


def settings(scenario: Path, **changes: Any) -> TrainingSettings:
    """Return settings for three rollouts, with an evaluation after each."""
    values: dict[str, Any] = {
        "algorithm": "maskable_ppo",
        "scenario": str(scenario),
        "steps": STEPS,
        "evaluation_interval": 1,
        "evaluation_cases": 2,
    }
    return TrainingSettings.model_validate(values | changes)


def hyperparameters(
    changes: Mapping[str, Any] = MappingProxyType({}), algorithm: str = "maskable_ppo"
) -> Hyperparameters:
    """Return hyperparameters for the small scenario."""
    small = SMALL
    if changes.get("policy") in ("MlpPolicy", "CnnPolicy"):  # their networks have other arguments
        small = {name: value for name, value in SMALL.items() if "policy_kwargs" not in name}
    return load_hyperparameters(algorithm, "BlastBarrier-v0", {**small, **changes})
