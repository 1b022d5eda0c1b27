"""Files are written whole or not at all, kept in stores, and read in processes of their own."""

import multiprocessing
import os
import pickle
import shutil
import sqlite3
import subprocess
import sys
import warnings
from collections import namedtuple
from contextlib import closing
from itertools import count
from multiprocessing.connection import Connection
from pathlib import Path

import pytest

from blast_env.errors import BlastEnvError, BlastEnvWarning
from blast_env.files import is_temporary, make_folder, write_atomically
from blast_env.store import Store
from tests.attack.disks import file_size_limit


def test_file_appears_only_when_the_block_ends(tmp_path: Path) -> None:
    target = tmp_path / "table.xlsx"
    with write_atomically(target) as temporary:
        assert temporary.parent == tmp_path
        assert temporary.suffix == ".xlsx"
        assert is_temporary(temporary.name)
        assert not any(map(is_temporary, ("film.mp4", ".hidden", "0123456789abcdef.pt")))
        temporary.write_text("new")
        assert not target.exists()
    assert target.read_text() == "new"
    assert os.listdir(tmp_path) == ["table.xlsx"]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_interrupted_write_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, error: type[BaseException]
) -> None:
    target = tmp_path / "a.txt"
    target.write_text("old")

    def write_half() -> None:
        with write_atomically(target) as temporary:
            temporary.write_text("half")
            raise error

    with pytest.raises(error):
        write_half()
    assert target.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_existing_file_keeps_its_permissions(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    target.write_text("old")
    target.chmod(0o604)
    with write_atomically(target) as temporary:
        temporary.write_text("new")
    assert target.stat().st_mode & 0o777 == 0o604


def test_new_file_has_the_permissions_of_any_new_file(tmp_path: Path) -> None:
    (tmp_path / "plain").write_text("")
    with write_atomically(tmp_path / "a.txt"):
        pass
    assert (tmp_path / "a.txt").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "real.txt").write_text("old")
    link = tmp_path / "link.txt"
    link.symlink_to("real.txt")
    with write_atomically(link) as temporary:
        temporary.write_text("new")
    assert link.is_symlink()
    assert (tmp_path / "real.txt").read_text() == "new"


def test_what_is_no_place_for_a_file_or_a_folder_is_named(tmp_path: Path) -> None:
    missing = pytest.raises(BlastEnvError, match=r"there is no folder '.*missing'")
    with missing, write_atomically(tmp_path / "missing" / "a.txt"):
        pass
    with pytest.raises(BlastEnvError, match="is a folder"), write_atomically(tmp_path):
        pass
    (tmp_path / "out").write_text("mine")
    with pytest.raises(BlastEnvError, match=r"out: cannot be a folder: File exists"):
        make_folder(tmp_path / "out")
    assert (tmp_path / "out").read_text() == "mine"


def test_folder_without_write_permission_is_a_clear_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*arguments: object) -> None:
        raise PermissionError(13, "Permission denied")

    # The superuser may write anywhere, so the refusal is made here.
    monkeypatch.setattr(Path, "open", refuse)
    denied = pytest.raises(BlastEnvError, match="cannot be written: Permission denied")
    with denied, write_atomically(tmp_path / "a.txt"):
        pass
    assert os.listdir(tmp_path) == []


def test_a_folder_is_made_with_those_above_it_and_may_be_there(tmp_path: Path) -> None:
    make_folder(tmp_path / "out" / "today")
    make_folder(tmp_path / "out" / "today")
    assert (tmp_path / "out" / "today").is_dir()


# --- A store gives back what was put in, or nothing: never anything else.


FORKING = pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
"""Forks begin at once; later versions of Python warn of threads, which here do nothing."""


def filled(path: Path) -> Store:
    store = Store(path)
    store.put("key 2", b"a first content, which a later one takes the place of")
    for number in range(3):
        store.put(f"key {number}", bytes([number]) * 2000)
    return store


def test_contents_come_back_for_another_object_and_a_copy(tmp_path: Path) -> None:
    first = filled(tmp_path / "a" / "store")
    for store in (first, Store(tmp_path / "a" / "store"), pickle.loads(pickle.dumps(first))):
        assert store.get("key 1") == bytes([1]) * 2000
        assert store.get("key 3") is None
        assert len(store) == 3
        assert list(store.items()) == [(f"key {k}", bytes([k]) * 2000) for k in range(3)]


def test_any_damage_is_an_error_or_a_missing_content_and_never_a_wrong_one(tmp_path: Path) -> None:
    path = tmp_path / "store"
    filled(path).__del__()  # which closes it, so that all of it is in one file
    whole = path.read_bytes()
    assert [each.name for each in tmp_path.iterdir()] == ["store"]
    flipped = [
        whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :]
        for place in range(0, len(whole), 331)
    ]
    refused = 0
    for content in [*flipped, whole[: len(whole) // 2], whole[:50], b"x" * 5000]:
        for each in tmp_path.iterdir():
            each.unlink()
        path.write_bytes(content)
        try:
            with warnings.catch_warnings(record=True) as notes:
                warnings.simplefilter("always")
                store = Store(path)
                found = [store.get(f"key {number}") for number in range(3)]
        except BlastEnvError:
            refused += 1
        else:
            assert len(notes) == (1 if store.damaged else 0)
            whole_or_none = zip(found, range(3), strict=True)
            assert all(each in (None, bytes([k]) * 2000) for each, k in whole_or_none)
    assert refused >= 3


def test_a_damaged_content_goes(tmp_path: Path) -> None:
    store = filled(tmp_path / "store")
    with closing(sqlite3.connect(tmp_path / "store")) as other:
        other.execute("UPDATE contents SET content = ? WHERE key = 'key 1'", (b"other",))
        other.execute("UPDATE contents SET key = 'key 9' WHERE key = 'key 2'")
        other.commit()
    with pytest.warns(BlastEnvWarning, match="has a damaged entry"):
        assert store.get("key 1") is None
    assert store.get("key 9") is None  # of another key
    assert store.damaged == 2
    assert len(store) == 1


def test_content_that_cannot_be_decoded_counts_as_damaged(tmp_path: Path) -> None:
    store = Store(tmp_path / "store")
    store.put("key", b"3.5")
    assert store.read("key", float) == 3.5
    with pytest.warns(BlastEnvWarning, match="has a damaged entry"):
        assert store.read("key", int) is None
    assert store.damaged == 1
    assert store.read("key", float) is None


def test_files_of_others_are_refused_and_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "other"
    with closing(sqlite3.connect(path)) as other:
        other.execute("CREATE TABLE contents (mine TEXT)")
        other.commit()
    content = path.read_bytes()
    with pytest.raises(BlastEnvError, match=r"other: is damaged, or no store .* another format"):
        Store(path)
    assert path.read_bytes() == content
    with pytest.raises(BlastEnvError, match="cannot be used"):
        Store(tmp_path)
    with pytest.raises(BlastEnvError, match="most_bytes is -1, must be at least 0"):
        Store(tmp_path / "new", -1)


def test_the_oldest_go_when_there_is_no_more_room(tmp_path: Path) -> None:
    store = Store(tmp_path / "store", most_bytes=10_000)
    for number in range(40):
        store.put(str(number), bytes(1000))
        assert len(store) <= 10
    assert [int(key) for key, _ in store.items()] == list(range(40 - len(store), 40))
    assert len(store) >= 9


def test_a_full_device_costs_the_new_content_alone(tmp_path: Path) -> None:
    store = filled(tmp_path / "store")
    with file_size_limit(1000), pytest.raises(BlastEnvError, match="store: cannot be used"):
        store.put("large", bytes(100_000))
    assert store.get("large") is None
    store.put("key 3", b"fits")
    assert len(store) == 4
    assert len(Store(tmp_path / "store")) == 4


def _mixed(path: Path, first: int) -> int:
    """Put and get what others put and get at the same time; return the number of errors."""
    store, wrong = Store(path, 20_000), 0
    for number in (*range(first, 40), *range(first)):
        store.put(str(number), bytes([number]) * 1000)
        for asked in (number, (number + 20) % 40):
            wrong += store.get(str(asked)) not in (None, bytes([asked]) * 1000)
    return wrong + store.damaged


@FORKING
def test_processes_at_once_never_read_anything_half_written(tmp_path: Path) -> None:
    """Also while each deletes what another one has just written, and all make the file."""
    with multiprocessing.get_context("fork").Pool(3) as pool:
        jobs = [(tmp_path / str(k), first) for k in range(3) for first in (0, 13, 26)]
        assert sum(pool.starmap(_mixed, jobs, chunksize=1)) == 0


@FORKING
def test_a_forked_process_opens_its_own_connection(tmp_path: Path) -> None:
    store = filled(tmp_path / "store")
    process = multiprocessing.get_context("fork").Process(target=store.put, args=("child", b"1"))
    process.start()
    process.join()
    assert process.exitcode == 0
    store.put("parent", b"2")
    assert (store.get("child"), store.get("parent"), len(store)) == (b"1", b"2", 5)


def _put_for_ever(store: Store, pipe: Connection) -> None:
    for number in count():
        store.put(str(number), bytes([number % 256]) * 3000)
        pipe.send(number)


@FORKING
def test_a_killed_process_leaves_all_that_it_had_put_and_nothing_half_written(
    tmp_path: Path,
) -> None:
    for most in (1, 17, 60):
        store = Store(tmp_path / str(most))
        receiver, sender = multiprocessing.Pipe(duplex=False)
        process = multiprocessing.get_context("fork").Process(
            target=_put_for_ever, args=(store, sender)
        )
        process.start()
        last = 0
        while last < most:
            last = receiver.recv()
        process.kill()
        process.join()
        while receiver.poll():
            last = receiver.recv()
        for number in range(last + 1):
            assert store.get(str(number)) == bytes([number % 256]) * 3000
        assert (len(store) - last, store.damaged) in ((1, 0), (2, 0))


def killed_writer(target: Path) -> Path:
    """Return the temporary file that a writer of a file leaves when it is killed."""
    code = (
        "import os, signal, sys\n"
        "from blast_env.files import write_atomically\n"
        "with write_atomically(sys.argv[1]) as temporary:\n"
        "    temporary.write_text('half')\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    before = set(target.parent.iterdir())
    subprocess.run([sys.executable, "-c", code, str(target)], check=False)
    (left,) = set(target.parent.iterdir()) - before
    assert is_temporary(left.name)
    os.utime(left, (0.0, 0.0))
    return left


@pytest.mark.skipif(sys.platform == "win32", reason="without locks of files")
def test_what_a_killed_writer_left_is_removed_by_the_next_one(tmp_path: Path) -> None:
    left, of_another = killed_writer(tmp_path / "a.gif"), killed_writer(tmp_path / "b.gif")
    with write_atomically(tmp_path / "a.gif") as first:
        os.utime(first, (0.0, 0.0))
        with write_atomically(tmp_path / "a.gif") as second:
            assert first.exists()  # its writer lives
            second.write_text("second")
        first.write_text("first")
    assert not left.exists()
    assert of_another.exists()
    assert (tmp_path / "a.gif").read_text() == "first"


@pytest.mark.parametrize("content", [b"", b"S"])
def test_a_store_that_has_lost_its_content_says_so_once(content: bytes, tmp_path: Path) -> None:
    Store(tmp_path / "a.sqlite").put("key", b"content")
    for path in tmp_path.iterdir():
        path.unlink()
    (tmp_path / "a.sqlite").write_bytes(content)
    with pytest.warns(BlastEnvWarning, match=r"a\.sqlite: has lost its content") as notes:
        store = Store(tmp_path / "a.sqlite")
    assert len(notes) == 1
    assert store.get("key") is None
    store.put("key", b"content")
    assert Store(tmp_path / "a.sqlite").get("key") == b"content"


def test_damaged_entries_are_one_note(tmp_path: Path) -> None:
    store = Store(tmp_path / "a.sqlite")
    for key in "abc":
        store.put(key, b"content")
    with closing(sqlite3.connect(tmp_path / "a.sqlite")) as other:
        other.execute("UPDATE contents SET content = x'00' WHERE key != 'c'")
        other.commit()
    with pytest.warns(BlastEnvWarning, match=r"a\.sqlite: has a damaged entry") as notes:
        assert [store.get(key) for key in "abc"] == [None, None, b"content"]
    assert (len(notes), store.damaged) == (1, 2)


@pytest.mark.skipif(sys.platform == "win32", reason="without limits of files")
def test_a_full_device_is_named_as_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = Store(tmp_path / "a.sqlite")
    with (
        file_size_limit(1000),
        pytest.raises(BlastEnvError, match=r"a\.sqlite: cannot be used"),
    ):
        store.put("key", bytes(100_000))
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage(10**6, 10**6, 0))
    with (
        file_size_limit(1000),
        pytest.raises(BlastEnvError, match=r"a\.sqlite: cannot be written: the device is full"),
    ):
        store.put("key", bytes(100_000))
