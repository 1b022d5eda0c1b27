"""Work requested on the page, as files: the task, its progress and its result."""

from collections.abc import Iterable
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from pydantic import Field, TypeAdapter

from blast_env.app.records import MOST_BYTES, Kept, write_kept
from blast_env.documents import check_values, read_text
from blast_env.errors import BlastEnvError
from blast_env.evaluation import LoadCase
from blast_env.evaluation.answers import AnswerTable
from blast_env.gas.settings import Cells
from blast_env.response.buildings import LevelOfProtection
from blast_env.site import AnyCharge, Scenario

if TYPE_CHECKING:
    from blast_env.report import StudyOptions

TASK: Final = "task.json"
STATUS: Final = "status.json"
ANSWER: Final = "answer.json"
"""Name of the file of an answer in the folder of its work."""

_LEAST_SHARE: Final = 0.05  # below it the time left cannot be estimated
State = Literal["waiting", "running", "done", "failed", "stopped"]


class SiteTask(Kept):
    """Work on a site.

    Attributes:
        scenario: The site as a document.
        threats: Those that layouts are tested against: a single one is known, several are hidden.
        cache: Folder for the loads of blasts.
    """

    scenario: dict[str, Any]
    threats: tuple[LoadCase, ...]
    cache: str

    @property
    def site(self) -> Scenario:
        """The site.

        Raises:
            ScenarioError: If the document is no scenario.
        """
        return Scenario.from_document(self.scenario, str(self.scenario.get("name", "the site")))


class LayoutTask(SiteTask):
    """Work on one layout.

    Attributes:
        layout: The layout.
    """

    layout: tuple[tuple[Any, ...], ...]


class BlastTask(LayoutTask):
    """Blasts of one layout, one per threat.

    Attributes:
        cells: The cells.
        blasts: Folder for the blasts, each under its key.
    """

    kind: Literal["blast"] = "blast"
    cells: Cells
    blasts: str


class SearchTask(SiteTask):
    """A search for a layout, or a proposal without a blast.

    Attributes:
        method: Name of the proposer.
        budget: Most blasts; 0 for a proposer that runs none.
        cells: The cells of the page; the search has cells twice as large.
    """

    kind: Literal["search"] = "search"
    method: str
    budget: int
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


class AnswerTask(LayoutTask):
    """A question on a layout, by gas dynamics.

    Attributes:
        question: The question.
        name: Name of the layout.
        cells: The cells; a search of advice has cells twice as large.
        target: Required level of protection.
        mass_error: Uncertainty of the masses; see `Uncertainty`.
        budget: Most blasts of a search of advice.
        subject: Digest of the site, the layout and the threats.
    """

    kind: Literal["answer"] = "answer"
    question: Question
    subject: str
    name: str
    cells: Cells
    target: int
    mass_error: float
    budget: int

    @property
    def level(self) -> LevelOfProtection:
        """The required level of protection."""
        return LevelOfProtection(self.target)


class Answer(Kept):
    """The answer to a question.

    Attributes:
        question: The question.
        subject: As in `AnswerTask`.
        parts: Its lines and tables.
    """

    question: Question
    subject: str
    parts: tuple[str | AnswerTable, ...]


class ReportChoice(Kept):
    """The contents of a report; see `StudyOptions`."""

    cells: tuple[float | str, float | str] = (0.5, 0.25)
    items: bool = True
    target: int = LevelOfProtection.LOW

    def options(self, charges: Iterable[AnyCharge], cache: Path) -> "StudyOptions":
        """Return the options of a report under some charges.

        Raises:
            BlastEnvError: If there are too many charges, or an option is out of bounds.
        """
        from blast_env.report import StudyOptions  # needs an extra

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
        choice: Its contents.
        path: The page, .html.
        pdf: The same as PDF; `None` for none.
    """

    kind: Literal["report"] = "report"
    choice: ReportChoice = ReportChoice()
    path: str
    pdf: str | None = None


Task = Annotated[
    BlastTask | SearchTask | ReportTask | AnswerTask,
    Field(discriminator="kind"),
]

_TASK: Final[TypeAdapter[Task]] = TypeAdapter(Task)


class Status(Kept):
    """The progress of work.

    Attributes:
        state: Its state.
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


def write_task(task: Task, folder: Path, title: str) -> None:
    """Write work and its first status into its folder.

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
        return _TASK.validate_json(check_values(read_text(folder / TASK, MOST_BYTES)))
    except ValueError as error:
        raise BlastEnvError(f"{folder}: holds no work: {error}") from error


def write_status(status: Status, folder: Path) -> None:
    """Write the progress of work."""
    write_kept(status, folder / STATUS)


def read_status(folder: Path) -> Status:
    """Return the progress of work; an unreadable status counts as failed."""
    try:
        return Status.model_validate_json(check_values(read_text(folder / STATUS, MOST_BYTES)))
    except ValueError as error:
        return Status(state="failed", title=folder.name, text=f"cannot be read: {error}")
