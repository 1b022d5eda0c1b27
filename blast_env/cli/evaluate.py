"""`blast-env evaluate`: how much a layout takes off the protected structures."""

import json
from collections.abc import Sequence
from math import isnan
from pathlib import Path
from typing import Annotated, Final

import pandas as pd
import typer

from blast_env.atomic import write_atomically
from blast_env.cli.output import make_table, print_line, progress_bar, result_console, user_errors
from blast_env.errors import BlastEnvError
from blast_env.evaluation.evaluate import CVAR_LEVEL, evaluate_against
from blast_env.evaluation.evaluator import BlastEvaluator
from blast_env.evaluation.layout_evaluation import LayoutEvaluation
from blast_env.evaluation.statistics import Estimate, check_cvar_level
from blast_env.evaluation.threats import draw_threats
from blast_env.scenario import check_layout, load_layout, load_scenario
from blast_env.units import PA_PER_PSI

_HEADERS: Final = (
    "structure",
    "protected",
    "without (Pa s)",
    "with (Pa s)",
    "reduction",
    "95 % interval",
    "threats in range",
)
_PERCENT: Final = 100.0


def evaluate(
    layout: Annotated[Path, typer.Option(help="JSON file with the barrier's (row, column) cells.")],
    scenario: Annotated[str, typer.Option(help="Bundled name, or a scenario file.")] = "courtyard",
    seeds: Annotated[int, typer.Option(min=1, help="Number of threats.")] = 32,
    first_seed: Annotated[
        int, typer.Option(min=0, help="The seeds count from here; use others than for a search.")
    ] = 0,
    processes: Annotated[int, typer.Option(min=1, help="Worker processes.")] = 1,
    engine: Annotated[str, typer.Option(help="Engine that runs the blasts.")] = "pymunk",
    cvar_level: Annotated[
        float, typer.Option(help="0.8: also show the mean of the worst 20 %.")
    ] = CVAR_LEVEL,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the JSON file, the tables and the figure.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Compare a layout with no barrier, both exposed to the same threats.

    Each seed draws a charge from the scenario, the fan and the air.
    """
    with user_errors():
        chosen = load_scenario(scenario)
        cells = check_layout(chosen, load_layout(layout))
        threats = draw_threats(chosen, range(first_seed, first_seed + seeds))
        evaluator = BlastEvaluator(chosen, engine)
        check_cvar_level(cvar_level)
        if out is not None:
            _make_folder(out)
        with progress_bar(f"{2 * seeds} blasts in {chosen.name}") as progress:
            evaluation = evaluate_against(
                evaluator, cells, threats, processes, cvar_level=cvar_level, progress=progress
            )
        written = [] if out is None else _write(evaluation, out)
    if as_json:
        files = [str(path) for path in written]
        print_line(json.dumps({**evaluation.to_dict(), "files": files}, indent=2))
    else:
        print_evaluation(evaluation, written)


def _make_folder(out: Path) -> None:
    """Create the folder before the blasts, so that no result is lost for want of it."""
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BlastEnvError(f"{out}: cannot be a folder: {error.strerror or error}") from error


def _write(evaluation: LayoutEvaluation, out: Path) -> list[Path]:
    written = [evaluation.to_json(out / "evaluation.json")]
    tables = {
        "structures.csv": evaluation.table,
        "modules.csv": evaluation.module_table,
        "threats.csv": evaluation.threat_table,
    }
    written += [_write_table(table, out / name) for name, table in tables.items()]
    written.append(evaluation.figure(out / "evaluation.png"))
    return written


def _write_table(table: pd.DataFrame, path: Path) -> Path:
    with write_atomically(path) as temporary:
        table.to_csv(temporary, index=False)
    return path


def print_evaluation(evaluation: LayoutEvaluation, written: Sequence[Path]) -> None:
    """Print the structures' mean loads, what the layout does over all threats, and the files."""
    count = len(evaluation.threats)
    table = make_table(
        f"{evaluation.scenario.name}: {len(evaluation.layout)} barrier modules against none, "
        f"{_seeds_text([threat.seed for threat in evaluation.threats])}",
        _HEADERS,
        text_columns=2,
    )
    for row in evaluation.table.to_dict("records"):
        reduction = Estimate(row["reduction"], row["reduction_low"], row["reduction_high"])
        table.add_row(
            str(row["structure"]),
            "yes" if row["protected"] else "no",
            f"{row['unprotected_impulse_pa_s']:,.0f}",
            f"{row['impulse_pa_s']:,.0f}",
            _percent(reduction.value),
            _interval(reduction),
            f"{row['threats_in_range']} of {count}",
        )
    result_console().print(table)
    _print_totals(evaluation)
    for note in evaluation.notes:
        print_line(f"note: {note}")
    for path in written:
        print_line(f"wrote {path}")


def _print_totals(evaluation: LayoutEvaluation) -> None:
    """Print what there is to say about the protected structures together."""
    reduction, worst = evaluation.reduction, evaluation.worst
    print_line(
        f"protected structures, by weight: mean reduction {_percent(reduction.value)} "
        f"(95 % interval {_interval(reduction)})"
    )
    for words, impulse, cvar in (
        ("without barrier", evaluation.unprotected_impulse_pa_s, evaluation.unprotected_cvar),
        ("with barrier", evaluation.impulse_pa_s, evaluation.cvar),
    ):
        half_width = "" if isnan(impulse.low) else f" +- {impulse.high - impulse.value:,.0f}"
        print_line(
            f"{words}: mean {impulse.value:,.0f}{half_width} Pa s "
            f"({impulse.value / PA_PER_PSI:.4f} psi s), mean of the worst "
            f"{_PERCENT * (1.0 - evaluation.cvar_level):.3g} % {cvar:,.0f} Pa s"
        )
    charge = worst.threat.charge
    print_line(
        f"worst threat: {charge.tnt_kg:g} kg TNT at ({charge.position_m[0]:.2f}, "
        f"{charge.position_m[1]:.2f}) m, seed {worst.threat.seed}: {worst.impulse_pa_s:,.0f} Pa s, "
        f"reduction {_percent(worst.reduction)}"
    )
    print_line(
        f"engine {evaluation.engine_name} ({evaluation.engine_version}), calibration "
        f"{evaluation.calibration.name}, scenario hash {evaluation.scenario.content_hash[:12]}"
    )


def _seeds_text(seeds: Sequence[int]) -> str:
    if len(seeds) == 1:
        return f"seed {seeds[0]}"
    return f"means over {len(seeds)} threats (seeds {min(seeds)} to {max(seeds)})"


def _percent(share: float) -> str:
    return "-" if isnan(share) else f"{_PERCENT * share:.1f} %"


def _interval(reduction: Estimate) -> str:
    """Return an interval; a dash where one threat says nothing about the others."""
    if isnan(reduction.low):
        return "-"
    return f"{_percent(reduction.low)} to {_percent(reduction.high)}"
