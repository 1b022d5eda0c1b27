"""The server of the page, for one person at a desk."""

from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Final

from blast_env.app.folder import WorkFolder
from blast_env.app.guard import Entrance, Guard, check_port
from blast_env.app.jobs import Workers
from blast_env.app.kept import check_key
from blast_env.app.session import Sessions
from blast_env.errors import BlastEnvError, import_extra

with import_extra("app", "page to design on"):
    import uvicorn
    from fastapi import Depends, FastAPI, HTTPException, Request
    from fastapi.responses import FileResponse, PlainTextResponse
    from nicegui import Client, app, ui
    from starlette.exceptions import HTTPException as StarletteHTTPException

    from blast_env.app.page.design_page import DesignPage
    from blast_env.app.page.start_page import StartPage

LOOPBACK: Final = ("127.0.0.1", "localhost", "::1")
_PAGE_FILES: Final = Path(__file__).parent / "page"
_PRIMARY: Final = "#005a8c"  # readable on white, and under white text
_TICK_S: Final = 0.05
_RECONNECT_S: Final = 30.0
"""Longest silence of a browser, as when gas keeps all cores busy, before it reloads the page."""

MOST_PAGES: Final = 24
"""Most pages open at the same time; each takes about a megabyte."""

_UNUSED_S: Final = 30.0
"""Lifetime of a page without a connected browser; a busy browser takes a while."""

_MOST_CONNECTIONS: Final = 400
_MOST_MESSAGE_BYTES: Final = 2_000_000
_KEPT_BY_BROWSER: Final = {"Cache-Control": "private, max-age=31536000, immutable"}


def add_pages(sessions: Sessions) -> None:
    """Add the pages to NiceGUI's application.

    Args:
        sessions: The designs.
    """
    room = [Depends(_check_room)]

    @ui.page("/", title="blast-env", dependencies=room)
    def start() -> None:
        _style()
        StartPage(sessions)

    @ui.page("/design/{design_id}", title="blast-env", dependencies=room)
    def design(design_id: str) -> None:
        _style()
        try:
            session = sessions.of(design_id)
        except BlastEnvError as error:
            StartPage(sessions, str(error))
            return
        DesignPage(session)
        ui.context.client.on_delete(partial(sessions.leave, design_id))

    @app.get("/blasts/{design_id}/{key}/{name}")
    def blast_file(design_id: str, key: str, name: str) -> FileResponse:
        try:
            folder = sessions.work.open(design_id).blast_of(key)
            check_key(name.replace(".", "", 1))
        except BlastEnvError as error:
            raise HTTPException(404, str(error)) from error
        if not (folder / name).is_file():
            raise HTTPException(404, f"there is no {name}")
        return FileResponse(folder / name, headers=_KEPT_BY_BROWSER)

    app.add_exception_handler(503, _say)
    app.add_exception_handler(404, _say)  # NiceGUI's would open a page
    app.timer(_TICK_S, sessions.workers.tick)
    app.timer(_UNUSED_S / 4.0, partial(Client.prune_instances, client_age_threshold=_UNUSED_S))


def _check_room() -> None:
    """Refuse a page beyond the limit.

    Raises:
        HTTPException: If `MOST_PAGES` are open.
    """
    if len(Client.instances) >= MOST_PAGES:
        raise HTTPException(
            503,
            f"{len(Client.instances)} pages are open, the most that may be is {MOST_PAGES}: close"
            f" some and try again in {_RECONNECT_S:.0f} s",
        )


def _say(_: Request, error: Exception) -> PlainTextResponse:
    assert isinstance(error, StarletteHTTPException)
    return PlainTextResponse(f"{error.detail}\n", error.status_code)


def _style() -> None:
    ui.colors(primary=_PRIMARY)
    ui.add_css((_PAGE_FILES / "page.css").read_text(encoding="utf-8"))


def serve(entrance: Entrance, folder: Path) -> None:
    """Serve the page until the process is terminated.

    Args:
        entrance: The address of the page, and its secret.
        folder: The work folder.
    """
    check_port(entrance.host, entrance.port)
    work, workers = WorkFolder(folder), Workers()
    with ExitStack() as held:
        held.enter_context(work.held(entrance.url))
        held.callback(workers.close)
        add_pages(Sessions(work, workers))
        app.on_startup(workers.prepare)
        app.on_shutdown(held.close)  # after SIGTERM, code below the server does not run
        outside = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
        ui.run_with(
            outside, title="blast-env", show_welcome_message=False, reconnect_timeout=_RECONNECT_S
        )
        # Not ui.run: its middleware around the pages would be outside the guard.
        uvicorn.run(
            Guard(outside, entrance), host=entrance.host, port=entrance.port, log_level="warning",
            ws="wsproto", ws_max_size=_MOST_MESSAGE_BYTES, limit_concurrency=_MOST_CONNECTIONS,
            server_header=False,
        )  # fmt: skip
