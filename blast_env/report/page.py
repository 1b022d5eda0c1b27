"""The report as self-contained HTML, and as PDF."""

from base64 import b64encode
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from hashlib import sha256
from math import isfinite, isnan
from pathlib import Path
from typing import Any, Final, NamedTuple
from warnings import catch_warnings, filterwarnings

import numpy as np
import tomli_w

from blast_env.answers.document import percent, worse
from blast_env.errors import BlastEnvError, import_extra
from blast_env.evaluation.engines.peaks import PeakSource
from blast_env.evaluation.engines.pieces import outcome_words
from blast_env.evaluation.questions.capacity import mass_near
from blast_env.evaluation.questions.grid_error import FACTOR, ORDER
from blast_env.evaluation.questions.probability import level_probability, probability_text
from blast_env.evaluation.questions.verdict import Verdict
from blast_env.evaluation.record import BuildingLoad
from blast_env.files import scratch_folder, write_atomically, write_text
from blast_env.gas.settings import CHECKED_SCALED_DISTANCE
from blast_env.geometry import layout_counts
from blast_env.layout import write_layout
from blast_env.plots.plan import stand_off_text
from blast_env.provenance import code_version, command, versions
from blast_env.report.checks import checks_of
from blast_env.report.figures import site_plan, worth_map
from blast_env.report.study import LoadPair, Study
from blast_env.report.threats import place_text
from blast_env.report.verdict import StudyVerdict
from blast_env.tables import table_records
from blast_env.units import MS_PER_S, PA_PER_KPA
from blast_env.values import count_of

with import_extra("report", "reports"):
    from jinja2 import Environment, PackageLoader, StrictUndefined, Template, pass_context
    from markupsafe import Markup

HTML_SUFFIXES: Final = (".html", ".htm")
_NONE: Final = "\N{EN DASH}"
_MINUS: Final = "\N{MINUS SIGN}"
_PLUS_MINUS: Final = "\N{PLUS-MINUS SIGN}"
_LIBRARIES: Final = ("numpy", "numba", "scipy", "matplotlib")
_HASH_DIGITS: Final = 16
_MOST_BAYS: Final = 40


def write_report(
    study: Study, html: str | Path, pdf: str | Path | None = None, commands: list[str] | None = None
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
    page = report_html(study, command() if commands is None else commands)
    write_text(html, page)
    if pdf is None:
        return [Path(html)]
    with write_atomically(pdf) as temporary:
        _weasyprint().HTML(string=page).write_pdf(str(temporary))
    return [Path(html), Path(pdf)]


def check_targets(html: str | Path, pdf: str | Path | None) -> None:
    """Refuse unusable files before any blast is run: wrong suffixes, a PDF without WeasyPrint."""
    if Path(html).suffix.lower() not in HTML_SUFFIXES:
        raise BlastEnvError(f"{html}: suffix is {Path(html).suffix!r}, must be .html")
    if pdf is not None:
        if Path(pdf).suffix.lower() != ".pdf":
            raise BlastEnvError(f"{pdf}: suffix is {Path(pdf).suffix!r}, must be .pdf")
        _weasyprint()


def _weasyprint() -> Any:
    """Return the package that makes PDF; it needs libraries of the system, Pango above all."""
    with import_extra("report", "PDF"), catch_warnings():
        # WeasyPrint's hint to packagers; without that library, embedded fonts are only larger.
        filterwarnings("ignore", "HarfBuzz-Subset", DeprecationWarning)
        try:
            import weasyprint
        except OSError as error:
            raise BlastEnvError(
                f"no PDF: WeasyPrint lacks a library of the system ({error}); install Pango, or "
                "print the HTML page from a browser"
            ) from error
    return weasyprint


def report_html(study: Study, commands: list[str]) -> str:
    """Return the report as one HTML page."""
    return _template().render(_context(study, commands))


@cache
def _template() -> Template:
    """Return the template, which takes longer to compile than to fill in."""
    environment = Environment(
        loader=PackageLoader("blast_env.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "impulse": _number,
        "pressure": lambda pa: _number(pa / PA_PER_KPA),
        "titled": pass_context(lambda context, name: context["scenario"].title_of(name)),
        "counted": _counted,
        "word": lambda passes, flagged: Verdict.of(passes).word(flagged).lower(),
        "percent": _percent,
        "gone": _gone,
        "span": _span,
        "noun_of": lambda number, noun: count_of(noun, number),
        "css": _css,
        "impulse_error": _error,
        "share_error": lambda share: _error(100.0 * share, 1),
        "points": _points,
        "ms": lambda time_s: _number(MS_PER_S * time_s),
        "money": pass_context(lambda context, cost: context["scenario"].zone.priced(cost)),
        "sum": "{:,.10g}".format,
        "wide_first": lambda pictures: sorted(pictures, key=lambda each: _steepness(each[1])),
        "picture": lambda png: f"data:image/png;base64,{b64encode(png).decode()}",
    }
    environment.tests["narrow"] = lambda png: _steepness(png) > _NARROW
    return environment.get_template("report.html.j2")


_NARROW: Final = 0.7
"""Height of a picture, as a share of its width, from which two fit beside each other."""


def _steepness(png: bytes) -> float:
    """Return the height of a picture as a share of its width."""
    width, height = (int.from_bytes(png[start : start + 4]) for start in (16, 20))
    return height / max(width, 1)


def _context(study: Study, commands: list[str]) -> dict[str, Any]:
    scenario, options = study.scenario, study.options
    coarse, fine = options.cells
    protected = [each for each in study.targets if each.protected]
    layout_json = _layout_file(study)
    verdict = StudyVerdict(study)
    standing = "" if verdict.barrier is None else outcome_words(verdict.barrier.pieces)
    return {
        "study": study,
        "scenario": scenario,
        "fine": fine,
        "coarse_words": options.words[0],
        "fine_words": options.words[1],
        "protected": protected,
        "others": [each for each in study.targets if not each.protected],
        "plan": site_plan(scenario, study.threats, study.layout),
        "place_texts": {
            each.name: place_text(each, scenario, study.layout) for each in study.threats
        },
        "stand_off": stand_off_text(scenario, study.layout),
        "summary": _summary(study),
        "verdict": verdict,
        "standing": standing,
        "standings": {each.name: _standings(study, each.name) for each in study.threats},
        "checks": checks_of(study),
        "details": options.details,
        "sure": _sureness(study),
        "facade_pictures": [
            (each.name, picture)
            for each in study.threats[:1]
            for picture in study.pictures.get(each.name, ())
            if picture[0].endswith("facades unfolded")
        ],
        "uncertainty": study.uncertainty,
        "references": REFERENCES,
        "spread": _spread(study),
        "final_notes": [each for each in study.notes if f", {options.words[1]}: " in each],
        "bay_tables": _bay_tables(study),
        "two_sizes": coarse != fine,
        "cells": " and ".join(dict.fromkeys(options.words)),
        "grid_error": study.grid_error,
        "index": {"ratio": options.ratio, "factor": FACTOR, "order": ORDER},
        "worth_map": worth_map(scenario, [each[1:] for each in study.worths])
        if study.items
        else None,
        "checked": CHECKED_SCALED_DISTANCE,
        "made": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "command": " ".join(_quoted(part) for part in commands),
        "versions": versions(options.coarse.version, _LIBRARIES) | {"code": code_version()},
        "scenario_toml": tomli_w.dumps(scenario.model_dump(mode="json", exclude_none=True)),
        "layout_json": layout_json,
        "layout_hash": sha256(layout_json.encode()).hexdigest()[:_HASH_DIGITS],
        "layout_words": layout_counts(study.layout),
        "bill": table_records(study.bill),
    }


class SummaryLine(NamedTuple):
    """The effect of a layout on a building, over all threats, with the finer cells.

    Attributes:
        worst: The loads under the threat with the largest impulse with the layout.
        least: Smallest reduction of its impulse under a threat.
        most: Largest reduction.
        error: Largest error of the cells of a reduction.
    """

    worst: LoadPair
    least: float
    most: float
    error: float


def _summary(study: Study) -> list[SummaryLine]:
    lines = []
    for target in study.targets:
        own = [each for each in study.fine if each.target.name == target.name and target.protected]
        if own:
            gone = [each.reduction for each in own]
            worst = max(own, key=lambda each: each.protected.impulse_pa_s)
            error = max(each.reduction_error for each in own)
            lines.append(SummaryLine(worst, float(min(gone)), float(max(gone)), error))
    return lines


def _standings(study: Study, threat: str) -> list[str]:
    """Return the standings of the impulses on protected buildings under a threat, each once."""
    pairs = [each for each in study.pairs if each.threat.name == threat and each.target.protected]
    loads = [load for each in pairs for load in (each.unprotected, each.protected)]
    return list(dict.fromkeys(load.stood.words for load in loads))


@dataclass(frozen=True)
class Confidence:
    """How sure the level of protection is, and up to which charge.

    Attributes:
        likely: Probability with the layout, and what drives it.
        unprotected: Probability without it.
        masses: The largest mass that keeps the level, by threat.
    """

    likely: str
    unprotected: str
    masses: tuple[str, ...]


def _sureness(study: Study) -> Confidence | None:
    """Return how sure the level is; `None` without buildings with a facade."""
    if not study.protected.responses:
        return None
    protected, unprotected = (
        level_probability(each, study.uncertainty) for each in (study.protected, study.unprotected)
    )
    target = study.target
    masses = []
    for number, threat in enumerate(study.threats):
        kg, is_found = mass_near(study.protected.under(number), target)
        kept = study.protected.under(number).passes(target)
        bound = "" if is_found else ("at least " if kept else "less than ")
        masses.append(f"{threat.name} {bound}{kg:.3g} kg TNT")
    bare_text = probability_text(unprotected.of(target), len(unprotected.levels))
    return Confidence(protected.words(target), bare_text, tuple(masses))


REFERENCES: Final = (
    "UFC 4-010-01, DoD minimum antiterrorism standards for buildings (levels of protection)",
    "UFC 3-340-02, Structures to resist the effects of accidental explosions (single degree of "
    "freedom; types of bursts)",
    "PDC-TR 06-08, Single degree of freedom structural response limits for antiterrorism design "
    "(damage of wall panels)",
    "ASTM E1300, Determining load resistance of glass in buildings (strength of panes)",
    "GSA P100, Facilities standards for the public buildings service, table 8-1 (performance "
    "conditions of glazing)",
    "ISO 16933, Explosion-resistant security glazing, arena air-blast test (hazard ratings)",
    "C. N. Kingery and G. Bulmash, ARBRL-TR-02555, 1984 (airblast of TNT)",
    "TNO, Methods for the determination of possible damage, CPR 16E, Green Book (houses)",
    "P. J. Roache, J. Fluids Eng. 116 (1994) 405 (error of the cells)",
    "T. Yang and Y. Luo, J. Civil Environ. Eng. 42(2) (2020) 115 (scatter of loads)",
)
"""The reference list of a report."""


def _spread(study: Study) -> tuple[float, float] | None:
    found = [each.reduction for each in study.outcomes if isfinite(each.reduction)]
    return (min(found), max(found)) if found else None


@dataclass(frozen=True)
class BayTable:
    """The bays of a building under a threat, those with the most severe panes first.

    Attributes:
        title: Building and charge.
        rows: Bay; then, without the layout and with it: share of panes that break, their
            condition, damage of the wall panel; and the standing of the load with it.
        left_out: Number of bays left out.
    """

    title: str
    rows: tuple[tuple[str, ...], ...]
    left_out: int


def _bay_tables(study: Study) -> list[BayTable]:
    tables = []
    for unprotected, protected in zip(
        study.unprotected.responses, study.protected.responses, strict=True
    ):
        both = list(zip(unprotected.rows, protected.rows, strict=True))
        # "5" is worse than "3b", and "3b" than "3a": the order of texts is right.
        both.sort(key=lambda rows: (str(rows[1]["condition"]), _share(rows[1])), reverse=True)
        rows = tuple(
            (
                str(first["bay"]),
                *(text for each in (first, second) for text in _bay_texts(each)),
                str(second["standing"]),
            )
            for first, second in both[:_MOST_BAYS]
        )
        x_m, y_m = protected.charge.position_m
        name = study.scenario.title_of(protected.building)
        title = f"{name}, {protected.charge.tnt_kg:g} kg at ({x_m:.1f}, {y_m:.1f}) m"
        tables.append(BayTable(title, rows, len(both) - len(rows)))
    return tables


def _share(row: Mapping[str, object]) -> float:
    share = float(str(row["break_probability"]))
    return -1.0 if isnan(share) else share


def _bay_texts(row: Mapping[str, object]) -> tuple[str, str, str]:
    return (
        _percent(float(str(row["break_probability"]))),
        str(row["condition"]) or _NONE,
        str(row["damage"]) or _NONE,
    )


def _number(value: float) -> str:
    """Return a number with three significant digits, or a dash if it is not finite."""
    if not isfinite(value):
        return _NONE
    if value == 0.0:
        return "0"
    digits = max(0, 2 - int(np.floor(np.log10(abs(value)))))
    return f"{value:,.{digits}f}".replace("-", _MINUS)


def _error(value: float, digits: int | None = None) -> str:
    """Return an error with its sign, with two significant digits or the given decimals.

    Empty if it is not finite.
    """
    if not isfinite(value):
        return ""
    if digits is None:
        digits = max(0, 1 - int(np.floor(np.log10(value)))) if value > 0.0 else 0
    return f" {_PLUS_MINUS} {value:,.{digits}f}"


def _counted(load: BuildingLoad) -> str:
    """Return the peak to compare with limits, and its source."""
    peak, source = _number(load.counted_pa / PA_PER_KPA), load.counted_by
    if source == PeakSource.GAS:
        return f"{peak} ({source})"
    return f"{peak} ({source}; gas {_number(load.peak_pa / PA_PER_KPA)})"


def _percent(share: float) -> str:
    return _NONE if isnan(share) else percent(share).replace("-", _MINUS)


def _css(text: str) -> Markup:
    """Return a text as a string of CSS, which can end neither the string nor the style sheet."""
    safe = "".join(
        each if each.isalnum() or each in " .,-" else f"\\{ord(each):x} " for each in text
    )
    return Markup(f'"{safe}"')  # nothing but letters, digits and escapes


def _gone(share: float) -> str:
    """Return a reduction; a negative one in words."""
    return _percent(share) + worse(share)


def _span(line: SummaryLine) -> str:
    """Return the reductions of a building under all threats; one if they do not differ."""
    least, most = _gone(line.least), _gone(line.most)
    return least if least == most else f"{least} to {most}"


def _points(share: float) -> str:
    return f"{100.0 * share:+.2f}".replace("-", _MINUS)


def _layout_file(study: Study) -> str:
    """Return the content of the layout's file, as commands read it."""
    with scratch_folder() as folder:
        path = write_layout(folder / "layout.json", study.scenario, study.layout)
        return path.read_text(encoding="utf-8")


def _quoted(part: str) -> str:
    return f'"{part}"' if " " in part else part
