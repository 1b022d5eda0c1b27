"""Work on other machines: a joblib backend that hands it to a Dask cluster.

Not joblib's own backend for Dask: that one waits for ever for work whose worker was killed too
often or whose scheduler has gone, and keeps no more under way than the workers that are there at
the start can do.
"""

import asyncio
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import joblib
from joblib.parallel import ParallelBackendBase, SequentialBackend

from blast_env.documents import DocumentError, checked_as, parse_json, read_text
from blast_env.errors import BlastEnvError, import_extra
from blast_env.provenance import code_digest, versions

if TYPE_CHECKING:
    from distributed import Client, Future

_CONNECT_S: Final = 10.0
_UNDER_WAY: Final = 500
"""Pieces of work that the scheduler has at least, so that workers that come later find some."""
_OWN: Final = ("blast_env", "blast_agents")
_OTHERS: Final = ("numba", "numpy", "pymoo", "pymunk", "scipy")
"""The packages that the bits of a result may depend on."""


class ClusterSize(NamedTuple):
    """What a cluster has at the moment; more may come.

    Attributes:
        workers: Worker processes.
        threads: Their threads, each of which does one piece of work at a time.
    """

    workers: int
    threads: int


@contextmanager
def on_cluster(address: str | Path) -> Iterator[ClusterSize]:
    """Let the workers of a Dask cluster do in this block what `blast_env.runner` is given.

    Results are those of this machine, and they are kept here, as soon as they are there. A worker
    that dies costs what it was doing: that is done again by another. Workers must have the code
    and the versions that this process has; work is refused by one that has not.

    Args:
        address: Of the scheduler, e.g. `"tcp://login1:8786"`, or the path of its scheduler file.

    Yields:
        How large the cluster is.

    Raises:
        MissingExtraError: If the extra `cluster` is not installed.
        BlastEnvError: If no scheduler answers. In the block, out of the runner: if the connection
            is lost, or the same piece of work has killed worker after worker.
    """
    client = _connect(str(address))
    try:
        threads = client.ncores()
        with joblib.parallel_config(backend=ClusterBackend(client), n_jobs=-1):
            yield ClusterSize(len(threads), sum(threads.values()))
    finally:
        client.close(timeout=_CONNECT_S)


def _connect(address: str) -> "Client":
    with import_extra("cluster", "work on a cluster"):
        from distributed import Client

    scheduler = address_of(address)
    try:
        # A client that finds nobody leaves a thread behind: so first see whether one answers.
        with ThreadPoolExecutor(1) as pool:  # in a notebook this thread has an event loop already
            pool.submit(asyncio.run, _knock(scheduler)).result()
        return Client(scheduler, timeout=_CONNECT_S, set_as_default=False, name="blast-env")
    except (OSError, ValueError, TypeError) as error:  # no answer; no address
        raise BlastEnvError(f"cluster {address!r}: no scheduler answers: {error}") from error


@dataclass(frozen=True)
class _SchedulerFile:
    """What is read of a scheduler file, which says much more."""

    address: str


def address_of(scheduler: str) -> str:
    """Return the address of a scheduler.

    Args:
        scheduler: The address, or the path of its scheduler file.

    Raises:
        BlastEnvError: If a scheduler file cannot be read.
    """
    if not os.path.isfile(scheduler):
        return scheduler
    try:
        return checked_as(_SchedulerFile, parse_json(read_text(Path(scheduler)))).address
    except DocumentError as error:
        raise BlastEnvError(f"cluster {scheduler!r}: is no scheduler file: {error}") from error


async def _knock(address: str) -> None:
    from distributed.comm import connect
    from distributed.security import Security

    comm = await connect(address, _CONNECT_S, **Security().get_connection_args("client"))
    await comm.close()


class _Done(NamedTuple):
    """A piece of work that has come to its end, and what is to be told of it."""

    future: "Future"
    tell: Callable[["_Outcome"], None]


class _Outcome(NamedTuple):
    """What a piece of work has returned, or why it has not."""

    result: Any = None
    error: BaseException | None = None


class ClusterBackend(ParallelBackendBase):
    """Hands each piece of work to the scheduler by itself; fetches results as many as there are.

    Args:
        client: Connected to the scheduler.
    """

    supports_retrieve_callback = True
    default_n_jobs = -1

    def __init__(self, client: "Client") -> None:
        super().__init__(nesting_level=0)
        self._client = client
        self._done: SimpleQueue[_Done | None] = SimpleQueue()
        self._under_way: set[Future] = set()

    def effective_n_jobs(self, n_jobs: int | None) -> int:  # noqa: ARG002
        """Return how many pieces of work are kept under way, whatever number is asked for."""
        threads: int = sum(self._client.ncores().values())
        return max(2 * threads, _UNDER_WAY)

    def start_call(self) -> None:
        """Begin to fetch results, in a thread that ends with `stop_call`."""
        self._done = SimpleQueue()
        Thread(target=self._fetch, args=(self._done,), daemon=True).start()

    def stop_call(self) -> None:
        """Fetch no more."""
        self._done.put(None)

    def submit(self, func: Callable[[], Any], callback: Callable[[_Outcome], None]) -> "Future":
        """Hand over a piece of work, and have `callback` called with what comes of it."""
        future = self._client.submit(_do, func, _origin(), pure=False)
        self._under_way.add(future)
        done = self._done
        future.add_done_callback(lambda future: done.put(_Done(future, callback)))
        return future

    def retrieve_result_callback(self, outcome: _Outcome) -> Any:
        """Return the result of a piece of work, or raise what it raised."""
        if outcome.error is not None:
            raise _told(outcome.error)
        return outcome.result

    def abort_everything(self, ensure_ready: bool = True) -> None:  # noqa: ARG002
        """Let go of what has not begun; workers end the piece that they are at."""
        under_way, self._under_way = self._under_way, set()
        self._client.cancel(list(under_way))

    def get_nested_backend(self) -> tuple[ParallelBackendBase, None]:
        """Return what a piece of work shares its own work out with: nobody."""
        return SequentialBackend(nesting_level=1), None

    def _fetch(self, queue: "SimpleQueue[_Done | None]") -> None:
        """Fetch results until there is nothing more to come: all that are there in one go."""
        is_over = False
        while not is_over:
            taken = [queue.get()]
            while not queue.empty():
                taken.append(queue.get())
            done = [each for each in taken if each is not None]
            is_over = len(done) < len(taken)
            for (future, tell), outcome in zip(done, self._outcomes(done), strict=True):
                self._under_way.discard(future)
                tell(outcome)

    def _outcomes(self, done: Sequence[_Done]) -> list[_Outcome]:
        futures = [future for future, _ in done]
        if all(future.status == "finished" for future in futures):
            try:
                return [_Outcome(result) for result in self._client.gather(futures)]
            except Exception:  # one has gone meanwhile: which, they say each for itself
                pass
        return [_outcome(future) for future in futures]


def _outcome(future: "Future") -> _Outcome:
    try:
        return _Outcome(future.result())
    except Exception as error:
        return _Outcome(error=error)


def _told(error: BaseException) -> BaseException:
    """Return an error of the cluster as one that says what happened; any other as it is."""
    from distributed import KilledWorker
    from distributed.comm import CommClosedError

    if isinstance(error, KilledWorker):
        told = BlastEnvError(
            f"cluster: a piece of work has ended {error.allowed_failures + 1} workers, for want "
            f"of memory or because they were killed; the last one was {error.last_worker.address}"
        )
    elif isinstance(error, CancelledError | CommClosedError):
        told = BlastEnvError(
            "cluster: the connection to the scheduler was lost; what is done is kept where the "
            "command has a folder for it, and the same command goes on"
        )
    else:
        return error
    told.__cause__ = error
    return told


def _do(work: Callable[[], Any], origin: str) -> Any:
    """Do a piece of work on a worker that would do it as the process that asks for it."""
    if _origin() != origin:
        raise BlastEnvError(
            f"cluster: a worker has {_origin()}, must have what asks for the work: {origin}"
        )
    return work()


@cache
def _origin() -> str:
    """Return the code and the versions that the result of a piece of work depends on."""
    specs = (find_spec(name) for name in _OWN)
    folders = (Path(spec.origin).parent for spec in specs if spec is not None and spec.origin)
    known = versions(packages=_OTHERS)
    return ", ".join(
        [
            f"blast-env {known['blast_env']}+{'+'.join(map(code_digest, folders))}",
            *(f"{name} {known[name]}" for name in _OTHERS),
        ]
    )
