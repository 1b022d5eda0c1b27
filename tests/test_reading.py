"""Reading in a process of its own: what it gives back, and what ends it."""

import sys
import threading
import time
from pathlib import Path

import pytest

from blast_env.errors import BlastEnvError
from blast_env.parquet import checked_table
from blast_env.reading import Reading, ReadingError, ReadingLimits, read_apart
from tests.pieces_of_reading import die, double, fault, fill, refuse, spin

BLASTS = Path(__file__).parents[1] / "docs/data/later_site_blasts.parquet"

pytestmark = pytest.mark.usefixtures("apart")


def test_the_result_comes_back() -> None:
    assert read_apart("a file", double, 21) == 42


def test_errors_come_back_as_they_are() -> None:
    with pytest.raises(BlastEnvError, match=r"^a\.toml: is wrong$"):
        read_apart("a.toml", refuse, "a.toml: is wrong")
    with pytest.raises(KeyError, match="ours") as caught:
        read_apart("a.toml", fault)
    assert "in fault" in caught.value.__notes__[0]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not limit processor time")
def test_processor_time_is_limited() -> None:
    limits = ReadingLimits(processor_s=1)
    with pytest.raises(ReadingError, match=r"a\.dxf: takes more than 1 s of processor time"):
        read_apart("a.dxf", spin, limits=limits)


def test_time_on_the_clock_is_limited() -> None:
    began_s = time.monotonic()
    with pytest.raises(ReadingError, match=r"a\.dxf: takes more than 0\.3 s on the clock"):
        read_apart("a.dxf", time.sleep, 60.0, limits=ReadingLimits(wall_s=0.3))
    assert time.monotonic() - began_s < 20.0


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="only Linux limits memory")
def test_memory_is_limited() -> None:
    limits = ReadingLimits(memory_bytes=100_000_000)
    with pytest.raises(ReadingError, match=r"a\.osm: takes more than 100 MB of memory"):
        read_apart("a.osm", fill, 20, limits=limits)
    assert read_apart("a.osm", fill, 8, limits=limits) == 8


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="only Linux limits memory")
@pytest.mark.parametrize("threads", ["1", "4"])
def test_a_table_takes_a_few_times_its_own_memory(
    threads: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # 30 MB of texts and numbers. Arrow's own pool and threads had set aside over ten times that.
    monkeypatch.setenv("OMP_NUM_THREADS", threads)
    path, limits = BLASTS, ReadingLimits(memory_bytes=150_000_000)
    table = read_apart(str(path), checked_table, path, limits=limits)
    assert table.nbytes > 25_000_000


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_a_process_that_is_killed_is_an_error() -> None:
    with pytest.raises(ReadingError, match=r"a\.osm: cannot be read: .* was ended"):
        read_apart("a.osm", die)


def test_another_thread_can_end_it() -> None:
    with Reading("a.osm", time.sleep, 60.0) as reading:
        threading.Timer(0.3, reading.end).start()
        with pytest.raises(ReadingError, match="was ended"):
            reading.result()
