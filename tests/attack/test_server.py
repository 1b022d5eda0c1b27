"""The server of `blast-env app` answers only the holder of the printed address."""

import os
import re
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, suppress
from email.message import Message
from http.client import HTTPConnection
from pathlib import Path
from time import sleep

import pytest

from blast_env.app.guard import HEADERS, Entrance

SERVER = """
import sys
from blast_env.app.jobs import Workers
Workers.prepare = lambda _: None
from blast_env_command import main
main()
"""
"""The command, without compiled code for blasts, of which there are none."""


@pytest.fixture
def entrance(tmp_path: Path) -> Iterator[Entrance]:
    """A running server."""
    with closing(socket.socket()) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-c", SERVER, "app", "--port", str(port)]
    # NiceGUI would take the server for one of its own tests.
    own = {name: value for name, value in os.environ.items() if "PYTEST" not in name}
    with subprocess.Popen(
        [*command, "--folder", str(tmp_path)], text=True, env=own, stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        found = re.search(r"\?token=(\S+)", process.stdout.readline())
        assert found is not None
        yield Entrance(port=port, token=found[1])
        process.terminate()


def answer(entrance: Entrance, path: str, headers: dict[str, str]) -> tuple[int, Message]:
    """Ask, as soon as the server listens; return the status and the headers."""
    for _ in range(600):
        with (
            suppress(ConnectionRefusedError),
            closing(HTTPConnection("127.0.0.1", entrance.port, timeout=30.0)) as connection,
        ):
            connection.request("GET", path, headers=headers)
            found = connection.getresponse()
            return found.status, found.headers
        sleep(0.1)
    raise AssertionError("the server does not answer")


@pytest.mark.slow
def test_strangers_and_other_pages_get_nothing(entrance: Entrance) -> None:
    own = {"Host": f"localhost:{entrance.port}", "Origin": entrance.url}
    cookie = {"Cookie": f"{entrance.cookie}={entrance.token}"}
    websocket = "/_nicegui_ws/socket.io/?EIO=4&transport=polling"
    for path in ("/", "/design/none", websocket):
        for headers in (
            own,
            own | {"Cookie": f"{entrance.cookie}=wrong"},
            own | cookie | {"Host": f"evil.example:{entrance.port}"},
            own | cookie | {"Origin": "http://evil.example"},
            own | cookie | {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Dest": "iframe"},
        ):
            status, said = answer(entrance, path, headers)
            assert status == 403, (path, headers)
            assert {name: said[name] for name in HEADERS} == dict(HEADERS)
    assert answer(entrance, "/", own | cookie)[0] == 200
