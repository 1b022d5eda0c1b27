"""Results beside each other: pictures, verdicts and the table of loads."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from nicegui import background_tasks, run, ui

from blast_env.answers.compare import headline, verdict_table
from blast_env.answers.document import TYPOGRAPHIC, address_of
from blast_env.answers.page import fill, text_table
from blast_env.app.blasts import Picture
from blast_env.app.session import LayoutView, Session
from blast_env.evaluation import LoadCase
from blast_env.evaluation.blasts import NO_BARRIER, Blasts
from blast_env.evaluation.questions.grid_error import GridError

_FILM: Final = "film"
_NOTHING: Final = "No results yet for the current layouts: press Blast."
_RUNNING: Final = "Running: the panel Work shows the progress."
_START_FILMS: Final = """
const films = [...document.querySelectorAll("img.be-film")];
Promise.all(films.map((film) => fetch(film.src).then((answer) => answer.blob()))).then((blobs) =>
  films.forEach((film, index) => { film.src = URL.createObjectURL(blobs[index]); }));
"""
"""Starts all films at once, when all are there: they have the same moments."""


@dataclass(frozen=True)
class _Found:
    """A blast with its pictures.

    Attributes:
        blasts: Its blasts and those without a barrier.
        number: Number of the threat in them.
        pictures: Its pictures by their labels, each with its address.
        damage: Names of the buildings whose damage can be drawn, by the labels of these pictures.
    """

    shown: LayoutView
    blasts: Blasts
    number: int
    pictures: Mapping[str, tuple[str, Picture]]
    damage: Mapping[str, str]


class ResultsView:
    """Shows the blasts of the current layouts.

    Args:
        session: The design.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._what = _FILM
        self._threat = ""
        self._with_bare = True
        self._large = False
        self._state: object = None
        self._build()

    def _build(self) -> None:
        with ui.row().classes("be-choices w-full items-center gap-2"):
            self._pictures = ui.select([_FILM], value=_FILM, label="picture")
            self._pictures.on_value_change(lambda e: self._set("_what", e.value))
            self._threats = ui.select([], label="threat")
            self._threats.on_value_change(lambda e: self._set("_threat", e.value))
            for element in (self._pictures, self._threats):
                element.props("dense outlined options-dense").classes("w-52")
            unprotected = ui.switch("compare with no barrier", value=True)
            unprotected.on_value_change(lambda e: self._set("_with_bare", e.value))
            large = ui.switch("large", value=False)
            large.on_value_change(lambda e: self._set("_large", e.value))
        with ui.element("div").classes("be-results"):
            self._empty = ui.label().classes("be-quiet")
            self._verdicts = text_table()
            self._sharp = ui.label(
                "The level rests on peaks corrected for clipping by the cells. Where the level on "
                "the cells is higher, use smaller cells."
            ).classes("be-quiet mb-2")
            self._cards = ui.element("div").classes("be-cards")
            self._unglazed = ui.label(
                "For damage of windows and walls, give structures windows or wall panels (on the "
                "left), and blast."
            ).classes("be-quiet")
            self._table = text_table().classes("mt-2")
            self._errors = ui.label(
                "Beside loads: the grid error, from the worst charge of each layout on "
                "cells twice as large; of reductions in percentage points."
            ).classes("be-quiet")
            self._notes = ui.column().classes("gap-0 mt-1")

    def _set(self, name: str, value: Any) -> None:
        """Apply another choice, unless it is empty, as while a list is refilled."""
        if value not in (None, "", getattr(self, name)):
            setattr(self, name, value)
            self.refresh()

    def refresh(self) -> None:
        """Show the current results, if they have changed."""
        session = self._session
        threats = {chosen_threat.name: chosen_threat for chosen_threat in session.chosen_threats()}
        if self._threat not in threats:
            self._threat = next(iter(threats))
        self._threats.set_options([*threats], value=self._threat)
        threat = threats[self._threat]
        shown = session.shown(threat)
        running = session.is_at_work
        options = (self._what, self._threat, self._with_bare, self._large, running)
        there = session.folder.blasts_there()
        state = (options, session.cells, shown, tuple(threats), there, session.scenario)
        if state == self._state:
            return
        self._state = state
        results, judged = session.results(), session.verdicts()
        found = [*self._found(shown, threat, results)]
        self._offer(found)
        chosen = [blast for blast in found if self._with_bare or blast.shown.name != NO_BARRIER]
        self._show_cards(chosen, threat)
        self._sharp.visible = any(verdict.is_clipped for *_, own in judged for verdict in own)
        self._unglazed.visible = bool(found) and not judged
        fill(self._verdicts, verdict_table(session.scenario, judged))
        fill(self._table, session.comparison())
        errors = (GridError.of(result) for result in results.values())
        self._errors.visible = any(error is not None for error in errors)
        self._empty.visible = not found
        self._empty.text = _RUNNING if running else _NOTHING
        self._show_notes(found)

    def _found(
        self, shown: Sequence[LayoutView], threat: LoadCase, results: Mapping[str, Blasts]
    ) -> Iterator[_Found]:
        """Yield every blast that is complete, with the addresses of its pictures."""
        session = self._session
        for layout in shown:
            drawn = session.folder.pictures_of(layout.key)
            blasts = results.get(layout.name)
            if blasts is None or threat not in blasts.threats or not drawn:
                continue
            where = f"/blasts/{session.folder.design_id}/{layout.key}"
            pictures = {own.label: (f"{where}/{own.file}", own) for own in drawn}
            judged = (own.building for own in session.judged(layout, threat))
            damage = {f"damage of {session.scenario.title_of(own)}": own for own in judged}
            yield _Found(layout, blasts, blasts.threats.index(threat), pictures, damage)

    def _offer(self, found: Sequence[_Found]) -> None:
        labels = (label for blast in found for label in (*blast.pictures, *blast.damage))
        options = [*dict.fromkeys(labels)] or [_FILM]
        if self._what not in options:
            self._what = options[0]
        self._pictures.set_options(options, value=self._what)

    def _show_cards(self, found: Sequence[_Found], threat: LoadCase) -> None:
        self._cards.clear()
        shown = [blast.pictures[self._what] for blast in found if self._what in blast.pictures]
        kinds = {picture.kind for _, picture in shown}
        wide = "walls" in kinds or any(self._what in blast.damage for blast in found)
        columns = 1 if wide or self._large or len(found) == 1 else 2
        self._cards.style(f"grid-template-columns: repeat({columns}, minmax(0, 1fr))")
        with self._cards:
            for blast in found:
                self._card(blast, threat)
        if "film" in kinds and len(found) > 1:
            ui.run_javascript(_START_FILMS)

    def _card(self, found: _Found, threat: LoadCase) -> None:
        name = found.shown.name
        with ui.element("figure").classes("be-card m-0"):
            with ui.row().classes("w-full items-center no-wrap"):
                title = name if name == NO_BARRIER else f"layout {name}"
                ui.label(title).style("font-weight: 600; white-space: nowrap")
                ui.space()
                ui.label(self._summary(found)).classes("be-quiet")
            image = ui.element("img").props(f'alt="{self._what}, {title}"')
            if self._what in found.pictures:
                address, picture = found.pictures[self._what]
                image.props(f'src="{address}"')
                image.classes("be-film" if picture.kind == "film" else "")
            elif self._what in found.damage:
                building = found.damage[self._what]
                background_tasks.create(self._draw(image, found.shown, threat, building))

    async def _draw(
        self, image: ui.element, shown: LayoutView, threat: LoadCase, building: str
    ) -> None:
        png = await run.io_bound(self._session.damage_png, shown, threat, building)
        if png is not None and not image.is_deleted:
            image.props(f'src="{address_of(png)}"')

    def _summary(self, found: _Found) -> str:
        noun = self._session.scenario.objective.noun
        noun = "mean impulse on protected facades" if noun == "impulse" else noun
        parts = sum(structure.protected for structure in self._session.scenario.structures)
        added = f" ({parts} structures, weighted)" if parts > 1 else ""
        return f"{noun}: {headline(found.blasts, found.number).text(TYPOGRAPHIC)}{added}"

    def _show_notes(self, found: Sequence[_Found]) -> None:
        records = [blast.blasts.records[blast.shown.name][blast.number] for blast in found]
        self._notes.clear()
        with self._notes:
            for note in dict.fromkeys(note for record in records for note in record.complete.notes):
                ui.label(f"note: {note}").classes("be-quiet")
