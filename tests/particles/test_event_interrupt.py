"""Ctrl-C is heard while compiled code runs, and costs nothing of what a run comes to."""

import signal
import time

import numpy as np
import pytest

from blast_env.evaluation.engines import Blast
from blast_env.evaluation.engines.particles import EventEngine
from blast_env.particles.event.engine import EventRun
from blast_env.site.scene import Scene
from tests.builders import point, site, square


def touching_air() -> Scene:
    """Return air whose balls touch each other: a hundred thousand events in one moment."""
    air = {"spacing_units": 2.0, "radius_units": 1.0, "elasticity": 1.0, "jitter": 0.0}
    house = square("house", 8.0, 4.0, 4, protected=True)
    model = {"preset": "ballistic", "overrides": {"air": air}}
    scenario = site("touching_air", (20.0, 20.0), point(5.0, 5.0), house, simulation=model)
    return Blast(scenario, (), 0, "event").scene


def outcome(run: EventRun) -> tuple[float, int, bytes, bytes]:
    run.advance(np.inf)
    return run.time_s, run.steps, run.log.to_array().tobytes(), run.balls().position.tobytes()


def test_an_interrupted_run_goes_on_to_the_same_end() -> None:
    whole = outcome(EventEngine().start(touching_air()))
    run = EventEngine().start(touching_air())
    run.advance(1e-6)
    # An alarm of the system: a thread might wait for the processor until the run has ended.
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    began_s = time.perf_counter()
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.02)
        with pytest.raises(KeyboardInterrupt):
            run.advance(np.inf)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert time.perf_counter() - began_s < 2.0
    assert outcome(run) == whole
