"""Many blasts in threads: the same results as one by one, in order, and errors that say which."""

import joblib
import pytest

from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import Blast, simulate_many
from blast_env.runner import run_all
from tests.pieces_of_work import kill, square, workers_within
from tests.scenarios import BALLISTIC_COURTYARD as COURTYARD

WALL = tuple((row, 0) for row in range(2, 12))
KEEP_OUT = (18, 0)
"""A cell of the courtyard that must stay empty."""


def blasts(count: int, engine: str = "event") -> list[Blast]:
    """Blasts that all differ: seeds, and every second one with a wall."""
    return [Blast(COURTYARD, WALL if seed % 2 else (), seed, engine) for seed in range(count)]


@pytest.mark.parametrize("threads", [1, 3])
def test_threads_change_nothing(threads: int) -> None:
    """Neither the order of the results nor a single bit of them."""
    alone = [blast.run().digest for blast in blasts(12)]
    assert [result.digest for result in simulate_many(blasts(12), threads)] == alone


def test_one_blast_may_be_given_twice() -> None:
    """Both runs work on the same scene at the same time."""
    blast = Blast(COURTYARD, seed=3, engine="event")
    first, second = simulate_many([blast, blast], threads=2)
    assert first.digest == second.digest
    assert first.obstacles is not second.obstacles


def test_progress_rises_to_one() -> None:
    shares: list[float] = []
    simulate_many(blasts(8), 2, shares.append)
    assert shares == [pytest.approx((done + 1) / 8) for done in range(8)]


@pytest.mark.parametrize("threads", [1, 3])
def test_an_error_says_which_blast(threads: int) -> None:
    """The first in order, whichever thread fails first."""
    wrong = [*blasts(4), Blast(COURTYARD, [KEEP_OUT], 4, "event"), Blast(COURTYARD, seed=-1)]
    with pytest.raises(BlastEnvError, match=r"^blasts\[4\]: cell \(18, 0\) must stay empty"):
        simulate_many(wrong, threads)


def test_a_wrong_seed_says_which_blast() -> None:
    with pytest.raises(BlastEnvError, match=r"^blasts\[1\]: seed is -1, must be an integer from 0"):
        simulate_many([Blast(COURTYARD, engine="event"), Blast(COURTYARD, seed=-1)], threads=2)


def test_blasts_after_an_error_do_not_run_first() -> None:
    """A mistake in the first of thousands must not take as long as all of them."""
    after = blasts(60)
    with pytest.raises(BlastEnvError, match=r"blasts\[0\]"):
        simulate_many([Blast(COURTYARD, [KEEP_OUT], engine="event"), *after], threads=1)
    begun = sum("scene" in vars(blast) for blast in after)
    assert begun < len(after)


@pytest.mark.parametrize("threads", [0, -2, 1.5, "2"])
def test_threads_out_of_bounds(threads: int) -> None:
    message = f"threads is {threads!r}, must be a whole number of at least 1"
    with pytest.raises(BlastEnvError, match=message):
        simulate_many(blasts(1), threads)


def test_a_worker_process_that_is_killed_is_an_error() -> None:
    """As the system does when the memory is full; no traceback of a pool."""
    with pytest.raises(BlastEnvError, match="a worker process has ended"):
        run_all(kill, range(2), workers=2)
    assert run_all(square, range(4), workers=2) == [0, 1, 4, 9]


def test_joblib_may_be_told_how_many_work() -> None:
    """By whoever calls, for all that runs within; without it one item comes after the other."""
    with joblib.parallel_config("threading", n_jobs=2):
        assert run_all(square, range(4)) == [0, 1, 4, 9]
        assert run_all(workers_within, range(1)) == [2]
    assert run_all(workers_within, range(2)) == [1, 1]
