"""Who may use the page: foreign hosts, origins, frames and those without the token may not."""

import asyncio
from collections.abc import AsyncIterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import httpx
import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket

from blast_env.app.guard import HEADERS, Entrance, Guard
from blast_env.errors import BlastEnvError

ENTRANCE: Final = Entrance(port=8080, more_names=("desk.example", "other.example:9000"))
URL: Final = "http://localhost:8080"
OWN: Final = {"origin": URL}


async def _page(request: Request) -> PlainTextResponse:
    return PlainTextResponse(f"{request.method} {len(await request.body())}")


async def _accept(socket: WebSocket) -> None:
    await socket.accept()


@dataclass
class Browser:
    """Asks a guarded application, with the token as a cookie if it is known."""

    known: bool = True
    most_bytes: int = 1000
    cookies: httpx.Cookies = field(default_factory=httpx.Cookies)

    def __post_init__(self) -> None:
        if self.known:
            self.cookies.set(ENTRANCE.cookie, ENTRANCE.token)
        routes = [
            Route("/{path:path}", _page, methods=["GET", "POST"]),
            WebSocketRoute("/{path:path}", _accept),
        ]
        self.guarded = Guard(Starlette(routes=routes), ENTRANCE, self.most_bytes)

    def ask(self, method: str, path: str, headers: Any = None, content: Any = None) -> Any:
        async def asked() -> httpx.Response:
            transport = httpx.ASGITransport(self.guarded)
            async with httpx.AsyncClient(
                transport=transport, base_url=URL, cookies=self.cookies
            ) as client:
                answer = await client.request(method, path, headers=headers, content=content)
                self.cookies = client.cookies
                return answer

        return asyncio.run(asked())

    def get(self, path: str = "/", headers: Any = None) -> Any:
        return self.ask("GET", path, headers)

    def opens_socket(self, headers: Mapping[str, str], query: str = "") -> bool:
        """Whether a websocket is accepted."""
        sent: list[Any] = []

        async def receive() -> Any:
            return {"type": "websocket.connect"}

        async def send(message: Any) -> None:
            sent.append(message["type"])

        said = {"host": "localhost:8080"} | dict(headers)
        if self.known:
            said["cookie"] = f"{ENTRANCE.cookie}={ENTRANCE.token}"
        scope = {
            "type": "websocket",
            "path": "/",
            "query_string": query.encode(),
            "headers": [(key.encode(), value.encode()) for key, value in said.items()],
        }
        asyncio.run(self.guarded(scope, receive, send))
        assert sent in (["websocket.accept"], ["websocket.close"])
        return sent == ["websocket.accept"]


@pytest.mark.parametrize(
    "host", ["localhost:8080", "127.0.0.1:8080", "[::1]:8080", "LOCALHOST:8080", "desk.example"]
    + ["desk.example:8080", "other.example:9000"],
)  # fmt: skip
def test_own_names_are_answered(host: str) -> None:
    assert Browser().get("/", headers={"host": host}).status_code == 200


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8080", "localhost", "localhost:80", "localhost:8081"]
    + ["localhost.evil.example:8080", "localhost:8080@evil.example", "other.example", "", "0.0.0.0"]
    + ["localhost:8080, evil.example", "192.168.0.7:8080"],
)  # fmt: skip
def test_names_that_lead_here_are_refused(host: str) -> None:
    """A page of that name could otherwise read everything, by DNS rebinding."""
    answer = Browser().get("/", headers={"host": host})
    assert answer.status_code == 403
    assert repr(host) in answer.text
    assert not Browser().opens_socket({"host": host} | OWN)


def test_two_hosts_are_refused() -> None:
    headers = [("host", "localhost:8080"), ("host", "evil.example")]
    assert Browser().get("/", headers).status_code == 403


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "", "http://localhost:3000", "file://"]
    + ["http://localhost:8080.evil.example", "ftp://localhost:8080", "localhost:8080"],
)  # fmt: skip
def test_other_origins_are_refused(origin: str) -> None:
    assert Browser().ask("POST", "/", {"origin": origin}).status_code == 403
    assert not Browser().opens_socket({"origin": origin})


def test_a_websocket_has_the_origin_and_the_token() -> None:
    assert Browser().opens_socket(OWN)
    assert not Browser().opens_socket({})
    assert not Browser(known=False).opens_socket(OWN)
    # The printed address opens the page, nothing else.
    assert not Browser(known=False).opens_socket(OWN, f"token={ENTRANCE.token}")


@pytest.mark.parametrize("path", ["/", "/design/x", "/player.js", "/_nicegui/x", "/blasts/a/b/c"])
def test_nothing_is_given_without_the_token(path: str) -> None:
    for given in ("", "?token=", "?token=wrong", f"?token={ENTRANCE.token}x"):
        answer = Browser(known=False).get(path + given)
        assert answer.status_code == 403
        assert "address that `blast-env app` or `serve` printed" in answer.text
    answer = Browser(known=False).ask("POST", f"{path}?token={ENTRANCE.token}", OWN)
    assert answer.status_code == 403
    wrong = Browser(known=False)
    wrong.cookies.set(ENTRANCE.cookie, "wrong")
    assert wrong.get(path).status_code == 403


def test_the_printed_address_lets_in_and_goes_on_without_its_token() -> None:
    browser = Browser(known=False)
    assert ENTRANCE.printed.startswith("http://127.0.0.1:8080/?token=")
    welcome = browser.get(f"/design/7?token={ENTRANCE.token}&x=1")
    assert 'content="0; url=/design/7?x=1"' in welcome.text
    assert ENTRANCE.token not in welcome.text
    cookie = welcome.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert "path=/" in cookie
    assert browser.get("/design/7?x=1").text == "GET 0"


def test_the_way_on_leads_nowhere_else() -> None:
    for path in ("//evil.example", "/\\evil.example", "/%22><script>"):
        welcome = Browser(known=False).get(f"http://localhost:8080{path}?token={ENTRANCE.token}")
        assert 'url=/evil.example"' in welcome.text or 'url=/%22%3E%3Cscript%3E"' in welcome.text


def test_every_start_has_another_token() -> None:
    assert Entrance().token != Entrance().token
    assert len(Entrance().token) >= 40
    assert Entrance().token not in repr(Entrance())


@pytest.mark.parametrize("place", ["iframe", "frame", "object", "embed", "script", "image", ""])
@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_other_pages_get_no_part_of_it(site: str, place: str) -> None:
    headers = {"sec-fetch-site": site, "sec-fetch-dest": place}
    assert Browser().get("/", headers).status_code == 403


def test_a_link_may_be_followed() -> None:
    headers = {"sec-fetch-site": "cross-site", "sec-fetch-dest": "document"}
    assert Browser().get("/", headers).status_code == 200
    assert Browser().get("/", headers={"sec-fetch-site": "none"}).status_code == 200


def test_every_answer_forbids_frames_and_foreign_parts() -> None:
    for case in (
        Browser().get("/"),
        Browser(known=False).get("/"),
        Browser(known=False).get(f"/?token={ENTRANCE.token}"),
        Browser().get("/", headers={"host": "evil.example"}),
        Browser().ask("PUT", "/"),
    ):
        assert {name: case.headers[name] for name in HEADERS} == dict(HEADERS)
    policy = HEADERS["Content-Security-Policy"]
    assert "frame-ancestors 'none'" in policy
    assert "default-src 'none'" in policy
    assert "http" not in policy  # no other host


def test_content_is_bounded_in_size() -> None:
    async def chunks() -> AsyncIterator[bytes]:
        yield b"x"

    guarded = Browser(most_bytes=10)
    assert guarded.ask("POST", "/", OWN, b"x" * 10).text == "POST 10"
    answer = guarded.ask("POST", "/", OWN, b"x" * 11)
    assert answer.status_code == 413
    assert "11 bytes, must have at most 10" in answer.text
    assert guarded.ask("POST", "/", OWN, chunks()).status_code == 411
    assert guarded.ask("PUT", "/", None, b"x").status_code == 405


def through(app: ASGIApp, receive: Receive, most_s: float = 9.0) -> list[Any]:
    """Return what a guarded application sends for a request with content."""
    sent: list[Any] = []

    async def send(message: Any) -> None:
        sent.append(message)

    headers = {
        "host": "localhost:8080",
        "content-length": "999",
        "cookie": f"{ENTRANCE.cookie}={ENTRANCE.token}",
    }
    scope = {
        "type": "http",
        "method": "POST",
        "path": "/",
        "query_string": b"",
        "headers": [(key.encode(), value.encode()) for key, value in headers.items()],
    }
    asyncio.run(Guard(app, ENTRANCE, most_s=most_s)(scope, receive, send))
    return sent


def test_content_is_bounded_in_time() -> None:
    async def app(_: Scope, receive: Receive, __: Send) -> None:
        while (await receive())["more_body"]:
            pass

    async def slow() -> Message:
        await asyncio.sleep(0.02)
        return {"type": "http.request", "body": b"x", "more_body": True}

    start, body = through(app, slow, most_s=0.1)
    assert start["status"] == 408
    assert b"more than 0.1 s" in body["body"]


def test_a_browser_that_is_closed_before_it_has_an_answer_is_no_fault() -> None:
    async def app(_: Scope, __: Receive, ___: Send) -> None:
        raise RuntimeError("No response returned.")

    async def gone() -> Message:
        return {"type": "http.disconnect"}

    async def there() -> Message:
        await asyncio.sleep(0.01)
        return {"type": "http.request", "body": b"", "more_body": False}

    assert through(app, gone) == []
    with pytest.raises(RuntimeError):
        through(app, there)


@pytest.mark.parametrize("name", ["", "http://desk", "desk/", "*", "a b", "desk:http", "x:123456"])
def test_a_name_that_is_none_is_refused(name: str) -> None:
    with pytest.raises(BlastEnvError, match=r"--allow-host is .*, must be a name"):
        Entrance(more_names=(name,))


def test_a_server_for_everybody_still_has_its_names() -> None:
    entrance = Entrance("0.0.0.0", 8080)
    assert "evil.example:8080" not in entrance.authorities
    assert "0.0.0.0:8080" not in entrance.authorities
    assert entrance.url == "http://localhost:8080"
    assert Entrance("::1", 80).authorities >= {"[::1]", "localhost", "[::1]:80"}
