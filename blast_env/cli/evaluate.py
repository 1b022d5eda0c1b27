"""`blast-env evaluate`: a layout against no barrier."""

import json
from collections.abc import Iterable, Mapping
from functools import partial
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import typer

from blast_env.cli.command import Target, note_target, writes
from blast_env.cli.options import (
    SCENARIO_HELP,
    CacheOption,
    ChargeOption,
    ClusterAddress,
    EngineChoice,
    FinalCellOption,
    FinalCellsOption,
    GivenCharge,
    JsonOption,
    ProcessesOption,
    TntOption,
    resume_words,
    running_on,
)
from blast_env.cli.output import (
    LAYOUT_PICTURE,
    judged_blasts,
    layout_picture,
    print_cost,
    print_json,
    print_line,
    print_table,
    print_written,
    progress_bar,
    resumable,
    save_pictures,
)
from blast_env.evaluation import BlastEvaluator, Evaluation, LoadCaseSet, SeedRange, compare
from blast_env.evaluation.answers import (
    building_words,
    interval,
    load_text,
    percent,
    points,
    share_text,
    standing_lines,
    worse,
)
from blast_env.evaluation.cases import are_all, fixed_charges
from blast_env.evaluation.engines import JUDGE, final_engine
from blast_env.files import make_folder, write_text
from blast_env.geometry import layout_counts
from blast_env.io.export import LayoutPlan, check_target, export_to, is_file
from blast_env.layout import LayoutFile, load_layout
from blast_env.site import AnyCharge, ObjectiveSection, Scenario, load_scenario
from blast_env.statistics import CVAR_LEVEL, Estimate, check_cvar_level
from blast_env.tables import write_csv

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _note_export(context: typer.Context, value: Path | None) -> Path | None:
    """Add the target of `--export`, a file or a folder; `check_target` checks other suffixes."""
    if value is not None and (is_file(value) or not value.suffix):
        suffixes = (value.suffix.lower(),) if is_file(value) else ()
        note_target(context, Target("--export", value, suffixes))
    return value


def evaluate(
    layout: Path = typer.Option(help="JSON file of the (row, column) cells."),
    scenario: str = typer.Option("courtyard", help=SCENARIO_HELP),
    seeds: int = typer.Option(32, help="Number of threats.", min=1),
    first_seed: int | None = typer.Option(
        None, help="First seed.", min=0, show_default="the first one outside training and search"
    ),
    engine: EngineChoice = JUDGE,
    cell_m: FinalCellOption = None,
    cells: FinalCellsOption = None,
    cvar_level: float = typer.Option(
        CVAR_LEVEL, help="Level of the CVaR: 0.8 is the mean of the worst 20 % of the loads."
    ),
    export: Path | None = typer.Option(
        None,
        help="Folder for the layout as JSON, CSV, GeoJSON and DXF; or a file with one of these "
        "suffixes.",
        callback=_note_export,
    ),
    out: Path | None = writes("Folder for the JSON file, the tables and the figure"),
    charge: ChargeOption = None,
    tnt_kg: TntOption = None,
    processes: ProcessesOption = 1,
    cluster: ClusterAddress = None,
    cache: CacheOption = None,
    as_json: JsonOption = False,
) -> None:
    """Compare a layout with no barrier, both exposed to the same threats.

    Each seed draws a charge from the scenario; for particles, also the fan and the air.

    Gas dynamics runs on cells of 0.25 m. The worst charge runs on cells twice as large as well: the
    difference gives the error of the cells beside each number.
    """
    check_cvar_level(cvar_level)
    given = GivenCharge.of(charge, tnt_kg)
    drawn = SeedRange.TEST.seeds(0, seeds)
    if first_seed is not None:
        drawn = range(first_seed, first_seed + seeds)
    with running_on(cluster), resumable(resume_words(cache)):
        site = load_scenario(scenario)
        elements = sorted(load_layout(layout, site))
        used = final_engine(engine, [site], cell_m, cells)
        case = LoadCaseSet(site, given.drawn_by(site, drawn, used))
        if export is not None:
            check_target(export)  # before the blasts, so that no result is lost
        if out is not None:
            make_folder(out)
        if not as_json:
            print_line(used.describe([site]))
            charges = [each.charge for each in case.threats]
            print_cost(judged_blasts(used, site, charges, layouts=2))
        evaluator = BlastEvaluator(site, used, cache=cache)
        with progress_bar(f"{2 * len(case.threats)} blasts in {site.name}") as progress:
            found = compare(
                evaluator,
                [case],
                [elements],
                processes,
                with_error=True,
                cvar_level=cvar_level,
                progress=progress,
            )
    provenance = LayoutFile.load(layout).provenance
    preset = site.simulation.preset if used.needs_calibration else None
    record = {**found.to_dict(), "preset": preset, "provenance": provenance}
    written = [] if out is None else _write(found, record, out)
    if export is not None:
        written += export_to(LayoutPlan(site, found.layout, provenance=provenance), export)
    counts = evaluator.counts
    if as_json:
        hits = {"hits": counts.cache_hits, "hit_rate": counts.cache_hit_rate}
        cached = {"blasts": counts.blasts, **hits}
        more = {"cache": cached, "files": [str(path) for path in written]}
        print_json({key: x for key, x in {**record, **more}.items() if key not in _LEFT_OUT})
        return
    _print_layout(found, drawn)
    _print_if_all_charges(site, [each.charge for each in case.threats])
    for note in found.notes:
        print_line(f"note: {note}")
    print_written(written)
    print_line(
        f"{counts.blasts:g} blasts run, {counts.cache_hits:g} known already "
        f"(cache hit rate {percent(counts.cache_hit_rate)})"
    )


def _threats_text(count: int, seeds: range) -> str:
    """Return the threats of the means in words."""
    if count == 1:
        return f"seed {seeds[0]}"
    return f"means over {count} threats (seeds {seeds[0]} to {seeds[-1]})"


def _print_if_all_charges(scenario: Scenario, charges: Iterable[AnyCharge]) -> None:
    """Print a note if charges include all possible ones of a scenario, which are fixed."""
    count = len(fixed_charges(scenario))
    if count > 1 and are_all(scenario, charges):
        print_line(
            f"note: the site has {count} fixed charges, which all count here; the interval is "
            "their spread, not an uncertainty about others"
        )


_LEFT_OUT: Final = ("scenario", "threats", "modules")
"""Parts of a record that `--json` leaves out; those of `--out` are complete."""


_HEADERS: Final = (
    "building",
    "protected",
    "without (Pa s)",
    "with (Pa s)",
    "reduction",
    "95 % interval",
    "threats in range",
    "standing",
)


def _write(found: Evaluation, record: Mapping[str, Any], out: Path) -> list[Path]:
    text = json.dumps(record, indent=2, allow_nan=False)
    tables = {
        "structures.csv": found.table,
        "buildings.csv": found.building_table,
        "modules.csv": found.module_table,
        "threats.csv": found.threat_table,
    }
    return [
        write_text(out / "evaluation.json", text + "\n"),
        *(write_csv(table, out / name) for name, table in tables.items()),
        *save_pictures(
            (out / "evaluation.png", partial(_figure, found)),
            (out / LAYOUT_PICTURE, partial(layout_picture, found.scenario, found.layout)),
        ),
    ]


def _figure(found: Evaluation) -> "Figure":
    # Here, because pictures need the extra `render`.
    from blast_env.plots.evaluation_figures import evaluation_figure

    return evaluation_figure(found)


def _print_layout(evaluation: Evaluation, seeds: range) -> None:
    """Print the buildings' mean loads, and the effect of the layout over all threats."""
    count = len(evaluation.threats)
    rows = []
    for row in evaluation.building_table.to_dict("records"):
        reduction = Estimate(row["reduction"], row["reduction_low"], row["reduction_high"])
        rows.append(
            (
                building_words(evaluation.scenario, str(row["structure"])),
                "yes" if row["protected"] else "no",
                _number(row["unprotected_impulse_pa_s"], row["unprotected_impulse_error_pa_s"]),
                _number(row["impulse_pa_s"], row["impulse_error_pa_s"]),
                percent(reduction.value) + _of_cells(points(row["reduction_error"])),
                interval(reduction),
                f"{row['threats_in_range']} of {count}",
                row["standing"],
            )
        )
    barriers = layout_counts(evaluation.layout, "barrier")
    title = f"{evaluation.scenario.name}: {barriers} against none, {_threats_text(count, seeds)}"
    print_table(title, _HEADERS, rows, text_columns=2)
    for line in standing_lines(evaluation.scenario, evaluation.building_table, "structure"):
        print_line(line)
    _print_totals(evaluation)


def _number(load: float, error: float) -> str:
    return f"{load:,.0f}" + _of_cells("" if isnan(error) else f"{error:,.0f}")


def _of_cells(error: str) -> str:
    return error and f" +- {error}"


def _print_totals(evaluation: Evaluation) -> None:
    """Print the loads on the protected structures together, and the worst threat."""
    worst, objective = evaluation.worst, evaluation.scenario.objective
    print_means(evaluation, objective, "threats" if evaluation.engine.has_noise else "charges")
    if objective != ObjectiveSection():
        print_line(
            f"objective ({_objective_text(objective)}): "
            f"{objective.text(evaluation.unprotected_load)} without barrier, "
            f"{objective.text(evaluation.load)} with"
        )
    charge = worst.charge
    print_line(
        f"worst threat: {charge.tnt_kg:g} kg TNT at ({charge.position_m[0]:.2f}, "
        f"{charge.position_m[1]:.2f}) m, seed {worst.threat.seed}: "
        f"{objective.text(worst.load)}, reduction {percent(worst.reduction)}"
    )
    is_scaled = evaluation.engine.needs_calibration
    law = f"calibration {evaluation.calibration}, " if is_scaled else ""
    print_line(f"{law}scenario hash {evaluation.scenario.content_hash[:12]}")


def _objective_text(objective: ObjectiveSection) -> str:
    """Return an objective in words: `peak overpressure, worst of the charges`."""
    over = {"mean": "mean over", "cvar": "mean of the worst", "worst": "worst of"}
    noun = "impulse and peak" if objective.quantity == "both" else objective.noun
    return f"{noun}, {over[objective.charges]} the charges"


def print_means(
    comparison: Evaluation, objective: ObjectiveSection, sampled: str = "charges"
) -> None:
    """Print the reduction, and the mean loads without and with barrier."""
    reduction = share_text(comparison.reduction, comparison.reduction_error, sampled)
    words = worse(comparison.reduction.value)
    print_line(f"protected structures, by weight: mean reduction {reduction}{words}")
    share = f"{100.0 * (1.0 - comparison.cvar_level):.3g} %"
    bare_error, bare_cvar = comparison.unprotected_mean_error, comparison.unprotected_cvar
    for words, load, error, cvar in (
        ("without barrier", comparison.unprotected_mean, bare_error, bare_cvar),
        ("with barrier", comparison.mean, comparison.mean_error, comparison.cvar),
    ):
        print_line(
            f"{words}: mean {load_text(objective, load, error, sampled)}, "
            f"mean of the worst {share} {objective.text(cvar)}"
        )
    if comparison.grid_error is not None:
        print_line(comparison.grid_error.words)
