"""A full device costs the new file alone; kill -9 at a step, and the same work goes on."""

import gc
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import gymnasium
import numpy as np
import pytest
from blast_agents.training import load_agent, resume, train
from blast_agents.training.evaluations import EvaluationRow, read_evaluations, write_evaluations
from blast_agents.training.run_folder import RunFolder
from blast_agents.training.weights import read_parameters, write_model
from matplotlib.figure import Figure
from stable_baselines3 import PPO

from blast_env.answers.html import write_page
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import Blast, BlastResult
from blast_env.files import is_temporary
from blast_env.io.export import LayoutPlan, export_layout
from blast_env.layout import write_layout
from blast_env.parquet import write_table
from blast_env.particles import COLLISION_COLUMNS
from blast_env.particles.calibration import load_calibration, save_calibration
from blast_env.plots import save_figure, write_film
from blast_env.site import save_scenario
from blast_env.tables import write_csv
from tests.agents.training_runs import hyperparameters, scenario_file, settings
from tests.attack.disks import file_size_limit
from tests.plots.scenes import LAYOUT, small_blast

UNCLOSED = pytest.mark.filterwarnings(
    r"ignore:Exception ignored in. <_io\.FileIO:pytest.PytestUnraisableExceptionWarning"
)
"""XlsxWriter leaves its scratch files to the collector when it fails; nothing else may complain."""

Writer = Callable[[Path], Any]


@cache
def _blast() -> Blast:
    return small_blast(with_barrier=True)


@cache
def _result() -> BlastResult:
    return _blast().run()


@cache
def _plan() -> LayoutPlan:
    return LayoutPlan(_blast().scenario, LAYOUT, provenance={"text": "x" * 3000})


def _figure(path: Path) -> None:
    figure = Figure(figsize=(2.0, 1.0))
    figure.text(0.1, 0.5, "a figure")
    save_figure(figure, path)


def _film(path: Path) -> None:
    write_film(_blast(), path, frames_per_s=2.0, slow_motion=10.0, width_px=320)


class _Corridor(gymnasium.Env[np.ndarray, int]):
    """The least that a model needs."""

    observation_space = gymnasium.spaces.Box(0.0, 1.0, (1,))
    action_space = gymnasium.spaces.Discrete(2)  # type: ignore[assignment]


@cache
def _model() -> PPO:
    return PPO("MlpPolicy", _Corridor(), n_steps=2, batch_size=2, device="cpu")


def _evaluations(path: Path) -> None:
    write_evaluations(path, [EvaluationRow(16, (0.1,), (3,), 0.1, 0.0, 0.2, 4, 8, 1.0)] * 9)


def _report(path: Path) -> None:
    """Write a page that says little: the numbers of a report cost blasts."""
    write_page("<p>" + "words " * 600, path)


WRITERS: Final[Mapping[str, Writer]] = MappingProxyType(
    {
        "scenario.toml": lambda path: save_scenario(_blast().scenario, path),
        "layout.json": lambda path: write_layout(path, _plan().scenario, LAYOUT, {"a": "b" * 3000}),
        "layout.csv": lambda path: export_layout(_plan(), path),
        "layout.geojson": lambda path: export_layout(_plan(), path),
        "layout.dxf": lambda path: export_layout(_plan(), path),
        "table.csv": lambda path: write_csv(_result().collisions, path),
        "table.xlsx": lambda path: _result().to_excel(path),
        "table.parquet": lambda path: write_table(
            _result().collisions, COLLISION_COLUMNS, _result().run_record, path
        ),
        "figure.png": _figure,
        "figure.svg": _figure,
        "figure.pdf": _figure,
        "film.mp4": _film,
        "calibration.json": lambda path: save_calibration(load_calibration("ballistic_ufc"), path),
        "best_model.zip": lambda path: write_model(_model(), path),
        "evaluations.npz": _evaluations,
        "report.html": _report,
    }
)
"""By the name of a file that each of them writes."""


@pytest.fixture(scope="module", autouse=True)
def spared() -> Iterator[None]:
    """Spare the collector, called after each failure, all that was there before."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[UNCLOSED] * n.endswith(".xlsx")) for n in WRITERS],
)
def test_what_was_there_outlives_a_full_device(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where only the last byte has no room, as with a film whose index comes last."""
    # Drawings say when they were made, in as many bytes as the moment needs.
    monkeypatch.setattr("ezdxf.options.write_fixed_meta_data_for_testing", True)
    path = tmp_path / name
    WRITERS[name](path)
    size = path.stat().st_size
    path.write_bytes(b"the old one")
    for most_bytes in (size - 1, size // 2):
        with file_size_limit(most_bytes), pytest.raises(BlastEnvError, match="cannot be written"):
            WRITERS[name](path)
        gc.collect()
        assert path.read_bytes() == b"the old one"
        assert list(tmp_path.iterdir()) == [path]


# --- kill -9 at a step on the disk, then the same work again: nothing that was whole is lost.


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


@pytest.fixture(scope="module")
def steps(tmp_path_factory: pytest.TempPathFactory) -> int:
    """The number of steps of a training that is not killed."""
    code, steps = in_process(training, tmp_path_factory.mktemp("whole"))
    assert code == 0
    assert steps > 10
    return steps


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_training_goes_on_after_a_kill(steps: int, tmp_path: Path, share: float) -> None:
    """Every checkpoint that it leaves is whole, and the last one is where the run goes on."""
    killed = tmp_path / "killed"
    assert in_process(training, killed, int(share * steps))[0] == -signal.SIGKILL
    folder = RunFolder(killed / "run")
    before = {path: path.read_bytes() for path in folder.checkpoints.values()}
    assert all(read_parameters(path)["policy"] for path in before)
    assert in_process(training, killed)[0] == 0
    assert all(path.read_bytes() == content for path, content in before.items())
    assert read_evaluations(folder.evaluations)[-1].timesteps == 32
    assert not any(is_temporary(path.name) for path in folder.path.rglob("*"))
    load_agent(folder.path)
