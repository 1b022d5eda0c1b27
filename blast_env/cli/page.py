"""`blast-env app`: the page to design on."""

from pathlib import Path

import typer

from blast_env.answers.terminal import print_line
from blast_env.cli.output import message_console


def page(
    port: int = typer.Option(8080, help="Port of the page.", min=1, max=65535),
    host: str = typer.Option(
        "127.0.0.1", help="Address to listen at; others than 127.0.0.1 are open to others."
    ),
    folder: Path = typer.Option(
        Path("blast-env-designs"), help="Where designs, blasts and layouts are kept."
    ),
    more_names: list[str] = typer.Option(
        [],
        "--allow-host",
        help="Another name under which browsers reach the page, with a port or without; more than "
        "one will do.",
    ),
) -> None:
    """Open a local web page to design on: draw a site, place barriers, blast, compare, search.

    Open the printed address: without its token, the page admits nobody. Every step is saved in the
    folder. Ctrl-C ends the page.
    """
    # Here, because the page needs the extra `app`.
    from blast_env.app.guard import Entrance
    from blast_env.app.server import LOOPBACK, serve

    entrance = Entrance(host, port, tuple(more_names))
    if host not in LOOPBACK:
        message_console().print(
            "warning: whoever has the address below, or listens on the way to"
            f" {host}, can use this page, read and change the designs in the folder and"
            " start work on this computer; nothing is encrypted",
            style="yellow",
        )
    print_line(f"blast-env app: {entrance.printed}  (designs in {folder})")
    serve(entrance, folder)
