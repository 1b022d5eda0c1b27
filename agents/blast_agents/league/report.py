"""The tables of a track: one row per entry, and one row per entry and case."""

from collections.abc import Sequence
from math import isnan
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from blast_agents.league.figure import league_figure
from blast_agents.league.standings import Result, Standings, verdicts
from blast_env.arrays import FloatArray
from blast_env.design.search import Proposal
from blast_env.evaluation import Case
from blast_env.files import write_atomically
from blast_env.geometry import layout_text
from blast_env.layout.build_scene import charge_against
from blast_env.plots.figures import save_figure
from blast_env.plots.style import count_of
from blast_env.provenance import package_version
from blast_env.statistics import reductions
from blast_env.tables import markdown_table, write_csv


def summary_table(standings: Standings) -> pd.DataFrame:
    """Return one row per entry, in the order of the entries.

    `minus_reference` is the difference to genetic search with the track's reference budget; its
    columns are missing if that search did not enter.
    """
    return pd.DataFrame([_summary(standings, result) for result in standings.results])


def case_table(standings: Standings) -> pd.DataFrame:
    """Return one row per entry and case; loads are the case's combination over its threats."""
    return pd.DataFrame(
        [
            {"entry": result.name, "method": result.entry.method, "budget": result.entry.budget}
            | _case(case, proposal, loads, bare)
            for result in standings.results
            for case, proposal, loads, bare in zip(
                standings.track.cases,
                result.proposals,
                result.loads,
                standings.unprotected,
                strict=True,
            )
        ]
    )


def _summary(standings: Standings, result: Result) -> dict[str, Any]:
    reduction, entry = standings.reduction(result), result.entry
    wins = {f"wins_{rule.name}": standings.win_share(result, rule) for rule in standings.rules}
    row = {
        "entry": entry.name,
        "method": entry.method,
        "budget": entry.budget,
        "cases": len(standings.track.cases),
        "held_out_threats": standings.unprotected.shape[1],
        "reduction": reduction.value,
        "reduction_low": reduction.low,
        "reduction_high": reduction.high,
        "worst_reduction": standings.comparison(result).worst_reduction,
        "cvar_reduction": standings.cvar_reduction(result),
        "is_rule": result.is_rule,
        "blasts": result.blasts,
        "blasts_per_case": result.blasts_per_case,
        "other_blasts_per_case": result.other_blasts_per_case,
        "cpu_s_per_case": result.cpu_s_per_case,
        "training_blasts": entry.training.blasts,
        "wall_time_s": result.seconds,
        "training_time_s": entry.training.seconds,
        "proposal_ms": result.proposal_ms,
        **wins,
    }
    if standings.reference is None:
        return row
    difference = standings.difference(result, standings.reference)
    return row | {
        "minus_reference": difference.value,
        "minus_reference_low": difference.low,
        "minus_reference_high": difference.high,
    }


def _case(case: Case, proposal: Proposal, loads: FloatArray, bare: FloatArray) -> dict[str, Any]:
    told = None if case.charge is None else charge_against(case.scenario, (), case.charge)
    x_m, y_m = (np.nan, np.nan) if told is None else told.position_m
    return {
        "case": case.name,
        "scenario_hash": case.scenario.content_hash,
        "charge_x_m": x_m,
        "charge_y_m": y_m,
        "first_held_out_seed": case.threats[0].seed,
        "load": case.counted(loads, proposal.layout),
        "unprotected_load": case.counted(bare),
        "unit": case.scenario.objective.unit,
        "reduction": reductions(case.counted(loads, proposal.layout), case.counted(bare)).item(),
        "blasts": proposal.blasts,
        "other_blasts": proposal.other_blasts,
        "cpu_s": proposal.cpu_s,
        "seconds": proposal.seconds,
        "modules": len(proposal.layout),
        "layout": layout_text(proposal.layout),
    }


HEADERS: Final = (
    "method",
    "reduction",
    "95 % interval",
    "worst case",
    "worst 20 %",
    "blasts a case",
    "other blasts",
    "CPU s a case",
    "blasts in total",
    "wall time (s)",
    "proposal (ms)",
)
"""Columns of the printed table."""

PAGE: Final = "league.md"


def table_rows(standings: Standings) -> list[tuple[str, ...]]:
    """Return the printed table, one row per entry; see `HEADERS`."""
    return [_row(standings, result) for result in standings.results]


def verdict_lines(standings: Standings) -> list[str]:
    """Return the verdicts on trained entries, or the reason why there is none."""
    if not any(result.has_learnt for result in standings.results):
        return ["No verdict: no trained agent has entered this track."]
    if not standings.references:
        return ["No verdict: neither a rule nor a search has entered."]
    return [verdict.text for verdict in verdicts(standings)]


def sample_text(standings: Standings) -> str:
    """Describe the quantity in the table and its sample."""
    count, threats = standings.unprotected.shape
    held_out = count_of("held-out threat", threats)
    if standings.has_one_case:
        over = f"one case; intervals and worst case are over its {held_out}"
    else:
        over = f"{count} cases, {held_out} each; intervals and worst case are over the cases"
    if standings.track.has_all_charges:
        over += (
            "; these are all fixed charges of the site: intervals are their spread, not an "
            "uncertainty about others, and training may have met them"
        )
    return f"Reduction of the {standings.noun}: {over}"


def write_league(all_standings: Sequence[Standings], folder: Path, command: str) -> list[Path]:
    """Write tables and figure of each track, and the page.

    Args:
        all_standings: The results, one per track.
        folder: Target folder, which exists.
        command: Command that started the league.

    Returns:
        The paths.

    Raises:
        BlastEnvError: If a file cannot be written, or the extra `render` is missing.
    """
    written = []
    for standings in all_standings:
        name = standings.track.name
        written += [
            write_csv(summary_table(standings), folder / f"{name}_summary.csv"),
            write_csv(case_table(standings), folder / f"{name}_cases.csv"),
            save_figure(league_figure(standings), folder / f"{name}.png"),
        ]
    page = folder / PAGE
    with write_atomically(page) as temporary:
        temporary.write_text(markdown(all_standings, command), encoding="utf-8")
    return [*written, page]


def markdown(all_standings: Sequence[Standings], command: str) -> str:
    """Return the page with a table, verdicts and a figure per track."""
    lines = ["# League", ""]
    for standings in all_standings:
        lines += [f"## {standings.track.title}", "", f"{sample_text(standings)}.", ""]
        lines += [markdown_table(HEADERS, table_rows(standings), numbers=True)]
        lines += ["", *(f"- {line}" for line in verdict_lines(standings)), ""]
        lines += _wins(standings)
        lines += [f"![Reduction over blasts spent]({standings.track.name}.png)", ""]
    engines = ", ".join(dict.fromkeys(standings.engine for standings in all_standings))
    lines += [
        "Blasts are those of the engine that judges, other blasts those of another one. Blasts in "
        "total and wall time include the training of an agent; blasts on held-out threats count "
        "nowhere. Wall time adds up what each search took in one process.",
        "",
        f"Engine {engines}, blast-env {package_version()}: `{command}`",
    ]
    return "\n".join(lines) + "\n"


def _wins(standings: Standings) -> list[str]:
    """Return the table of the shares of cases in which each entry is better than each rule."""
    rules = standings.rules
    if not rules:
        return []
    heading = "Share of the cases in which it is better than a rule (a tie is half a case):"
    headers = ("method", *(rule.name for rule in rules))
    rows = [
        (
            result.name,
            *(f"{100.0 * standings.win_share(result, rule):.0f} %" for rule in rules),
        )
        for result in standings.results
    ]
    return [heading, "", markdown_table(headers, rows, numbers=True), ""]


def _row(standings: Standings, result: Result) -> tuple[str, ...]:
    value, low, high = standings.reduction(result)
    return (
        result.name,
        _percent(value),
        "-" if isnan(low) else f"{100.0 * low:.1f} to {_percent(high)}",
        _percent(standings.comparison(result).worst_reduction),
        _percent(standings.cvar_reduction(result)),
        f"{result.blasts_per_case:,.0f}",
        f"{result.other_blasts_per_case:,.0f}",
        f"{result.cpu_s_per_case:,.2f}",
        f"{result.blasts:,}",
        f"{result.seconds:,.1f}",
        f"{result.proposal_ms:,.1f}",
    )


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"
