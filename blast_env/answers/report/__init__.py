"""The report on a layout, for its decision makers: a document, as self-contained HTML and PDF."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path
from typing import Final

import tomli_w

from blast_env.answers.document import AnyPart, Document, Line, Picture, Section, Table
from blast_env.answers.html import ReportDetails, check_targets, page_of, write_page
from blast_env.answers.report import basis, checks, loads, summary
from blast_env.evaluation.questions.limits import Limit
from blast_env.evaluation.study import (
    Progress,
    Study,
    StudyOptions,
    StudyPlan,
    final_cells,
    gas_of,
    run_study,
)
from blast_env.files import scratch_folder
from blast_env.geometry import Element
from blast_env.layout import write_layout
from blast_env.plots.report_figures import Drawing, ThreatPictures, site_plan
from blast_env.provenance import code_version, command, versions
from blast_env.site import Scenario

__all__ = [
    "Limit",
    "Report",
    "ReportDetails",
    "Study",
    "StudyOptions",
    "StudyPlan",
    "check_targets",
    "final_cells",
    "report_document",
    "run_report",
    "write_report",
]

_LIBRARIES: Final = ("numpy", "numba", "scipy", "matplotlib")
_HASH_DIGITS: Final = 16


@dataclass(frozen=True, eq=False)
class Report:
    """A report before it is put into words.

    Attributes:
        study: Its blasts.
        pictures: The pictures of each threat on the finer cells, by its name.
    """

    study: Study
    pictures: Mapping[str, Sequence[Drawing]] = field(default_factory=dict)


def run_report(
    scenario: Scenario,
    layout: Sequence[Element],
    options: StudyOptions | None = None,
    progress: Progress = lambda _, __: None,
) -> Report:
    """Run the blasts of a report, and draw those of its threats; see `run_study`.

    Raises:
        BlastEnvError: If the layout is not legal, a charge is out of place, or a limit names no
            building; all before the first blast.
    """
    drawn: dict[str, ThreatPictures] = {}
    study = run_study(
        scenario,
        layout,
        options,
        progress,
        lambda threat: drawn.setdefault(threat.name, ThreatPictures()),
    )
    pictures = {name: own.pictures for name, own in drawn.items()} if study.has_finer else {}
    return Report(study, pictures)


def write_report(
    report: Report,
    html: str | Path,
    pdf: str | Path | None = None,
    details: ReportDetails | None = None,
    commands: Sequence[str] | None = None,
) -> list[Path]:
    """Write a report as one HTML file with its pictures inside and, if requested, as PDF.

    `commands` is the command that made it, by default the command line of this process.

    Returns:
        The files.

    Raises:
        BlastEnvError: If a suffix is wrong, a file cannot be written, or WeasyPrint lacks its
            libraries; the page is written before the PDF.
    """
    check_targets(html, pdf)
    document = report_document(report, command() if commands is None else commands)
    return write_page(page_of(document, report.study.scenario.name, details), html, pdf)


def report_document(report: Report, commands: Sequence[str] = ()) -> Document:
    """Return a report in words, with the command that made it."""
    study = report.study
    known = versions(gas_of(study.blasts).version, _LIBRARIES) | {"code": code_version()}
    sections = (
        _heading(study),
        summary.summary_of(study),
        _plan(study),
        _facades(report),
        basis.alternatives(study),
        basis.design_basis(study),
        basis.assumptions(study, known),
        basis.limits(study),
        basis.references(),
        loads.loads_of(study, report.pictures),
        loads.contributions(study),
        loads.other_places(study),
        checks.checks_of(study),
        Section.of("Reproduction", _reproduction(study, commands, known)),
    )
    return Document(tuple(section for section in sections if section is not None))


def _heading(study: Study) -> Section:
    made = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    words = (
        f"Report on a protective layout of the site {study.scenario.name}, {made}. Loads by gas "
        "dynamics (compressible Euler equations in three dimensions), "
        f"{basis.cells_words(study)}. Impulses in Pa s, overpressures in kPa, lengths in m."
    )
    return Section("", (Line.of(words, kind="quiet"),))


def _plan(study: Study) -> Section:
    scenario = study.scenario
    site = scenario.site
    size = f"{site.width_m} m x {site.height_m} m, air simulated to {scenario.air_height_m} m."
    turned = ""
    if scenario.georeference is not None:
        axis = "east" if scenario.georeference.kind == "map" else "the drawing's x axis"
        angle = f"{scenario.georeference.rotation_deg:.2f} degrees"
        turned = f" Its x axis is turned by {angle} from {axis}."
    caption = f"Plan of the site with stand-offs, {size}{turned}"
    picture = Picture(caption, site_plan(scenario, study.threats, study.layout), is_large=True)
    return Section("Plan", (picture,))


def _facades(report: Report) -> Section | None:
    """Return the damage under the first threat; `None` without pictures of it."""
    name, words = report.study.threats[0].name, gas_of(report.study.blasts).cell_words
    pictures = tuple(
        Picture(
            f"{name}, {own.caption}: without the layout, and with it; {words}.",
            own.png,
            is_large=True,
        )
        for own in report.pictures.get(name, ())
        if own.is_facade
    )
    return Section("Facades before and after", pictures) if pictures else None


def _reproduction(
    study: Study, commands: Sequence[str], known: Mapping[str, str]
) -> Iterator[AnyPart]:
    text = _layout_text(study)
    yield Line.of(" ".join(_quoted(part) for part in commands), kind="code")
    fine = gas_of(study.blasts).cell_words
    yield Line.of(
        "The digest of a blast identifies all of its numbers. Those of page one are the worst of "
        f"the threats, {fine}."
    )
    digest = sha256(text.encode()).hexdigest()[:_HASH_DIGITS]
    rows = [
        *known.items(),
        ("scenario hash", study.scenario.content_hash),
        ("layout file hash (SHA-256)", digest),
        *((f"digest: {label}", own[:_HASH_DIGITS]) for label, own in study.digests),
    ]
    yield Table.of("", ("", ""), rows, 2)
    yield Line.of("Layout", kind="head")
    yield Line.of(text, kind="code")
    yield Line.of("Scenario", kind="head")
    scenario = study.scenario.model_dump(mode="json", exclude_none=True)
    yield Line.of(tomli_w.dumps(scenario), kind="code")


def _layout_text(study: Study) -> str:
    """Return the content of the layout's file, as commands read it."""
    with scratch_folder() as folder:
        path = write_layout(folder / "layout.json", study.scenario, study.layout)
        return path.read_text(encoding="utf-8")


def _quoted(part: str) -> str:
    return f'"{part}"' if " " in part else part
