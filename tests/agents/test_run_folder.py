"""A run folder that is damaged, or belongs to another scenario, is refused with the reason."""

import os
from collections.abc import Callable
from pathlib import Path
from shutil import copytree
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
import pytest
import torch
from blast_agents.training import load_agent, resume, train
from blast_agents.training.run_folder import RunFolder
from blast_agents.training.weights import read_parameters
from stable_baselines3.common.save_util import save_to_zip_file

from blast_env.errors import BlastEnvError
from blast_env.files import is_temporary
from blast_env.site import save_scenario
from tests.agents.training_runs import (
    ROLLOUT,
    hyperparameters,
    scenario_file,
    settings,
    small_scenario,
)

CONFIG = "BlastBarrier-v0/config.yml"
ARGS = "BlastBarrier-v0/args.yml"
CHECKPOINT = f"rl_model_{ROLLOUT}_steps.zip"
EVALUATIONS = "evaluations.npz"

Damage = Callable[[Path], None]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run with steps left; not to be changed."""
    folder = tmp_path_factory.mktemp("finished")
    train(settings(scenario_file(folder), steps=1), hyperparameters(), folder / "run")
    edit(ARGS, "steps: 1\n", "steps: 99\n")(folder / "run")
    return folder / "run"


def write(name: str, text: str) -> Damage:
    def change(run: Path) -> None:
        (run / name).write_text(text)

    return change


def remove(name: str) -> Damage:
    return lambda run: (run / name).unlink()


def edit(name: str, old: str, new: str) -> Damage:
    def change(run: Path) -> None:
        text = (run / name).read_text()
        assert old in text
        (run / name).write_text(text.replace(old, new))

    return change


def cut(name: str) -> Damage:
    def change(run: Path) -> None:
        content = (run / name).read_bytes()
        (run / name).write_bytes(content[: len(content) // 2])

    return change


def change_scenario(run: Path) -> None:
    save_scenario(small_scenario(stock=5), run / "scenario.toml")


def flip_a_bit(run: Path) -> None:
    """In the weights themselves, where only a checksum can see it."""
    path = run / CHECKPOINT
    content = bytearray(path.read_bytes())
    weights = read_parameters(path)["policy"]["action_net.cell.weight"].numpy().tobytes()
    content[bytes(content).index(weights)] ^= 1
    path.write_bytes(bytes(content))


def compress(name: str) -> Damage:
    """As a few kilobytes that become any memory."""

    def change(run: Path) -> None:
        with ZipFile(run / name) as archive:
            members = {member: archive.read(member) for member in archive.namelist()}
        with ZipFile(run / name, "w", ZIP_DEFLATED) as archive:
            for member, content in members.items():
                archive.writestr(member, content)

    return change


def with_tensors(name: str, change: Callable[[dict[str, torch.Tensor]], object]) -> Damage:
    def edit_weights(run: Path) -> None:
        parameters = read_parameters(run / name)
        change(parameters["policy"])
        save_to_zip_file(run / name, params=parameters)

    return edit_weights


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (write(CONFIG, "n_envs: ["), "config.yml: is missing or damaged: is no YAML"),
        (write(CONFIG, "a: &a [1]\nb: *a\n"), "config.yml: .* has the alias"),
        (write(CONFIG, "!!python/object/apply:os.getcwd []"), "config.yml: .* is no YAML"),
        (remove(CONFIG), "is no run folder: there is no BlastBarrier-v0/config.yml"),
        (remove(ARGS), "args.yml: is missing or damaged: there is no such file"),
        (remove("scenario.toml"), "the run folder is damaged"),
        (change_scenario, "it is another scenario"),
        (cut(CHECKPOINT), f"{CHECKPOINT}: is damaged"),
        (flip_a_bit, f"{CHECKPOINT}: is damaged"),
        (compress(CHECKPOINT), f"{CHECKPOINT}: is damaged, .* is compressed"),
        (write(CHECKPOINT, "weights"), f"{CHECKPOINT}: is damaged"),
        (cut(EVALUATIONS), f"{EVALUATIONS}: is damaged"),
        (compress(EVALUATIONS), f"{EVALUATIONS}: is damaged: .* is compressed"),
        (edit(CONFIG, "  width: 8\n", "  width: 9\n"), f"{CHECKPOINT}: weights and configuration"),
        (edit(CONFIG, "gamma: 1.0", "gamma: 2024-01-01"), "config.yml: .*2024"),
        (edit(ARGS, "steps: 99", "steps: many"), "args.yml: .* steps is 'many'"),
        (edit(ARGS, "seed: 0", "sead: 0"), "args.yml: .* sead is 0"),
        (
            with_tensors(CHECKPOINT, lambda tensors: tensors.popitem()),
            f"{CHECKPOINT}: weights and configuration differ: .* Missing",
        ),
    ],
)
def test_a_damaged_folder_is_refused_with_the_reason(
    finished: Path, tmp_path: Path, damage: Damage, words: str
) -> None:
    run = Path(copytree(finished, tmp_path / "run"))
    damage(run)
    with pytest.raises(BlastEnvError, match=words):
        resume(run)


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("evaluation_cases: ", "evaluation_cases: 1", "evaluation_cases is 12, must be 2 as"),
        (
            "evaluation_first_seed: ",
            "evaluation_first_seed: 1",
            "evaluation_first_seed is 10, must be 0",
        ),
        ("threat: visible", "threat: hidden", "threat is 'hidden', must be 'visible' as in"),
        ("evaluation_engine: null", "evaluation_engine: gas", "evaluation_engine is 'gas', must"),
    ],
)
def test_evaluations_of_other_threats_do_not_go_on_with_a_run(
    finished: Path, tmp_path: Path, before: str, after: str, words: str
) -> None:
    """The weights of the largest reduction would be those of the easiest threats."""
    run = Path(copytree(finished, tmp_path / "run"))
    edit(ARGS, before, after)(run)
    with pytest.raises(BlastEnvError, match=words):
        resume(run)


def test_an_evaluation_that_does_not_say_its_settings_goes_on(
    finished: Path, tmp_path: Path
) -> None:
    """Those of earlier versions."""
    run = Path(copytree(finished, tmp_path / "run"))
    with np.load(run / EVALUATIONS) as arrays:
        columns = {name: arrays[name] for name in arrays.files if name != "judging"}
    np.savez(run / EVALUATIONS, **columns, judging=["["])
    with pytest.raises(BlastEnvError, match="is missing or damaged"):
        resume(run)
    np.savez(run / EVALUATIONS, **columns)
    assert len(resume(run).evaluations) > len(columns["timesteps"])


def test_a_tensor_larger_than_its_file_is_refused(finished: Path, tmp_path: Path) -> None:
    run = Path(copytree(finished, tmp_path / "run"))
    huge = torch.zeros(1).expand(10**6, 10**6)
    with_tensors("best_model.zip", lambda tensors: tensors.update(a=huge))(run)
    with pytest.raises(BlastEnvError, match=r"best_model.zip: is damaged, .* not in the file"):
        load_agent(run)


def test_weights_that_are_no_numbers_are_refused(finished: Path, tmp_path: Path) -> None:
    run = Path(copytree(finished, tmp_path / "run"))
    with_tensors("best_model.zip", lambda tensors: [t.fill_(torch.nan) for t in tensors.values()])(
        run
    )
    with pytest.raises(BlastEnvError, match=r"best_model.zip: the weights .* are not finite"):
        load_agent(run)


def test_the_run_of_another_scenario_is_refused(finished: Path) -> None:
    with pytest.raises(BlastEnvError, match=r"courtyard: the scenario's hash is .*, must be"):
        resume(finished, scenario="courtyard")


def test_a_folder_with_something_in_it_is_refused(tmp_path: Path) -> None:
    scenario = scenario_file(tmp_path)
    with pytest.raises(BlastEnvError, match=r"has 'small.toml' in it, must be empty$"):
        train(settings(scenario), hyperparameters(), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["small.toml"]


def test_the_folder_of_a_run_says_how_to_go_on(finished: Path, tmp_path: Path) -> None:
    with pytest.raises(BlastEnvError, match="has a run in it already; --resume continues"):
        train(settings(scenario_file(tmp_path)), hyperparameters(), finished)


def test_a_run_without_an_evaluation_has_no_agent_yet(tmp_path: Path) -> None:
    def stop(share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(settings(scenario_file(tmp_path)), hyperparameters(), tmp_path / "run", stop)
    with pytest.raises(BlastEnvError, match="has no weights yet, before its first evaluation"):
        load_agent(tmp_path / "run")
    assert resume(tmp_path / "run").evaluations[-1].timesteps == 3 * ROLLOUT


@pytest.mark.parametrize("written", ["scenario.toml", "command.txt", "args.yml", "config.yml"])
def test_a_folder_whose_making_was_interrupted_is_begun_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, written: str
) -> None:
    """Before this file was written."""
    run, replace = tmp_path / "run", os.replace

    def killed_at(source: Path, target: Path) -> None:
        if Path(target).name == written:
            raise KeyboardInterrupt
        replace(source, target)

    chosen = (settings(scenario_file(tmp_path), steps=1), hyperparameters())
    monkeypatch.setattr(os, "replace", killed_at)
    with pytest.raises(KeyboardInterrupt):
        train(*chosen, run)
    monkeypatch.undo()
    (run / ".0123456789abcdef.toml").write_text("left by a killed writer")
    with pytest.raises(BlastEnvError, match="its making was interrupted: train begins anew"):
        resume(run)
    assert train(*chosen, run).evaluations[-1].timesteps == ROLLOUT
    assert not any(is_temporary(path.name) for path in run.rglob("*"))


def test_checkpoints_and_tables_are_in_the_order_of_their_steps(tmp_path: Path) -> None:
    for name in ("rl_model_96_steps.zip", "rl_model_128_steps.zip", "rl_model_x_steps.zip"):
        (tmp_path / name).touch()
    (tmp_path / "0.monitor.csv").touch()
    folder = RunFolder(tmp_path)
    assert [*folder.checkpoints] == [96, 128]
    assert folder.monitors == {0: tmp_path / "0.monitor.csv"}
