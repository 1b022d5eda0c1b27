"""The panel on the right: layouts, blasts, proposals, and the current work."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import time
from typing import Final

from nicegui import ui

from blast_env.app import placing
from blast_env.app.design import SLOTS
from blast_env.app.editor import Editor, Tool
from blast_env.app.offers import offered, runs_blasts
from blast_env.app.page.numbers import NumberField
from blast_env.app.session import Session
from blast_env.app.threats import threats_of
from blast_env.app.work import Status
from blast_env.errors import BlastEnvError
from blast_env.gas.cost import cost_words, time_words
from blast_env.gas.settings import Cells
from blast_env.geometry import Layout
from blast_env.site import Scenario

_CELLS: Final[dict[Cells, str]] = {
    0.25: "cells of 0.25 m: final results, with the grid error",
    "fine": "fine growing cells: the same on sites of 40 m and more",
    0.5: "cells of 0.5 m: a look in a tenth of the time",
    "coarse": "coarse growing cells: the same on sites of 40 m and more",
}
_SHOWN_JOBS: Final = 8
_STATES: Final = {
    "waiting": ("hourglass_empty", "waiting"),
    "running": ("autorenew", "running"),
    "done": ("check_circle", "done"),
    "failed": ("error", "failed"),
    "stopped": ("stop_circle", "stopped"),
}


@dataclass
class _Card:
    """Work on the page; its elements are bound to its status, and stay while that changes."""

    folder: Path
    status: Status

    def can_show(self, folder: Path, status: Status) -> bool:
        """Return whether the same elements can show a status of some work."""
        return self.folder == folder and _elements_of(self.status) == _elements_of(status)


def _elements_of(status: Status) -> tuple[object, ...]:
    """Return the values that decide which elements show a status."""
    return status.title, status.state, status.file, status.layout is None, _says(status)


def _says(status: Status) -> bool:
    """Return whether the text of a status adds to its state."""
    return status.text not in ("", _STATES[status.state][1])


def _state_of(status: Status) -> str:
    """Return the state of work in a word, and the time left."""
    left_s = status.left_s(time())
    return _STATES[status.state][1] + ("" if left_s is None else f", {time_words(left_s)} left")


class WorkPanel:
    """Starts blasts and proposals, and follows them.

    Args:
        editor: The editor of the design.
        after: Called after the panel has changed something.
        results: Called to show the results.
    """

    def __init__(
        self,
        editor: Editor,
        after: Callable[[], None],
        results: Callable[[], None],
    ) -> None:
        self._editor = editor
        self._after = after
        self._results = results
        self._filling = False
        self._cards: list[_Card] | None = None
        self._refusal: ui.notification | None = None
        self._seen: object = None
        self._there: tuple[frozenset[str], bool] | None = None
        self._build()

    @property
    def _session(self) -> Session:
        return self._editor.session

    def _build(self) -> None:
        with ui.column().classes("be-side be-right").props('role="region" aria-label="work"'):
            self._build_layouts()
            self._build_blast()
            self._build_proposal()
            ui.label("Work").classes("be-head")
            self._jobs = ui.column().classes("w-full gap-1").props('aria-live="polite"')

    def _build_layouts(self) -> None:
        ui.label("Layouts").classes("be-head")
        with ui.row().classes("w-full items-center no-wrap gap-2"):
            self._slots = ui.toggle(dict(enumerate(SLOTS)), on_change=lambda e: self._show(e.value))
            self._slots.props('dense no-caps aria-label="layout that is edited"').classes(
                "be-slots"
            )
            copy = ui.button(icon="content_copy", on_click=self._copy).props("dense flat size=sm")
            copy.props('aria-label="copy into the next empty layout"')
            copy.tooltip("copy into the next empty layout")
            clear = ui.button(icon="layers_clear", on_click=self._clear).props("dense flat size=sm")
            clear.props('aria-label="clear this layout"').tooltip("clear this layout")
        self._counted = ui.label().classes("be-quiet")
        self._palette = ui.select(
            {}, label="item to place", on_change=lambda e: self._item(e.value)
        )
        self._palette.props("dense outlined options-dense").classes("w-full be-whole")
        self._turned = ui.switch("rotated (key R)", on_change=lambda e: self.turn(e.value))
        self._measures = ui.column().classes("w-full gap-0")
        self._measures_shown: object = None

    def _build_blast(self) -> None:
        ui.separator()
        with ui.row().classes("w-full items-center no-wrap gap-2"):
            ui.label("Blast").classes("be-head")
            ui.space()
            one = ui.button("Blast", icon="flare", on_click=self.blast)
            one.props("dense no-caps color=red-9").mark("blast")
            every = ui.button("all", on_click=self.blast_all).props("dense outline no-caps")
            every.tooltip("blast every layout that is not empty")
        self._cells = ui.select(
            _CELLS, value=0.25, label="gas dynamics", on_change=lambda e: self._use(e.value)
        )
        self._threats = ui.select(
            [], label="threats", multiple=True, on_change=lambda e: self._against(e.value)
        )
        for element in (self._cells, self._threats):
            element.props("dense outlined options-dense").classes("w-full be-whole")
        self._cost = ui.label().classes("be-quiet").props('aria-live="polite"')

    def _build_proposal(self) -> None:
        ui.separator()
        with ui.row().classes("w-full items-center no-wrap gap-2"):
            ui.label("Proposal").classes("be-head")
            ui.space()
            propose = ui.button("Propose", icon="lightbulb", on_click=self.propose)
            propose.props("dense no-caps").mark("propose")
        with ui.row().classes("w-full no-wrap gap-1"):
            self._proposer = ui.select([], label="by")
            self._proposer.props("dense outlined options-dense").classes("grow be-whole")
            self._budget = NumberField("blasts", 50, whole=True, least=1)
            self._budget.classes("w-20")
        self._budget.bind_enabled_from(self._proposer, "value", runs_blasts)
        self._search_cost = ui.label().classes("be-quiet")
        for element in (self._proposer, self._budget):
            element.on_value_change(lambda: self._say_cost_of_search())

    # Actions.

    def _show(self, slot: int) -> None:
        if not self._filling:
            self._session.show(slot)

    def _copy(self) -> None:
        design = self._session.design
        empty = [k for k, layout in enumerate(design.layouts) if not layout and k != design.active]
        if not empty:
            ui.notify("all four layouts are in use: clear one first", type="warning")
            return
        self._try(
            lambda: self._session.put(
                f"copy {SLOTS[design.active]} to {SLOTS[empty[0]]}",
                design.with_layout(design.layout, empty[0]),
            )
        )
        self._session.show(empty[0])

    def _clear(self) -> None:
        design = self._session.design
        label = f"clear {SLOTS[design.active]}"
        self._try(lambda: self._session.put(label, design.with_layout(())))

    def _item(self, name: str | None) -> None:
        if not self._filling and name is not None:
            self._editor.item = name
            self._editor.choose(Tool.PLACE)
            self._after()

    def turn(self, turned: bool | None = None) -> None:
        """Toggle or set the rotation of the item to place."""
        if self._filling:
            return
        self._editor.turned = not self._editor.turned if turned is None else turned
        self._after()

    def _harden(self, measure: str, taken: bool) -> None:
        if not self._try(lambda: self._session.harden(measure, taken=taken)):
            self._measures_shown = None  # its switch is wrong: draw it again
            self._after()

    def _use(self, cells: Cells) -> None:
        if self._filling:
            return
        self._session.cells = cells
        self._try(self._session.keep)
        self._after()

    def _against(self, names: Sequence[str]) -> None:
        if not self._filling and names:
            self._session.threats = tuple(names)
            self._try(self._session.keep)
            self._after()

    def blast(self) -> None:
        """Blast the active layout."""
        self._blast([self._session.design.active])

    def blast_all(self) -> None:
        """Blast every layout that is not empty, and no barrier."""
        layouts = self._session.design.layouts
        self._blast([k for k, layout in enumerate(layouts) if layout] or [0])

    def _blast(self, slots: Sequence[int]) -> None:
        if self._try(lambda: self._session.blast(slots)):
            self._results()
            self.follow()

    def propose(self) -> None:
        """Start the chosen proposer or search."""
        name, session = str(self._proposer.value), self._session
        self._try(lambda: session.search(name, int(self._budget.filled)))
        self.follow()

    def _take(self, status: Status) -> None:
        active = self._session.design.active
        if self._try(lambda: self._session.take(status, active)):
            ui.notify(f"copied into layout {SLOTS[active]}", type="positive")

    def _stop(self, folder: Path) -> None:
        self._session.workers.stop(folder)
        self.follow()

    def _try(self, act: Callable[[], object]) -> bool:
        """Call `act`, or show its error; return whether it succeeded."""
        self._dismiss()
        try:
            act()
        except BlastEnvError as error:
            self._refusal = ui.notification(
                str(error), type="negative", multi_line=True, close_button=True, timeout=None
            )
            return False
        return True

    def _dismiss(self) -> None:
        """Take away the last refusal, which the next action or edit may have mended."""
        if self._refusal is not None:
            self._refusal.dismiss()
            self._refusal = None

    # Display.

    def refresh(self) -> None:
        """Show the current design."""
        session, design = self._session, self._session.design
        if self._seen not in (None, design):
            self._dismiss()
        self._seen = design
        self._filling = True
        self._slots.value = design.active
        self._counted.text = placing.counted(design.scenario, design.layout)
        offers = placing.palette(design.scenario, design.layout)
        names = [offer.name for offer in offers]
        if offers and self._editor.item not in names:
            self._editor.item = names[0]
        options = {offer.name: f"{offer.label}, {offer.left} left" for offer in offers}
        self._palette.set_options(options, value=self._editor.item if offers else None)
        chosen = next((offer for offer in offers if offer.name == self._editor.item), None)
        self._turned.value = self._editor.turned
        self._turned.visible = chosen is not None and chosen.can_turn
        self._offer_measures(design.scenario, design.layout)
        self._offer_proposals(design.scenario)
        known = [own.name for own in threats_of(design.scenario)]
        self._threats.set_options(known, value=list(session.threats))
        self._cells.value = session.cells
        self._filling = False
        self._say_cost()
        self._say_cost_of_search()

    def _say_cost(self) -> None:
        session = self._session
        self._there = self._files_there
        slots = [session.design.active]
        costs = session.cost(slots)
        self._cost.text = cost_words([*costs, *session.cost_of_error(slots)], drawn=len(costs))

    @property
    def _files_there(self) -> tuple[frozenset[str], bool]:
        return self._session.folder.blasts_there(), self._session.is_at_work

    def _say_cost_of_search(self) -> None:
        costs = []
        if runs_blasts(self._proposer.value):
            with suppress(BlastEnvError):  # the field shows the error
                costs = [*self._session.cost_of_search(int(self._budget.filled))]
        self._search_cost.visible = bool(costs)
        if costs:
            self._search_cost.text = cost_words(costs)

    def _offer_measures(self, scenario: Scenario, layout: Layout) -> None:
        """Offer the measures, one switch each."""
        offers = placing.measures(scenario, layout)
        if offers == self._measures_shown:
            return
        self._measures_shown = offers
        self._measures.clear()
        with self._measures:
            if offers:
                ui.label("measures: hardening needs no new blast").classes("be-quiet")
            for offer in offers:
                act = partial(self._harden, offer.name)
                switch = ui.switch(offer.label, value=offer.is_taken)
                switch.on_value_change(lambda event, act=act: act(event.value))
                switch.props("dense").classes("text-sm").tooltip(offer.words)

    def _offer_proposals(self, scenario: Scenario) -> None:
        """Offer rules and searches for a site; keep the choice if it is still offered."""
        offers = {**offered(scenario)}
        chosen = self._proposer.value
        value = chosen if chosen in offers else next(iter(offers), None)
        self._proposer.set_options(offers, value=value)

    def follow(self) -> None:
        """Show the progress of work."""
        if self._files_there != self._there:
            self._say_cost()
        jobs = self._session.jobs(_SHOWN_JOBS)
        cards = self._cards
        if cards is not None and len(cards) == len(jobs):
            pairs = [*zip(cards, jobs, strict=True)]
            if all(card.can_show(*job) for card, job in pairs):
                for card, (_, status) in pairs:
                    card.status = status
                return
        self._jobs.clear()
        with self._jobs:
            if not jobs:
                ui.label("nothing yet: press Blast").classes("be-quiet")
            self._cards = [self._card(folder, status) for folder, status in jobs]

    def _card(self, folder: Path, status: Status) -> _Card:
        card, icon = _Card(folder, status), _STATES[status.state][0]
        with ui.column().classes("be-job"):
            with ui.row().classes("w-full items-center no-wrap gap-1"):
                ui.icon(icon, size="18px", color="red-9" if status.state == "failed" else "blue-9")
                ui.label(status.title).style("font-weight: 600; font-size: 13px")
                ui.space()
                ui.label().classes("be-quiet").bind_text_from(card, "status", _state_of)
            if not status.is_over:
                bar = ui.linear_progress(show_value=False, size="8px")
                bar.props(f'aria-label="share of {status.title}"')
                bar.bind_value_from(card, "status", lambda own: own.share)
            if _says(status):
                refused = "be-refused" if status.state == "failed" else "be-quiet"
                text = ui.label().classes(refused)
                text.bind_text_from(card, "status", lambda part: part.text)
            with ui.row().classes("gap-1"):
                if not status.is_over:
                    stop = ui.button("stop", icon="stop", on_click=partial(self._stop, folder))
                    stop.props("dense outline no-caps size=sm")
                if status.layout is not None:
                    words = "use it" if status.is_over else "use the best so far"
                    take = ui.button(words, icon="input", on_click=lambda: self._take(card.status))
                    take.props("dense outline no-caps size=sm")
                if status.file and status.state in ("done", "stopped"):
                    fetch = partial(ui.download.file, status.file)
                    button = ui.button("download", icon="download", on_click=lambda: fetch())
                    button.props("dense outline no-caps size=sm")
        return card
