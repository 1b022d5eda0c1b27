"""The page of one design."""

from collections.abc import Callable

from nicegui import ui

from blast_env.app.editor import Editor
from blast_env.app.page.files_menu import FilesMenu
from blast_env.app.page.plan_view import PlanPanel, SolidView
from blast_env.app.page.results_view import ResultsView
from blast_env.app.page.screening_view import ScreeningView
from blast_env.app.page.site_panel import SitePanel
from blast_env.app.page.verdict_view import VerdictView
from blast_env.app.page.work_panel import WorkPanel
from blast_env.app.session import Session

_PERIOD_S = 0.15
_SCREENING = "Screening"


class DesignPage:
    """The page of one design, in one tab.

    Args:
        session: The design.
    """

    def __init__(self, session: Session) -> None:
        self.session = session
        self.editor = Editor(session)
        self._header()
        with ui.row().classes("be-main"):
            self._site = SitePanel(self.editor, self.refresh)
            with ui.column().classes("be-centre"):
                with ui.tabs().props("dense no-caps align=left inline-label") as self._tabs:
                    ui.tab("Plan", icon="map")
                    ui.tab("3-D", icon="view_in_ar")
                    ui.tab(_SCREENING, icon="radar")
                    ui.tab("Verdict", icon="gavel")
                    ui.tab("Results", icon="leaderboard")
                with ui.tab_panels(self._tabs, value=session.view, animated=False).classes(
                    "w-full grow"
                ) as panels:
                    panels.props("keep-alive").style("background: transparent")
                    with ui.tab_panel("Plan").classes("p-0 gap-1"):
                        self._plan = PlanPanel(self.editor, self.refresh, self._commands())
                    with ui.tab_panel("3-D").classes("p-0"):
                        self._solid = SolidView(self.editor)
                    with ui.tab_panel(_SCREENING).classes("p-0"):
                        self._screening = ScreeningView(session)
                    with ui.tab_panel("Verdict").classes("p-0"):
                        self._verdict = VerdictView(session)
                    with ui.tab_panel("Results").classes("p-0"):
                        self._results = ResultsView(session)
            self._tabs.on_value_change(lambda event: self._keep_view(event.value))
            self._work = WorkPanel(self.editor, self.refresh, self.show_results)
        ui.context.client.on_delete(session.listen(self.refresh))
        self.refresh()
        ui.timer(_PERIOD_S, self._follow)

    def show_results(self) -> None:
        """Turn to the results."""
        self._tabs.value = "Results"

    def _keep_view(self, view: str) -> None:
        self.session.view = view
        self.session.keep()
        self._screening.show(view == _SCREENING)

    def refresh(self) -> None:
        """Show the current design in all parts of the page."""
        self._site.refresh()
        self._plan.refresh()
        self._solid.refresh()
        self._work.refresh()
        self._results.refresh()
        self._verdict.refresh()
        self._screening.show(self.session.view == _SCREENING)
        history = self.session.history
        self._undo.set_enabled(bool(history.past))
        self._redo.set_enabled(bool(history.future))
        self._last.text = f"last: {history.present.label}"
        self._title.text = history.design.scenario.name

    def _follow(self) -> None:
        self._work.follow()
        self._results.refresh()
        self._verdict.refresh()

    def _header(self) -> None:
        with ui.header().classes("be-header items-center gap-1 q-py-none q-px-md"):
            ui.label("blast-env").classes("be-title")
            self._title = ui.label().classes("q-ml-md")
            FilesMenu(self.session, self.refresh)
            self._undo = ui.button("Undo", icon="undo", on_click=self.session.undo)
            self._redo = ui.button("Redo", icon="redo", on_click=self.session.redo)
            for button, words in ((self._undo, "Ctrl+Z"), (self._redo, "Ctrl+Y")):
                button.props("flat dense no-caps color=white").tooltip(words)
            self._last = ui.label().classes("be-wide").style("font-size: 12.5px; opacity: 0.85")
            ui.space().classes("be-wide")
            kept = ui.label("saved at every step").classes("be-wide")
            kept.style("font-size: 12.5px; opacity: 0.85")
            ui.button("Keys", icon="keyboard", on_click=_show_keys).props(
                "flat dense no-caps color=white"
            ).classes("be-wide")

    def _commands(self) -> dict[str, Callable[[], None]]:
        return {
            "ctrl+z": self.session.undo,
            "ctrl+y": self.session.redo,
            "ctrl+shift+z": self.session.redo,
            "b": lambda: self._work.blast(),
            "r": lambda: self._work.turn(),
        }


_KEYS = (
    (
        "V P E S Z K C A G",
        "tools: select, place, erase, structure, zone, no-build area, charge, area, gauge",
    ),
    ("arrow keys", "with Select: move the selection by 0.5 m; otherwise: move the cell"),
    ("Enter, space", "place an item on the cell, or remove the one there"),
    ("R", "rotate the item to place"),
    ("Delete, Escape", "delete the selection; deselect"),
    ("B", "blast"),
    ("Ctrl+Z, Ctrl+Y", "undo, redo"),
    ("+ - 0", "zoom in, zoom out, whole site"),
    ("right mouse button", "erase, whatever the tool"),
    ("Tab", "go to the next field or button"),
)


def _show_keys() -> None:
    with ui.dialog(value=True) as dialog, ui.card().classes("w-[620px] max-w-full"):
        ui.label("Keys").style("font-weight: 600; font-size: 16px")
        with ui.grid(columns="180px 1fr").classes("w-full gap-1"):
            for key, words in _KEYS:
                ui.label(key).style("font-weight: 600")
                ui.label(words)
        ui.button("close", on_click=dialog.close).props("autofocus no-caps")
