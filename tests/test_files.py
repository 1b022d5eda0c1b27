"""Files are written whole or not at all; what a killed writer left goes."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from blast_env.errors import BlastEnvError
from blast_env.files import is_temporary, make_folder, write_atomically


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
