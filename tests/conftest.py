"""Settings for all tests."""

import gc
import multiprocessing
import os
import sys
from collections.abc import Iterator

# Two threads for small sums cost many times what one does where workers share the cores. Set before
# NumPy and torch are imported.
os.environ.setdefault("OMP_NUM_THREADS", "1")

import hypothesis  # looks for what refers to it, which is not found once frozen
import pytest
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from tests.coverage import RARE
from tests.figures import DRAW, undrawn_figures

# Its workers do not ask for it. Set before the package is imported.
measured = getattr(sys.modules.get("slipcover.pytest_plugin"), "_slipcover_instance", None)
if measured is not None:
    measured.d_miss_threshold = RARE

# The modules that tests import, and the tests, all stay: it would look through them for nothing,
# which takes a third of their time. Afterwards most of what becomes garbage needs no collector.
gc.disable()
gc.set_threshold(20_000, 20, 20)

# Windows of render_mode="human" need no screen here. Set before pygame is imported.
os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
# Tables are as wide as in a pipe, whatever the terminal that runs the tests.
os.environ.pop("COLUMNS", None)
# TorchRL, once imported, has every process of Python's started from nothing, which takes seconds;
# it leaves alone what has been chosen, and asking chooses Python's own way.
multiprocessing.get_start_method()


# The same examples every time; "many" draws others, and finds what these do not.
hypothesis.settings.register_profile("quick", max_examples=10, deadline=None, derandomize=True)
hypothesis.settings.register_profile("many", max_examples=2000, deadline=None)
hypothesis.settings.load_profile("quick")


@pytest.fixture(autouse=True, scope="session")
def _nothing_here_outlives_a_power_failure() -> Iterator[None]:
    """Spare the tests the waiting for disks; processes that they start and kill still do wait."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda _: None)
        yield


@pytest.fixture(autouse=True, scope="session")
def _files_are_read_in_this_process() -> Iterator[None]:
    """Spare tests of what is in a file a process for each reading, unless they ask for `apart`."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("BLAST_ENV_READING", "1")
        yield


@pytest.fixture
def apart(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read files in processes of their own, as outside the tests."""
    monkeypatch.delenv("BLAST_ENV_READING")


LAY_OUT = ConstrainedLayoutEngine.execute


@pytest.fixture(autouse=True, scope="session")
def _figures_are_laid_out_in_no_time() -> Iterator[None]:
    """Leave the parts of figures where they begin, unless a test asks for `laid_out`."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ConstrainedLayoutEngine, "execute", lambda *_: None)
        yield


@pytest.fixture
def laid_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lay figures out: for tests that look at where things come to lie."""
    monkeypatch.setattr(ConstrainedLayoutEngine, "execute", LAY_OUT)


@pytest.fixture
def undrawn() -> Iterator[None]:
    """Leave figures empty. Packages of tests have a fixture of their own, which ends with them."""
    with undrawn_figures():
        yield


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw figures, among tests that leave them empty."""
    monkeypatch.setattr(Figure, "draw", DRAW)


def pytest_collection_finish() -> None:
    """Spare the collector, and processes that are forked, the modules and tests that stay."""
    gc.collect()
    gc.freeze()
    gc.enable()
