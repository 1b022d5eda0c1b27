"""How many more blasts several threads of `simulate_many` run in the same time than one."""

from dataclasses import dataclass
from math import ceil
from time import perf_counter, process_time
from typing import Final

from blast_env.batch import simulate_many
from blast_env.scenario import Scenario
from blast_env.simulation import Blast

_LOT_S: Final = 1.0
"""One thread takes about this long for the blasts that are timed."""
_TRIED: Final = 4
"""Blasts that are run to see how many that is."""
_FEWEST: Final = 4
"""Blasts of each thread at least, so that a long one at the end weighs little."""


@dataclass(frozen=True)
class ThreadFigures:
    """Time by the clock of the same blasts in one thread and in several.

    Attributes:
        blasts: How many blasts.
        threads: How many threads.
        one_thread_s: The least over the repeats.
        all_threads_s: Likewise.
    """

    blasts: int
    threads: int
    one_thread_s: float
    all_threads_s: float

    @property
    def scaling(self) -> float:
        """How many times faster the threads are than one."""
        return self.one_thread_s / self.all_threads_s


def measure_threads(scenario: Scenario, threads: int, repeats: int) -> ThreadFigures:
    """Time blasts on the event engine in one thread and in several, in turn.

    By the clock, because what counts is when the last blast is done. Whatever else runs on the
    machine takes cores from the threads: as many cores as threads have to be idle, and the least
    over the repeats counts.

    Args:
        scenario: The scenario.
        threads: How many threads.
        repeats: How often each is timed.

    Raises:
        BlastEnvError: If `threads` is not a whole number of at least 1.
    """
    simulate_many([_blast(scenario, 0)], threads)  # compiles, where nothing is on disk yet
    start = process_time()
    for seed in range(_TRIED):
        _blast(scenario, seed).run()
    of_each = ceil(_LOT_S * _TRIED / (process_time() - start) / threads)
    blasts = threads * max(of_each, _FEWEST)
    pairs = [
        (_clocked(scenario, blasts, 1), _clocked(scenario, blasts, threads)) for _ in range(repeats)
    ]
    one_thread_s, all_threads_s = (min(column) for column in zip(*pairs, strict=True))
    return ThreadFigures(blasts, threads, one_thread_s, all_threads_s)


def _blast(scenario: Scenario, seed: int) -> Blast:
    return Blast(scenario, seed=seed, engine="event")


def _clocked(scenario: Scenario, blasts: int, threads: int) -> float:
    """Return how long so many blasts take by the clock; they are laid out anew each time."""
    start = perf_counter()
    simulate_many([_blast(scenario, seed) for seed in range(blasts)], threads)
    return perf_counter() - start
