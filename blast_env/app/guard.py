"""Access control of the page: only the holder of the printed address, and no other web page.

Every page open in a browser on this computer can reach a server at its loopback address. So the
server answers only under its known names (which defeats DNS rebinding), only to requests from its
own pages, and only with the token of the printed address.
"""

import asyncio
import html
import re
import secrets
import socket
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final
from urllib.parse import quote, urlencode

from blast_env.errors import BlastEnvError, import_extra

with import_extra("app", "page to design on"):
    from starlette.datastructures import URL, MutableHeaders
    from starlette.requests import HTTPConnection
    from starlette.responses import HTMLResponse, PlainTextResponse, Response
    from starlette.types import ASGIApp, Message, Receive, Scope, Send
    from starlette.websockets import WebSocketClose

MOST_BYTES: Final = 100_000_000
"""Largest request; larger ones are refused before they are read."""

MOST_SECONDS: Final = 120.0
"""Longest time that a file may take to arrive."""

TOKEN: Final = "token"
"""Name of the token in the printed address."""

_GONE_S: Final = 0.1
_UNANSWERED: Final = "No response returned."
_TOKEN_BYTES: Final = 32
_EVERYWHERE: Final = ("0.0.0.0", "::", "")
_OWN_NAMES: Final = ("localhost", "127.0.0.1", "[::1]")
_NAME: Final = re.compile(r"(\[[0-9a-f:.]+\]|[a-z0-9_-]+(\.[a-z0-9_-]+)*)(:[0-9]{1,5})?")
METHODS: Final = ("GET", "HEAD", "POST")
"""Methods of the requests of a page."""

_POLICY: Final = MappingProxyType(
    {
        "default-src": "'none'",
        # NiceGUI's pages carry inline scripts, and compile their templates in the browser.
        "script-src": "'self' 'unsafe-inline' 'unsafe-eval'",
        "style-src": "'self' 'unsafe-inline'",
        "img-src": "'self' data: blob:",
        "media-src": "'self' blob:",
        "font-src": "'self' data:",
        "connect-src": "'self'",
        "base-uri": "'none'",
        "form-action": "'self'",
        "frame-ancestors": "'none'",
    }
)

HEADERS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "Content-Security-Policy": "; ".join(f"{key} {value}" for key, value in _POLICY.items()),
        "X-Frame-Options": "DENY",
        "X-Content-Type-Options": "nosniff",
        # Not "no-referrer": with it, browsers send no origin with a form.
        "Referrer-Policy": "same-origin",
        "Cross-Origin-Opener-Policy": "same-origin",
        "Cross-Origin-Resource-Policy": "same-origin",
    }
)
"""Headers of every response."""


@dataclass(frozen=True)
class Entrance:
    """The address of the page, and its secret.

    Attributes:
        host: Address to listen at.
        port: Port to listen at.
        more_names: Further names under which the server answers, with a port or without.
        token: The secret of the printed address.
    """

    host: str = "127.0.0.1"
    port: int = 8080
    more_names: tuple[str, ...] = ()
    token: str = field(default_factory=lambda: secrets.token_urlsafe(_TOKEN_BYTES), repr=False)

    def __post_init__(self) -> None:
        """Check the names."""
        for name in self.more_names:
            if _NAME.fullmatch(name.lower()) is None:
                raise BlastEnvError(
                    f"--allow-host is {name!r}, must be a name or a name and a port, such as"
                    " desk.example:8080"
                )

    @property
    def url(self) -> str:
        """The address, without its secret."""
        name = "localhost" if self.host in _EVERYWHERE else _bracketed(self.host)
        return f"http://{name}:{self.port}"

    @property
    def printed(self) -> str:
        """The address to open."""
        return f"{self.url}/?{urlencode({TOKEN: self.token})}"

    @property
    def cookie(self) -> str:
        """Name of the cookie; browsers keep one set of cookies for all ports of a host."""
        return f"blast-env-{self.port}"

    @property
    def authorities(self) -> frozenset[str]:
        """The values allowed in the header `Host`, and after the scheme in `Origin`."""
        own = _OWN_NAMES if self.host in _EVERYWHERE else (*_OWN_NAMES, _bracketed(self.host))
        # As they are, too: behind a reverse proxy on its scheme's default port.
        named = [more_name.lower() for more_name in self.more_names]
        bare = (*own, *named) if self.port == 80 else named
        return frozenset((*bare, *(f"{name}:{self.port}" for name in (*own, *named))))


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host else host.lower()


def check_port(host: str, port: int) -> None:
    """Refuse an unusable port, before anything is started."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or error
            raise BlastEnvError(
                f"port {port} of {host} cannot be used: {reason}; name another one (--port)"
            ) from error


class Guard:
    """ASGI middleware that admits only allowed requests and websockets to an application.

    Args:
        app: The application.
        entrance: The address of the page, and its secret.
        most_bytes: Largest request.
        most_s: Longest time that a request with content may take.
        methods: Methods of requests.
    """

    def __init__(
        self,
        app: ASGIApp,
        entrance: Entrance,
        most_bytes: int = MOST_BYTES,
        most_s: float = MOST_SECONDS,
        methods: tuple[str, ...] = METHODS,
    ) -> None:
        self.app = app
        self._entrance = entrance
        self._authorities = entrance.authorities
        self._most_bytes = most_bytes
        self._most_s = most_s
        self._methods = methods

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or refuse it."""
        if scope["type"] not in ("http", "websocket"):  # start and end of the server
            await self.app(scope, receive, send)
            return
        asked = HTTPConnection(scope)
        reason = self._foreign(asked)
        if scope["type"] == "websocket":
            if reason or not self._is_known(asked):
                await WebSocketClose(code=1008, reason=reason or _WITHOUT_TOKEN)(
                    scope, receive, send
                )
            else:
                await self.app(scope, receive, send)
            return
        answered = _with_headers(send)
        refusal = self._refusal(asked, reason)
        if refusal is not None:
            await refusal(scope, receive, answered)
        else:
            await self._pass_on(scope, receive, answered)

    def _refusal(self, asked: HTTPConnection, reason: str) -> Response | None:
        """Return the response to a request that must not reach the application, or `None`."""
        method = asked.scope["method"]
        if reason:
            return _refused(403, reason)
        if method not in self._methods:
            return _refused(405, f"method {method} is none of {', '.join(self._methods)}")
        given = asked.query_params.get(TOKEN)
        if method == "GET" and given is not None and self._is_token(given):
            return self._welcome(asked)
        if not self._is_known(asked):
            return _refused(403, _WITHOUT_TOKEN)
        if method == "POST":
            return self._too_large(asked)
        return None

    def _foreign(self, asked: HTTPConnection) -> str:
        """Return the reason why a request is foreign to the page; empty if it is not."""
        hosts = asked.headers.getlist("host")
        if len(hosts) != 1 or hosts[0].lower() not in self._authorities:
            return (
                f"host {', '.join(hosts)!r} is none that this page was started for; another name"
                " is allowed with `blast-env app --allow-host`"
            )
        origins = asked.headers.getlist("origin")
        is_websocket = asked.scope["type"] == "websocket"
        if is_websocket and len(origins) != 1:
            return "a websocket without one origin is refused"
        for origin in origins:
            scheme, _, authority = origin.lower().partition("://")
            if scheme not in ("http", "https") or authority not in self._authorities:
                return f"origin {origin!r} is not this page: other pages may not use it"
        site, place = (asked.headers.get(f"sec-fetch-{name}", "") for name in ("site", "dest"))
        # Other pages may only link here; a frame has another destination than "document".
        if site not in ("", "none", "same-origin") and place != "document":
            return "other pages may not use this page, nor show it in a frame"
        return ""

    def _is_known(self, asked: HTTPConnection) -> bool:
        """Return whether a browser has the cookie, or another program the token as bearer."""
        bearer = asked.headers.get("authorization", "").removeprefix("Bearer ")
        return self._is_token(asked.cookies.get(self._entrance.cookie, "")) or self._is_token(
            bearer
        )

    def _is_token(self, given: str) -> bool:
        return secrets.compare_digest(given.encode(), self._entrance.token.encode())

    def _welcome(self, asked: HTTPConnection) -> Response:
        """Return a page that stores the token in a cookie and goes on to the address without it.

        Not an HTTP redirect: a browser that came from another page would send no cookie with it.
        """
        # A leading double slash would be another host.
        path = quote("/" + asked.scope["path"].lstrip("/\\"))
        rest = urlencode(
            [
                multi_item
                for multi_item in asked.query_params.multi_items()
                if multi_item[0] != TOKEN
            ]
        )
        where = html.escape(f"{path}?{rest}" if rest else path)
        answer = HTMLResponse(
            f'<!doctype html><meta http-equiv="refresh" content="0; url={where}">'
            f'<title>blast-env</title><a href="{where}">on to the page</a>',
            headers={"Cache-Control": "no-store"},
        )
        answer.set_cookie(
            self._entrance.cookie,
            self._entrance.token,
            httponly=True,
            samesite="strict",
            secure=URL(scope=asked.scope).scheme == "https",
        )
        return answer

    def _too_large(self, asked: HTTPConnection) -> Response | None:
        length = asked.headers.get("content-length", "")
        if "transfer-encoding" in asked.headers or not length.isdecimal():
            return _refused(411, "content without its length is refused")
        if int(length) > self._most_bytes:
            return _refused(
                413,
                f"the content has {int(length):,} bytes, must have at most {self._most_bytes:,}",
            )
        return None

    async def _pass_on(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let the application answer, within the time limit for requests with content."""
        begun = False

        async def noted(message: Message) -> None:
            nonlocal begun
            begun = True
            await send(message)

        try:
            async with asyncio.timeout(self._most_s if scope["method"] == "POST" else None):
                await self.app(scope, receive, noted)
        except TimeoutError:
            if not begun:
                words = f"the content took more than {self._most_s:g} s to arrive"
                await _refused(408, words)(scope, receive, send)
        except RuntimeError as error:
            # Starlette raises this if the browser closed before the application answered.
            if str(error) != _UNANSWERED or not await _is_gone(receive):
                raise


class PathGuard:
    """ASGI middleware that admits programs, not pages, under a path that begins with the token.

    It is for clients that can be given an address, but no header.

    Args:
        app: The application, which sees paths without the token.
        entrance: The address, and its secret.
    """

    def __init__(self, app: ASGIApp, entrance: Entrance) -> None:
        self.app = app
        self._entrance = entrance

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or refuse it."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        asked = HTTPConnection(scope)
        hosts = asked.headers.getlist("host")
        token, _, path = scope["path"].removeprefix("/").partition("/")
        is_own = len(hosts) == 1 and hosts[0].lower() in self._entrance.authorities
        known = secrets.compare_digest(token.encode(), self._entrance.token.encode())
        if is_own and known and "origin" not in asked.headers:
            await self.app({**scope, "path": f"/{path}", "raw_path": b""}, receive, send)
        elif scope["type"] == "websocket":
            await WebSocketClose(code=1008, reason=_WITHOUT_TOKEN)(scope, receive, send)
        else:
            await _refused(403, _WITHOUT_TOKEN)(scope, receive, send)


async def _is_gone(receive: Receive) -> bool:
    """Return whether the browser has hung up."""
    with suppress(TimeoutError):
        async with asyncio.timeout(_GONE_S):
            while (await receive())["type"] != "http.disconnect":
                pass
            return True
    return False


_WITHOUT_TOKEN: Final = (
    "this is opened by the address that `blast-env app` or `serve` printed, with its token"
)


def _refused(status: int, reason: str) -> Response:
    return PlainTextResponse(f"{reason}\n", status, headers={"Cache-Control": "no-store"})


def _with_headers(send: Send) -> Send:
    """Return a `send` that adds the common headers to responses."""

    async def sent(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for key, value in HEADERS.items():
                headers[key] = value
        await send(message)

    return sent
