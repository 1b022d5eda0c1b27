"""A shielding study as plain data: what repeats it, and what came out."""

import json
import math
import platform
from dataclasses import asdict
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from blast_env.physics.engine import find_engine
from blast_env.physics.parameters import parameters_digest

if TYPE_CHECKING:
    from blast_env.calibration.shielding_reflection import ReflectionReport
    from blast_env.calibration.shielding_report import ShieldingReport

SCHEMA_VERSION: Final = 1
"""The version of the file that `ShieldingReport.to_json` writes."""


def shielding_record(
    report: "ShieldingReport", exponent: float | None, reflection: "ReflectionReport | None"
) -> dict[str, Any]:
    """Return everything about a shielding study as what JSON knows; NaN is `None`."""
    study = report.study
    engine = find_engine(study.engine)
    return {
        "schema_version": SCHEMA_VERSION,
        "preset": study.simulation if isinstance(study.simulation, str) else None,
        "parameters": study.parameters.model_dump(mode="json"),
        "parameters_digest": parameters_digest(study.parameters, engine.name),
        "engine": engine.name,
        "versions": {
            "blast_env": version("blast-env"),
            "engine": engine.version,
            "python": platform.python_version(),
            "numpy": np.__version__,
        },
        "seeds": list(study.seeds),
        "time_limit_s": study.time_limit_s,
        "geometry": asdict(study.geometry),
        "exponent": exponent,
        "result": {
            "ratios": _rows(report.summary(exponent)),
            "free_field_slope": [_plain(value) for value in report.free_field_slope],
            "late_shares": report.late_shares._asdict(),
            "gauges": _rows(report.gauges),
            "free_field": _rows(report.free_field),
        },
        "reflection": None if reflection is None else _rows(reflection.reflection),
        "arrivals": None if reflection is None else _rows(reflection.arrivals),
    }


def record_text(record: dict[str, Any]) -> str:
    """Return a record as the text of a JSON file."""
    return json.dumps(record, indent=2, allow_nan=False) + "\n"


def _rows(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the rows of a table; NaN is `None`."""
    return [
        {str(key): _plain(value) for key, value in row.items()} for row in table.to_dict("records")
    ]


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and math.isnan(value) else value
