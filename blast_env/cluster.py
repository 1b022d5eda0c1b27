"""Work on other machines: a joblib backend for a Dask cluster.

joblib's own Dask backend waits for ever for work whose worker was killed too often or whose
scheduler has gone, and joblib asks a backend for results a hundred times a second. So the runner
takes them from here as they arrive. Sections of scenario files, and whole scenarios, are sent once:
a blast travels as its layout and threat, and a worker keeps what it has derived from the site.
"""

import asyncio
import logging
import os
import pickle
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial
from importlib.util import find_spec
from io import BytesIO
from itertools import groupby
from math import inf
from pathlib import Path
from queue import SimpleQueue
from time import monotonic
from typing import TYPE_CHECKING, Any, Final, NamedTuple
from uuid import uuid4

import joblib
from cloudpickle import CloudPickler
from joblib.parallel import ParallelBackendBase

from blast_env.documents import DocumentError, checked_as, parse_json, read_text
from blast_env.errors import BlastEnvError, import_extra, value_text
from blast_env.provenance import code_digest, versions
from blast_env.sections import Section

if TYPE_CHECKING:
    from distributed import Client, Future

_CONNECT_S: Final = 10.0
_UNDER_WAY: Final = 500
"""Least number of submitted pieces of work, so that workers that join later find some."""
_SIZE_KEPT_S: Final = 5.0
"""Time for which the number of threads is not asked for again."""
_MOST_SENT: Final = 256
"""Most sections that stay on the cluster for further work."""
_OWN: Final = ("blast_env", "blast_agents")
_OTHERS: Final = ("numba", "numpy", "pymoo", "pymunk", "scipy")
"""Packages on which the bits of a result may depend."""


_OF_THE_CONNECTION: Final = (
    "distributed.batched",
    "distributed.client",
    "distributed.comm",
    "distributed.core",
    "distributed.utils",
    "tornado.application",
)
"""Loggers that report a lost connection with tracebacks, which an error says already."""


class ClusterSize(NamedTuple):
    """The present size of a cluster, which may grow.

    Attributes:
        workers: Number of worker processes.
        threads: Number of their threads; each does one piece of work at a time.
    """

    workers: int
    threads: int


@contextmanager
def on_cluster(address: str | Path) -> Iterator[ClusterSize]:
    """Run the work of `blast_env.runner` in this block on the workers of a Dask cluster.

    Results equal those of this machine and are kept here as soon as they arrive. The work of a
    worker that dies is done again by another. Workers must have the code and the versions of this
    process; a worker with others refuses the work.

    Args:
        address: Address of the scheduler, e.g. `"tcp://login1:8786"`, or path of its scheduler
            file.

    Yields:
        The size of the cluster.

    Raises:
        MissingExtraError: If the extra `cluster` is not installed.
        BlastEnvError: If no scheduler answers. In the block, from the runner: if the connection
            is lost, or the same piece of work has killed several workers in turn.
    """
    client = _connect(str(address))
    with _silent(_OF_THE_CONNECTION):
        try:
            size = _size(client)
            with joblib.parallel_config(backend=ClusterBackend(client), n_jobs=-1):
                yield size
        finally:
            client.close(timeout=_CONNECT_S)


def _size(client: "Client") -> ClusterSize:
    try:
        threads = client.ncores()
    except OSError as error:
        raise _lost() from error
    return ClusterSize(len(threads), sum(threads.values()))


@contextmanager
def _silent(names: Sequence[str]) -> Iterator[None]:
    """Let loggers be silent in this block."""
    loggers = [logging.getLogger(name) for name in names]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


def _connect(address: str) -> "Client":
    with import_extra("cluster", "work on a cluster"):
        from distributed import Client

    scheduler = address_of(address)
    try:
        # A client that finds no scheduler leaves a thread behind, so try a connection first.
        with ThreadPoolExecutor(1) as pool:  # in a notebook this thread has an event loop already
            pool.submit(asyncio.run, _knock(scheduler)).result()
        return Client(scheduler, timeout=_CONNECT_S, set_as_default=False, name="blast-env")
    except (OSError, ValueError, TypeError) as error:  # no answer; no address
        raise BlastEnvError(
            f"cluster {value_text(address)}: no scheduler answers: {error}"
        ) from error


@dataclass(frozen=True)
class _SchedulerFile:
    """The only part of a scheduler file that is read."""

    address: str


def address_of(scheduler: str) -> str:
    """Return the address of a scheduler.

    Args:
        scheduler: The address, or the path of its scheduler file.
    """
    if not os.path.isfile(scheduler):
        return scheduler
    try:
        return checked_as(_SchedulerFile, parse_json(read_text(Path(scheduler)))).address
    except DocumentError as error:
        raise BlastEnvError(
            f"cluster {value_text(scheduler)}: is no scheduler file: {error}"
        ) from error


async def _knock(address: str) -> None:
    from distributed.comm import connect
    from distributed.security import Security

    comm = await connect(address, _CONNECT_S, **Security().get_connection_args("client"))
    await comm.close()


class Outcome(NamedTuple):
    """The result of a piece of work, or its error."""

    result: Any = None
    error: BaseException | None = None

    def get(self) -> Any:
        """Return the result, or raise the error."""
        if self.error is not None:
            raise _known(self.error)
        return self.result


class ClusterBackend(ParallelBackendBase):
    """Submits pieces of work, many in one message; fetches all finished results together.

    Args:
        client: A client connected to the scheduler.

    Attributes:
        work_bytes: Bytes of all work sent so far, without sections.
        section_bytes: Bytes of each section sent.
    """

    default_n_jobs = -1

    def __init__(self, client: "Client") -> None:
        super().__init__(nesting_level=0)
        self._client = client
        self._sent: OrderedDict[int, _SectionOnCluster] = OrderedDict()
        self._counted_s, self._count = -inf, 0
        self._fetched_before: list[Future] = []
        self.work_bytes = 0
        self.section_bytes: list[int] = []

    def effective_n_jobs(self, n_jobs: int | None) -> int:  # noqa: ARG002
        """Return the number of pieces of work to keep submitted; `n_jobs` does not change it."""
        if monotonic() > self._counted_s + _SIZE_KEPT_S:
            self._count = max(2 * _size(self._client).threads, _UNDER_WAY)
            self._counted_s = monotonic()
        return self._count

    def outcomes(
        self, function: Callable[[Any], Any], items: Sequence[Any]
    ) -> Iterator[tuple[int, Outcome]]:
        """Yield (index, outcome) of each item as soon as it is finished.

        What has not begun when the iteration ends is withdrawn.

        Args:
            function: Does one item.
        """
        done: SimpleQueue[tuple[int, Future]] = SimpleQueue()
        under_way: dict[int, Future] = {}
        submitted = 0
        try:
            while submitted < len(items) or under_way:
                room = self.effective_n_jobs(None) - len(under_way)
                some = items[submitted : submitted + room]
                for index, future in enumerate(self._submitted(function, some), submitted):
                    under_way[index] = future
                    future.add_done_callback(partial(_note, done, index))
                submitted += len(some)
                if some:  # only now: a client says at once what comes first, the rest 10 ms later
                    self._fetched_before.clear()
                # Waits for one, then takes all that are there: one message fetches many results.
                taken = [done.get()]
                while not done.empty():
                    taken.append(done.get())
                futures = [under_way.pop(index) for index, _ in taken]
                self._fetched_before += futures
                found = self._fetched(futures)
                yield from zip([index for index, _ in taken], found, strict=True)
        finally:
            if under_way:
                self._client.cancel(list(under_way.values()))

    def _submitted(
        self, function: Callable[[Any], Any], items: Sequence[Any]
    ) -> "Iterator[Future]":
        """Submit items in their order; those in a row with the same sections in one message."""
        packed = [self._packed(partial(function, item)) for item in items]
        for _, group in groupby(packed, key=lambda pair: [future.key for future in pair[1]]):
            own = list(group)
            work, common = [piece for piece, _ in own], own[0][1]
            # Of keys of one group the scheduler hands out one at a time, as workers get free.
            keys = [f"{_do.__name__}-{uuid4()}" for _ in own]
            yield from self._client.map(_do, work, key=keys, origin=_origin(), common=common)

    def _packed(self, work: Callable[[], Any]) -> "tuple[bytes, list[Future]]":
        """Return a piece of work as bytes without its sections, and those, which are sent once."""
        common: dict[int, Future] = {}
        buffer = BytesIO()
        _Packer(buffer, lambda section: self._place(section, common)).dump(work)
        packed = buffer.getvalue()
        self.work_bytes += len(packed)
        return packed, list(common.values())

    def _place(self, section: Section, common: "dict[int, Future]") -> int:
        """Return the place of a section among those of a piece of work."""
        key = id(section)
        sent = self._sent.get(key)
        if sent is None:
            # A site is sent once for all of its blasts: what follows it has its place alone.
            packed = pickle.dumps(section)
            self.section_bytes.append(len(packed))
            content = self._client.submit(_unpacked, packed, _origin(), pure=False)
            sent = self._sent[key] = _SectionOnCluster(section, content)
            if len(self._sent) > _MOST_SENT:
                self._sent.popitem(last=False)
        self._sent.move_to_end(key)
        common.setdefault(key, sent.content)
        return list(common).index(key)

    def _fetched(self, futures: "Sequence[Future]") -> list[Outcome]:
        if all(future.status == "finished" for future in futures):
            try:
                return [Outcome(result) for result in self._client.gather(list(futures))]
            except Exception:  # one was lost meanwhile; each is fetched separately below
                pass
        return [_outcome(future) for future in futures]


def _note(done: "SimpleQueue[tuple[int, Future]]", index: int, future: "Future") -> None:
    done.put((index, future))


def _outcome(future: "Future") -> Outcome:
    try:
        return Outcome(future.result())
    except Exception as error:
        return Outcome(error=error)


def _known(error: BaseException) -> BaseException:
    """Return an error of the cluster as a `BlastEnvError` with the cause; any other unchanged."""
    from distributed import KilledWorker
    from distributed.comm import CommClosedError

    if isinstance(error, KilledWorker):
        reworded = BlastEnvError(
            f"cluster: one task has ended {error.allowed_failures + 1} workers, for lack "
            f"of memory or because they were killed; the last one was {error.last_worker.address}"
        )
    elif isinstance(error, CancelledError | CommClosedError):
        reworded = _lost()
    else:
        return error
    reworded.__cause__ = error
    return reworded


def _lost() -> BlastEnvError:
    return BlastEnvError(
        "cluster: the connection to the scheduler was lost; results so far are kept if the "
        "command has a folder for them, and the same command resumes"
    )


class _SectionOnCluster(NamedTuple):
    """A section that workers have, or can get from another, and its place on the cluster.

    The section itself is kept, so that no other takes its identity.
    """

    section: Section
    content: "Future"


class _Packer(CloudPickler):
    """Puts places in the place of sections.

    Args:
        buffer: Where the bytes go.
        place: Returns the place of a section.
    """

    def __init__(self, buffer: BytesIO, place: Callable[[Section], int]) -> None:
        super().__init__(buffer)
        self._place = place

    def persistent_id(self, obj: Any) -> int | None:
        return self._place(obj) if isinstance(obj, Section) else None


class _Unpacker(pickle.Unpickler):
    """Puts sections in the place of their places; see `_Packer`."""

    def __init__(self, packed: bytes, common: Sequence[Section]) -> None:
        super().__init__(BytesIO(packed))
        self._common = common

    def persistent_load(self, pid: int) -> Section:
        return self._common[pid]


def _do(packed: bytes, origin: str, common: Sequence[Section]) -> Any:
    """Do a piece of work, on a worker with the code and versions of the submitting process."""
    _check(origin)
    return _Unpacker(packed, common).load()()


def _unpacked(packed: bytes, origin: str) -> Section:
    """Return a section, on such a worker."""
    _check(origin)
    section: Section = pickle.loads(packed)
    return section


def _check(origin: str) -> None:
    if _origin() != origin:
        raise BlastEnvError(
            f"cluster: a worker has {_origin()}, must have that of the submitter: {origin}"
        )


@cache
def _origin() -> str:
    """Return the code digests and versions on which the result of a piece of work depends."""
    # Bits depend on this code, and on the libraries whose kernels add in another order.
    specs = (find_spec(name) for name in _OWN)
    folders = (Path(spec.origin).parent for spec in specs if spec is not None and spec.origin)
    known = versions(packages=_OTHERS)
    return ", ".join(
        [
            f"blast-env {known['blast_env']}+{'+'.join(map(code_digest, folders))}",
            *(f"{name} {known[name]}" for name in _OTHERS),
        ]
    )
