"""The standings: tables of the judged submissions, one row per method."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import isnan
from operator import attrgetter

import numpy as np

from blast_env.answers.document import Table
from blast_env.benchmark.definitions import DEFINITIONS
from blast_env.benchmark.judging import SubmissionJudgement
from blast_env.statistics import Estimate, holm_adjusted
from blast_env.tables import markdown_table
from blast_env.values import markup_text

_HEAD = """# Standings

Judged entries to the [benchmark](benchmark.md), ranked by its [points beside the best
rule](benchmark.md#score). The files in `blast_env/benchmark/data/standings` have the layouts of
every run. `blast-env judge --page standings.md` writes this page from them. The load is that of gas
dynamics; intervals are of 95 %. p is the chance of such a difference to the best rule, or a larger
one, if there is none, corrected for the number of entries (Holm).
"""

_NAMED = 3
"""Most problems that a title names."""


def standings_tables(judged: Sequence[SubmissionJudgement]) -> Iterator[Table]:
    """Yield a table for each set of problems and size of the judge's cells."""
    groups: dict[tuple[tuple[str, ...], float], list[SubmissionJudgement]] = {}
    for judged_submission in judged:
        groups.setdefault(
            (tuple(sorted(judged_submission.problems)), judged_submission.cell_m), []
        ).append(judged_submission)
    for (problems, cell_m), own in groups.items():
        yield _table(own, problems, cell_m)


def standings_page(judged: Sequence[SubmissionJudgement]) -> str:
    """Return the page of the documentation with the standings, in Markdown."""
    parts = [_HEAD]
    for table in standings_tables(judged):
        rows = [[markup_text(cell) for cell in row] for row in table.cells()]
        title = markup_text(table.title)
        parts += [f"## {title}\n", markdown_table(table.headers, rows) + "\n"]
    methods: dict[str, list[str]] = {}
    for judged_submission in judged:
        methods.setdefault(judged_submission.note, []).append(judged_submission.method)
    notes = [
        (markup_text(", ".join(names)), markup_text(note))
        for note, names in methods.items()
        if note
    ]
    if notes:
        parts += ["## Methods\n", markdown_table(("methods", "note"), notes) + "\n"]
    return "\n".join(parts)


def _table(judged: Sequence[SubmissionJudgement], problems: Sequence[str], cell_m: float) -> Table:
    """Return the table of submissions to the same problems, the largest lead first."""
    runs = {run.problem: run for entry in judged for run in entry.runs}.values()
    rule, best = (
        100.0 * (1.0 - float(np.mean(shares)))
        for shares in ([run.rule for run in runs], [run.best for run in runs])
    )
    # By the score of any layout: both have 1 in a problem without a better one than the rule's.
    of_rule, of_best = (
        float(np.mean([replace(run, share=share(run)).score for run in runs]))
        for share in (attrgetter("rule"), attrgetter("best"))
    )
    found: list[tuple[float, float, tuple[str, ...]]] = [
        (off - rule, score, (name, "", "", f"{off:.1f}", f"{off - rule:+.1f}", "", f"{score:.2f}"))
        for name, score, off in (("best known", of_best, best), ("best rule", of_rule, rule))
    ]
    entries = [
        (entry, budget) for entry in judged for budget in sorted({run.budget for run in entry.runs})
    ]
    # One p value for each row, adjusted for the number of rows.
    chances = holm_adjusted([entry.lead_p_value(budget) for entry, budget in entries])
    for (entry, budget), chance in zip(entries, chances, strict=True):
        seeds = len({run.seed for run in entry.runs if run.budget == budget})
        taken, lead = (of(budget).scaled(100.0) for of in (entry.reduction, entry.lead))
        score = entry.score(budget)
        row = (
            *(entry.method, f"{budget:,}", str(seeds), f"{taken.value:.1f}"),
            " ".join((f"{lead.value:+.1f}", _ends(lead, "{:.1f}"))).rstrip(),
            "< 0.001" if chance < 0.001 else f"{chance:.3f}",
            " ".join((f"{score.value:.2f}", _ends(score, "{:.2f}"))).rstrip(),
        )
        found.append((lead.value, score.value, row))
    # Rounded, so that rows equal but for their last bits keep their order.
    found.sort(key=lambda entry: (round(entry[0], 9), round(entry[1], 9)), reverse=True)
    names = ", ".join(problems)
    if set(problems) == set(DEFINITIONS):
        names = "All problems"
    elif len(problems) > _NAMED:
        names = f"{len(problems)} problems: {', '.join(problems[:_NAMED])}, ..."
    return Table(
        f"{names}; cells of {cell_m:g} m",
        (
            *("method", "blasts", "seeds", "load taken off, %", "beside the best rule, points"),
            *("p", "score"),
        ),
        tuple(row for *_, row in found),
    )


def _ends(found: Estimate, form: str) -> str:
    """Return the interval of an estimate as text, if it has one."""
    low, high = (form.format(item) for item in found[1:])
    return "" if isnan(found.low) else f"({low} to {high})"
