"""`blast-env app` before it serves anything."""

import re
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from blast_env.app.folder import WorkFolder
from blast_env.cli import app


@pytest.fixture
def taken() -> Iterator[int]:
    """A port that somebody listens at."""
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        yield other.getsockname()[1]


def run(*arguments: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["app", *arguments], env={"COLUMNS": "300"})
    return done.exit_code, done.output


def test_a_port_in_use_is_a_message(taken: int, tmp_path: Path) -> None:
    code, text = run("--port", str(taken), "--folder", str(tmp_path / "designs"))
    assert code == 2
    assert f"port {taken} of 127.0.0.1 cannot be used" in text
    assert "--port" in text
    assert "warning" not in text
    assert not (tmp_path / "designs").exists()


def test_an_address_that_others_reach_is_warned_of(taken: int, tmp_path: Path) -> None:
    code, text = run("--host", "0.0.0.0", "--port", str(taken), "--folder", str(tmp_path))
    assert code == 2
    assert "whoever has the address below, or listens on the way to 0.0.0.0" in text


def test_the_address_that_is_printed_has_a_token_that_is_new_each_time(
    taken: int, tmp_path: Path
) -> None:
    asked = ("--port", str(taken), "--folder", str(tmp_path), "--host", "0.0.0.0")
    found = [
        re.search(rf"http://localhost:{taken}/\?token=(\S{{43}}) ", run(*asked)[1]) for _ in "ab"
    ]
    tokens = {case[1] for case in found if case is not None}
    assert len(tokens) == 2


def test_a_folder_that_is_open_elsewhere_is_a_message(tmp_path: Path) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        free = probe.getsockname()[1]
    with WorkFolder(tmp_path).held("http://127.0.0.1:1"):
        code, text = run("--port", str(free), "--folder", str(tmp_path))
    assert code == 2
    assert "is open already at http://127.0.0.1:1" in text
