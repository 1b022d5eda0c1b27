"""Screening: the site's answer by Kingery and Bulmash, before any blast."""

from typing import Final

from nicegui import background_tasks, run, ui

from blast_env.answers.document import Table
from blast_env.answers.page import address_of, fill, text_table
from blast_env.app.session import NO_FACADE, Session
from blast_env.errors import BlastEnvError
from blast_env.evaluation.questions.screening import (
    LEFT_OUT,
    STAND_OFF_HEADERS,
    THREAT_HEADERS,
    Screening,
    screen,
)
from blast_env.geometry import Layout
from blast_env.response.buildings import LevelOfProtection
from blast_env.response.requirements import Requirement
from blast_env.site import Scenario
from blast_env.site.presets import CHARGE_PRESETS, PRESETS_SOURCE, NamedMass

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
            self._threats = text_table()
            self._picture = ui.element("img").props('alt="stand-offs as rings"').classes("w-full")
            self._threats.visible = self._picture.visible = False
            self._stand_offs = ui.column().classes("w-full gap-1")
            ui.label(f"{LEFT_OUT}; presets: {PRESETS_SOURCE}").classes("be-quiet")

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
        masses = [NamedMass(name, CHARGE_PRESETS[name][0]) for name in self._masses.value]
        required = Requirement.parsed(self._required.value)
        answer: tuple[Screening, str] | BlastEnvError | None
        try:
            if not session.scenario.bays:
                raise BlastEnvError(NO_FACADE)
            answer = await run.io_bound(
                _answer, session.scenario, session.design.layout, masses, required
            )
        except BlastEnvError as error:
            answer = error
        if answer is None or state != self._state or self._said.is_deleted:
            return  # changed meanwhile, or closed
        self._put(answer, required)

    def _put(self, answer: "tuple[Screening, str] | BlastEnvError", required: Requirement) -> None:
        self._stand_offs.clear()
        failed = isinstance(answer, BlastEnvError)
        self._threats.visible = self._picture.visible = not failed
        if isinstance(answer, BlastEnvError):
            self._said.text = str(answer)
            return
        found, picture = answer
        self._said.text = f"required: {required.words}; worst place of each threat by damage"
        rows = [found.threat_row(each, [required]) for each in found.threats]
        fill(self._threats, Table.of("", THREAT_HEADERS, rows, len(THREAT_HEADERS)))
        self._picture.props(f'src="{picture}"')
        with self._stand_offs:
            for each in found.threats:
                ui.label(f"stand-off (m) for each level, {each.name} (* on this site)")
                of_each = found.stand_off_rows(each)
                table = Table.of("", STAND_OFF_HEADERS, of_each, len(STAND_OFF_HEADERS))
                fill(text_table(), table)


def _answer(
    scenario: Scenario, layout: Layout, masses: list[NamedMass], required: Requirement
) -> tuple[Screening, str]:
    """Return a screening and its picture as an address of data."""
    # Here, because pictures take half a second to import.
    from blast_env.plots.figures import png_of
    from blast_env.plots.screening import screening_picture

    found = screen(scenario, layout, masses)
    for each in found.threats:
        found.threat_row(each, [required])
    return found, address_of(png_of(screening_picture(scenario, layout, found), _DPI))
