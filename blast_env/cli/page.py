"""`blast-env app`: the page to design on."""

from dataclasses import dataclass
from pathlib import Path

from blast_env.cli.command import Command, option
from blast_env.cli.output import message_console, print_line


@dataclass(frozen=True, kw_only=True)
class AppCommand(Command):
    """Open a local web page to design on: draw a site, place barriers, blast, compare, search.

    Open the printed address: without its token, the page admits nobody. Every step is saved in the
    folder. Ctrl-C ends the page.
    """

    port: int = option(8080, "Port of the page.", min=1, max=65535)
    host: str = option(
        "127.0.0.1", "Address to listen at; others than 127.0.0.1 are open to others."
    )
    folder: Path = option(Path("blast-env-designs"), "Where designs, blasts and layouts are kept.")
    more_names: tuple[str, ...] = option(
        (),
        "Another name under which browsers reach the page, with a port or without; more than one"
        " will do.",
        flag="--allow-host",
    )
    runs: tuple[Path, ...] = option(
        (), "Run folder of a trained agent to ask; may be given again.", flag="--run"
    )

    def __call__(self) -> None:
        """Serve the page until Ctrl-C."""
        # Here, because the page needs the extra `app`.
        from blast_env.app.guard import Entrance
        from blast_env.app.server import LOOPBACK, serve

        for each in self.runs:
            check_run(each)
        entrance = Entrance(self.host, self.port, self.more_names)
        if self.host not in LOOPBACK:
            message_console().print(
                "warning: whoever has the address below, or listens on the way to"
                f" {self.host}, can use this page, read and change the designs in the folder and"
                " start work on this computer; nothing is encrypted",
                style="yellow",
            )
        print_line(f"blast-env app: {entrance.printed}  (designs in {self.folder})")
        serve(entrance, self.folder, self.runs)


def check_run(folder: Path) -> None:
    """Refuse a folder that is no run, before anything is started.

    Raises:
        BlastEnvError: If it is no run folder.
    """
    from blast_agents.training.run_folder import RunFolder  # here, because it imports torch

    RunFolder(folder).configuration()
