"""`blast-env train`, run in this process."""

from functools import partial
from pathlib import Path

from tests.agents.training_runs import SMALL, scenario_file
from tests.cli.running import run

train = partial(run, "train")


def small(folder: Path) -> list[str | Path]:
    """Return options with which a training takes about a second."""
    options: list[str | Path] = ["--scenario", scenario_file(folder), "--envs", "1"]
    values = {**SMALL, "evaluation_cases": 2}
    del values["n_envs"]
    for key, value in values.items():
        options += ["--set", f"{key}={value}"]
    return options


def test_a_run_says_what_it_came_to_and_can_be_taken_up_again(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    result = train("--steps", "20", "--seed", "3", "--run", folder, *small(tmp_path))
    assert result.exit_code == 0, result.output
    assert "32 steps, 8 episodes" in result.stdout  # two whole rollouts
    assert "best on held-out threats" in result.stdout
    assert str(folder / "best_model.zip") in result.stdout
    again = train("--resume", folder)
    assert again.exit_code == 0, again.output
    assert "32 steps, 8 episodes" in again.stdout
