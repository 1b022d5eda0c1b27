"""The tables of a track: one row an entry, and one row an entry and case."""

from typing import Any

import numpy as np
import pandas as pd

from agents.league.entries import Training
from agents.league.standings import Result, Standings
from agents.league.tracks import TrackCase
from agents.proposal import Layout, Proposal
from blast_env.evaluation.statistics import FloatArray


def summary_table(standings: Standings) -> pd.DataFrame:
    """Return one row an entry, in the order of entering.

    `minus_reference` is the difference to genetic search with the track's reference budget; the
    columns are missing if that did not enter.
    """
    return pd.DataFrame([_summary(standings, result) for result in standings.results])


def case_table(standings: Standings) -> pd.DataFrame:
    """Return one row an entry and case; impulses are means over the held-out threats."""
    return pd.DataFrame(
        [
            {"entry": result.name, "method": result.method, "budget": result.budget}
            | _case(case, proposal, impulses_pa_s, bare_pa_s)
            for result in standings.results
            for case, proposal, impulses_pa_s, bare_pa_s in zip(
                standings.track.cases,
                result.proposals,
                result.impulse_pa_s,
                standings.unprotected_pa_s,
                strict=True,
            )
        ]
    )


def _summary(standings: Standings, result: Result) -> dict[str, Any]:
    reduction, training = standings.reduction(result), result.training or Training(0, 0.0)
    row = {
        "entry": result.name,
        "method": result.method,
        "budget": result.budget,
        "cases": len(standings.track.cases),
        "held_out_threats": standings.unprotected_pa_s.shape[1],
        "reduction": reduction.value,
        "reduction_low": reduction.low,
        "reduction_high": reduction.high,
        "worst_reduction": standings.worst(result),
        "blasts": result.blasts,
        "blasts_per_case": result.blasts_per_case,
        "training_blasts": training.blasts,
        "wall_time_s": result.seconds,
        "training_time_s": training.seconds,
        "proposal_ms": result.proposal_ms,
    }
    if standings.reference is None:
        return row
    difference = standings.difference(result, standings.reference)
    return row | {
        "minus_reference": difference.value,
        "minus_reference_low": difference.low,
        "minus_reference_high": difference.high,
    }


def _case(
    case: TrackCase, proposal: Proposal, impulses_pa_s: FloatArray, bare_pa_s: FloatArray
) -> dict[str, Any]:
    x_m, y_m = (np.nan, np.nan) if case.charge is None else case.charge.position_m
    return {
        "case": case.name,
        "scenario_hash": case.scenario.content_hash,
        "charge_x_m": x_m,
        "charge_y_m": y_m,
        "first_held_out_seed": case.held_out[0].seed,
        "impulse_pa_s": float(impulses_pa_s.mean()),
        "unprotected_impulse_pa_s": float(bare_pa_s.mean()),
        "reduction": 1.0 - float(impulses_pa_s.mean() / bare_pa_s.mean()),
        "blasts": proposal.blasts,
        "seconds": proposal.seconds,
        "modules": len(proposal.layout),
        "layout": _cells_text(proposal.layout),
    }


def _cells_text(layout: Layout) -> str:
    """Return the cells of a layout for one field of a table: `3,4 3,5`."""
    return " ".join(f"{row},{column}" for row, column in layout)
