"""`blast-env evaluate`: a layout against no barrier."""

import json
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from blast_env.answers.evaluate import (
    cache_line,
    evaluation_answer,
    evaluation_picture,
    sampling_notes,
)
from blast_env.answers.terminal import print_parts
from blast_env.cli.command import Target, note_target, writes
from blast_env.cli.options import (
    SCENARIO_HELP,
    CacheOption,
    ChargeInput,
    ChargeOption,
    ClusterAddress,
    EngineChoice,
    FinalCellOption,
    FinalCellsOption,
    JsonOption,
    ProcessesOption,
    TntOption,
    resume_words,
    running_on,
)
from blast_env.cli.output import (
    LAYOUT_PICTURE,
    blasts_running,
    layout_picture,
    print_outcome,
    print_record,
    resumable,
    save_pictures,
)
from blast_env.evaluation import (
    BlastCounts,
    BlastEvaluator,
    Evaluation,
    LoadCaseSet,
    SeedRange,
    compare,
)
from blast_env.evaluation.campaign import Campaign
from blast_env.evaluation.engines import JUDGE, final_engine
from blast_env.files import make_folder, write_text
from blast_env.io.export import LayoutPlan, check_target, export_to, is_file
from blast_env.layout import LayoutFile, load_layout
from blast_env.site import load_scenario
from blast_env.statistics import CVAR_LEVEL, check_cvar_level
from blast_env.tables import write_csv


def _note_export(context: typer.Context, value: Path | None) -> Path | None:
    """Add the target of `--export`, a file or a folder; `check_target` checks other suffixes."""
    if value is not None and (is_file(value) or not value.suffix):
        suffixes = (value.suffix.lower(),) if is_file(value) else ()
        note_target(context, Target("--export", value, suffixes))
    return value


_FirstSeedOption = Annotated[
    int | None,
    typer.Option(
        help="First seed.", min=0, show_default="the first one outside training and search"
    ),
]
_CvarLevelOption = Annotated[
    float, typer.Option(help="Level of the CVaR: 0.8 is the mean of the worst 20 % of the loads.")
]
_ExportOption = Annotated[
    Path | None,
    typer.Option(
        help="Folder for the layout as JSON, CSV, GeoJSON, DXF and glTF; or a file with one of "
        "their suffixes, or .ifc.",
        callback=_note_export,
    ),
]


def evaluate(
    layout: Path = typer.Option(help="JSON file of the (row, column) cells."),
    scenario: str = typer.Option("courtyard", help=SCENARIO_HELP),
    seeds: int = typer.Option(32, help="Number of threats.", min=1),
    first_seed: _FirstSeedOption = None,
    engine: EngineChoice = JUDGE,
    cell_m: FinalCellOption = None,
    cells: FinalCellsOption = None,
    cvar_level: _CvarLevelOption = CVAR_LEVEL,
    export: _ExportOption = None,
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
    difference gives the grid error beside each number.
    """
    check_cvar_level(cvar_level)
    given = ChargeInput.of(charge, tnt_kg)
    drawn = SeedRange.TEST.seeds(0, seeds)
    if first_seed is not None:
        drawn = range(first_seed, first_seed + seeds)
    with running_on(cluster), resumable(resume_words(cache)):
        site = load_scenario(scenario)
        elements, provenance = sorted(load_layout(layout, site)), LayoutFile.load(layout).provenance
        used = final_engine(engine, [site], cell_m, cells)
        case = LoadCaseSet(site, given.drawn_by(site, drawn, used))
        if export is not None:
            check_target(export)  # before the blasts, so that no result is lost
        if out is not None:
            make_folder(out)
        evaluator = BlastEvaluator(site, used, cache=cache)
        sides = {"without": (), "with": tuple(elements)}
        costs = Campaign(case, sides, evaluator, evaluator.coarser()).cost()
        label, words = f"{2 * len(case.threats)} blasts in {site.name}", used.describe([site])
        with blasts_running(label, words, costs, is_quiet=as_json) as progress:
            found = compare(
                *(evaluator, [case], [elements], processes),
                with_error=True,
                cvar_level=cvar_level,
                progress=progress,
            )
    preset = site.simulation.preset if used.needs_calibration else None
    notes = [*sampling_notes(found), *found.notes]
    record = {**found.to_dict(), "notes": notes, "preset": preset, "provenance": provenance}
    written = [] if out is None else _write(found, record, out)
    if export is not None:
        written += export_to(LayoutPlan(site, found.layout, provenance=provenance), export)
    if as_json:
        print_record(_summary(record, evaluator.counts), written)
        return
    print_outcome(evaluation_answer(found, drawn), written)
    print_parts([cache_line(evaluator.counts)])


def _summary(record: Mapping[str, Any], counts: BlastCounts) -> dict[str, Any]:
    """Return the record for `--json`, with the use of the cache."""
    hits = {"hits": counts.cache_hits, "hit_rate": counts.cache_hit_rate}
    short = {key: value for key, value in record.items() if key not in _LEFT_OUT}
    return {**short, "cache": {"blasts": counts.blasts, **hits}}


_LEFT_OUT: Final = ("scenario", "threats", "modules")
"""Parts of a record that `--json` leaves out; those of `--out` are complete."""


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
            (out / "evaluation.png", partial(evaluation_picture, found)),
            (out / LAYOUT_PICTURE, partial(layout_picture, found.scenario, found.layout)),
        ),
    ]
