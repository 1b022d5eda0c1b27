"""A site on which a report takes seconds."""

from collections.abc import Sequence
from typing import Any

from blast_env.answers import Document, Table
from blast_env.answers.html import page_of
from blast_env.answers.report import Report, ReportDetails, report_document
from blast_env.site import Scenario
from tests.gas_sites import WALL, hut

LAYOUT = WALL[1:5]


def small_hut(**changes: Any) -> Scenario:
    """Return the hut of `tests.gas_sites` with less air around it."""
    site = {"width_m": 8.0, "height_m": 6.0, "air_height_m": 3.0}
    return hut(site=site, gauges=[], **changes)


def glazed_hut() -> Scenario:
    """Return the small hut with windows and walls in its four sides; its loads are the same."""
    pane = {"kind": "glazing", "title": "low window", "source": "made up", "thickness_mm": 11.12}
    pane |= {"width_m": 0.9, "height_m": 0.8, "sill_m": 0.5, "glass": "fully_tempered"}
    document = small_hut(components={"low": pane}).model_dump(mode="json")
    facade = {"storey_m": 2.0, "glazing": "low", "wall": "concrete_200"}
    document["structures"][0]["facade"] = facade
    return Scenario.from_document(document, "hut")


def page_text(
    report: Report, commands: Sequence[str] = (), details: ReportDetails | None = None
) -> str:
    """Return a report as an HTML page."""
    title = report.study.scenario.name
    return page_of(report_document(report, commands), title, details)


def table_of(document: Document, title: str) -> Table:
    """Return the table of a document with a title."""
    tables = (part for part in document.parts if isinstance(part, Table))
    return next(table for table in tables if table.title == title)
