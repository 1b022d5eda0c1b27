"""`blast-env app`: the page to design on."""

from pathlib import Path
from typing import Annotated

import typer

from blast_env.cli.output import message_console, print_line, user_errors


def app(
    port: Annotated[int, typer.Option(min=1, max=65535, help="Port of the page.")] = 8080,
    host: Annotated[
        str, typer.Option(help="Address to listen at; others than 127.0.0.1 are open to others.")
    ] = "127.0.0.1",
    folder: Annotated[
        Path, typer.Option(help="Where designs, blasts and layouts are kept.")
    ] = Path("blast-env-designs"),
    run: Annotated[
        list[Path] | None,
        typer.Option(help="Run folder of a trained agent to ask; more than one will do."),
    ] = None,
) -> None:
    """Open a local web page to design on: draw a site, place barriers, blast, compare, search.

    Everything is kept in the folder at every step. Ctrl-C ends the page.
    """
    with user_errors():
        # Here, because the page needs the extra `app`.
        from blast_env.app.server import LOOPBACK, serve

        for each in run or ():
            check_run(each)
        if host not in LOOPBACK:
            message_console().print(
                f"warning: whoever reaches {host} can use this page, read and change the designs"
                " in the folder and start work on this computer; there is no password",
                style="yellow",
            )
        print_line(f"blast-env app: http://{host}:{port}  (designs in {folder})")
        serve(host, port, folder, tuple(run or ()))


def check_run(folder: Path) -> None:
    """Refuse a folder that is no run, before anything is started.

    Raises:
        BlastEnvError: If it is none.
    """
    from blast_agents.training.run_folder import RunFolder  # here, because it imports torch

    RunFolder(folder).configuration()
