"""The verdict: does a layout comply, with which probability, up to which charge, at which cost?"""

from functools import partial
from pathlib import Path

from nicegui import ui

from blast_env.answers.page import show
from blast_env.app.page.numbers import NumberField
from blast_env.app.page.uploads import complaints
from blast_env.app.session import Session
from blast_env.app.work import Answer, Question
from blast_env.gas.cost import cost_words
from blast_env.response.levels import LevelOfProtection

_HEADINGS = {
    Question.ASSESS: "Does the layout comply?",
    Question.CAPACITY: "Up to which charge?",
    Question.ADVISE: "Which measures comply at the least cost?",
}
_LEVELS = {int(own): own.label for own in [*LevelOfProtection][1:]}


class VerdictView:
    """Asks questions on the active layout, and shows the latest answer to each.

    Args:
        session: The design.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._shown: object = None
        level = session.scenario.objective.level or LevelOfProtection.LOW
        with ui.row().classes("be-choices w-full items-center gap-2"):
            self._target = ui.select(_LEVELS, value=int(level), label="required level")
            self._target.props("dense outlined options-dense").classes("w-36")
            self._mass = NumberField("mass error (share)", 0.1, least=0.0)
            self._budget = NumberField("blasts of a search", 60, whole=True, least=1)
            for element in (self._mass, self._budget):
                element.classes("w-28")
            for question in Question:
                button = ui.button(question.value, on_click=partial(self._ask, question))
                button.props("dense no-caps").classes("shrink-0").mark(question.value)
                button.tooltip(_HEADINGS[question])
        with ui.element("div").classes("be-results"):
            self._cost = ui.label().classes("be-quiet")
            self._answers = ui.column().classes("w-full gap-1").props('aria-live="polite"')

    def _ask(self, question: Question) -> None:
        session = self._session
        with complaints():
            level = LevelOfProtection(self._target.value)
            asked = question, level, self._mass.filled, int(self._budget.filled)
            cost = cost_words(session.cost_of_question(*asked))
            session.ask(*asked)
            self._cost.text = f"{question}: up to {cost}; the panel Work shows its progress"

    def refresh(self) -> None:
        """Show the latest answers, if they or the design have changed."""
        session = self._session
        state: tuple[list[Path], object, object] = (
            session.folder.answers_there(),
            session.design,
            session.threats,
        )
        if state == self._shown:
            return
        self._shown = state
        self._answers.clear()
        with self._answers:
            for answer, is_present in session.answers():
                _show(answer, is_present)


def _show(answer: Answer, is_present: bool) -> None:
    ui.label(_HEADINGS[answer.question]).classes("be-head")
    if not is_present:
        ui.label("The site, the layout or the threats have changed since: ask again.").classes(
            "be-refused"
        )
    show(answer.document)
