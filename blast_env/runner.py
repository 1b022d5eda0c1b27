"""Many blasts at once, in threads of one process."""

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor

from blast_env.errors import BlastEnvError
from blast_env.simulation import Blast, BlastResult


def simulate_many(
    blasts: Sequence[Blast],
    threads: int = 1,
    progress: Callable[[float], None] | None = None,
) -> list[BlastResult]:
    """Run blasts to their ends, several at a time.

    The results are those of `Blast.run`, to the last bit, whatever the number of threads.

    Threads pay with the engine `event`: its compiled loop lets other threads run, and nothing has
    to be copied from process to process. The preparation of a blast and its result are Python,
    which one thread at a time runs. With `pymunk` threads change nothing but the order of the
    work; there use processes.

    Args:
        blasts: The blasts.
        threads: How many run at the same time; more than there are cores do not help.
        progress: Called in the caller's thread with the share of the blasts that is done.

    Returns:
        The results, in the order of the blasts.

    Raises:
        BlastEnvError: If `threads` is not a whole number of at least 1, or if a blast cannot be
            run; the message says which, the first one of them. Those that have not begun yet are
            left out then.
    """
    if not isinstance(threads, int) or threads < 1:
        raise BlastEnvError(f"threads is {threads!r}, must be a whole number of at least 1")
    results: list[BlastResult] = []
    with ThreadPoolExecutor(min(threads, len(blasts)) or 1) as pool:
        running = [pool.submit(blast.run) for blast in blasts]
        try:
            for number, future in enumerate(running):
                results.append(_result_of(future, number))
                if progress is not None:
                    progress(len(results) / len(blasts))
        except BaseException:  # an interruption as well: do not first run what is left
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return results


def _result_of(future: "Future[BlastResult]", number: int) -> BlastResult:
    """Wait for a result; an error of the user's says which blast it came from."""
    try:
        return future.result()
    except ValueError as error:  # what unusable arguments cause, `BlastEnvError` among it
        raise BlastEnvError(f"blasts[{number}]: {error}") from error
