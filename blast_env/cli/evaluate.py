"""`blast-env evaluate`: a layout, or the agent of a run, against no barrier."""

from dataclasses import fields
from pathlib import Path
from typing import Final

import typer

from blast_env.cli.command import Target, note_target, writes
from blast_env.cli.evaluation_report import EvaluateOptions, report
from blast_env.cli.options import (
    UNTIL_HELP,
    CacheOption,
    ChargeOption,
    ClusterAddress,
    CvarOption,
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
from blast_env.cli.output import resumable
from blast_env.errors import BlastEnvError, import_extra
from blast_env.evaluation import BlastEvaluator, LoadCaseSet, SeedRange
from blast_env.evaluation.engines import JUDGE
from blast_env.io.export import is_file
from blast_env.layout import LayoutFile, load_layout
from blast_env.site import load_scenario
from blast_env.statistics import CVAR_LEVEL, check_cvar_level

_SCENARIO: Final = "courtyard"


def _note_export(context: typer.Context, value: Path | None) -> Path | None:
    """Add the target of `--export`, a file or a folder; `check_target` checks other suffixes."""
    if value is not None and (is_file(value) or not value.suffix):
        suffixes = (value.suffix.lower(),) if is_file(value) else ()
        note_target(context, Target("--export", value, suffixes))
    return value


def evaluate(
    context: typer.Context,
    layout: Path | None = typer.Option(None, help="JSON file of the (row, column) cells."),
    run: Path | None = typer.Option(
        None, help="Folder of a training run, whose agent proposes the layouts."
    ),
    scenario: str | None = typer.Option(
        None, help="Bundled name, or a scenario file, for --layout.", show_default=_SCENARIO
    ),
    seeds: int = typer.Option(32, help="Number of threats.", min=1),
    first_seed: int | None = typer.Option(
        None, help="First seed.", min=0, show_default="the first one outside training and search"
    ),
    engine: EngineChoice = JUDGE,
    cell_m: FinalCellOption = None,
    cells: FinalCellsOption = None,
    until: str | None = typer.Option(None, help=UNTIL_HELP, show_default="structures"),
    cvar_level: CvarOption = CVAR_LEVEL,
    export: Path | None = typer.Option(
        None,
        help="Folder for the layouts as JSON, CSV, GeoJSON and DXF; or, for one layout, a file "
        "with one of these suffixes.",
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
    """Compare layouts with no barrier, both exposed to the same threats.

    Each seed draws a charge from the scenario; for particles, also the fan and the air. With --run,
    an agent trained on visible charges proposes one layout per charge, any other agent one layout
    for all.

    Gas dynamics runs on cells of 0.25 m. The worst charge runs on cells twice as large as well: the
    difference gives the error of the cells beside each number.
    """
    check_cvar_level(cvar_level)
    if first_seed is None:
        drawn = SeedRange.TEST.seeds(0, seeds)
    else:
        drawn = range(first_seed, first_seed + seeds)
    own = {each.name for each in fields(EvaluateOptions)} & {*context.params}
    options = EvaluateOptions(
        **{name: context.params[name] for name in own - {"seeds"}},
        given=GivenCharge.of(charge, tnt_kg),
        seeds=drawn,
        is_json=as_json,
    )
    with running_on(cluster), resumable(resume_words(cache)):
        if run is not None:
            _evaluate_run(run, layout, scenario, options)
        elif layout is not None:
            _evaluate_file(layout, scenario or _SCENARIO, options)
        else:
            raise BlastEnvError("--layout or --run is missing: give the layouts to evaluate")


def _evaluate_file(path: Path, name: str, options: EvaluateOptions) -> None:
    scenario = load_scenario(name)
    layout, provenance = sorted(load_layout(path, scenario)), LayoutFile.load(path).provenance
    engine = options.engine_for(options.engine, [scenario])
    case = LoadCaseSet(scenario, options.threats(scenario, engine))
    evaluator = BlastEvaluator(scenario, engine, cache=options.cache)
    report(evaluator, [case], [layout], options, provenance)


def _evaluate_run(
    run: Path, layout: Path | None, scenario: str | None, options: EvaluateOptions
) -> None:
    """Evaluate the agent of a run; refuse options that the run folder already fixes."""
    if layout is not None:
        raise BlastEnvError(
            "--layout and --run exclude each other: a run's agent proposes the layouts"
        )
    if scenario is not None:
        raise BlastEnvError("--scenario cannot be used with --run: the run folder contains it")
    # Here, because runs need the extras.
    with import_extra("agents,render", "--run"):
        from blast_env.cli.agent_runs import evaluate_run
    evaluate_run(run, options)
