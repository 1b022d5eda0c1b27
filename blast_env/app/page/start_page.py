"""The start page: saved designs, and sites for new ones."""

from datetime import datetime

from nicegui import ui

from blast_env.app.page.numbers import NumberField
from blast_env.app.page.uploads import complaints, site_upload
from blast_env.app.session import Sessions
from blast_env.app.sources import blank_site
from blast_env.site import Scenario, bundled_scenarios, load_scenario
from blast_env.units import MODULE_SIDE_M

_MOST_SHOWN = 30


class StartPage:
    """The start page.

    Args:
        sessions: The designs.
        message: A message to show first.
    """

    def __init__(self, sessions: Sessions, message: str = "") -> None:
        self._sessions = sessions
        with ui.header().classes("be-header items-center q-py-none q-px-md"):
            ui.label("blast-env").classes("be-title")
            ui.label("where should barriers stand?").classes("q-ml-md")
        with ui.row().classes("be-start w-full gap-4 q-pa-md items-start"):
            with ui.column().classes("be-side"):
                self._begin(message)
            with ui.column().classes("be-side"):
                self._designs()

    def _begin(self, message: str) -> None:
        if message:
            ui.label(message).classes("be-refused")
        ui.label("Start from a site of your own").classes("be-head")
        site_upload("drop a file here, or press +", self._sessions.workers, self._create)
        ui.label("or from a bundled one").classes("be-head")
        for name in bundled_scenarios():
            with ui.row().classes("be-site w-full items-center"):
                button = ui.button(name, icon="add", on_click=lambda _, n=name: self._bundled(n))
                button.props("no-caps dense outline").classes("w-44 shrink-0")
                ui.label(load_scenario(name).description).classes("be-quiet be-what")
        ui.separator()
        with ui.row().classes("items-center gap-2"):
            self._sides = [
                NumberField(words, 40.0, least=MODULE_SIDE_M)
                for words in ("width (m)", "depth (m)")
            ]
            for side in self._sides:
                side.classes("w-28")
            ui.button("blank site", icon="crop_free", on_click=self._blank).props(
                "no-caps dense outline"
            )

    def _designs(self) -> None:
        ui.label("Continue a design").classes("be-head")
        entries = self._sessions.work.designs()
        if not entries:
            ui.label("No designs yet.").classes("be-quiet")
        for entry in entries[:_MOST_SHOWN]:
            when = datetime.fromtimestamp(entry.changed_s).strftime("%Y-%m-%d %H:%M")
            if entry.problem:
                ui.label(f"{entry.design_id}: {entry.problem}").classes("be-refused")
                continue
            with ui.row().classes("w-full items-center no-wrap"):
                ui.link(entry.title, f"/design/{entry.design_id}").style("font-weight: 600")
                ui.space()
                ui.label(f"{when}, {entry.design_id}").classes("be-quiet")
        ui.label(f"designs are saved in {self._sessions.work.path}").classes("be-quiet q-mt-md")

    def _bundled(self, name: str) -> None:
        self._create(load_scenario(name), name)

    def _blank(self) -> None:
        with complaints():
            self._create(blank_site(*(side.filled for side in self._sides)), "a blank site")

    def _create(self, scenario: Scenario, source: str) -> None:
        with complaints():
            session = self._sessions.new(scenario, f"site of {source}")
            ui.navigate.to(f"/design/{session.folder.design_id}")
