"""A run folder that is damaged, or belongs to another scenario, is refused with the reason."""

from collections.abc import Callable
from pathlib import Path
from shutil import copytree

import pytest
from blast_agents.training import resume, train
from blast_agents.training.agent import Checkpoint

from blast_env.errors import BlastEnvError
from blast_env.scenario import save_scenario
from tests.agents.training_runs import hyperparameters, scenario_file, settings, small_scenario


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run that is finished; not to be changed."""
    folder = tmp_path_factory.mktemp("finished")
    train(settings(scenario_file(folder), steps=1), hyperparameters(), folder / "run")
    return folder / "run"


def damage_configuration(run: Path) -> None:
    (run / "config.yaml").write_text("settings: [")


def change_configuration(run: Path) -> None:
    path = run / "config.yaml"
    path.write_text(path.read_text().replace("n_steps: 16", "n_steps: many"))


def remove_configuration(run: Path) -> None:
    (run / "config.yaml").unlink()


def change_scenario(run: Path) -> None:
    save_scenario(small_scenario(stock=5), run / "scenario.toml")


def cut_checkpoint(run: Path) -> None:
    path = run / "last.pt"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def flip_a_bit(run: Path) -> None:
    """In the weights themselves, where only a checksum can see it."""
    path = run / "last.pt"
    content = bytearray(path.read_bytes())
    weights = Checkpoint.load(path).policy["action_net.cell.weight"].numpy().tobytes()
    content[bytes(content).index(weights)] ^= 1
    path.write_bytes(bytes(content))


def remove_checkpoint(run: Path) -> None:
    (run / "last.pt").unlink()


def cut_table(run: Path) -> None:
    path = run / "rollouts.csv"
    path.write_text(path.read_text().replace("steps", "stops"))


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (damage_configuration, "config.yaml: is damaged"),
        (change_configuration, "n_steps is 'many': Input should be a valid integer"),
        (remove_configuration, "is no run folder: there is no config.yaml"),
        (change_scenario, "it is another scenario"),
        (cut_checkpoint, "last.pt: is damaged"),
        (flip_a_bit, "last.pt: is damaged"),
        (remove_checkpoint, "there is no such checkpoint"),
        (cut_table, "rollouts.csv: is missing or damaged"),
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
    with pytest.raises(BlastEnvError, match=r"has 'small.toml' in it, must be empty; --resume"):
        train(settings(scenario), hyperparameters(), tmp_path)
