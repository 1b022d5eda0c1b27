"""A full device costs the new file and nothing else, and nobody is told that it was written."""

import gc
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from types import SimpleNamespace

import pytest

from blast_env.errors import BlastEnvError
from blast_env.files import is_temporary, write_atomically
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
