"""A training is the same every time, survives any interruption, and its folder is checked."""

import json
import multiprocessing
from dataclasses import astuple, replace
from importlib import import_module
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest
import torch
from blast_agents.training import resume, train
from blast_agents.training.checkpoint import Checkpoint, Weights
from blast_agents.training.run_folder import EvaluationRow, RolloutRow, read_rows
from blast_agents.training.train import TrainingResult

from blast_env.errors import BlastEnvError
from blast_env.site import load_scenario
from tests.agents.training_runs import (
    ROLLOUT,
    STEPS,
    hyperparameters,
    scenario_file,
    settings,
    small_scenario,
)

FILES = {
    "checkpoint.pt",
    "command.txt",
    "config.json",
    "evaluations.csv",
    "learning_curve.png",
    "rollouts.csv",
    "scenario.toml",
    "tensorboard",
    "versions.json",
}


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run that is finished; not to be changed."""
    folder = tmp_path_factory.mktemp("finished")
    train(settings(scenario_file(folder)), hyperparameters(), folder / "run")
    return folder / "run"


def outcome(run: Path) -> tuple[list[tuple], list[tuple], Weights]:
    """Return all that a run has come to, but for the time it took and where blasts came from."""
    rollouts = read_rows(run / "rollouts.csv", RolloutRow)
    evaluations = read_rows(run / "evaluations.csv", EvaluationRow)
    return (
        [astuple(replace(row, seconds=0.0, blasts=0, cache_hits=0)) for row in rollouts],
        [astuple(replace(row, seconds=0.0, blasts=0)) for row in evaluations],
        Checkpoint.load(run / "checkpoint.pt").policy,
    )


def assert_same_outcome(run: Path, other: Path) -> None:
    rollouts, evaluations, weights = outcome(run)
    other_rollouts, other_evaluations, other_weights = outcome(other)
    assert rollouts == other_rollouts
    assert evaluations == other_evaluations
    assert weights.keys() == other_weights.keys()
    for name, values in weights.items():
        assert torch.equal(values, other_weights[name]), name


def interrupted(run: Path, scenario: Path, after_steps: int) -> None:
    """Train until a step, then stop as by Ctrl-C."""

    def progress(share: float) -> None:
        if share >= after_steps / STEPS:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(settings(scenario), hyperparameters(), run, progress)


def test_a_run_folder_has_all_that_a_reader_asks_for(finished: Path) -> None:
    assert {path.name for path in finished.iterdir()} == FILES
    configuration = json.loads((finished / "config.json").read_text())
    assert configuration["settings"]["seed"] == 0
    assert configuration["scenario_hash"] == small_scenario().content_hash
    assert load_scenario(finished / "scenario.toml") == small_scenario()
    assert "torch" in json.loads((finished / "versions.json").read_text())
    rollouts, evaluations, _ = outcome(finished)
    assert [row[0] for row in rollouts] == [row[0] for row in evaluations] == [16, 32, 48]
    assert all(row.blasts > 0 for row in read_rows(finished / "rollouts.csv", RolloutRow))


def test_the_best_weights_are_those_of_the_best_evaluation(finished: Path) -> None:
    evaluations = read_rows(finished / "evaluations.csv", EvaluationRow)
    best = max(evaluations, key=lambda row: row.reduction)
    checkpoint = Checkpoint.load(finished / "checkpoint.pt")
    assert checkpoint.counters.best_reduction == best.reduction
    assert checkpoint.counters.best_steps == best.steps
    same = [torch.equal(checkpoint.best_policy[n], v) for n, v in checkpoint.policy.items()]
    assert all(same) == (best.steps == checkpoint.counters.steps)


def test_tensorboard_has_what_there_is_to_watch(finished: Path) -> None:
    module = import_module("tensorboard.backend.event_processing.event_accumulator")
    events = module.EventAccumulator(str(finished / "tensorboard"))
    events.Reload()
    watched = {
        "rollout/reward",
        "rollout/reduction",
        "blasts/per_second",
        "blasts/cache_hits",
        "evaluation/reduction",
        "train/approx_kl",
    }
    assert watched <= set(events.Tags()["scalars"])
    assert [event.step for event in events.Scalars("rollout/reduction")] == [16, 32, 48]


def test_another_seed_gives_another_one(finished: Path, tmp_path: Path) -> None:
    short = settings(scenario_file(tmp_path), seed=1, steps=ROLLOUT)
    train(short, hyperparameters(), tmp_path / "run")
    assert outcome(finished)[0][:1] != outcome(tmp_path / "run")[0]


def test_an_interrupted_run_ends_as_if_it_had_not_been(finished: Path, tmp_path: Path) -> None:
    """Weights, tables and steps, to the last bit: the same seed gives the same run."""
    interrupted(tmp_path / "run", scenario_file(tmp_path), ROLLOUT + 3)
    result = resume(tmp_path / "run")
    assert result.progress.counters.steps == STEPS
    assert_same_outcome(finished, tmp_path / "run")


def test_a_finished_run_stays_as_it_is(finished: Path, tmp_path: Path) -> None:
    run = Path(copytree(finished, tmp_path / "run"))
    assert resume(run).progress.counters.steps == STEPS
    assert_same_outcome(finished, run)


def test_the_loss_of_an_environment_s_process_is_told(tmp_path: Path) -> None:
    """As the kernel takes one when memory runs out."""
    of_others = multiprocessing.active_children()

    def progress(share: float) -> None:
        for child in multiprocessing.active_children():
            if child not in of_others:
                child.kill()

    chosen = hyperparameters({"n_envs": 2})
    with pytest.raises(BlastEnvError, match=r"has ended, .*; --resume continues"):
        train(settings(scenario_file(tmp_path)), chosen, tmp_path / "run", progress)


def test_an_unknown_engine_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    scenario = scenario_file(tmp_path)
    with pytest.raises(BlastEnvError, match="did you mean 'event'"):
        train(settings(scenario, engine="evnt"), hyperparameters(), tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_policy_for_the_other_algorithm_is_refused(tmp_path: Path) -> None:
    chosen = hyperparameters({"policy": "blast_agents.policies.spatial.SpatialPolicy"})
    with pytest.raises(BlastEnvError, match="for maskable_ppo"):
        train(settings(scenario_file(tmp_path)), chosen, tmp_path / "run")


@pytest.mark.parametrize(
    ("algorithm", "threat", "policy"),
    [
        ("ppo", "visible", "blast_agents.policies.spatial.SpatialPolicy"),
        ("maskable_ppo", "hidden", "blast_agents.policies.spatial.SpatialMaskablePolicy"),
    ],
)
def test_other_algorithms_and_hidden_threats_train_too(
    tmp_path: Path, algorithm: str, threat: str, policy: str
) -> None:
    chosen = settings(scenario_file(tmp_path), algorithm=algorithm, threat=threat)
    result: TrainingResult = train(
        chosen, hyperparameters({"policy": policy}, algorithm), tmp_path / "run"
    )
    assert result.progress.counters.steps == STEPS
    assert np.isfinite(result.progress.counters.best_reduction)
    places = result.configuration.hyperparameters.policy_kwargs.places
    assert places == (1 if threat == "visible" else 9)  # a hidden charge may be in many


def test_training_learns(tmp_path: Path) -> None:
    """On a site where only cells in the line of sight help, within some 150 blasts."""
    changes = {"n_steps": 128, "batch_size": 64, "n_epochs": 4, "learning_rate": 0.01}
    chosen = hyperparameters({**changes, "policy_kwargs.width": 16})
    run = settings(scenario_file(tmp_path), steps=128 * 3, evaluation_interval=3)
    rows = train(run, chosen, tmp_path / "run").progress.rollouts
    first, last = (np.mean([row.reduction for row in part]) for part in (rows[:1], rows[-1:]))
    assert last > first + 0.1
