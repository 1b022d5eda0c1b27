"""The page attacked as other pages, strangers and hostile files would do it: the command itself.

Each attempt is answered by nothing (it held) or by a sentence (what got through).
"""

import http.client
import json
import os
import re
import select
import socket
import subprocess
import sys
from base64 import b64encode
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from html.parser import HTMLParser
from pathlib import Path
from threading import Thread
from time import monotonic, sleep
from types import MappingProxyType
from typing import Any, Final
from urllib.parse import quote

from blast_env.app.folder import WorkFolder
from blast_env.app.guard import HEADERS, MOST_BYTES, Entrance
from blast_env.app.plan import PixelView, plan_svg
from blast_env.app.server import MOST_PAGES
from blast_env.errors import BlastEnvError
from blast_env.site import Scenario, load_scenario
from tests.site.documents import full_document

Attempt = tuple[str, Callable[[], str]]
"""What is tried, and the function that tries it."""

_MOST_TOLD: Final = 100
_START_S: Final = 120.0
_ANSWER_S: Final = 30.0
_MOST_MORE_MIB: Final = 100.0
"""Memory that many quick clients may cost."""


@dataclass(frozen=True)
class Answer:
    """What the server said.

    Attributes:
        status: The status; 0 if it hung up.
        headers: The headers, by names in small letters.
        content: The content.
    """

    status: int
    headers: Mapping[str, str] = field(default_factory=dict)
    content: bytes = b""


@dataclass
class Victim:
    """A server of the command, and what is asked of it.

    Attributes:
        process: Its process.
        entrance: Where it is, with its token.
        folder: Its work folder.
        design_id: A design in it.
        said: What it said on standard error.
    """

    process: "subprocess.Popen[str]"
    entrance: Entrance
    folder: Path
    design_id: str
    said: list[str] = field(default_factory=list)
    _takes_files: str = field(default="", init=False)

    @property
    def cookie(self) -> str:
        """The cookie of somebody who may."""
        return f"{self.entrance.cookie}={self.entrance.token}"

    @property
    def own(self) -> dict[str, str]:
        """Headers of the page's own requests."""
        return {
            "Host": f"localhost:{self.entrance.port}",
            "Origin": f"http://localhost:{self.entrance.port}",
            "Cookie": self.cookie,
        }

    @property
    def paths(self) -> tuple[str, ...]:
        """What can be asked for."""
        return (
            "/",
            f"/design/{self.design_id}",
            "/player.js",
            f"/blasts/{self.design_id}/key/000.jpg",
            f"/damage/{self.design_id}/key/damage_0_0.png",
            "/_nicegui_ws/socket.io/?EIO=4&transport=polling",
            "/favicon.ico",
        )

    def ask(
        self,
        path: str,
        headers: Mapping[str, str | Sequence[str]],
        method: str = "GET",
        content: bytes = b"",
    ) -> Answer:
        """Ask with these headers and no others."""
        connection = http.client.HTTPConnection("127.0.0.1", self.entrance.port, timeout=_ANSWER_S)
        try:
            connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
            for name, values in headers.items():
                for value in [values] if isinstance(values, str) else values:
                    connection.putheader(name, value)
            if content and "Content-Length" not in headers:
                connection.putheader("Content-Length", str(len(content)))
            connection.endheaders()
            with suppress(OSError):  # it may have refused already
                connection.send(content)
            answer = connection.getresponse()
            said = {name.lower(): value for name, value in answer.getheaders()}
            return Answer(answer.status, said, answer.read())
        except (OSError, http.client.HTTPException):
            return Answer(0)
        finally:
            connection.close()

    def hand_over(self, headers: Mapping[str, str], content: bytes) -> Answer:
        """Ask where a page takes files; a page that nobody looks at does so for a while."""
        answer = self.ask(self._takes_files or "/nothing", headers, "POST", content)
        until_s = monotonic() + 2 * _START_S
        while answer.status == 404 and monotonic() < until_s:
            page = self.ask("/", self.own).content.decode()
            found = re.search(r"/_nicegui/client/[0-9a-f-]+/upload/\d+", page)
            if found is None:  # too many pages
                sleep(1.0)
                continue
            self._takes_files = found[0]
            answer = self.ask(self._takes_files, headers, "POST", content)
        return answer

    def socket_status(self, headers: Mapping[str, str]) -> int:
        """Return the status of asking for a websocket; 101 if it is open."""
        asked = {
            "Connection": "Upgrade",
            "Upgrade": "websocket",
            "Sec-WebSocket-Version": "13",
            "Sec-WebSocket-Key": b64encode(os.urandom(16)).decode(),
        }
        lines = [f"{name}: {value}" for name, value in (asked | dict(headers)).items()]
        request = "GET /_nicegui_ws/socket.io/?EIO=4&transport=websocket HTTP/1.1\r\n"
        with socket.create_connection(("127.0.0.1", self.entrance.port), _ANSWER_S) as plug:
            plug.sendall((request + "\r\n".join(lines) + "\r\n\r\n").encode())
            begin = plug.recv(4096).decode("latin-1")
        return int(begin.split()[1]) if begin else 0

    @property
    def memory_mib(self) -> float:
        """Memory of the server's process."""
        text = Path(f"/proc/{self.process.pid}/status").read_text(encoding="ascii")
        return int(next(each for each in text.splitlines() if "VmRSS" in each).split()[1]) / 1024

    def is_well(self) -> str:
        """Return why the server is not; empty if it is."""
        if self.process.poll() is not None:
            return f"the server ended with {self.process.returncode}"
        if self.ask("/player.js", self.own).status != 200:
            return "the server does not answer"
        faults = [each for each in self.said if "Traceback" in each]
        self.said.clear()
        return "the server printed a traceback" if faults else ""


@contextmanager
def victim(folder: Path) -> Iterator[Victim]:
    """Start the command in a folder, with a design; it ends with the block."""
    work = WorkFolder(folder)
    design_id = work.create(load_scenario("courtyard"), "begin").design_id
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "blast_env", "app", "--port", str(port)]
    # NiceGUI would take the server for one of its own tests.
    own = {name: value for name, value in os.environ.items() if "PYTEST" not in name}
    with subprocess.Popen(
        [*command, "--folder", str(folder)],
        text=True,
        env=own,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        try:
            ready, _, _ = select.select([process.stdout], [], [], _START_S)
            line = process.stdout.readline() if ready else ""
            found = re.search(r"\?token=(\S+)", line)
            assert found is not None, f"no address: {line}"
            entrance = Entrance(port=port, token=found[1])
            server = Victim(process, entrance, folder, design_id)
            Thread(target=lambda: server.said.extend(process.stderr or ()), daemon=True).start()
            _wait_for(server)
            yield server
        finally:
            process.terminate()


def _wait_for(server: Victim) -> None:
    until_s = monotonic() + _START_S
    while server.ask("/player.js", server.own).status != 200:
        assert monotonic() < until_s, "the server does not answer"
        assert server.process.poll() is None, "the server ended"
        sleep(0.2)


# What is tried.


def _refused(server: Victim, path: str, headers: Mapping[str, Any], method: str = "GET") -> str:
    """Return what got through of a request that must not."""
    answer = server.ask(path, headers, method, b"x" if method == "POST" else b"")
    return "" if answer.status in (0, 400, 403) else f"status {answer.status}"


def _no_socket(server: Victim, headers: Mapping[str, str]) -> str:
    status = server.socket_status(headers)
    return "" if status in (0, 400, 403) else f"websocket: status {status}"


def hosts(server: Victim) -> Iterator[Attempt]:
    """Names that lead here, as DNS rebinding makes them."""
    port = server.entrance.port
    names = [
        *(f"evil.example:{port}", "evil.example", f"localhost.evil.example:{port}"),
        *(f"localhost:{port + 1}", "localhost", "127.0.0.1", f"127.0.0.1.nip.example:{port}"),
        *(f"0.0.0.0:{port}", f"127.1:{port}", f"2130706433:{port}", f"[::ffff:127.0.0.1]:{port}"),
        *(f"evil.example@localhost:{port}", f"localhost:{port}@evil.example", "", " "),
        *(f"localhost:{port}.", f"localhost.:{port}", f"localhost:0{port}", f"localhost:{port}/"),
    ]
    for name in names:
        for path in server.paths:
            yield f"{name!r} {path}", partial(_refused, server, path, server.own | {"Host": name})
        yield f"{name!r} websocket", partial(_no_socket, server, server.own | {"Host": name})
    own = server.own["Host"]
    for path in server.paths:
        two = {"Host": [own, "evil.example"], "Cookie": server.cookie}
        yield f"two hosts {path}", partial(_refused, server, path, two)
        forwarded = server.own | {"Host": "evil.example", "X-Forwarded-Host": own, "Forwarded": own}
        yield f"forwarded {path}", partial(_refused, server, path, forwarded)


def origins(server: Victim) -> Iterator[Attempt]:
    """Other pages in the same browser: websockets and forms of theirs, with the cookie."""
    port = server.entrance.port
    names = [
        *("http://evil.example", "https://evil.example", "null", "", "file://", "about:blank"),
        *(f"http://localhost:{port + 1}", "http://localhost", f"localhost:{port}", "http://"),
        *(f"http://localhost:{port}.evil.example", f"http://localhost:{port}@evil.example"),
        *(f"http://evil.example:{port}", f"http://localhost:{port}/", f"ftp://localhost:{port}"),
        "chrome-extension://x",
    ]
    for name in names:
        said = server.own | {"Origin": name}
        yield f"{name!r} websocket", partial(_no_socket, server, said)
        for path in server.paths:
            for method in ("GET", "POST"):
                yield f"{name!r} {method} {path}", partial(_refused, server, path, said, method)
    without = {name: value for name, value in server.own.items() if name != "Origin"}
    yield "no origin, websocket", partial(_no_socket, server, without)


def frames(server: Victim) -> Iterator[Attempt]:
    """The page, or a part of it, in another page."""
    for site in ("cross-site", "same-site"):
        for place in ("iframe", "frame", "embed", "object", "script", "image", "style", "empty"):
            said = {"Host": server.own["Host"], "Cookie": server.cookie}
            said |= {"Sec-Fetch-Site": site, "Sec-Fetch-Dest": place}
            for path in server.paths:
                yield f"{site} {place} {path}", partial(_refused, server, path, said)
    knowing = {"Host": server.own["Host"], "Cookie": server.cookie}
    for headers in (knowing, {"Host": "evil.example"}, {"Host": server.own["Host"]}):
        for path in (*server.paths, "/nothing", f"/?token={server.entrance.token}"):
            yield f"headers of {path}", partial(_headers_missing, server, path, headers)


def _headers_missing(server: Victim, path: str, headers: Mapping[str, str]) -> str:
    said = server.ask(path, headers).headers
    wrong = [name for name, value in HEADERS.items() if said.get(name.lower()) != value]
    if "access-control-allow-origin" in said:
        wrong.append("access-control-allow-origin")
    return f"not as it should be: {', '.join(wrong)}" if wrong else ""


def tokens(server: Victim) -> Iterator[Attempt]:
    """Without the token, or with another."""
    token, name = server.entrance.token, server.entrance.cookie
    host = {"Host": server.own["Host"], "Origin": server.own["Origin"]}
    wrong = ["", "x", token[:-1], f"{token}x", token.swapcase(), f" {token}x", "\xe9"]
    wrong.append("A" * len(token))
    cookies = [f"{name}={each}" for each in wrong]
    cookies += [f"token={token}", f"other={token}", f"x{name}={token}", "", ";", f"{name}"]
    for cookie in cookies:
        said = host | {"Cookie": cookie}
        yield f"cookie {cookie!r} websocket", partial(_no_socket, server, said)
        for path in server.paths:
            for method in ("GET", "POST"):
                yield f"cookie {cookie!r} {path}", partial(_refused, server, path, said, method)
    for each in (*wrong, *(f"{token}&token=x", "&token=")):
        query = quote(each, safe="&=") if "&" in each else quote(each)
        for path in server.paths:
            mark = "&" if "?" in path else "?"
            if each.startswith(token) and "&" in each:
                continue
            asked = f"{path}{mark}token={query}"
            yield f"address {asked}", partial(_refused, server, asked, host)
    for method in ("POST", "PUT", "DELETE", "OPTIONS", "PATCH", "TRACE"):
        asked = f"/?token={token}"
        yield f"{method} with the address", partial(_no_method, server, asked, host, method)


def _no_method(server: Victim, path: str, headers: Mapping[str, str], method: str) -> str:
    answer = server.ask(path, headers, method, b"x")
    held = answer.status in (0, 400, 403, 405) and "set-cookie" not in answer.headers
    return "" if held else f"status {answer.status}"


def paths(server: Victim) -> Iterator[Attempt]:
    """Names of files and designs that lead elsewhere, by somebody who may."""
    design = server.design_id
    ups = [
        *("..", "%2e%2e", "..%2f", "..%5c", "%2e%2e%2f%2e%2e%2f", "....//", "%252e%252e", "%00"),
        *(".", "..%c0%af", "~", "C:%5c", "%2fetc%2fpasswd", "-", "%ff", "con", "*", "%0d%0aX:1"),
        "a" * 5000,
    ]
    kept = ("design.json", "open.json", "record.json", "etc/passwd", "000.jpg")
    for up in ups:
        for name in kept:
            for path in (
                f"/blasts/{up}/{up}/{name}",
                f"/blasts/{design}/{up}/{name}",
                f"/blasts/{design}/key/{up}{name}",
                f"/damage/{up}/{up}/{name}",
                f"/damage/{design}/key/{up}{name}",
                f"/design/{up}{name}",
                f"/player.js/{up}/{name}",
                f"/_nicegui/{up}/{up}/{name}",
            ):
                yield path, partial(_gives_nothing, server, path)


def _gives_nothing(server: Victim, path: str) -> str:
    answer = server.ask(path, server.own)
    if answer.status >= 500 and answer.status != 503:
        return f"status {answer.status}"
    leaked = [each for each in (b'"sites"', b'"process"', b"root:") if each in answer.content]
    if leaked or "X" in answer.headers or "x" in answer.headers:
        return f"gave {answer.content[:40]!r}"
    return ""


def uploads(server: Victim) -> Iterator[Attempt]:
    """Files that are too large, have names that lead elsewhere, or are not what they say."""
    for length in (str(MOST_BYTES + 1), "9" * 30, "-1", "x", "1e9", "0x10"):
        yield f"length {length}", partial(_no_length, server, {"Content-Length": length})
    yield "no length", partial(_no_length, server, {"Transfer-Encoding": "chunked"})
    names = [
        *("../../x.toml", "..\\x.toml", "/etc/cron.d/x.toml", "..", ".toml", "%2e%2e%2fx.toml"),
        *("con.toml", "<script>.toml", "x.exe", "x.json", "x.dxf", "x.pbf", "x\0.toml", ""),
        *("a" * 4000 + ".toml", "x.toml\r\nX: 1"),
    ]
    contents = [b"", b"\0" * 1000, b"schema_version = ", b"[" * 100_000, b"{}" * 9]
    contents.append(b'a = "' + b'\\"' * 40_000)
    for name in names:
        for content in contents:
            attack = f"{name[:20]!r} with {content[:12]!r}"
            yield attack, partial(_survives, server, [(name, content)])
    yield "100 files at once", partial(_survives, server, [("x.toml", b"a")] * 100)
    yield "no form", partial(_survives, server, [])


def _no_length(server: Victim, headers: Mapping[str, str]) -> str:
    answer = server.hand_over(server.own | dict(headers), b"")
    return "" if answer.status in (400, 411, 413) else f"status {answer.status}"


def _survives(server: Victim, files: Sequence[tuple[str, bytes]]) -> str:
    """Hand files over; the server goes on, and nothing is written but designs."""
    before = _files_outside(server)
    content = b""
    for name, part in files:
        head = f'--b\r\nContent-Disposition: form-data; name="f"; filename="{name}"\r\n\r\n'
        content += head.encode() + part + b"\r\n"
    content += b"--b--\r\n"
    said = server.own | {"Content-Type": "multipart/form-data; boundary=b"}
    answer = server.hand_over(said, content)
    if answer.status == 500:
        return "status 500"
    if _files_outside(server) != before:
        return "wrote a file"
    return server.is_well()


def _files_outside(server: Victim) -> list[str]:
    """Return the files that no upload may change, beside the designs."""
    near = [*server.folder.parent.iterdir(), *server.folder.iterdir(), Path("/etc/cron.d/x.toml")]
    return sorted(str(each) for each in near if each.exists() and "designs" not in each.name)


def clients(server: Victim) -> Iterator[Attempt]:
    """Many quick clients, which never come back."""
    before_mib = server.memory_mib

    def quick() -> str:
        answer = server.ask(f"/design/{server.design_id}", server.own)
        more_mib = server.memory_mib - before_mib
        if answer.status not in (200, 503):
            return f"status {answer.status}"
        if answer.status == 503 and str(MOST_PAGES).encode() not in answer.content:
            return "the bound is not said"
        return f"{more_mib:.0f} MiB more" if more_mib > _MOST_MORE_MIB else ""

    for number in range(500):
        yield f"page {number}", quick
    for number in range(200):
        yield (
            f"websocket {number}",
            lambda: "" if server.socket_status(server.own) in (101, 503) else "no websocket",
        )
    yield "afterwards", server.is_well


SCRIPTS: Final = (
    "<script>hacked=1</script>",
    "<img src=x onerror=hacked=1>",
    '"><svg onload=hacked=1>',
    "</style><script>hacked=1</script>",
    "</textarea><img src=x onerror=hacked=1>",
    "javascript:hacked=1",
    "{{constructor.constructor('hacked=1')()}}",
    "${hacked=1}`${hacked=1}`",
    "<a href=javascript:hacked=1>x</a>",
    "]]><script>hacked=1</script>",
    "&lt;script&gt;hacked=1&lt;/script&gt;",
    "\u2028<iframe srcdoc='<script>parent.hacked=1</script>'>",
)
"""Texts that a browser must not run, wherever they are stored."""


def places_of(document: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Give the places of a document where a text stands."""
    if isinstance(document, str):
        yield path
        return
    pairs: Iterator[tuple[Any, Any]]
    pairs = iter(document.items() if isinstance(document, dict) else enumerate(document))
    for key, value in pairs:
        if isinstance(value, str | dict | list):
            yield from places_of(value, (*path, key))


def with_text(document: Any, path: Sequence[Any], text: str) -> Any:
    """Return a document with another text in a place."""
    if not path:
        return text
    pairs = document.items() if isinstance(document, dict) else enumerate(document)
    made = {
        key: with_text(value, path[1:], text) if key == path[0] else value for key, value in pairs
    }
    return made if isinstance(document, dict) else [*made.values()]


def scenarios_with_scripts() -> Iterator[tuple[str, Scenario]]:
    """Give sound scenarios with a script in one of their texts, in all that may hold one."""
    document = json.loads(json.dumps(full_document()))
    for place in places_of(document):
        for script in SCRIPTS:
            try:
                made = Scenario.from_document(with_text(document, place, script), "script")
            except BlastEnvError:
                continue  # it is no name there
            yield f"{'.'.join(map(str, place))} {script!r}", made


class _Markup(HTMLParser):
    """Lists what in a text of HTML or SVG a browser could run."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note a tag that runs something that was stored."""
        if tag in ("iframe", "object", "embed", "foreignobject"):
            self.found.append(tag)
        for name, value in attrs:
            if name.startswith("on") or ("hacked" in (value or "") and name in ("href", "src")):
                self.found.append(f"{tag} {name}")

    def handle_data(self, data: str) -> None:
        """Note a script that was stored: of those that belong to the page none has such lines."""
        if self.cdata_elem == "script" and re.search(r"(?m)^hacked=1$", data):
            self.found.append("script")


def runs(markup: str) -> list[str]:
    """Return what a browser would run of it."""
    parser = _Markup()
    parser.feed(markup)
    parser.close()
    return parser.found


def scripts(server: Victim) -> Iterator[Attempt]:
    """A script in every name and tag: pages that show it, and plans that are drawn of it."""
    work = WorkFolder(server.folder)
    tried = [*scenarios_with_scripts()]
    for attack, scenario in tried:
        yield f"plan: {attack}", partial(_plan_runs, scenario)
    for attack, scenario in tried[:: max(len(tried) // MOST_PAGES, 1)]:
        design_id = work.create(scenario, "script").design_id
        yield f"page: {attack}", partial(_page_runs, server, f"/design/{design_id}")
    yield "list of designs", partial(_page_runs, server, "/")


def _plan_runs(scenario: Scenario) -> str:
    found = runs(plan_svg(PixelView.of(scenario, 600, 400), scenario, (), None))
    return f"the plan runs {found}" if found else ""


def _page_runs(server: Victim, path: str) -> str:
    until_s = monotonic() + 2 * _START_S
    while (answer := server.ask(path, server.own)).status == 503 and monotonic() < until_s:
        sleep(1.0)
    if answer.status != 200:
        return f"status {answer.status}"
    found = runs(answer.content.decode())
    return f"the page runs {found}" if found else ""


ATTACKS: Final[Mapping[str, Callable[[Victim], Iterator[Attempt]]]] = MappingProxyType(
    {
        "host": hosts,
        "origin": origins,
        "frame": frames,
        "token": tokens,
        "path names": paths,
        "upload": uploads,
        "stored script": scripts,
        "clients": clients,
    }
)


def attempts_of(name: str, server: Victim) -> tuple[int, list[str]]:
    """Attack a server; return how often, and what got through."""
    count, through = 0, []
    for attack, attempt in ATTACKS[name](server):
        count += 1
        problem = attempt()
        if problem:
            through.append(f"{attack[:_MOST_TOLD]}: {problem}")
    problem = server.is_well()
    return count, [*through, *([problem] if problem else [])]
