"""What a league writes: tables, figures, and a page that brings them together."""

from collections.abc import Sequence
from importlib.metadata import version
from math import isnan
from pathlib import Path
from typing import Final

import pandas as pd

from agents.league.figure import league_figure
from agents.league.standings import REFERENCE_METHOD, Result, Standings
from agents.league.tables import case_table, summary_table
from agents.league.verdict import verdicts
from blast_env.atomic import write_atomically
from blast_env.rendering.figures import save_figure
from blast_env.rendering.style import count_of

HEADERS: Final = (
    "method",
    "reduction",
    "95 % interval",
    "worst case",
    "blasts a case",
    "blasts in total",
    "wall time (s)",
    "proposal (ms)",
)
"""Columns of the printed table."""

PAGE: Final = "league.md"


def table_rows(standings: Standings) -> list[tuple[str, ...]]:
    """Return the printed table, a row an entry; see `HEADERS`."""
    return [_row(standings, result) for result in standings.results]


def verdict_lines(standings: Standings) -> list[str]:
    """Return what may be said of the agents, or why nothing can be."""
    if not any(result.training is not None for result in standings.results):
        return ["No verdict: no trained agent has entered this track."]
    if standings.reference is None:
        budget = standings.track.reference_budget
        return [f"No verdict: {REFERENCE_METHOD} search with {budget} blasts has not entered."]
    return [verdict.text for verdict in verdicts(standings)]


def sample_text(standings: Standings) -> str:
    """Return what the numbers are means over."""
    count, threats = standings.unprotected_pa_s.shape
    held_out = count_of("held-out threat", threats)
    if standings.has_one_case:
        return f"One case; intervals and worst case are over its {held_out}"
    return f"{count} cases, {held_out} each; intervals and worst case are over the cases"


def write_league(all_standings: Sequence[Standings], folder: Path, command: str) -> list[Path]:
    """Write tables and figure of each track, and the page.

    Args:
        all_standings: One a track.
        folder: It exists.
        command: What started the league.

    Returns:
        The paths.

    Raises:
        BlastEnvError: If a file cannot be written, or the extra `render` is missing.
    """
    written = []
    for standings in all_standings:
        name = standings.track.name
        written += [
            _write_table(summary_table(standings), folder / f"{name}_summary.csv"),
            _write_table(case_table(standings), folder / f"{name}_cases.csv"),
            save_figure(league_figure(standings), folder / f"{name}.png"),
        ]
    page = folder / PAGE
    with write_atomically(page) as temporary:
        temporary.write_text(markdown(all_standings, command), encoding="utf-8")
    return [*written, page]


def markdown(all_standings: Sequence[Standings], command: str) -> str:
    """Return the page: a table, verdicts and the figure of each track."""
    lines = ["# League", ""]
    for standings in all_standings:
        lines += [f"## {standings.track.title}", "", f"{sample_text(standings)}.", ""]
        lines += [_line(HEADERS), "|---|" + "---:|" * (len(HEADERS) - 1)]
        lines += [_line(row) for row in table_rows(standings)]
        lines += ["", *(f"- {line}" for line in verdict_lines(standings)), ""]
        lines += [f"![Reduction over blasts spent]({standings.track.name}.png)", ""]
    engines = ", ".join(dict.fromkeys(standings.engine for standings in all_standings))
    lines += [
        "Blasts in total and wall time include the training of an agent; blasts on held-out "
        "threats count nowhere. Wall time adds up what each search took in one process.",
        "",
        f"Engine {engines}, blast-env {version('blast-env')}: `{command}`",
    ]
    return "\n".join(lines) + "\n"


def _row(standings: Standings, result: Result) -> tuple[str, ...]:
    value, low, high = standings.reduction(result)
    return (
        result.name,
        _percent(value),
        "-" if isnan(low) else f"{100.0 * low:.1f} to {_percent(high)}",
        _percent(standings.worst(result)),
        f"{result.blasts_per_case:,.0f}",
        f"{result.blasts:,}",
        f"{result.seconds:,.1f}",
        f"{result.proposal_ms:,.1f}",
    )


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _write_table(table: pd.DataFrame, path: Path) -> Path:
    with write_atomically(path) as temporary:
        table.to_csv(temporary, index=False)
    return path
