"""The standings: tables of the judged submissions, one row per method."""

from collections.abc import Iterator, Sequence
from math import isnan

import numpy as np

from blast_env.benchmark.definitions import DEFINITIONS
from blast_env.benchmark.judging import JudgedSubmission
from blast_env.evaluation.answers import AnswerTable
from blast_env.statistics import Estimate
from blast_env.tables import markdown_table
from blast_env.values import markup_text

_HEAD = """# Standings

Judged entries to the [benchmark](benchmark.md), with its [score](benchmark.md#score). The files in
`blast_env/benchmark/data/standings` have the layouts of every run. `blast-env judge --page
standings.md` writes this page from them. The load is that of gas dynamics; intervals are of 95 %.
"""

_NAMED = 3
"""Most problems that a title names."""


def standings_tables(judged: Sequence[JudgedSubmission]) -> Iterator[AnswerTable]:
    """Yield a table for each set of problems and size of the judge's cells."""
    groups: dict[tuple[tuple[str, ...], float], list[JudgedSubmission]] = {}
    for each in judged:
        groups.setdefault((tuple(sorted(each.problems)), each.cell_m), []).append(each)
    for (problems, cell_m), own in groups.items():
        yield _table(own, problems, cell_m)


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


def _table(
    judged: Sequence[JudgedSubmission], problems: Sequence[str], cell_m: float
) -> AnswerTable:
    runs = {run.problem: run for each in judged for run in each.runs}.values()
    rule, best = (
        100.0 * (1.0 - float(np.mean(shares)))
        for shares in ([run.rule for run in runs], [run.best for run in runs])
    )
    found: list[tuple[float, float, tuple[str, ...]]] = [
        (score, off, (name, "", "", f"{score:.2f}", "", "", f"{off:.1f}", f"{off - rule:+.1f}"))
        for name, score, off in (("best known", 1.0, best), ("best rule", 0.0, rule))
    ]
    for each in judged:
        for budget in sorted({run.budget for run in each.runs}):
            seeds = len({run.seed for run in each.runs if run.budget == budget})
            score, over = each.score(budget), each.score_over_problems(budget)
            taken, lead = (of(budget).scaled(100.0) for of in (each.reduction, each.lead))
            row = (
                *(each.method, f"{budget:,}", str(seeds), f"{score.value:.2f}"),
                *(_ends(of, "{:.2f}") for of in (score, over)),
                f"{taken.value:.1f}",
                " ".join((f"{lead.value:+.1f}", _ends(lead, "{:.1f}"))).rstrip(),
            )
            found.append((score.value, taken.value, row))
    found.sort(key=lambda each: (round(each[0], 9), round(each[1], 9)), reverse=True)
    names = ", ".join(problems)
    if set(problems) == set(DEFINITIONS):
        names = "All problems"
    elif len(problems) > _NAMED:
        names = f"{len(problems)} problems: {', '.join(problems[:_NAMED])}, ..."
    return AnswerTable(
        f"{names}; cells of {cell_m:g} m",
        (
            *("method", "blasts", "seeds", "score", "over seeds", "over problems"),
            *("load taken off, %", "beside the best rule, points"),
        ),
        tuple(row for *_, row in found),
    )


def _ends(found: Estimate, form: str) -> str:
    """Return the interval of an estimate as text, if it has one."""
    low, high = (form.format(each) for each in found[1:])
    return "" if isnan(found.low) else f"({low} to {high})"
