"""The server of the page, for one person at a desk."""

import socket
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Final

from blast_env.app.folder import WorkFolder
from blast_env.app.jobs import Workers
from blast_env.app.records import check_key
from blast_env.app.session import Sessions
from blast_env.errors import BlastEnvError, import_extra

with import_extra("app", "page to design on"):
    from fastapi import HTTPException
    from fastapi.responses import FileResponse
    from nicegui import app, ui

    from blast_env.app.page.design_page import DesignPage
    from blast_env.app.page.start_page import StartPage

LOOPBACK: Final = ("127.0.0.1", "localhost", "::1")

_PAGE_FILES: Final = Path(__file__).parent / "page"
_PRIMARY: Final = "#005a8c"  # on white and under white it can be read
_TICK_S: Final = 0.05
_RECONNECT_S: Final = 30.0
"""How long a browser may be silent, as while gas keeps all cores busy, before it loads anew."""

_KEPT_BY_BROWSER: Final = {"Cache-Control": "private, max-age=31536000, immutable"}


def add_pages(sessions: Sessions, runs: Sequence[Path] = ()) -> None:
    """Add the pages to NiceGUI's application.

    Args:
        sessions: The designs.
        runs: Run folders of trained agents that may be asked for layouts.
    """

    @ui.page("/", title="blast-env")
    def start() -> None:
        _style()
        StartPage(sessions)

    @ui.page("/design/{design_id}", title="blast-env")
    def design(design_id: str) -> None:
        _style()
        try:
            session = sessions.of(design_id)
        except BlastEnvError as error:
            StartPage(sessions, str(error))
            return
        DesignPage(session, runs)

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

    app.add_static_file(local_file=_PAGE_FILES / "player.js", url_path="/player.js")
    app.timer(_TICK_S, sessions.workers.tick)


def _style() -> None:
    ui.colors(primary=_PRIMARY)
    ui.add_css((_PAGE_FILES / "page.css").read_text(encoding="utf-8"))
    ui.add_body_html('<script src="/player.js"></script>')


def check_port(host: str, port: int) -> None:
    """Refuse a port on which nothing can be served, before anything is started.

    Raises:
        BlastEnvError: If it is in use, or may not be used.
    """
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


def serve(host: str, port: int, folder: Path, runs: Sequence[Path] = ()) -> None:
    """Serve the page until the process is told to end.

    Args:
        host: Address to listen at.
        port: Port to listen at.
        folder: Where everything is kept.
        runs: Run folders of trained agents.

    Raises:
        BlastEnvError: If the port cannot be used, or another server has the folder open.
    """
    check_port(host, port)
    work, workers = WorkFolder(folder), Workers()
    with ExitStack() as held:
        held.enter_context(work.held(f"http://{host}:{port}"))
        held.callback(workers.close)
        add_pages(Sessions(work, workers), runs)
        app.on_startup(workers.prepare)
        app.on_shutdown(held.close)  # after SIGTERM nothing else is run any more
        ui.run(
            host=host, port=port, title="blast-env", reload=False, show=False,
            show_welcome_message=False, reconnect_timeout=_RECONNECT_S,
        )  # fmt: skip
