"""Screening: the site's answer by Kingery and Bulmash and the atlas, before any blast."""

from typing import Final

from nicegui import background_tasks, run, ui

from blast_env.answers.document import Document, Picture
from blast_env.answers.page import show
from blast_env.answers.screening import screening_answer
from blast_env.app.session import NO_FACADE, Session
from blast_env.atlas import packaged_laws
from blast_env.errors import BlastEnvError
from blast_env.evaluation.questions.screening import screen
from blast_env.geometry import Layout
from blast_env.response.levels import LevelOfProtection
from blast_env.response.requirements import Requirement
from blast_env.site import Scenario
from blast_env.site.sources import CHARGE_PRESETS, PRESETS_SOURCE, MassPreset

_REQUIREMENTS: Final = (
    *("very low", "low", "medium", "high"),
    *("gsa 1", "gsa 2", "gsa 3a", "gsa 3b", "iso A", "iso B", "iso D", "iso E"),
)
_DPI: Final = 90


class ScreeningView:
    """Shows the screening of the current site and layout.

    Args:
        session: The design.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._state: object = None
        self._is_open = False
        level = session.scenario.objective.level or LevelOfProtection.LOW
        with ui.row().classes("be-choices w-full items-center gap-2"):
            presets = {name: f"{name}: {kg:g} kg" for name, (kg, _) in CHARGE_PRESETS.items()}
            self._masses = ui.select(
                presets, multiple=True, value=[], label="masses, else the site's"
            )
            self._required = ui.select([*_REQUIREMENTS], value=level.label, label="required")
            for element in (self._masses, self._required):
                element.props("dense outlined options-dense").classes("w-64")
                element.on_value_change(self.refresh)
        with ui.element("div").classes("be-results"):
            self._said = ui.label().classes("be-quiet").props('aria-live="polite"')
            self._answer = ui.column().classes("w-full gap-1")
            ui.label(f"presets: {PRESETS_SOURCE}").classes("be-quiet")

    def show(self, is_open: bool) -> None:
        """Begin or end to follow the design."""
        self._is_open = is_open
        self.refresh()

    def refresh(self) -> None:
        """Screen the current site, if it is shown and has changed."""
        session = self._session
        state = (
            session.scenario.content_hash,
            repr(session.scenario.bays_with(session.design.layout)) if self._is_open else "",
            session.design.layout,
            (*self._masses.value,),
            self._required.value,
        )
        if self._is_open and state != self._state:
            self._state = state
            self._said.text = "screening"
            background_tasks.create(self._screen(state))

    async def _screen(self, state: object) -> None:
        session = self._session
        masses = [MassPreset(name, CHARGE_PRESETS[name][0]) for name in self._masses.value]
        required = Requirement.parsed(self._required.value)
        answer: Document | None = None
        words = ""
        try:
            if not session.scenario.bays:
                raise BlastEnvError(NO_FACADE)
            answer = await run.io_bound(
                _answer, session.scenario, session.design.layout, masses, required
            )
        except BlastEnvError as error:
            words = str(error)
        if not (answer or words) or state != self._state or self._said.is_deleted:
            return  # changed meanwhile, or closed
        self._said.text = words
        self._answer.clear()
        with self._answer:
            show(answer or Document(()))


def _answer(
    scenario: Scenario, layout: Layout, masses: list[MassPreset], required: Requirement
) -> Document:
    # Here, because pictures take half a second to import.
    from blast_env.plots.figures import png_of
    from blast_env.plots.screening import screening_picture

    found = screen(scenario, layout, masses, packaged_laws())
    rings = png_of(screening_picture(scenario, layout, found), _DPI)
    parts = screening_answer(scenario, layout, found, [required])
    return Document.of([*parts, Picture("stand-offs as rings", rings)])
