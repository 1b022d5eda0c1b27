"""The work folder: designs, their blasts, and the server that holds it.

Every file is written as a whole, so that nothing is lost when a page is reloaded, a browser closed
or the server stopped.
"""

import json
import secrets
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from blast_env.app.blasts import PICTURES, BlastPictures, Picture
from blast_env.app.design import Design, DesignStep, History
from blast_env.app.kept import MOST_BYTES, DesignSettings, check_key, read_kept, write_kept
from blast_env.app.work import ANSWER
from blast_env.documents import DocumentError, parse_json, read_text
from blast_env.errors import BlastEnvError
from blast_env.files import make_folder, write_atomically, write_text
from blast_env.site import Scenario

_DESIGN: Final = "design.json"
_SETTINGS: Final = "settings.json"
_OPEN: Final = "open.txt"
_LOCK: Final = "open.sqlite"


@dataclass(frozen=True)
class DesignEntry:
    """A design in the list of saved designs.

    Attributes:
        design_id: Its name in the folder.
        title: Name of its site.
        changed_s: Time of the last change, seconds since 1970.
        problem: The reason why it cannot be opened; empty if it can.
    """

    design_id: str
    title: str
    changed_s: float
    problem: str = ""


class DesignFolder:
    """The folder of one design.

    Args:
        path: The folder; it must exist.

    Attributes:
        path: As given.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @property
    def design_id(self) -> str:
        """Name of the design: that of its folder."""
        return self.path.name

    @property
    def jobs(self) -> Path:
        """Folder of the requested work."""
        return self.path / "jobs"

    @property
    def blasts(self) -> Path:
        """Folder of the blasts."""
        return self.path / "blasts"

    def save(self, history: History) -> None:
        """Save a design with its steps."""
        content = json.dumps(history.record(), allow_nan=False)
        with write_atomically(self.path / _DESIGN) as temporary:
            temporary.write_text(content, encoding="utf-8")

    def settings(self) -> DesignSettings | None:
        """Return the settings of its page; `None` if none were saved."""
        return read_kept(DesignSettings, self.path / _SETTINGS)

    def keep_settings(self, settings: DesignSettings) -> None:
        """Save the settings of its page."""
        write_kept(settings, self.path / _SETTINGS)

    def load(self) -> History:
        """Return the design with its steps."""
        return History.from_record(self._content(), str(self.path / _DESIGN))

    def entry(self) -> DesignEntry:
        """Return the entry of the design for a list, without checking the whole design."""
        try:
            changed_s = (self.path / _DESIGN).stat().st_mtime
            content = self._content()
            site = content["sites"][content["present"]["scenario"]]
            return DesignEntry(self.design_id, str(site["name"]), changed_s)
        except (BlastEnvError, OSError, LookupError, TypeError) as error:
            return DesignEntry(self.design_id, "damaged", 0.0, str(error))

    def blast_of(self, key: str) -> Path:
        """Return the folder of a blast, which need not exist."""
        return self.blasts / check_key(key)

    def blasts_there(self) -> frozenset[str]:
        """Return the keys of the complete blasts."""
        return frozenset(path.parent.name for path in self.blasts.glob(f"*/{PICTURES}"))

    def pictures_of(self, key: str) -> tuple[Picture, ...]:
        """Return the pictures of a blast; none if it is not complete."""
        found = read_kept(BlastPictures, self.blast_of(key) / PICTURES)
        return () if found is None else found.pictures

    def answers_there(self) -> list[Path]:
        """Return the files of answers, the latest first."""
        return sorted(self.jobs.glob(f"*/{ANSWER}"), reverse=True)

    def _content(self) -> Any:
        path = self.path / _DESIGN
        try:
            return parse_json(read_text(path, MOST_BYTES))
        except DocumentError as error:
            raise BlastEnvError(f"{path}: cannot be read: {error}") from error


class WorkFolder:
    """The folder of all designs.

    Args:
        path: The folder; created if it is missing.

    Attributes:
        path: As given, absolute.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path).expanduser().absolute()
        make_folder(self._designs)

    @property
    def cache(self) -> Path:
        """Folder of the loads of blasts, shared by all designs."""
        return self.path / "cache"

    def designs(self) -> list[DesignEntry]:
        """Return the designs, the latest changed first."""
        # A process killed while it creates a design leaves a folder without one.
        folders = [folder for folder in self._designs.iterdir() if (folder / _DESIGN).exists()]
        entries = [DesignFolder(folder).entry() for folder in folders]
        return sorted(entries, key=lambda part: -part.changed_s)

    def create(self, scenario: Scenario, label: str) -> DesignFolder:
        """Return the folder of a new design.

        Args:
            label: Label of the first step: the source of the site.
        """
        folder = DesignFolder(self._designs / secrets.token_hex(6))
        for path in (folder.path, folder.jobs, folder.blasts):
            make_folder(path)
        folder.save(History(DesignStep(label, Design(scenario))))
        return folder

    def open(self, design_id: str) -> DesignFolder:
        """Return the folder of a design."""
        folder = DesignFolder(self._designs / check_key(design_id))
        if not (folder.path / _DESIGN).is_file():
            raise BlastEnvError(f"there is no design {design_id!r} in {self.path}")
        return folder

    @contextmanager
    def held(self, url: str) -> Iterator[None]:
        """Hold the folder in this block: two servers would overwrite each other's designs.

        Args:
            url: Address of this server, for the message of others.
        """
        mark = self.path / _OPEN
        # The system frees the lock of a killed process, too.
        with closing(sqlite3.connect(self.path / _LOCK, timeout=0.0)) as lock:
            try:
                lock.execute("BEGIN EXCLUSIVE")
                write_text(mark, url)
            except sqlite3.OperationalError as error:
                if error.sqlite_errorcode != sqlite3.SQLITE_BUSY:
                    raise BlastEnvError(f"{self.path}: cannot be held: {error}") from error
                raise BlastEnvError(
                    f"{self.path} is open already at {read_text(mark)}: go there, or name another"
                    " folder (--folder)"
                ) from error
            yield

    @property
    def _designs(self) -> Path:
        return self.path / "designs"
