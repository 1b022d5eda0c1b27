"""`blast-env evaluate`: a layout, or the agent of a run, against no barrier."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from functools import partial
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import typer

from blast_env.cli.command import Target, note_target, writes
from blast_env.cli.options import (
    CacheOption,
    ChargeOption,
    ClusterAddress,
    CvarOption,
    EngineChoice,
    EvaluateOptions,
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
from blast_env.errors import BlastEnvError, import_extra
from blast_env.evaluation import (
    BlastEvaluator,
    Evaluation,
    Evaluators,
    LoadCaseSet,
    SeedRange,
    compare,
)
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
from blast_env.evaluation.engines import JUDGE, Engine
from blast_env.files import make_folder, write_text
from blast_env.geometry import Element, layout_counts
from blast_env.io.export import LayoutPlan, check_target, export_layouts, is_file
from blast_env.layout import LayoutFile, load_layout
from blast_env.site import AnyCharge, ObjectiveSection, Scenario, load_scenario, save_scenario
from blast_env.statistics import CVAR_LEVEL, Estimate, check_cvar_level
from blast_env.tables import write_csv

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
    _report(evaluator, [case], [layout], options, provenance)


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
        from blast_env.cli.agent_runs import proposals
    evaluators, cases, layouts, provenance = proposals(run, options)
    _report(evaluators, cases, layouts, options, provenance)


def threats_text(count: int, seeds: range) -> str:
    """Return the threats of the means in words."""
    if count == 1:
        return f"seed {seeds[0]}"
    return f"means over {count} threats (seeds {seeds[0]} to {seeds[-1]})"


def _print_if_all_charges(
    scenario: Scenario, charges: Iterable[AnyCharge], *, is_trained: bool
) -> None:
    """Print a note if charges include all possible ones of a scenario, which are fixed."""
    count = len(fixed_charges(scenario))
    training = "training may have met them, and " if is_trained else ""
    if count > 1 and are_all(scenario, charges):
        print_line(
            f"note: the site has {count} fixed charges, which all count here; {training}the "
            "interval is their spread, not an uncertainty about others"
        )


_LEFT_OUT: Final = ("scenario", "threats", "modules", "cases")
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


_CASE_HEADERS: Final = (
    *("scenario", "charge (m)", "kg TNT", "modules", "without (Pa s)", "with (Pa s)"),
    "reduction",
)


def asked_blasts(
    cases: Sequence[LoadCaseSet], engine: Engine
) -> Iterator[tuple[Engine | None, Scenario, AnyCharge]]:
    """Yield the blasts of an evaluation, for their cost: both layouts, and the worst threat."""
    for case in cases:
        for threat in case.threats:
            yield from [(engine, case.scenario, threat.charge)] * 2
    worst = cases[0]
    yield from [(engine.coarser, worst.scenario, worst.threats[0].charge)] * 2


def _report(
    evaluators: Evaluators | BlastEvaluator,
    cases: Sequence[LoadCaseSet],
    layouts: Sequence[Sequence[Element]],
    options: EvaluateOptions,
    provenance: Mapping[str, Any],
) -> None:
    """Evaluate layouts, one per case; print and write the result.

    Several cases are those of the agent of a run, with one charge each; a single one has the
    threats drawn by the seeds. `provenance` has the origin of the layouts.
    """
    if options.export is not None:
        check_target(options.export, len(cases))  # before the blasts, so that no result is lost
    if options.out is not None:
        make_folder(options.out)
    engine, scenarios = evaluators.engine, [case.scenario for case in cases]
    if not options.is_json:
        print_line(engine.describe(scenarios))
        print_cost(asked_blasts(cases, engine))
    names = [*dict.fromkeys(each.name for each in scenarios)]
    place = names[0] if len(names) == 1 else f"{len(names)} sites"
    blasts = 2 * sum(len(case.threats) for case in cases)
    with progress_bar(f"{blasts} blasts in {place}") as progress:
        found = compare(
            evaluators,
            cases,
            layouts,
            options.processes,
            with_error=True,
            cvar_level=options.cvar_level,
            progress=progress,
        )
    record = {
        **found.to_dict(),
        "scenario_name": place,
        "preset": scenarios[0].simulation.preset if engine.needs_calibration else None,
        "provenance": dict(provenance),
    }
    written = [] if options.out is None else _write(found, record, options.out)
    exported = [] if options.export is None else _export(found, provenance, options.export)
    counts = evaluators.counts
    if options.is_json:
        hits = {"hits": counts.cache_hits, "hit_rate": counts.cache_hit_rate}
        cache = {"blasts": counts.blasts, **hits}
        more = {"cache": cache, "files": [str(path) for path in (*written, *exported)]}
        print_json({key: x for key, x in {**record, **more}.items() if key not in _LEFT_OUT})
        return
    _print_evaluation(found, options.seeds, provenance)
    print_written(written)
    if found.has_one_case:
        print_written(exported)
    elif exported:
        print_line(f"wrote {len(cases)} layouts to {options.export}, files: {len(exported)}")
    print_line(
        f"{counts.blasts:g} blasts run, {counts.cache_hits:g} known already "
        f"(cache hit rate {percent(counts.cache_hit_rate)})"
    )


def _write(found: Evaluation, record: Mapping[str, Any], out: Path) -> list[Path]:
    text = json.dumps(record, indent=2, allow_nan=False)
    written = [write_text(out / "evaluation.json", text + "\n")]
    picture = (out / "evaluation.png", partial(_figure, found))
    if not found.has_one_case:
        return [*written, write_csv(found.case_table, out / "cases.csv"), *save_pictures(picture)]
    tables = {
        "structures.csv": found.table,
        "buildings.csv": found.building_table,
        "modules.csv": found.module_table,
        "threats.csv": found.threat_table,
    }
    written += [write_csv(table, out / name) for name, table in tables.items()]
    plan = partial(layout_picture, found.scenario, found.layout)
    return written + save_pictures(picture, (out / LAYOUT_PICTURE, plan))


def _export(found: Evaluation, provenance: Mapping[str, Any], target: Path) -> list[Path]:
    """Export the layouts, numbered if there are several; each with its site if these differ."""
    digits, plans = len(str(len(found.cases))), dict[str, LayoutPlan]()
    for number, (case, layout) in enumerate(zip(found.cases, found.layouts, strict=True), start=1):
        threat, own = case.threats[0], dict(provenance)
        name = "layout" if found.has_one_case else f"layout_{number:0{digits}}"
        if not found.has_one_case:
            own["seed"] = threat.seed
        known = case.charge is not None
        charge = threat.charge_against(case.scenario, layout) if known else None
        plans[name] = LayoutPlan(case.scenario, layout, charge, own)
    written = export_layouts(plans, target)
    if len({case.scenario.name for case in found.cases}) > 1:  # no other file has the sites
        for name, plan in plans.items():
            written.append(target / f"{name}_site.toml")
            save_scenario(plan.scenario, written[-1])
    return written


def _figure(found: Evaluation) -> "Figure":
    # Here, because pictures need the extra `render`.
    from blast_env.plots.evaluation_figures import comparison_figure, evaluation_figure

    return evaluation_figure(found) if found.has_one_case else comparison_figure(found)


def _print_evaluation(found: Evaluation, seeds: range, provenance: Mapping[str, Any]) -> None:
    if found.has_one_case:
        _print_layout(found, seeds)
    else:
        title = f"{provenance['algorithm']} of {provenance['run']}, a layout a row"
        _print_cases(found, f"{title}, {threats_text(len(found.cases), seeds)}")
    charges = [threat.charge for case in found.cases for threat in case.threats]
    _print_if_all_charges(found.scenario, charges, is_trained="run" in provenance)
    for note in found.notes if found.has_one_case else ():
        print_line(f"note: {note}")


def _print_cases(found: Evaluation, title: str) -> None:
    """Print the layout of each case, and the mean effect."""
    objective = found.cases[0].scenario.objective
    rows = [
        (
            row["scenario"],
            f"({row['charge_x_m']:.1f}, {row['charge_y_m']:.1f})",
            f"{row['tnt_kg']:g}",
            str(row["modules"]),
            objective.text(row["unprotected_load"]),
            objective.text(row["load"]),
            percent(row["reduction"]) + ("" if row["in_range"] else " ~"),
        )
        for row in found.case_table.to_dict("records")
    ]
    print_table(title, _CASE_HEADERS, rows)
    outside = int((~found.within.all(axis=1)).sum())
    if outside:
        print_line(f"note: {outside} threats are outside the range of the calibration (marked ~)")
    print_means(found, objective, "cases")
    if found.engine.needs_calibration:
        calibrations = dict.fromkeys(str(case.scenario.calibration) for case in found.cases)
        print_line(f"calibration {', '.join(calibrations)}")


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
    title = f"{evaluation.scenario.name}: {barriers} against none, {threats_text(count, seeds)}"
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
