"""Jobs that are killed (kill -9) at one step on the disk after the other, and begun again.

A step is whatever changes names or opens a file to write: rename, mkdir, remove, open. Python tells
of each before it happens, so that a kill at step k + 1 is also one right after step k.
"""

import multiprocessing
import os
import re
import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Final

from blast_agents.training import resume, train
from blast_agents.training.checkpoint import Checkpoint
from typer.testing import CliRunner

from blast_env.app.folder import WorkFolder
from blast_env.app.jobs import jobs_of
from blast_env.app.session import Sessions
from blast_env.cli import app
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastStore
from blast_env.files import is_temporary
from blast_env.layout import write_layout
from blast_env.particles.calibration.free_field import FreeFieldStudy
from blast_env.site import load_scenario, save_scenario
from blast_env.store import Store
from tests.agents.training_runs import hyperparameters, scenario_file, settings, small_scenario
from tests.app.here import Here
from tests.report.sites import LAYOUT, small_hut

_STEPS: Final = ("os.rename", "os.mkdir", "os.remove", "open")
_WRITING: Final = os.O_WRONLY | os.O_RDWR

REFUSED: Final = 3
"""Exit code of a job that ends with the documented error."""


@dataclass(frozen=True)
class Job:
    """What is killed.

    Attributes:
        run: Does the work in a folder, and goes on with what is there already, as a user would:
            the same command again, or the one that an error names.
        outcome: What has come of it, without times.
    """

    run: Callable[[Path], None]
    outcome: Callable[[Path], Any]


def _train(folder: Path) -> None:
    chosen = settings(scenario_file(folder), steps=32)
    try:
        train(chosen, hyperparameters(), folder / "run")
    except BlastEnvError as error:
        if "--resume continues" not in str(error):
            raise
        resume(folder / "run")


def _training_outcome(folder: Path) -> Any:
    checkpoint = Checkpoint.load(folder / "run" / "checkpoint.pt")
    rows = (folder / "run" / "rollouts.csv").read_text().count("\n")
    evaluations = (folder / "run" / "evaluations.csv").read_text().count("\n")
    weights = [each.numpy().tobytes() for each in checkpoint.policy.values()]
    best = [each.numpy().tobytes() for each in checkpoint.best_policy.values()]
    left = [path.name for path in (folder / "run").iterdir() if is_temporary(path.name)]
    steps = [row.steps for row in checkpoint.rollouts]
    reductions = [row.reduction for row in checkpoint.evaluations]
    return weights, best, steps, reductions, rows, evaluations, left


def _command(*arguments: str | Path) -> None:
    result = CliRunner().invoke(app, [str(each) for each in arguments], catch_exceptions=False)
    if result.exit_code == 2:  # what a command says to the user
        raise BlastEnvError(result.output)
    assert result.exit_code == 0, result.output


def _search(folder: Path) -> None:
    options = ("--method", "random", "--budget", "6", "--held-out", "2", "--seed", "1")
    where = ("--cache", folder / "cache", "--out", folder / "out")
    _command("search", "--engine", "event", *options, *where)


_WALL: Final = Path(__file__).with_name("wall.json")


def _evaluate(folder: Path) -> None:
    where = ("--cache", folder / "cache", "--out", folder / "out")
    _command("evaluate", "--layout", _WALL, "--seeds", "2", "--engine", "event", *where)


def _files(folder: Path) -> dict[str, bytes]:
    """Return what is written for the reader; not JSON, which has the command in it."""
    written = (folder / "out").iterdir()
    return {
        path.name: path.read_bytes()
        for path in written
        if path.suffix in (".csv", ".png") and _is_kept(path)
    }


def _study(folder: Path) -> None:
    FreeFieldStudy(load_scenario("free_field"), (10.0, 12.0), (0, 1), "event").run(
        store=folder / "runs.sqlite"
    )


def _study_outcome(folder: Path) -> Any:
    return list(Store(folder / "runs.sqlite").items())


def _report(folder: Path) -> None:
    site, layout = folder / "site.toml", folder / "layout.json"
    if not layout.exists():
        save_scenario(small_hut(), site)
        write_layout(layout, small_hut(), LAYOUT, {})
    less = ("--threats", "1", "--places", "1", "--no-items", "--stills", "0", "--processes", "1")
    where = ("--cache", folder / "cache", "--out", folder / "report.html")
    _command("report", site, "--layout", layout, *less, *where)


def _report_outcome(folder: Path) -> Any:
    """Return the numbers of the page, and what the cache has."""
    cells = re.findall(r"<td[^>]*>([^<]*)</td>", (folder / "report.html").read_text("utf-8"))
    loads = BlastStore(folder / "cache")
    numbers = [cell for cell in cells if re.fullmatch(r"[-+0-9., ]+", cell)]
    return numbers, len(loads), _left(folder)


def _page(folder: Path) -> None:
    """A design, a layout and its blasts, as the page does them; what is there is opened again."""
    work = WorkFolder(folder / "work")
    sessions = Sessions(work, Here())
    with work.held("http://localhost"):
        there = work.designs()
        session = (
            sessions.of(there[0].design_id) if there else sessions.new(small_scenario(), "begin")
        )
        session.put("layout", session.design.with_layout(((0, 0), (1, 0))))
        session.blast([0])


def _page_outcome(folder: Path) -> Any:
    work = WorkFolder(folder / "work")
    (entry,) = work.designs()
    design = work.open(entry.design_id)
    records = [design.record_of(key) for key in sorted(design.blasts_there())]
    loads = [(record.key, str(record.loads)) for record in records if record is not None]
    frames = sorted(path.name for path in design.blasts.rglob("*.jpg") if _is_kept(path))
    states = {status.state for _, status in jobs_of(design.jobs)}
    return entry.problem, design.load().design, loads, frames, "done" in states


def _is_kept(path: Path) -> bool:
    return not is_temporary(path.name)


def _left(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if _is_kept(path))


JOBS: Final = {
    "train": Job(_train, _training_outcome),
    "search": Job(_search, _files),
    "evaluate": Job(_evaluate, _files),
    "calibrate": Job(_study, _study_outcome),
    "report": Job(_report, _report_outcome),
    "app": Job(_page, _page_outcome),
}


@dataclass(frozen=True)
class Ending:
    """How a process has ended.

    Attributes:
        code: Its exit code; `REFUSED` for the documented error.
        steps: How many steps it came to.
        said: What the documented error said.
    """

    code: int
    steps: int
    said: str


def _run_until(
    job: Callable[[Path], None], folder: Path, kill_at: int, steps: Any, said: Any
) -> None:
    """Do the job in this process, and kill it at a step in the folder."""
    place = str(folder)

    def watch(event: str, arguments: tuple[Any, ...]) -> None:
        if event not in _STEPS or not str(arguments[0]).startswith(place):
            return
        if event == "open" and not (isinstance(arguments[2], int) and arguments[2] & _WRITING):
            return
        if steps.value == kill_at:
            os.kill(os.getpid(), signal.SIGKILL)
        steps.value += 1

    sys.addaudithook(watch)
    try:
        job(folder)
    except BlastEnvError as error:
        said.put(str(error))
        sys.exit(REFUSED)


def in_process(job: Callable[[Path], None], folder: Path, kill_at: int = -1) -> Ending:
    """Do a job in a process of its own; it is killed at a step, unless that is negative."""
    folder.mkdir(parents=True, exist_ok=True)
    # Optimisers of torch import its compiler, which would take each process a second and a half.
    import_module("torch._dynamo")
    context = multiprocessing.get_context("fork")
    steps, said = context.Value("i", 0, lock=False), context.SimpleQueue()
    process = context.Process(target=_run_until, args=(job, folder, kill_at, steps, said))
    process.start()
    process.join()
    return Ending(
        process.exitcode or 0, steps.value, "" if said.empty() else " ".join(said.get().split())
    )


def outcome_after_kill(name: str, folder: Path, kill_at: int) -> Any:
    """Kill a job at a step, begin it again as a user would, and return what came of it.

    It may come to its end first: how often one tells how far it is goes by the clock.

    Raises:
        RuntimeError: If it failed in another way, or could not go on.
    """
    ending = in_process(JOBS[name].run, folder, kill_at)
    if ending.code not in (0, -signal.SIGKILL):
        raise RuntimeError(f"ended with {ending.code} before it was killed: {ending.said}")
    return outcome_of_going_on(name, folder)


def outcome_of_going_on(name: str, folder: Path) -> Any:
    """Do a job, in what is there, and return what came of it.

    Raises:
        RuntimeError: If it failed.
    """
    ending = in_process(JOBS[name].run, folder)
    if ending.code != 0:
        raise RuntimeError(f"cannot go on: {ending.said or f'exit code {ending.code}'}")
    return JOBS[name].outcome(folder)


def steps_and_outcome(name: str, folder: Path) -> tuple[int, Any]:
    """Do a job that is not killed; return how many steps it takes and what comes of it."""
    job = JOBS[name]
    ending = in_process(job.run, folder)
    if ending.code != 0:
        raise RuntimeError(f"{name}: {ending.said or f'exit code {ending.code}'}")
    return ending.steps, job.outcome(folder)
