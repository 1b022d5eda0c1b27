"""An evaluation as plain data: what repeats it, and what came out."""

import math
import platform
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from blast_env.evaluation.statistics import Estimate
from blast_env.units import PA_PER_PSI

if TYPE_CHECKING:
    from blast_env.evaluation.layout_evaluation import LayoutEvaluation, ThreatOutcome

SCHEMA_VERSION: Final = 1
"""The version of the file that `LayoutEvaluation.to_json` writes."""


def evaluation_record(evaluation: "LayoutEvaluation") -> dict[str, Any]:
    """Return everything about an evaluation as what JSON knows; NaN is `None`."""
    scenario = evaluation.scenario
    return {
        "schema_version": SCHEMA_VERSION,
        "scenario": scenario.model_dump(mode="json", exclude_none=True),
        "scenario_hash": scenario.content_hash,
        "layout": [list(cell) for cell in evaluation.layout],
        "engine": evaluation.engine_name,
        "calibration": evaluation.calibration.name,
        "versions": {
            "blast_env": version("blast-env"),
            "engine": evaluation.engine_version,
            "python": platform.python_version(),
            "numpy": np.__version__,
        },
        "result": _result(evaluation),
        "notes": list(evaluation.notes),
        "threats": _rows(evaluation.threat_table),
        "structures": _rows(evaluation.table),
        "modules": _rows(evaluation.module_table),
    }


def _result(evaluation: "LayoutEvaluation") -> dict[str, Any]:
    return {
        "reduction": _estimate(evaluation.reduction),
        "impulse_pa_s": _estimate(evaluation.impulse_pa_s),
        "impulse_psi_s": _estimate(evaluation.impulse_psi_s),
        "unprotected_impulse_pa_s": _estimate(evaluation.unprotected_impulse_pa_s),
        "unprotected_impulse_psi_s": _estimate(evaluation.unprotected_impulse_psi_s),
        "cvar_level": evaluation.cvar_level,
        "cvar_pa_s": evaluation.cvar,
        "cvar_psi_s": evaluation.cvar / PA_PER_PSI,
        "unprotected_cvar_pa_s": evaluation.unprotected_cvar,
        "unprotected_cvar_psi_s": evaluation.unprotected_cvar / PA_PER_PSI,
        "worst": _worst(evaluation.worst),
        "in_range": evaluation.in_range,
    }


def _estimate(estimate: Estimate) -> dict[str, float | None]:
    value, low, high = map(_or_none, estimate)
    return {"value": value, "ci95_low": low, "ci95_high": high}


def _worst(outcome: "ThreatOutcome") -> dict[str, Any]:
    return {
        "seed": outcome.threat.seed,
        "charge_position_m": list(outcome.threat.charge.position_m),
        "tnt_kg": outcome.threat.charge.tnt_kg,
        "impulse_pa_s": outcome.impulse_pa_s,
        "unprotected_impulse_pa_s": outcome.unprotected_impulse_pa_s,
        "reduction": _or_none(outcome.reduction),
        "in_range": outcome.in_range,
    }


def _rows(table: pd.DataFrame) -> list[dict[str, Any]]:
    return [
        {str(name): _or_none(value) for name, value in row.items()}
        for row in table.to_dict("records")
    ]


def _or_none(value: Any) -> Any:
    """Return the value, or `None` for a number that does not exist."""
    return None if isinstance(value, float) and math.isnan(value) else value
