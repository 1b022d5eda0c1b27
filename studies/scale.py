"""Costs at scale: work on several workers, and a store with many blasts."""

import sqlite3
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from math import isnan
from multiprocessing import get_context
from pathlib import Path
from statistics import fmean
from tempfile import TemporaryDirectory
from time import perf_counter, process_time, sleep, time_ns
from typing import Annotated, Final, Protocol

import joblib
import numpy as np
import typer
from blast_agents.training import TrainingSettings, load_hyperparameters
from blast_agents.training.environments import make_environments
from blast_agents.training.run_folder import RunConfiguration

from blast_env.cli.output import print_line, progress_bar, user_errors
from blast_env.cluster import on_cluster
from blast_env.design.rules import random_layout
from blast_env.envs.strategies import SingleScenario
from blast_env.errors import import_extra
from blast_env.evaluation import BlastEvaluator, Threat
from blast_env.evaluation.engines import find_engine
from blast_env.files import FolderStore, make_folder
from blast_env.geometry import Layout
from blast_env.layout.build_scene import draw_charge
from blast_env.runner import run_all
from blast_env.site import Scenario, load_scenario
from blast_env.tables import markdown_table
from blast_env.units import MS_PER_S
from studies.gas.loads import yard

app = typer.Typer(help=__doc__, add_completion=False, pretty_exceptions_enable=False)

CONTENT_BYTES: Final = 2_000
"""Approximate size of the loads of a blast in the courtyard."""


class Store(Protocol):
    """The interface of `FolderStore`."""

    def get(self, key: str) -> bytes | None:
        """Return the content of a key, or `None` if it is not there."""

    def put(self, key: str, content: bytes) -> None:
        """Store the content of a key; evict the least recently used contents if necessary."""

    def __len__(self) -> int:
        """Return the number of contents."""


class SqliteStore:
    """The interface of `FolderStore` on one SQLite file in WAL mode.

    A table holds the hash of the key, the key, the content, its checksum, and the time of its last
    use; with an index by that time, eviction is one transaction. Like `FolderStore` without waiting
    for the device: a loss of power loses the last contents, and damages none.

    Args:
        path: The file.
        most_bytes: Maximum total size of the contents.
    """

    def __init__(self, path: Path, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self._connection = sqlite3.connect(path, timeout=60.0, isolation_level=None)
        for line in (
            "PRAGMA journal_mode = WAL",
            "PRAGMA synchronous = NORMAL",
            "CREATE TABLE IF NOT EXISTS kept (hash BLOB PRIMARY KEY, key TEXT, content BLOB, "
            "checksum INTEGER, size INTEGER, used INTEGER) WITHOUT ROWID",
            "CREATE INDEX IF NOT EXISTS by_use ON kept (used, size)",
            "CREATE TABLE IF NOT EXISTS total (size INTEGER)",
            "INSERT INTO total SELECT 0 WHERE NOT EXISTS (SELECT * FROM total)",
        ):
            self._connection.execute(line)

    def get(self, key: str) -> bytes | None:
        """Return the content of a key, or `None` if it is missing or damaged."""
        at = sha256(key.encode()).digest()
        query = "SELECT key, content, checksum FROM kept WHERE hash = ?"
        row = self._connection.execute(query, (at,)).fetchone()
        if row is None or row[0] != key or zlib.crc32(row[1]) != row[2]:
            return None
        self._connection.execute("UPDATE kept SET used = ? WHERE hash = ?", (time_ns(), at))
        content: bytes = row[1]
        return content

    def put(self, key: str, content: bytes) -> None:
        """Store the content of a key; evict the least recently used contents if necessary."""
        at, run = sha256(key.encode()).digest(), self._connection.execute
        run("BEGIN IMMEDIATE")
        old = run("SELECT size FROM kept WHERE hash = ?", (at,)).fetchone()
        values = (at, key, content, zlib.crc32(content), len(content), time_ns())
        run("INSERT OR REPLACE INTO kept VALUES (?, ?, ?, ?, ?, ?)", values)
        run("UPDATE total SET size = size + ?", (len(content) - (old[0] if old else 0),))
        (size,) = run("SELECT size FROM total").fetchone()
        if size > self._most_bytes:
            self._evict(size)
        run("COMMIT")

    def _evict(self, size: int) -> None:
        """Delete the least recently used contents, down to 90 % of `most_bytes`."""
        last, left = 0, size
        for used, own in self._connection.execute("SELECT used, size FROM kept ORDER BY used"):
            if left <= 0.9 * self._most_bytes:
                break
            last, left = used, left - own
        self._connection.execute("DELETE FROM kept WHERE used <= ?", (last,))
        self._connection.execute("UPDATE total SET size = ?", (left,))

    def __len__(self) -> int:
        count: int = self._connection.execute("SELECT count(*) FROM kept").fetchone()[0]
        return count

    def close(self) -> None:
        """Close the file."""
        self._connection.close()


@dataclass(frozen=True)
class StoreFigures:
    """Wall-clock times and size of a store with many contents; `_us` times are means per content.

    Attributes:
        fill_us: Time to put a content, without eviction.
        hit_us: Time to get a stored content.
        miss_us: Time to look up a missing one.
        count_s: Time to count the contents.
        evict_s: Time to put a content that causes an eviction to 90 % of the maximum.
        shared_us: Time to put a content while another process does the same.
        megabytes: Size of the full store on the device.
    """

    fill_us: float
    hit_us: float
    miss_us: float
    count_s: float
    evict_s: float
    shared_us: float
    megabytes: float


def files(folder: Path, most_bytes: int) -> Store:
    """Return the store of files."""
    return FolderStore(folder / "files", ".loads", most_bytes, durable=False)  # as `DiskCache`


def sqlite(folder: Path, most_bytes: int) -> Store:
    """Return the store of one SQLite file."""
    return SqliteStore(folder / "kept.sqlite", most_bytes)


STORES: Final[dict[str, Callable[[Path, int], Store]]] = {"files": files, "SQLite": sqlite}


def measure_store(make: Callable[[Path, int], Store], folder: Path, entries: int) -> StoreFigures:
    """Measure a store in an empty folder: fill, read, write from two processes, overfill."""
    content = np.random.default_rng(0).bytes(CONTENT_BYTES)
    room = 2 * entries * CONTENT_BYTES
    store = make(folder, room)
    fill_us = _each_us(lambda key: store.put(key, content), _keys("a", entries))
    looked = _keys("a", entries)[:: max(entries // 2000, 1)]
    hit_us = _each_us(store.get, looked)
    miss_us = _each_us(store.get, _keys("b", len(looked)))
    began_s = perf_counter()
    assert len(store) == entries
    count_s = perf_counter() - began_s
    megabytes = sum(path.stat().st_blocks for path in folder.rglob("*")) * 512 / 1e6
    shared_us = _shared_us(make, folder, room, max(entries // 50, 10))
    full = make(folder, entries * CONTENT_BYTES)  # less than the contents
    began_s = perf_counter()
    full.put("the one too many", content)
    return StoreFigures(
        fill_us, hit_us, miss_us, count_s, perf_counter() - began_s, shared_us, megabytes
    )


def _keys(prefix: str, count: int) -> list[str]:
    return [f"{prefix} {number} " + "k" * 300 for number in range(count)]  # as long as a blast's


def _each_us(act: Callable[[str], object], keys: Sequence[str]) -> float:
    began_s = perf_counter()
    for key in keys:
        act(key)
    return 1e6 * (perf_counter() - began_s) / len(keys)


def _shared_us(make: Callable[[Path, int], Store], folder: Path, room: int, count: int) -> float:
    """Return the time of a put in each of two processes that write at the same time."""
    context = get_context("spawn")
    begin, times = context.Barrier(2), context.Queue()
    writers = [
        context.Process(target=_write, args=(make, folder, room, f"c{number}", count, begin, times))
        for number in range(2)
    ]
    for writer in writers:
        writer.start()
    found = [times.get(timeout=300) for _ in writers]
    for writer in writers:
        writer.join()
    return float(np.mean(found))


def _write(make, folder, room, prefix, count, begin, times) -> None:  # type: ignore[no-untyped-def]
    store = make(folder, room)
    content = bytes(CONTENT_BYTES)
    begin.wait()
    times.put(_each_us(lambda key: store.put(key, content), _keys(prefix, count)))


@app.command("store")
def compare_stores(
    entries: Annotated[int, typer.Option(min=100, help="Contents of 2 kB.")] = 100_000,
    folder: Annotated[Path, typer.Option(help="Where there is room for them.")] = Path("out"),
) -> None:
    """Print the times and sizes of a store of files and of one in SQLite, with many contents."""
    rows = []
    with user_errors(), progress_bar(f"stores with {entries:,} contents") as progress:
        make_folder(folder)
        for done, (name, make) in enumerate(STORES.items(), start=1):
            with TemporaryDirectory(dir=folder) as inside:
                of = measure_store(make, Path(inside), entries)
            progress(done / len(STORES))
            times = (of.fill_us, of.shared_us, of.hit_us, of.miss_us)
            rows.append(
                (
                    name,
                    *(f"{each:,.0f}" for each in times),
                    f"{of.count_s:.3f}",
                    f"{of.evict_s:.2f}",
                    f"{of.megabytes:,.0f}",
                )
            )
    print_line(
        markdown_table(
            (
                "store",
                "put (us)",
                "put, two processes (us)",
                "get (us)",
                "miss (us)",
                "count (s)",
                "evict a tenth (s)",
                "MB on the device",
            ),
            rows,
        )
    )


@dataclass(frozen=True)
class Speed:
    """Wall-clock speed of blasts on a number of workers.

    Attributes:
        workers: Number of workers.
        blasts: Number of blasts.
        passed_s: Time until all were finished.
        alone_s: Sum of their times on the workers; NaN if not measured.
    """

    workers: int
    blasts: int
    passed_s: float
    alone_s: float = float("nan")

    @property
    def overhead_ms(self) -> float:
        """Time on a worker per blast besides the blast, including the wait for the next one."""
        return MS_PER_S * (self.workers * self.passed_s - self.alone_s) / self.blasts

    def row(self, what: str) -> tuple[str, ...]:
        """Return a row of the table."""
        numbers = (MS_PER_S * self.alone_s / self.blasts, self.overhead_ms)
        cells = ("-" if isnan(number) else f"{number:.1f}" for number in numbers)
        return (
            what,
            f"{self.workers}",
            f"{self.blasts}",
            f"{self.blasts / self.passed_s:.2f}",
            *cells,
        )


PAUSE_S: Final = 0.02


def on_workers(
    piece: Callable[[Layout], float], scenario: Scenario, workers: int, count: int
) -> Speed:
    """Time a piece of work for random layouts, submitted together, within `on_cluster`."""
    rng = np.random.default_rng(0)
    layouts = [random_layout(scenario, rng) for _ in range(count)]
    run_all(piece, layouts[: 4 * workers])  # so that all workers have loaded everything
    began_s = perf_counter()
    alone_s = sum(run_all(piece, layouts))
    return Speed(workers, count, perf_counter() - began_s, alone_s)


def _blast_s(scenario: Scenario, engine: str, layout: Layout) -> float:
    """Run a blast; return its time in s."""
    began_s = perf_counter()
    evaluator = BlastEvaluator(scenario, engine)
    evaluator.loads(layout, Threat(draw_charge(scenario, 0), 0))
    return perf_counter() - began_s


def _pause_s(_scenario: Scenario, _layout: Layout) -> float:
    """Sleep for `PAUSE_S`, with the arguments of a blast; return the time in s."""
    began_s = perf_counter()
    sleep(PAUSE_S)
    return perf_counter() - began_s


def training_on_workers(scenario: Scenario, engine: str, workers: int, episodes: int) -> Speed:
    """Time episodes of random placements in vectors of four environments per worker."""
    hyperparameters = load_hyperparameters("maskable_ppo", "default", {"n_envs": 4 * workers})
    configuration = RunConfiguration(
        settings=TrainingSettings(
            algorithm="maskable_ppo", scenario=scenario.name, steps=1, engine=engine
        ),
        hyperparameters=hyperparameters.model_copy(update={"env_wrapper": []}),
        scenario_hash=scenario.content_hash,
    )
    environments = make_environments(configuration, SingleScenario(scenario))
    environments.seed(0)
    environments.reset()
    rng, blasts, ended, passed_s = np.random.default_rng(0), np.zeros(4 * workers), 0, 0.0
    first = 0.0
    while ended < episodes + 4 * workers:  # the first episode of each loads everything
        began_s = perf_counter()
        masks = environments.env_method("action_masks")
        actions = np.array([rng.choice(np.flatnonzero(mask[:-1])) for mask in masks])
        *_, infos = environments.step(actions)
        passed_s += perf_counter() - began_s
        for index, info in enumerate(infos):
            if "blasts" in info:
                blasts[index] = info["blasts"]
                ended += 1
                if ended == 4 * workers:
                    first, passed_s = blasts.sum(), 0.0
    environments.close()
    return Speed(workers, int(blasts.sum() - first), passed_s)


@contextmanager
def local_workers(count: int) -> Iterator[None]:
    """Run blasts on workers of this machine, in the same way as on remote ones."""
    with import_extra("cluster", "workers"):
        from distributed import LocalCluster

    with (
        LocalCluster(n_workers=count, threads_per_worker=1, dashboard_address=None) as local,
        on_cluster(local.scheduler_address),
    ):
        yield


@app.command("workers")
def compare_workers(
    workers: Annotated[int, typer.Option(min=1, help="From 1 to so many.")] = 2,
    pauses: Annotated[int, typer.Option(min=1, help="Pieces that do nothing.")] = 500,
    gas_blasts: Annotated[int, typer.Option(min=1)] = 60,
    episodes: Annotated[int, typer.Option(min=1, help="Of training, with gas.")] = 32,
) -> None:
    """Print the speed of blasts and training on workers of this machine, and their overhead.

    Times are wall-clock times, so that blasts need as many idle cores as workers. The pauses
    measure the overhead per blast.
    """
    rows, site = [], yard()
    with user_errors(), progress_bar("workers") as progress:
        for count in range(1, workers + 1):
            with local_workers(count):
                pause = on_workers(partial(_pause_s, site), site, count, pauses)
                gas = on_workers(partial(_blast_s, site, "gas"), site, count, gas_blasts)
                training = training_on_workers(site, "gas", count, episodes)
            rows.append(pause.row(f"a pause of {MS_PER_S * PAUSE_S:.0f} ms"))
            rows += [gas.row("yard, gas"), training.row("yard, gas, training")]
            progress(count / workers)
    headers = ("what", "workers", "blasts", "blasts/s", "one takes (ms)", "beside it (ms)")
    print_line(f"{joblib.cpu_count()} cores")
    print_line(markdown_table(headers, rows))


@app.command("costs")
def unit_costs(
    scenario: Annotated[str, typer.Option(help="Bundled name, or a scenario file.")] = "courtyard",
    cell: Annotated[float, typer.Option(help="Side of the cells, m.")] = 0.5,
    blasts: Annotated[int, typer.Option(min=1, help="Gas blasts that are measured.")] = 5,
    million: Annotated[float, typer.Option(min=0.0, help="Millions of blasts planned.")] = 1.0,
    price: Annotated[float, typer.Option(min=0.0, help="Of a core hour, any currency.")] = 0.04,
) -> None:
    """Print the cost of a gas blast, and of millions: core hours, storage, money."""
    with user_errors(), TemporaryDirectory() as folder, progress_bar("gas blasts") as progress:
        site, rng = load_scenario(scenario), np.random.default_rng(0)
        engine = find_engine("gas", cell)
        evaluator = BlastEvaluator(site, engine, cache=folder)
        evaluator.loads((), Threat(draw_charge(site, 0), 0))  # loads everything
        began_s = process_time()
        for number in range(blasts):
            evaluator.loads(random_layout(site, rng), Threat(draw_charge(site, number), 0))
            progress((number + 1) / blasts)
        cpu_s = (process_time() - began_s) / blasts
        kept = [path.stat() for path in Path(folder).iterdir()]
    stored = fmean(each.st_size for each in kept)
    on_device = fmean(512 * each.st_blocks for each in kept)
    planned = million * 1e6
    hours = planned * cpu_s / 3600.0
    print_line(
        f"{site.name}, cells of {cell:g} m: {cpu_s:.2f} CPU s a blast (mean of {blasts} layouts), "
        f"{stored:,.0f} bytes kept, {on_device:,.0f} on the device"
    )
    print_line(
        f"{million:g} million blasts: {hours:,.0f} core hours, {hours / 64.0:,.0f} h on 64 cores, "
        f"{planned * on_device / 1e9:.1f} GB in {planned:,.0f} files, {hours * price:,.0f} at "
        f"{price:g} a core hour"
    )


if __name__ == "__main__":
    app()
