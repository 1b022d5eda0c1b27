"""`blast-env evaluate`: a layout, or the agent of a run, against no barrier."""

from pathlib import Path
from typing import Annotated

import typer

from blast_env.cli.cluster import ClusterAddress, running_on
from blast_env.cli.evaluation_report import EvaluateOptions, report_layout
from blast_env.cli.options import (
    AsJson,
    CacheFolder,
    CellSide,
    ChargePlace,
    CvarLevel,
    JsonAll,
    Processes,
    TntMass,
)
from blast_env.cli.output import check_json, resume_with_cache, user_errors
from blast_env.cli.targets import checked_targets
from blast_env.errors import BlastEnvError, import_extra
from blast_env.evaluation import BlastEvaluator
from blast_env.export import LayoutPlan
from blast_env.physics.engines import find_engine
from blast_env.scenario import LayoutFile, load_layout, load_scenario
from blast_env.statistics import CVAR_LEVEL, check_cvar_level

_SCENARIO = "courtyard"


_ENGINE = "event"


LayoutPath = Annotated[Path | None, typer.Option(help="JSON file of the (row, column) cells.")]


RunPath = Annotated[
    Path | None, typer.Option(help="Folder of a training run: evaluate what its agent proposes.")
]


ScenarioName = Annotated[
    str | None,
    typer.Option(help="Bundled name, or a scenario file, for --layout.", show_default=_SCENARIO),
]


SeedCount = Annotated[int, typer.Option(min=1, help="Number of threats.")]


FirstSeed = Annotated[
    int | None,
    typer.Option(
        min=0,
        help="The seeds count from here.",
        show_default="the first one that no training and no search meets",
    ),
]


EngineName = Annotated[
    str | None,
    typer.Option(
        help="Engine that runs the blasts.", show_default=f"{_ENGINE}; with --run that of the run"
    ),
]


ExportPath = Annotated[
    Path | None,
    typer.Option(
        help="Folder for the layouts as JSON, CSV, GeoJSON and DXF; or, for one layout, a file "
        "with one of these suffixes."
    ),
]


OutFolder = Annotated[
    Path | None, typer.Option(help="Folder for the JSON file, the tables and the figure.")
]


def evaluate(
    layout: LayoutPath = None,
    run: RunPath = None,
    scenario: ScenarioName = None,
    seeds: SeedCount = 32,
    first_seed: FirstSeed = None,
    processes: Processes = 1,
    cluster: ClusterAddress = None,
    engine: EngineName = None,
    cell: CellSide = None,
    charge: ChargePlace = None,
    tnt_kg: TntMass = None,
    cvar_level: CvarLevel = CVAR_LEVEL,
    cache: CacheFolder = None,
    export: ExportPath = None,
    out: OutFolder = None,
    as_json: AsJson = False,
    json_all: JsonAll = False,
) -> None:
    """Compare layouts with no barrier, both exposed to the same threats.

    Each seed draws a charge from the scenario, the fan and the air. With --run an agent that was
    trained on visible charges proposes a layout for each of them, any other one layout for all.
    """
    options = EvaluateOptions(
        seeds=seeds,
        first_seed=first_seed,
        processes=processes,
        engine=engine,
        cell_m=cell,
        charge_m=charge,
        tnt_kg=tnt_kg,
        cvar_level=cvar_level,
        cache=cache,
        export=export,
        out=out,
        as_json=as_json,
        json_all=json_all,
    )
    folders = {"--out": out, "--cache": cache}
    with (
        user_errors(lambda: resume_with_cache(cache)),
        checked_targets(options.files, folders | options.folders),
        running_on(cluster),
    ):
        check_cvar_level(cvar_level)
        check_json(as_json, json_all)
        if run is not None:
            _refuse_beside_run(layout, scenario)
            _evaluate_run(run, options)
        elif layout is not None:
            _evaluate_file(layout, scenario or _SCENARIO, options)
        else:
            raise BlastEnvError("--layout or --run is missing: what is to be evaluated")


def _refuse_beside_run(layout: Path | None, scenario: str | None) -> None:
    """Refuse options that say what the run folder says."""
    if layout is not None:
        raise BlastEnvError(
            "--layout and --run exclude each other: a run's agent proposes the layouts"
        )
    if scenario is not None:
        raise BlastEnvError("--scenario cannot be used with --run: the run folder says it")


def _evaluate_file(path: Path, scenario: str, options: EvaluateOptions) -> None:
    """Evaluate the layout of a file."""
    chosen = load_scenario(scenario)
    cells = load_layout(path, chosen)
    plan = LayoutPlan(chosen, cells, provenance=LayoutFile.load(path).provenance)
    evaluator = BlastEvaluator(
        chosen, find_engine(options.engine or _ENGINE, options.cell_m), cache=options.cache
    )
    report_layout(plan, evaluator, options)


def _evaluate_run(run: Path, options: EvaluateOptions) -> None:
    """Evaluate the agent of a run, if the packages that it needs are there."""
    # Here, because runs need the extras.
    with import_extra("agents,render", "--run"):
        from blast_env.cli.agent_runs import evaluate_run
    evaluate_run(run, options)
