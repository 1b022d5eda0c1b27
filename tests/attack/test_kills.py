"""kill -9 at a step on the disk, then the same work again: the result is the undisturbed one."""

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from blast_agents.training import resume, train
from blast_agents.training.checkpoint import Checkpoint

from blast_env.errors import BlastEnvError
from blast_env.files import is_temporary
from tests.agents.training_runs import hyperparameters, scenario_file, settings

STEPS = ("os.rename", "os.mkdir", "os.remove", "open")
"""What changes names or opens a file to write. Python reports each before it happens."""


def training(folder: Path) -> None:
    """Train, or go on with what is there, as the error says."""
    chosen = settings(scenario_file(folder), steps=32)
    try:
        train(chosen, hyperparameters(), folder / "run")
    except BlastEnvError as error:
        if "--resume continues" not in str(error):
            raise
        resume(folder / "run")


def outcome(folder: Path) -> Any:
    """Return all of a training but its times."""
    run = folder / "run"
    checkpoint = Checkpoint.load(run / "checkpoint.pt")
    lines = [(run / f"{name}.csv").read_text().count("\n") for name in ("rollouts", "evaluations")]
    weights = [
        each.numpy().tobytes()
        for policy in (checkpoint.policy, checkpoint.best_policy)
        for each in policy.values()
    ]
    steps = [row.steps for row in checkpoint.rollouts]
    reductions = [row.reduction for row in checkpoint.evaluations]
    left = [path.name for path in run.iterdir() if is_temporary(path.name)]
    return weights, steps, reductions, lines, left


def run_until(work: Callable[[Path], None], folder: Path, kill_at: int, steps: Any) -> None:
    def watch(event: str, arguments: tuple[Any, ...]) -> None:
        if event not in STEPS or not str(arguments[0]).startswith(str(folder)):
            return
        writes = isinstance(arguments[-1], int) and arguments[-1] & (os.O_WRONLY | os.O_RDWR)
        if event == "open" and not writes:
            return
        if steps.value == kill_at:
            os.kill(os.getpid(), signal.SIGKILL)
        steps.value += 1

    sys.addaudithook(watch)
    work(folder)


def in_process(work: Callable[[Path], None], folder: Path, kill_at: int = -1) -> tuple[int, int]:
    """Work in a process that is killed at a step, unless that is negative; code and steps."""
    folder.mkdir(exist_ok=True)
    # Optimisers of torch import its compiler, which would take each process a second and a half.
    import_module("torch._dynamo")
    context = multiprocessing.get_context("fork")
    steps = context.Value("i", 0, lock=False)
    process = context.Process(target=run_until, args=(work, folder, kill_at, steps))
    process.start()
    process.join()
    return process.exitcode or 0, steps.value


@pytest.mark.slow
def test_training_goes_on_after_a_kill(tmp_path: Path) -> None:
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    code, steps = in_process(training, whole)
    assert code == 0
    assert steps > 10
    assert in_process(training, killed, steps // 2)[0] == -signal.SIGKILL
    assert in_process(training, killed)[0] == 0
    assert outcome(killed) == outcome(whole)
