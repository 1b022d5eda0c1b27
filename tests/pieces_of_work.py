"""Work for the workers of a pool: apart from the tests, whose imports take seconds."""

import os
import signal

import joblib


def square(number: int) -> int:
    """Return the square of a number."""
    return number * number


def kill(_: int) -> None:
    """End the process that does it, as no error does."""
    os.kill(os.getpid(), signal.SIGKILL)


def workers_within(_: int) -> int:
    """Return how many workers joblib would use here."""
    return int(joblib.effective_n_jobs(None))
