"""Independent pieces of work in parallel, on this machine or on a cluster (`on_cluster`)."""

import os
import socket
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import closing
from functools import partial
from typing import Any, Literal, TypeVar, overload
from warnings import catch_warnings, simplefilter

import joblib
from joblib.parallel import get_active_backend

from blast_env.errors import BlastEnvError

Item = TypeVar("Item")
Result = TypeVar("Result")

ProgressCallback = Callable[[float], None]
"""A callback for the finished share of some work, 0 to 1."""


def run_all(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    workers: int = 1,
    progress: ProgressCallback | None = None,
) -> list[Result]:
    """Return the results of all items in their order, computed in parallel processes.

    Results do not depend on the number of workers. When an item raises, items that have not begun
    are left out; of several errors the first in the order of the items is raised. If joblib has
    another backend (`joblib.parallel_config`, `on_cluster`), that one does the work, with its
    number of workers if that is larger.

    Args:
        function: Does one item; it and the items must pickle.
        items: The work; a single item is done in this process.
        workers: Number of items in progress at the same time; 1 for this process alone.
        progress: Called with the finished share of the items.
    """
    check_workers("workers", workers)
    count = _processes(workers, len(items))
    here = count == 1
    found = map(function, items) if here else _parallel(function, items, count, "generator")
    results: list[Result] = []
    for result in found:
        results.append(result)
        if progress is not None:
            progress(len(results) / len(items))
    return results


def as_completed(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    workers: int = 1,
) -> Iterator[tuple[int, Result]]:
    """Yield (index, result) of each item as soon as it is finished, so that it can be saved.

    Arguments and errors are those of `run_all`.
    """
    check_workers("workers", workers)
    count = _processes(workers, len(items)) if len(items) > 1 else 1
    if count == 1:
        return enumerate(map(function, items))
    numbered = partial(_numbered, function)
    return _parallel(numbered, list(enumerate(items)), count, "generator_unordered")


def configured_workers() -> int:
    """Return the number of workers set for joblib (`on_cluster`), by default 1."""
    return int(joblib.effective_n_jobs(None))


@overload
def share_of(
    progress: ProgressCallback, done: int, whole: int, part: int = 1
) -> ProgressCallback: ...
@overload
def share_of(
    progress: ProgressCallback | None, done: int, whole: int, part: int = 1
) -> ProgressCallback | None: ...
def share_of(
    progress: ProgressCallback | None, done: int, whole: int, part: int = 1
) -> ProgressCallback | None:
    """Return a callback that converts the share of a part to a share of the whole.

    Args:
        done: Amount of the whole before the part.
        whole: Total amount.
        part: Amount of the part.
    """
    if progress is None:
        return None
    return lambda share: progress((done + share * part) / whole)


def check_workers(name: str, workers: int) -> None:
    """Refuse a number of workers that is not a whole number of at least 1 (`BlastEnvError`)."""
    if not isinstance(workers, int) or isinstance(workers, bool) or workers < 1:
        raise BlastEnvError(f"{name} is {workers!r}, must be a whole number of at least 1")


def _numbered(function: Callable[[Any], Any], numbered: tuple[int, Any]) -> tuple[int, Any]:
    index, item = numbered
    return index, function(item)


def _watched(function: Callable[[Any], Any], parent: int, host: str, item: Any) -> Any:
    """Do an item in a worker, which ends with the process that started it."""
    if os.getppid() == parent and socket.gethostname() == host:
        from blast_env.processes import end_with  # as in `_parallel`

        end_with(parent)
    return function(item)


def _processes(workers: int, items: int) -> int:
    """Return the number of processes for the work; 1 for this process alone."""
    return max(min(max(workers, configured_workers()), items), 1)


def _parallel(
    function: Callable[[Any], Any],
    items: Sequence[Any],
    workers: int,
    return_as: Literal["generator", "generator_unordered"],
) -> Iterator[Any]:
    backend: Any = get_active_backend()[0]
    if hasattr(backend, "outcomes"):  # of a cluster
        outcomes = backend.outcomes(function, items)
        yield from _in_order(outcomes, in_order=return_as == "generator")
        return
    from blast_env.processes import uninterrupted  # only where processes are started

    parallel = joblib.Parallel(workers, prefer="processes", return_as=return_as)
    watched = partial(_watched, function, os.getpid(), socket.gethostname())
    try:
        with uninterrupted():
            found = parallel(joblib.delayed(watched)(item) for item in items)
        try:
            for result in found:  # noqa: UP028  # `yield from` would close with the warning
                yield result
        except BaseException:
            with catch_warnings():
                # It advises whoever stops, as Ctrl-C does, to ask for less work.
                simplefilter("ignore", UserWarning)
                found.close()
            raise
    except BrokenExecutor as error:
        raise BlastEnvError(
            "a worker process has ended, for lack of memory or because it was killed; results so "
            "far are kept if the command has a folder for them, and the same command resumes"
        ) from error


def _in_order(outcomes: Iterator[tuple[int, Any]], *, in_order: bool) -> Iterator[Any]:
    """Yield the results of outcomes, by index where asked for; the first error ends them."""
    with closing(outcomes):  # type: ignore[type-var]  # a generator
        kept: dict[int, Any] = {}
        due = 0
        for index, outcome in outcomes:
            if not in_order:
                yield outcome.get()
                continue
            kept[index] = outcome
            while due in kept:
                yield kept.pop(due).get()
                due += 1
