"""A run folder that is damaged, or belongs to another scenario, is refused with the reason."""

import os
from collections.abc import Callable
from pathlib import Path
from shutil import copytree
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile

import pytest
import torch
from blast_agents.training import load_agent, resume, train
from blast_agents.training.checkpoint import Checkpoint

from blast_env.errors import BlastEnvError
from blast_env.files import is_temporary
from blast_env.site import save_scenario
from tests.agents.training_runs import hyperparameters, scenario_file, settings, small_scenario


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run that is finished; not to be changed."""
    folder = tmp_path_factory.mktemp("finished")
    train(settings(scenario_file(folder), steps=1), hyperparameters(), folder / "run")
    edit_configuration('"steps": 1,', '"steps": 99,')(folder / "run")
    return folder / "run"


def damage_configuration(run: Path) -> None:
    (run / "config.json").write_text("settings: [")


def remove_configuration(run: Path) -> None:
    (run / "config.json").unlink()


def change_scenario(run: Path) -> None:
    save_scenario(small_scenario(stock=5), run / "scenario.toml")


def cut_checkpoint(run: Path) -> None:
    path = run / "checkpoint.pt"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def flip_a_bit(run: Path) -> None:
    """In the weights themselves, where only a checksum can see it."""
    path = run / "checkpoint.pt"
    content = bytearray(path.read_bytes())
    weights = Checkpoint.load(path).policy["action_net.cell.weight"].numpy().tobytes()
    content[bytes(content).index(weights)] ^= 1
    path.write_bytes(bytes(content))


def remove_checkpoint(run: Path) -> None:
    (run / "checkpoint.pt").unlink()


def edit_configuration(old: str, new: str) -> Callable[[Path], None]:
    def edit(run: Path) -> None:
        path = run / "config.json"
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new))

    return edit


def edit_checkpoint(**changes: Any) -> Callable[[Path], None]:
    def edit(run: Path) -> None:
        path = run / "checkpoint.pt"
        content = torch.load(path, weights_only=True)
        torch.save(content | changes, path)

    return edit


def compress_checkpoint(run: Path) -> None:
    """As a few kilobytes that become any memory."""
    path = run / "checkpoint.pt"
    with ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with ZipFile(path, "w", ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (damage_configuration, "config.json: is damaged"),
        (remove_configuration, "is no run folder: there is no config.json"),
        (change_scenario, "it is another scenario"),
        (cut_checkpoint, "checkpoint.pt: is damaged"),
        (flip_a_bit, "checkpoint.pt: is damaged"),
        (remove_checkpoint, "there is no such checkpoint"),
        (compress_checkpoint, "is compressed"),
        (edit_configuration('"places": 1', '"places": 9'), "places is 9 in the .*, must be 1"),
        (edit_configuration('"rows": 8', '"rows": 9'), "policy_kwargs.rows is 9, must be 8"),
        (
            edit_configuration('"width": 8', '"width": 9'),
            "width is 9 in the configuration, must be 8",
        ),
        (edit_configuration('"gamma": 1.0', '"gamma": "2024-01-01"'), "gamma is '2024-01-01'"),
        (edit_checkpoint(format=1), "format is 1, must be 2"),
        (edit_checkpoint(counters={"steps": "many"}), "counters.steps is 'many'"),
        (edit_checkpoint(policy={"a": torch.zeros(1).expand(10**6, 10**6)}), "not in the file"),
        (edit_checkpoint(optimizer={"a": 1}), "optimiser's state does not fit"),
    ],
)
def test_a_damaged_folder_is_refused_with_the_reason(
    finished: Path, tmp_path: Path, damage: Callable[[Path], None], words: str
) -> None:
    run = Path(copytree(finished, tmp_path / "run"))
    damage(run)
    with pytest.raises(BlastEnvError, match=words):
        resume(run)


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


def test_tables_are_written_anew_from_the_checkpoint(finished: Path, tmp_path: Path) -> None:
    """They are for people: one that was cut at the end of a line would be taken for whole."""
    run = Path(copytree(finished, tmp_path / "run"))
    edit_configuration('"steps": 99,', '"steps": 1,')(run)
    names = ("rollouts.csv", "evaluations.csv")
    before = [(run / name).read_bytes() for name in names]
    for name in names:
        (run / name).write_text("steps\n")
    (run / ".0123456789abcdef.pt").write_bytes(b"left by a killed writer")
    resume(run)
    assert [(run / name).read_bytes() for name in names] == before
    assert not (run / ".0123456789abcdef.pt").exists()


def test_weights_that_are_no_numbers_are_refused(finished: Path, tmp_path: Path) -> None:
    run = Path(copytree(finished, tmp_path / "run"))
    weights = {
        name: torch.full_like(value, torch.nan)
        for name, value in Checkpoint.load(run / "checkpoint.pt").policy.items()
    }
    edit_checkpoint(best_policy=weights)(run)
    with pytest.raises(BlastEnvError, match="are not finite"):
        load_agent(run)


def test_a_run_without_a_rollout_has_no_agent_yet(tmp_path: Path) -> None:
    def stop(share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(settings(scenario_file(tmp_path)), hyperparameters(), tmp_path / "run", stop)
    with pytest.raises(BlastEnvError, match="has no weights yet, before its first rollout"):
        load_agent(tmp_path / "run")


@pytest.mark.parametrize("written", ["scenario.toml", "command.txt", "checkpoint.pt", None])
def test_a_folder_whose_making_was_interrupted_is_begun_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, written: str | None
) -> None:
    """Before this file was written, or before the rename that makes it the folder of a run."""
    run, replace = tmp_path / "run", os.replace

    def killed_at(source: Path, target: Path) -> None:
        if Path(target).name == (written or "config.json"):
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
    assert train(*chosen, run).progress.counters.steps > 0
    assert not any(is_temporary(path.name) for path in run.iterdir())
