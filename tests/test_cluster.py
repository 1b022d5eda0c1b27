"""A cluster gives what one process gives, whatever happens to its workers."""

import json
import logging
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Timer
from types import SimpleNamespace

import joblib
import pytest
from typer.testing import CliRunner

from blast_env import cluster
from blast_env.cli import app
from blast_env.cluster import ClusterBackend, on_cluster
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, BlastLoads, draw_threats
from blast_env.evaluation.engines.contract import EngineBlast
from blast_env.runner import as_completed, run_all
from blast_env.site import load_scenario
from tests.pieces_of_work import Touch, name_and_seed, process, refuse_three, square, workers_within
from tests.scenarios import BALLISTIC_COURTYARD

distributed = pytest.importorskip("distributed")

PAIRS = [((), threat) for threat in draw_threats(BALLISTIC_COURTYARD, range(12))]


@dataclass(frozen=True)
class Dask:
    """A scheduler and its workers, each a process of its own.

    Attributes:
        file: The scheduler file.
        workers: The processes of the workers: one thread each, and nobody to start them again.
    """

    file: Path
    workers: list[int]


Starting = Callable[..., int]
"""Starts a command of Dask with options, `scheduler` or `worker`; returns its process."""


@pytest.fixture(scope="module")
def start() -> Iterator[Starting]:
    """Start processes as forks of one that has imported what they need."""
    with subprocess.Popen(
        [sys.executable, "-m", "tests.dask_forks"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as forks:
        assert forks.stdin is not None
        assert forks.stdout is not None
        asked, answers = forks.stdin, forks.stdout

        def started(*words: str) -> int:
            print(json.dumps(words), file=asked, flush=True)
            return int(answers.readline())

        yield started


@contextmanager
def dask(start: Starting, folder: Path, workers: int) -> Iterator[tuple[Dask, int]]:
    """Start them as docs/howto/cluster.md does; give them with the scheduler's process."""
    file = folder / "scheduler.json"
    at = ("--scheduler-file", str(file))
    scheduler = start("scheduler", *at, "--port", "0", "--host", "127.0.0.1", "--no-dashboard")
    one = ("--no-nanny", "--nthreads", "1", "--no-dashboard")
    started = [start("worker", *at, *one) for _ in range(workers)]
    try:
        with distributed.Client(scheduler_file=file, timeout=60, set_as_default=False) as client:
            if workers:
                client.wait_for_workers(workers, timeout=60)
        yield Dask(file, started), scheduler
    finally:
        for number in (*started, scheduler):
            end(number)


def end(number: int) -> None:
    """Kill a process, and wait until there is none of that number."""
    with suppress(ProcessLookupError):
        while True:
            os.kill(number, signal.SIGKILL)
            time.sleep(0.01)


@pytest.fixture(scope="module")
def two(start: Starting, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Dask]:
    """Two workers."""
    with dask(start, tmp_path_factory.mktemp("dask"), workers=2) as (started, _):
        yield started


def test_all_that_the_runner_does_runs_on_the_workers(two: Dask) -> None:
    """Whatever number of processes is asked for, 1 too, and however many items there are."""
    with on_cluster(two.file):
        assert set(run_all(process, range(40))) == {*two.workers}
        assert sorted(as_completed(square, range(9))) == [(i, i * i) for i in range(9)]
        assert run_all(square, range(60), workers=2) == [i * i for i in range(60)]
    assert set(run_all(process, range(2))) == {os.getpid()}


def test_work_does_not_share_itself_out_again(two: Dask) -> None:
    """A search on a worker runs its blasts there, as it does in a worker process."""
    with on_cluster(two.file):
        assert run_all(workers_within, range(2)) == [1, 1]


def test_the_error_of_an_item_ends_the_work(two: Dask) -> None:
    with on_cluster(two.file):
        with pytest.raises(BlastEnvError, match=r"^item 3 is odd$"):
            run_all(refuse_three, range(60))
        assert run_all(square, range(3)) == [0, 1, 4]


def test_a_stop_leaves_out_what_has_not_begun(
    two: Dask, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As Ctrl-C does: workers are at once there for others. The scheduler has all items by then."""
    monkeypatch.setattr(cluster, "_UNDER_WAY", 200)
    with on_cluster(two.file):
        results = as_completed(Touch(tmp_path), range(200))
        next(results)
        results.close()  # type: ignore[attr-defined]
        run_all(square, range(2))  # comes after what had begun
        begun = len(list(tmp_path.iterdir()))
        run_all(square, range(2))
    assert 0 < begun < 200
    assert len(list(tmp_path.iterdir())) == begun


def test_a_worker_with_other_code_is_refused(two: Dask, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its results would be kept under the versions of whoever asked."""
    monkeypatch.setattr(cluster, "_origin", lambda: "blast-env 0.0.1+0, numpy 1.26.4")
    message = "a worker has blast-env .*, must have that of the submitter: blast-env 0.0.1"
    with on_cluster(two.file), pytest.raises(BlastEnvError, match=message):
        run_all(square, range(2))


def test_a_blast_travels_without_its_site(two: Dask) -> None:
    """The bytes of a blast depend on layout and threat alone, and its site is sent once."""
    found = {}
    for name in ("visitor_entrance", "street_front"):
        scenario = load_scenario(name)
        threat = draw_threats(scenario, [0])[0]
        blasts = [EngineBlast(scenario, (), threat.charge, seed) for seed in range(50)]
        with distributed.Client(scheduler_file=two.file, set_as_default=False) as client:
            backend = ClusterBackend(client)
            with joblib.parallel_config(backend=backend, n_jobs=-1):
                for _ in range(2):
                    assert run_all(name_and_seed, blasts) == [(name, seed) for seed in range(50)]
        found[name] = backend.work_bytes / 100, backend.section_bytes
    (small, of_small), (large, of_large) = found.values()
    assert (len(of_small), len(of_large)) == (1, 2)  # the other one has a vehicle
    assert of_large[0] > of_small[0] > 3000
    assert small == pytest.approx(large, abs=20)
    assert small < 1200


def test_a_command_on_a_cluster_prints_what_it_prints_without(two: Dask) -> None:
    arguments = ["search", "--engine", "event", "--method", "random", "--budget", "2"]
    arguments += ["--held-out", "2"]
    alone = CliRunner().invoke(app, arguments)
    shared = CliRunner().invoke(app, [*arguments, "--cluster", str(two.file)])
    assert shared.exit_code == 0
    assert f"cluster {two.file}: 2 workers with 2 threads now" in shared.stderr
    assert _without_times(shared.stdout) == _without_times(alone.stdout)


def _without_times(text: str) -> str:
    return re.sub(r"[\d.]+ s$", "", text, flags=re.MULTILINE)


def test_a_killed_worker_changes_nothing(two: Dask, tmp_path: Path) -> None:
    """Killed at a blast: to the last bit what one process gives, each blast kept once.

    The last test with the two, for only one of them is left.
    """
    alone = BlastEvaluator(BALLISTIC_COURTYARD, "event").loads_of_many(PAIRS)
    evaluator = BlastEvaluator(BALLISTIC_COURTYARD, "event", cache=tmp_path)
    shares: list[float] = []

    def kill_one(share: float) -> None:
        end(two.workers[0])
        shares.append(share)

    with on_cluster(two.file) as size:
        found = evaluator.loads_of_many(PAIRS, progress=kill_one)
    assert size == (2, 2)
    assert [_bits(load) for load in found] == [_bits(load) for load in alone]
    assert shares == [pytest.approx((done + 1) / len(PAIRS)) for done in range(len(PAIRS))]
    assert evaluator.counts.blasts == len(PAIRS)
    again = BlastEvaluator(BALLISTIC_COURTYARD, "event", cache=tmp_path)
    assert [_bits(load) for load in again.loads_of_many(PAIRS)] == [_bits(load) for load in alone]
    assert again.counts.blasts == 0


def _bits(loads: BlastLoads) -> tuple[object, bytes]:
    return loads.structures, loads.module_impulse_sim.tobytes()


def test_work_that_kills_its_workers_is_given_up() -> None:
    """Not tried for ever, and said."""
    last = SimpleNamespace(address="tcp://node7:40123")
    error = distributed.KilledWorker("blast", last, 3)
    with pytest.raises(BlastEnvError, match=r"ended 4 workers, .* the last one was tcp://node7"):
        cluster.Outcome(error=error).get()


def test_a_lost_scheduler_is_an_error(
    start: Starting,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    """And not a wait without end, nor do tracebacks of Dask come before it."""
    monkeypatch.setattr(logging.getLogger("distributed"), "propagate", True)
    lost = "the connection to the scheduler was lost"
    with dask(start, tmp_path, workers=0) as (started, scheduler), on_cluster(started.file) as size:
        assert size == (0, 0)
        Timer(0.2, end, [scheduler]).start()
        with pytest.raises(BlastEnvError, match=lost):
            run_all(square, range(100))
    assert caplog.text == ""


def test_a_scheduler_that_is_lost_before_the_work_is_the_same_error(
    start: Starting, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "_CONNECT_S", 3.0)

    def work_without(scheduler: int, file: Path) -> None:
        with on_cluster(file):
            end(scheduler)
            run_all(square, range(100))

    with dask(start, tmp_path, workers=0) as (started, scheduler):
        levels = _levels()
        with pytest.raises(BlastEnvError, match="the connection to the scheduler was lost"):
            work_without(scheduler, started.file)
        assert _levels() == levels


def _levels() -> dict[str, int]:
    """Return the levels of all loggers."""
    names = [*logging.root.manager.loggerDict]
    return {name: logging.getLogger(name).level for name in names}


@pytest.mark.parametrize(
    ("given", "what"),
    [
        ("nonsense", "missing port number"),
        ("ftp://node:1", "unknown address scheme 'ftp'"),
        ("", "missing port number"),
        ("tcp://127.0.0.1:9", "Timed out"),
    ],
)
def test_an_address_without_a_scheduler(
    given: str, what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "_CONNECT_S", 0.2)
    message = f"^cluster {given!r}: no scheduler answers: .*{what}"
    with pytest.raises(BlastEnvError, match=message), on_cluster(given):
        pass


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"address": 7}'])
def test_another_file_is_no_scheduler_file(content: str, tmp_path: Path) -> None:
    path = tmp_path / "scheduler.json"
    path.write_text(content)
    message = r"^cluster '.*': is no scheduler file: "  # a long path is cut
    with pytest.raises(BlastEnvError, match=message), on_cluster(path):
        pass
