"""Opening and saving: sites and layouts as files, all forms of export, reports."""

from collections.abc import Callable
from functools import partial
from typing import Any, Final

import tomli_w
from nicegui import events, ui

from blast_env.app.design import SLOTS
from blast_env.app.page.uploads import complaints, file_upload, read_upload, site_upload
from blast_env.app.session import Session
from blast_env.app.sources import layout_of_file
from blast_env.evaluation.study import final_cells
from blast_env.files import scratch_folder
from blast_env.gas.cost import cost_words
from blast_env.gas.settings import Cells
from blast_env.io.export import SUFFIXES, LayoutPlan, export_layout
from blast_env.provenance import versions
from blast_env.response.levels import LevelOfProtection
from blast_env.site import Scenario

_CELLS: Final[dict[tuple[Cells, Cells], str]] = {
    (0.5, 0.25): "0.5 and 0.25 m: with the grid error",
    (0.5, 0.5): "0.5 m only: much quicker",
    ("coarse", "fine"): "coarse and fine: growing cells, for sites of 40 m and more",
    ("coarse", "coarse"): "coarse only: growing cells, much quicker",
}
_LEVELS: Final = {
    int(level): f"level of protection: {level.label}"
    for level in LevelOfProtection
    if level > LevelOfProtection.BELOW_STANDARDS
}


def _menu(words: str, icon: str) -> ui.menu:
    with ui.button(words, icon=icon).props("flat dense no-caps color=white"):
        return ui.menu()


class FilesMenu:
    """The menus of the header.

    Args:
        session: The design.
        after: Called after a file has changed the design.
    """

    def __init__(self, session: Session, after: Callable[[], None]) -> None:
        self._session = session
        self._after = after
        with _menu("Open", "folder_open"):
            ui.menu_item("all designs, new design", lambda: ui.navigate.to("/"))
            ui.menu_item("replace the site from a file", self._open_site)
            ui.menu_item("layout from a file", self._open_layout)
        with _menu("Save as", "save_alt"):
            ui.menu_item("site: scenario file (.toml)", self._save_site)
            for suffix in SUFFIXES:
                ui.menu_item(f"layout: {suffix}", partial(self._save_layout, suffix))
            ui.menu_item("report on this layout (.html)", partial(self._save_report, False))
            ui.menu_item("report on this layout (.pdf)", partial(self._save_report, True))

    def _open_site(self) -> None:
        with ui.dialog(value=True) as dialog, ui.card().classes("w-[480px]"):
            ui.label("Replace the site").style("font-weight: 600")
            ui.label("Barriers that are legal on the new site stay. Undo restores everything.")

            def use(scenario: Scenario, name: str) -> None:
                dialog.close()
                notes = self._session.put_site(f"site of {name}", scenario)
                for note in notes:
                    ui.notify(note, type="warning", multi_line=True)
                self._after()

            site_upload("drop a file here, or press +", self._session.workers, use)
            ui.button("cancel", on_click=dialog.close).props("flat no-caps")

    def _open_layout(self) -> None:
        with ui.dialog(value=True) as dialog, ui.card().classes("w-[480px]"):
            active = self._session.design.active
            ui.label(f"Open a layout file (.json) as layout {SLOTS[active]}")

            async def take(event: events.UploadEventArguments) -> None:
                file = await read_upload(self._session.workers, event.file, layout_of_file)
                if file is None:
                    return
                dialog.close()
                with complaints():
                    layout = file.layout_for(self._session.scenario)
                    design = self._session.design.with_layout(layout)
                    self._session.put(f"layout of {event.file.name}", design)
                self._after()

            file_upload("drop a file here, or press +", (".json",), take)
            ui.button("cancel", on_click=dialog.close).props("flat no-caps")

    def _save_site(self) -> None:
        scenario = self._session.scenario
        text = tomli_w.dumps(scenario.model_dump(mode="json", exclude_none=True))
        ui.download.content(text.encode(), f"{scenario.name}.toml")

    def _save_layout(self, suffix: str) -> None:
        session = self._session
        name = f"{session.scenario.name}_{SLOTS[session.design.active]}{suffix}"
        provenance = {"made by": "blast-env app", "versions": versions()}
        with complaints(), scratch_folder() as folder:
            plan = LayoutPlan(session.scenario, session.design.layout, provenance=provenance)
            ui.download.content(export_layout(plan, folder / name).read_bytes(), name)

    def _save_report(self, as_pdf: bool) -> None:
        with complaints():
            self._session.cost_of_report()  # raises if no report is possible
            ReportDialog(self._session, as_pdf)


class ReportDialog:
    """Lets the user choose the contents of a report, and shows its cost.

    Args:
        session: The design.
        as_pdf: Whether to write the report as PDF, too.
    """

    def __init__(self, session: Session, as_pdf: bool) -> None:
        self._session, self._as_pdf = session, as_pdf
        with ui.dialog(value=True) as self._dialog, ui.card().classes("w-[480px]"):
            kind = "PDF" if as_pdf else "HTML page"
            ui.label(f"Report on layout {SLOTS[session.design.active]}: {kind}").style(
                "font-weight: 600"
            )
            cells = final_cells(session.scenario)
            self._cells = ui.select(_CELLS, value=cells, label="cells of gas dynamics")
            wanted = session.scenario.objective.level or LevelOfProtection.LOW
            self._target = ui.select(_LEVELS, value=wanted, label="required level")
            self._target.visible = bool(session.scenario.bays)
            self._items = ui.switch("contribution of each barrier", value=True)
            for element in (self._cells, self._target):
                element.props("dense outlined options-dense").classes("w-full")
            self._cost = ui.label().props('aria-live="polite"')
            ui.label(
                "A stopped report keeps its finished parts, once the loads on the coarser cells"
                " are known."
            ).classes("be-quiet")
            with ui.row():
                ui.button("begin", on_click=self._begin).props("no-caps")
                ui.button("cancel", on_click=self._dialog.close).props("flat no-caps")
        for own in (self._cells, self._items):
            own.on_value_change(self._say_cost)
        self._say_cost()

    @property
    def _contents(self) -> dict[str, Any]:
        """The chosen options of `StudyOptions`."""
        return {
            "cells": (*self._cells.value,),
            "items": bool(self._items.value),
            "target": LevelOfProtection(self._target.value),
        }

    def _say_cost(self) -> None:
        cost = self._session.cost_of_report(**self._contents)
        self._cost.text = cost_words(cost.blasts, cost.drawn)

    def _begin(self) -> None:
        session = self._session
        name = f"{session.scenario.name}_{SLOTS[session.design.active]}"
        page = session.folder.path / f"{name}.html"
        self._dialog.close()
        with complaints():
            pdf = page.with_suffix(".pdf") if self._as_pdf else None
            session.report(page, pdf, **self._contents)
            ui.notify("the report is being made: download it on the right when it is ready")
