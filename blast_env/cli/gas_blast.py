"""What `blast-env simulate --engine gas` prints and writes."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from blast_env.cli.output import make_table, print_line, progress_bar, result_console
from blast_env.geometry import Element, layout_counts
from blast_env.physics.gas.engine import GasEngine
from blast_env.physics.scene import Charge
from blast_env.scenario import Scenario
from blast_env.scenario.build_scene import draw_threat
from blast_env.simulation.gas import GasBlast, GasResult
from blast_env.units import MS_PER_S, PA_PER_KPA

_HEADERS: Final = (
    "structure",
    "protected",
    "impulse (Pa s)",
    "first phase (Pa s)",
    "peak (kPa)",
    "arrival (ms)",
    "most loaded wall",
    "roof (Pa s)",
)


@dataclass(frozen=True)
class GasOutput:
    """What is written beside the table, and whether the result is printed as JSON."""

    excel: Path | None
    parquet: Path | None
    as_json: bool


def report_gas_blast(
    scenario: Scenario,
    layout: Sequence[Element],
    seed: int,
    engine: GasEngine,
    charge_m: tuple[float, float] | None,
    output: GasOutput,
) -> None:
    """Run one blast of gas dynamics; print and write what it did.

    Raises:
        BlastEnvError: If it cannot be run, or a file cannot be written.
    """
    charge = draw_threat(scenario, seed)
    if charge_m is not None:
        charge = Charge(charge_m, charge.tnt_kg, charge.height_m)
    blast = GasBlast(scenario, tuple(layout), seed, engine, charge)
    with progress_bar(f"gas blast in {scenario.name}") as progress:
        result = blast.run(progress)
    written = []
    if output.excel is not None:
        written.append(result.to_excel(output.excel))
    if output.parquet is not None:
        written.append(result.to_parquet(output.parquet))
    if output.as_json:
        print_line(json.dumps(_record(result, written), indent=2))
    else:
        _print(result, written)


def _print(result: GasResult, written: Sequence[Path]) -> None:
    charge = result.run.site.charge
    x_m, y_m = charge.position_m
    table = make_table(
        f"{result.blast.scenario.name}: {charge.tnt_kg:g} kg TNT at ({x_m:.2f}, {y_m:.2f}) m, "
        f"{charge.height_m:g} m high, {layout_counts(result.blast.layout, 'barrier')}",
        _HEADERS,
        text_columns=2,
    )
    for row in result.structures.to_dict("records"):
        impulse = result.impulse(row["structure"])
        mark = "" if impulse.in_range else "~"
        table.add_row(
            row["structure"],
            "yes" if row["protected"] else "no",
            f"{mark}{impulse.pa_s:,.0f}",
            f"{row['first_impulse_pa_s']:,.0f}",
            f"{row['peak_pa'] / PA_PER_KPA:,.1f}",
            _number(MS_PER_S * row["arrival_s"], ".1f"),
            f"{row['most_loaded_face']} {row['most_loaded_pa_s']:,.0f}",
            _number(row["roof_impulse_pa_s"], ",.0f"),
        )
    result_console().print(table)
    if len(result.gauges):
        result_console().print(_gauges(result.gauges))
    cells = " x ".join(str(count) for count in result.run.grid.shape)
    print_line(
        f"engine {result.engine_name} ({result.engine_version}), {cells} cells of "
        f"{result.blast.engine.cell_m:g} m, {result.steps:,} steps, "
        f"{MS_PER_S * result.time_s:.0f} ms simulated; ended because {result.end_reason}"
    )
    notes = [note for name in result.structures["structure"] for note in result.impulse(name).notes]
    for note in dict.fromkeys(notes):
        print_line(f"outside what was checked (~): {note}")
    print_line(f"digest {result.digest}")
    for path in written:
        print_line(f"wrote {path}")


def _gauges(gauges: pd.DataFrame) -> Any:
    table = make_table(
        "gauges", ("gauge", "x (m)", "y (m)", "z (m)", "peak (kPa)", "impulse (Pa s)"), 1
    )
    for row in gauges.to_dict("records"):
        places = (f"{row[axis]:.2f}" for axis in ("x_m", "y_m", "z_m"))
        peak, impulse = row["peak_pa"] / PA_PER_KPA, row["positive_impulse_pa_s"]
        table.add_row(row["name"], *places, f"{peak:,.1f}", f"{impulse:,.0f}")
    return table


def _record(result: GasResult, written: Sequence[Path]) -> dict[str, object]:
    """Return the result as plain data; numbers that do not exist are null."""
    names = result.structures["structure"]
    return {
        "run": result.run_record,
        "structures": _rows(result.structures),
        "impulse": {
            name: {**result.impulse(name)._asdict(), "pa_s": result.impulse(name).pa_s}
            for name in names
        },
        "modules": _rows(result.modules),
        "gauges": _rows(result.gauges),
        "files": [str(path) for path in written],
    }


def _rows(table: pd.DataFrame) -> list[dict[str, object]]:
    plain = table.astype(object).where(table.notna(), None)
    return [{str(key): value for key, value in row.items()} for row in plain.to_dict("records")]


def _number(value: float, form: str) -> str:
    return "-" if np.isnan(value) else format(value, form)
