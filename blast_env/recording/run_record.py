"""What is needed to repeat a run."""

import platform
from importlib.metadata import version
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from blast_env.simulation import BlastResult

RunRecord = dict[str, str | int | float]
"""What was run, with which versions, and how it ended; names and plain values."""


def run_record(result: "BlastResult") -> RunRecord:
    """Return the record of a run."""
    blast, charge = result.blast, result.blast.scene.charge
    record: RunRecord = {
        "scenario": blast.scenario.name,
        "scenario hash": blast.scenario.content_hash,
        "layout (row, column)": " ".join(f"{row},{column}" for row, column in blast.layout),
        "seed": blast.seed,
        "charge x (m)": charge.position_m[0],
        "charge y (m)": charge.position_m[1],
        "charge TNT equivalent (kg)": charge.tnt_kg,
        "engine": result.engine_name,
        "engine version": result.engine_version,
        "blast-env version": version("blast-env"),
        "python version": platform.python_version(),
        "numpy version": np.__version__,
        "balls at the start": len(blast.scene.balls),
        "balls at the end": len(result.final_balls),
        "steps": result.steps,
        "simulated time (s)": result.time_s,
        "ended because": str(result.end_reason),
        "digest": result.digest,
    }
    for group, values in blast.scenario.parameters.model_dump().items():
        record |= {f"parameter {group}.{name}": value for name, value in values.items()}
    return record
