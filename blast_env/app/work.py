"""Work that a page asks for, as files: what is to be done, how far it has come, what came of it."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from pydantic import Field, TypeAdapter

from blast_env.app.records import MOST_BYTES, EngineRecord, Kept, write_kept
from blast_env.app.threats import NamedThreat
from blast_env.documents import read_text
from blast_env.errors import BlastEnvError
from blast_env.response.buildings import LevelOfProtection
from blast_env.scenario import AnyCharge, Scenario

if TYPE_CHECKING:
    from blast_env.reporting import StudyOptions

TASK: Final = "task.json"
STATUS: Final = "status.json"
_LEAST_SHARE: Final = 0.05  # before that nobody knows
State = Literal["waiting", "running", "done", "failed", "stopped"]


class SiteTask(Kept):
    """Work on a site.

    Attributes:
        scenario: The site as a document.
        threats: Those that layouts are held against: one is known, more are hidden.
        cache: Folder for the loads of blasts.
    """

    scenario: dict[str, Any]
    threats: tuple[NamedThreat, ...]
    cache: str

    @property
    def site(self) -> Scenario:
        """The site.

        Raises:
            ScenarioError: If the document is none.
        """
        return Scenario.from_document(self.scenario, str(self.scenario.get("name", "the site")))


class LayoutTask(SiteTask):
    """Work on one layout.

    Attributes:
        layout: The layout.
    """

    layout: tuple[tuple[Any, ...], ...]


class BlastTask(LayoutTask):
    """Blasts of one layout, one a threat.

    Attributes:
        engine: The engine.
        blasts: Folder that the blasts are put into, each under its key.
    """

    kind: Literal["blast"] = "blast"
    engine: EngineRecord
    blasts: str


class SearchTask(SiteTask):
    """A search for a layout.

    Attributes:
        method: Name of the method.
        budget: Most blasts.
        engine: The engine.
        begin_with: A layout to begin with, for methods that can.
    """

    kind: Literal["search"] = "search"
    method: str
    budget: int
    engine: EngineRecord
    begin_with: tuple[tuple[Any, ...], ...] = ()


class ProposalTask(SiteTask):
    """A layout that is proposed at once.

    Attributes:
        proposer: Name of a rule, or the folder of a trained agent's run.
        is_run: Whether it is a folder.
    """

    kind: Literal["proposal"] = "proposal"
    proposer: str
    is_run: bool = False


class FilmTask(LayoutTask):
    """A film of the first threat as a file to keep, without a barrier beside it.

    Attributes:
        engine: The engine.
        path: The file.
    """

    kind: Literal["film"] = "film"
    engine: EngineRecord
    path: str


class ReportChoice(Kept):
    """What is to be in a report; see `StudyOptions`."""

    cells: tuple[float | str, float | str] = (0.5, 0.25)
    items: bool = True
    target: int = LevelOfProtection.LOW

    def options(self, charges: Iterable[AnyCharge], cache: Path) -> "StudyOptions":
        """Return the options of a report under some charges.

        Raises:
            BlastEnvError: If there are too many.
        """
        from blast_env.reporting import StudyOptions  # needs an extra

        return StudyOptions(
            charges=tuple(charges),
            cells=self.cells,
            items=self.items,
            target=LevelOfProtection(self.target),
            cache=cache,
        )


class ReportTask(LayoutTask):
    """A report on one layout by gas dynamics.

    Attributes:
        choice: What is to be in it.
        path: The page, .html.
        pdf: The same as PDF; `None` for none.
    """

    kind: Literal["report"] = "report"
    choice: ReportChoice = ReportChoice()
    path: str
    pdf: str | None = None


Task = Annotated[
    BlastTask | SearchTask | ProposalTask | FilmTask | ReportTask, Field(discriminator="kind")
]

_TASK: Final[TypeAdapter[Task]] = TypeAdapter(Task)


class Status(Kept):
    """How far work has come.

    Attributes:
        state: Where it is.
        title: What it is, for people.
        share: Share that is done.
        text: What is going on, or what came of it, or what is wrong.
        layout: The best layout so far, or the one that is proposed; `None` without one.
        file: A file that was made.
        began_s: When it began, seconds since 1970; 0 for not yet.
        grace_s: How long it may take to stop, and to keep what it has, before it is ended.
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
        """Return how long it still takes, if it goes on as until now; `None` if that is unknown."""
        if self.state != "running" or self.share < _LEAST_SHARE or not self.began_s:
            return None
        return (now_s - self.began_s) * (1.0 - self.share) / self.share

    @property
    def is_over(self) -> bool:
        """Whether nothing more will come."""
        return self.state in ("done", "failed", "stopped")


def write_task(task: Task, folder: Path, title: str) -> None:
    """Put work into a folder of its own.

    Raises:
        BlastEnvError: If it cannot be written.
    """
    write_kept(task, folder / TASK)
    write_status(Status(title=title), folder)


def read_task(folder: Path) -> Task:
    """Return the work of a folder.

    Raises:
        BlastEnvError: If there is none.
    """
    try:
        return _TASK.validate_json(read_text(folder / TASK, MOST_BYTES))
    except ValueError as error:
        raise BlastEnvError(f"{folder}: holds no work: {error}") from error


def write_status(status: Status, folder: Path) -> None:
    """Say how far work has come."""
    write_kept(status, folder / STATUS)


def read_status(folder: Path) -> Status:
    """Return how far work has come; where that cannot be read, that it failed."""
    try:
        return Status.model_validate_json(read_text(folder / STATUS, MOST_BYTES))
    except ValueError as error:
        return Status(state="failed", title=folder.name, text=f"cannot be read: {error}")
