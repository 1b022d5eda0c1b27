"""A full device costs the new file and nothing else, and nobody is told that it was written."""

import gc
import os
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from types import SimpleNamespace

import pytest

from blast_env.errors import BlastEnvError
from blast_env.evaluation.free_field import FreeFieldRun
from blast_env.files import FolderStore, is_temporary, write_atomically
from blast_env.journal import Journal
from tests.attack.disks import file_size_limit
from tests.attack.writers import WRITERS

UNCLOSED = pytest.mark.filterwarnings(
    r"ignore:Exception ignored in. <_io\.FileIO:pytest.PytestUnraisableExceptionWarning"
)
"""XlsxWriter leaves its scratch files to the collector when it fails; nothing else may complain."""
SLOW = ("pair.mp4", "film.gif", "report.pdf")
"""Of kinds that others stand for."""


@pytest.fixture(scope="module", autouse=True)
def spared() -> Iterator[None]:
    """Spare the collector, called after each failure, all that was there before."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[UNCLOSED] * n.endswith(".xlsx")) for n in WRITERS if n not in SLOW],
)
def test_what_was_there_outlives_a_full_device(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where only the last byte has no room, as with a film whose index comes last."""
    # Drawings and reports say when they were made, in as many bytes as the moment needs.
    monkeypatch.setattr("ezdxf.options.write_fixed_meta_data_for_testing", True)
    then = SimpleNamespace(now=lambda zone: datetime(2026, 1, 1, tzinfo=zone))
    monkeypatch.setattr("blast_env.report.page.datetime", then)
    path = tmp_path / name
    WRITERS[name](path)
    size = path.stat().st_size
    path.write_bytes(b"the old one")
    for most_bytes in (size - 1, size // 2):
        with file_size_limit(most_bytes), pytest.raises(BlastEnvError, match="cannot be written"):
            WRITERS[name](path)
        gc.collect()
        assert path.read_bytes() == b"the old one"
        assert list(tmp_path.iterdir()) == [path]


def test_a_study_goes_on_after_a_full_device(tmp_path: Path) -> None:
    store = tmp_path / "runs.jsonl"
    journal = Journal(store, FreeFieldRun)
    runs = [FreeFieldRun(f"key {seed}", 10.0, seed, 1.0, 1.0, None) for seed in range(3)]
    journal.add(runs[0])
    limit = store.stat().st_size + 20
    with file_size_limit(limit), pytest.raises(BlastEnvError, match="cannot be written"):
        journal.add(runs[1])
    journal.add(runs[2])
    assert journal.read() == [runs[0], runs[2]]


def test_a_store_keeps_what_it_had_on_a_full_device(tmp_path: Path) -> None:
    store = FolderStore(tmp_path, ".result")
    store.put("key", b"old")
    with file_size_limit(1000), pytest.raises(BlastEnvError, match="cannot be written"):
        store.put("key", bytes(2000))
    assert store.get("key") == b"old"
    assert len(store) == 1


def test_what_a_writer_left_that_was_killed_before_its_rename_is_no_second_entry(
    tmp_path: Path,
) -> None:
    store = FolderStore(tmp_path, ".result", most_bytes=10_000)
    store.put("key", b"kept")
    (whole,) = tmp_path.iterdir()
    left = tmp_path / f".{16 * '0'}.result"
    left.write_bytes(whole.read_bytes())
    os.utime(left, (0.0, 0.0))
    assert list(store.items()) == [("key", b"kept")]
    assert len(store) == 1
    store.put("large", bytes(9_950))  # it goes when there is no more room
    assert not left.exists()


def test_an_error_about_another_file_names_it(tmp_path: Path) -> None:
    with (
        pytest.raises(BlastEnvError, match=r"a.txt: cannot be written: .* '.*missing'"),
        write_atomically(tmp_path / "a.txt"),
    ):
        (tmp_path / "missing").read_text()


def test_what_a_killed_writer_leaves_is_known_by_its_name(tmp_path: Path) -> None:
    with write_atomically(tmp_path / "film.mp4") as temporary:
        assert is_temporary(temporary.name)
    for name in ("film.mp4", ".hidden", ".gitignore", "0123456789abcdef.pt"):
        assert not is_temporary(name)
