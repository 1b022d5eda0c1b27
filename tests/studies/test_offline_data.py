"""The data set of Minari; its package needs jax, so that `make test` does not install it."""

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from studies import offline_data
from tests.evaluation.engines.shade import ShadeEngine
from tests.libraries.ids import IDS, arguments

# Minari asks for an author, and leaves it to the interpreter to remove its temporary folder.
pytestmark = [
    pytest.mark.filterwarnings("ignore::UserWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]
WHY = "needs `pip install blast-env[datasets]`: `make matrix-minari` runs it"


def test_rules_take_turns_and_random_layouts_are_legal() -> None:
    env = gym.make("BlastBarrier-v0", engine=ShadeEngine(), observation="features", action="place")
    shares: list[float] = []
    found = offline_data.record(env, 6, ("rules", "random"), None, shares.append)
    assert [len(item) for item in found.values()] == [3, 3]
    assert min(found["rules"]) == pytest.approx(1.0 - 0.9**16)  # the whole stock stands
    assert min(found["random"]) > 0.0
    assert shares == pytest.approx(np.arange(1, 7) / 6)


def test_the_command_writes_what_minari_reads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    minari = pytest.importorskip("minari", reason=WHY)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    app = typer.Typer()
    app.command()(offline_data.main)
    options = ("--episodes", "4", "--engine", "surrogate", "--scenario", "control_room")
    result = CliRunner().invoke(app, options)
    assert result.exit_code == 0, result.output
    data = minari.load_dataset("blast/barrier-v0")
    assert data.total_episodes == 4
    for episode in data.iterate_episodes():
        assert sum(episode.rewards) == pytest.approx(float(episode.infos["reduction"][-1]) - 1.0)
        assert bool(episode.terminations[-1])


@pytest.mark.parametrize("name", [*IDS, "BlastBarrier-MO-v0"])
def test_it_records_episodes_of_every_id(name: str, tmp_path: Path, monkeypatch: Any) -> None:
    minari = pytest.importorskip("minari", reason=WHY)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    # Minari stores arrays of bytes with three axes as pictures of one, three or four channels.
    shown = {"observation": "grid"} if name.startswith("BlastBarrier") else {}
    options: dict[str, Any] = shown | arguments(name)
    env = gym.make(name, max_episode_steps=3, **options)
    collector = minari.DataCollector(env, record_infos=True)
    for seed in range(2):
        _, info = collector.reset(seed=seed)
        ended = False
        while not ended:
            action = env.action_space.sample()
            _, _, terminated, truncated, info = collector.step(action)
            ended = terminated or truncated
    data = collector.create_dataset(dataset_id="blast/any-v0")
    collector.close()
    assert data.total_episodes == 2
    assert {*next(data.iterate_episodes()).infos} == {*info}
