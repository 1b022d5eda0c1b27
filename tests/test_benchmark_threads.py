"""The scaling of threads is measured on what it says; how good it is needs idle cores."""

import pytest

from blast_env.errors import BlastEnvError
from blast_env.studies.benchmark.parallel import ThreadFigures, measure_threads
from tests.scenarios import BALLISTIC_COURTYARD

SHORT = BALLISTIC_COURTYARD.with_simulation(
    overrides={"stepping": {"time_limit_s": 0.01}, "air": {"spacing_units": 3.0}}
)


def test_twice_as_fast_is_a_scaling_of_two() -> None:
    assert ThreadFigures(40, 2, one_thread_s=3.0, all_threads_s=1.5).scaling == 2.0


def test_both_are_timed_on_the_same_whole_number_of_blasts_a_thread() -> None:
    figures = measure_threads(SHORT, threads=3, repeats=1)
    assert figures.threads == 3
    assert figures.blasts % 3 == 0
    assert figures.blasts >= 12
    assert figures.one_thread_s > 0.0 < figures.all_threads_s


def test_no_threads_are_refused() -> None:
    with pytest.raises(BlastEnvError, match="threads is 0"):
        measure_threads(SHORT, threads=0, repeats=1)
