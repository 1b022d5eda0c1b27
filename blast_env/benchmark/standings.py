"""The standings: tables of the judged submissions, one row per method."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import isnan

import numpy as np

from blast_env.benchmark.definitions import BUDGETS
from blast_env.benchmark.judging import JudgedSubmission
from blast_env.statistics import Estimate, mean_estimate
from blast_env.tables import markdown_table
from blast_env.values import markup_text

_HEAD = """# Standings

Judged entries to the [benchmark](benchmark.md). The files in `blast_env/benchmark/data/standings`
have the layouts of every run. `blast-env judge --page` writes this page from them. The tables say
how much of the load each layout takes off, by gas dynamics. Intervals are of 95 %, over the seeds
unless the title names the problems.
"""

_NAMED = 6
"""Most problems that a title names."""


@dataclass(frozen=True)
class StandingsTable:
    """A table of methods on the same problems, judged with the same cells.

    Attributes:
        title: Problems, quantity and cells.
        headers: Headers of the columns; the first column has the methods.
        rows: Rows, best method first.
    """

    title: str
    headers: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def standings_tables(judged: Sequence[JudgedSubmission]) -> Iterator[StandingsTable]:
    """Yield for each set of problems the scores, then the load reduction in each problem."""
    groups: dict[tuple[tuple[str, ...], float], list[JudgedSubmission]] = {}
    for each in judged:
        groups.setdefault((tuple(sorted(each.problems)), each.cell_m), []).append(each)
    for (problems, cell_m), own in groups.items():
        yield _scores(own, problems, cell_m)
        if len(problems) > 1:
            yield _means(own, problems, cell_m)
        yield from (_reductions(own, name, cell_m) for name in problems)


def standings_page(judged: Sequence[JudgedSubmission]) -> str:
    """Return the page of the documentation with the standings, in Markdown."""
    parts = [_HEAD]
    for table in standings_tables(judged):
        rows = [[markup_text(cell) for cell in row] for row in table.rows]
        title = markup_text(table.title)
        parts += [f"## {title}\n", markdown_table(table.headers, rows) + "\n"]
    methods: dict[str, list[str]] = {}
    for each in judged:
        methods.setdefault(each.note, []).append(each.method)
    notes = [
        (markup_text(", ".join(names)), markup_text(note))
        for note, names in methods.items()
        if note
    ]
    if notes:
        parts += ["## Methods\n", markdown_table(("methods", "note"), notes) + "\n"]
    return "\n".join(parts)


def _scores(
    judged: Sequence[JudgedSubmission], problems: Sequence[str], cell_m: float
) -> StandingsTable:
    entered = {run.budget for each in judged for run in each.runs}
    budgets = [budget for budget in BUDGETS if budget in entered]
    rows = [
        (
            each.method,
            str(len(each.runs)),
            *(_text(each.score(budget), "{:.2f}") for budget in budgets),
            _text(each.area(), "{:.2f}"),
        )
        for each in sorted(judged, key=lambda each: -each.area().value)
    ]
    counted = f"{len(problems)} problem{'s' * (len(problems) > 1)}"
    names = ", ".join(problems[:_NAMED]) + (", ..." if len(problems) > _NAMED else "")
    return StandingsTable(
        f"Score on {counted}: {names}; cells of {cell_m:g} m",
        ("method", "runs", *(f"{budget:,} blasts" for budget in budgets), "all budgets"),
        tuple(rows),
    )


def _means(
    judged: Sequence[JudgedSubmission], problems: Sequence[str], cell_m: float
) -> StandingsTable:
    """Return the reductions over all problems, and the lead over the best rule of each."""
    found = []
    for each in judged:
        for budget in sorted({run.budget for run in each.runs}):
            off, lead = (of(budget).scaled(100.0) for of in (each.reduction, each.lead))
            row = (each.method, f"{budget:,}", _text(off, "{:.1f}"), _text(lead, "{:+.1f}"))
            found.append((off.value, row))
    return StandingsTable(
        f"Load taken off in all {len(problems)} problems, %, with intervals over the problems; "
        f"cells of {cell_m:g} m",
        ("method", "budget", "mean", "more than the best rule of each"),
        tuple(row for _, row in sorted(found, key=lambda each: -each[0])),
    )


def _reductions(judged: Sequence[JudgedSubmission], problem: str, cell_m: float) -> StandingsTable:
    found = []
    for each in judged:
        for budget in sorted({run.budget for run in each.runs}):
            runs = [run for run in each.runs if (run.problem, run.budget) == (problem, budget)]
            if runs:
                off = 100.0 * (1.0 - np.array([run.share for run in runs]))
                spent = max(run.blasts for run in runs)
                cells = (f"{spent:,}", str(len(runs)), _text(mean_estimate(off), "{:.1f}"))
                found.append((float(off.mean()), (each.method, *cells, f"{off.max():.1f}")))
    rule, best = next(
        (run.rule, run.best) for each in judged for run in each.runs if run.problem == problem
    )
    found += [
        (100.0 * (1.0 - share), (name, "", "", f"{100.0 * (1.0 - share):.1f}", ""))
        for name, share in (("best rule", rule), ("best known", best))
    ]
    return StandingsTable(
        f"Load taken off in {problem}, %; cells of {cell_m:g} m",
        ("method", "blasts", "seeds", "mean", "best seed"),
        tuple(row for _, row in sorted(found, key=lambda each: -each[0])),
    )


def _text(found: Estimate, form: str) -> str:
    """Return the text of an estimate, with its interval if it has one."""
    value, low, high = (form.format(each) for each in found)
    return value if isnan(found.low) else f"{value} ({low} to {high})"
