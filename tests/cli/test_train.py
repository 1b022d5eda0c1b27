"""`blast-env train`, run in this process."""

from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from blast_env.cli import app
from tests.agents.training_runs import SMALL, scenario_file


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, ["train", *(str(argument) for argument in arguments)])


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
    result = run("--steps", "20", "--seed", "3", "--run", folder, *small(tmp_path))
    assert result.exit_code == 0, result.output
    assert "32 steps, 8 episodes" in result.stdout  # two whole rollouts
    assert "best on held-out threats" in result.stdout
    assert str(folder / "checkpoint.pt") in result.stdout
    again = run("--resume", folder)
    assert again.exit_code == 0, again.output
    assert "32 steps, 8 episodes" in again.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--run", "run", "--algo", "maskable_pp"), "did you mean 'maskable_ppo'"),
        (("--run", "run", "--set", "ent_coeff=1"), "did you mean 'ent_coef'"),
        (("--run", "run", "--set", "evaluation_case=1"), "did you mean 'evaluation_cases'"),
        (("--run", "run", "--set", "torch_threads=0"), "torch_threads is 0: Input should be"),
        (("--run", "run", "--scenario", "free_field"), "no build zone"),
        (("--steps", "5"), "--run is missing"),
        (("--resume", "nowhere"), "is no run folder"),
        (("--resume", "run", "--seed", "5"), "--seed cannot be changed with --resume"),
    ],
)
def test_bad_input_is_one_clear_message(
    arguments: tuple[str, ...], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = run(*arguments)
    assert result.exit_code == 2
    assert words in " ".join(result.output.split())
    assert "Traceback" not in result.output
    assert not (tmp_path / "run").exists()
