"""Work requested on the page: its progress and its answers, as files that survive a kill."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from time import monotonic, time
from typing import Any, Final, Literal, TypeAlias

from blast_env.answers.document import Document
from blast_env.app.kept import MOST_BYTES, FileRecord, write_kept
from blast_env.documents import check_values, read_text
from blast_env.evaluation import LoadCase
from blast_env.gas.settings import Cells
from blast_env.site import Scenario

STATUS: Final = "status.json"
ANSWER: Final = "answer.json"
"""Name of the file of an answer in the folder of its work."""

_LEAST_SHARE: Final = 0.05  # below it the time left cannot be estimated
_LEAST_PAUSE_S: Final = 0.1
State = Literal["waiting", "running", "done", "failed", "stopped"]


class Status(FileRecord):
    """The progress of work.

    Attributes:
        title: Its title on the page.
        share: Completed share, 0 to 1.
        text: The current activity, the result or the error.
        layout: The best layout so far, or the proposed one; `None` without one.
        file: The file that it wrote.
        began_s: Its start, seconds since 1970; 0 before it.
        grace_s: Time allowed to stop and to keep its results, before its process is killed.
    """

    state: State = "waiting"
    title: str = ""
    share: float = 0.0
    text: str = ""
    layout: tuple[tuple[Any, ...], ...] | None = None
    file: str | None = None
    began_s: float = 0.0
    grace_s: float = 5.0

    def left_s(self, now_s: float) -> float | None:
        """Return the time left at the present rate, s; `None` if it cannot be estimated."""
        if self.state != "running" or self.share < _LEAST_SHARE or not self.began_s:
            return None
        return (now_s - self.began_s) * (1.0 - self.share) / self.share

    @property
    def is_over(self) -> bool:
        """Whether the work has ended."""
        return self.state in ("done", "failed", "stopped")


def write_status(status: Status, folder: Path) -> None:
    """Write the progress of work."""
    write_kept(status, folder / STATUS)


def read_status(folder: Path) -> Status:
    """Return the progress of work; an unreadable status counts as failed."""
    try:
        return Status.model_validate_json(check_values(read_text(folder / STATUS, MOST_BYTES)))
    except ValueError as error:
        return Status(state="failed", title=folder.name, text=f"cannot be read: {error}")


def end(folder: Path, state: State, text: str) -> None:
    """Write the end of work into its status, unless it has ended already."""
    status = read_status(folder)
    if not status.is_over:
        write_status(status.model_copy(update={"state": state, "text": text}), folder)


class StatusWriter:
    """Writes the progress of work into its status, at most every 0.1 s.

    Args:
        folder: The folder of the work.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        changes = {"state": "running", "began_s": time()}
        self._status = read_status(folder).model_copy(update=changes)
        self._written_s = 0.0
        self.write()

    def write(self, **changes: object) -> None:
        """Write changes of the status at once; the keys are the fields of `Status`."""
        self._status = self._status.model_copy(update=changes)
        self._written_s = monotonic()
        write_status(self._status, self.folder)

    def share(self, share: float) -> None:
        """Write the completed share, 0 to 1, if an update is due."""
        if self.is_due:
            self.write(share=min(max(share, 0.0), 1.0))

    @property
    def is_due(self) -> bool:
        """Whether the last update is long enough ago."""
        return monotonic() - self._written_s >= _LEAST_PAUSE_S

    @property
    def status(self) -> Status:
        """The status written last."""
        return self._status


Task: TypeAlias = Callable[[StatusWriter], None]
"""Work for a process: it pickles, and may be interrupted anywhere by `KeyboardInterrupt`."""


@dataclass(frozen=True, kw_only=True)
class TaskWithBlasts:
    """What all work with blasts has.

    Attributes:
        threats: The threats: a single one is known, several are hidden.
        cache: Folder of the store of blasts.
        cells: The cells of the page; a search has cells twice as large.
    """

    site: Scenario
    threats: tuple[LoadCase, ...]
    cache: Path
    cells: Cells


class Question(StrEnum):
    """Questions on the level of protection of buildings, each as a command answers it.

    Attributes:
        ASSESS: Does the layout comply, and with which probability? As `assess`.
        CAPACITY: Up to which charge, and from which stand-off? As `assess --capacity`.
        ADVISE: Which measures comply at the least cost? As `advise`.
    """

    ASSESS = "assess"
    CAPACITY = "largest charge"
    ADVISE = "advise"


class Answer(FileRecord):
    """The answer to a question.

    Attributes:
        subject: Digest of the site, the layout and the threats.
    """

    question: Question
    subject: str
    document: Document
