"""The printed and written output of `blast-env evaluate`."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import isnan, nan
from pathlib import Path
from typing import TYPE_CHECKING, Final

from blast_env.cli.options import GivenCharge
from blast_env.cli.output import (
    LAYOUT_PICTURE,
    layout_picture,
    print_cost,
    print_json,
    print_line,
    print_table,
    print_written,
    progress_bar,
    save_pictures,
)
from blast_env.evaluation import (
    BlastEvaluator,
    Evaluation,
    LoadCase,
    LoadCaseSet,
    compare,
    draw_threats,
)
from blast_env.evaluation.answers import building_words
from blast_env.evaluation.cases import are_all, fixed_charges, in_turn, one_of_each_charge
from blast_env.evaluation.engines import Engine
from blast_env.evaluation.evaluator import BlastCounts
from blast_env.evaluation.grid_error import final_engine, percent, points, with_errors, worse
from blast_env.files import make_folder
from blast_env.geometry import layout_counts
from blast_env.io.export import LayoutPlan, check_target, export_layouts
from blast_env.site import AnyCharge, ObjectiveSection, Scenario
from blast_env.statistics import Estimate
from blast_env.tables import write_csv

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True, kw_only=True)
class EvaluateOptions:
    """The options of an evaluation common to a layout file and a run; see `evaluate`."""

    given: GivenCharge
    seeds: range
    engine: str
    cell_m: float | None
    cells: str | None
    until: str | None
    cvar_level: float
    processes: int
    cache: Path | None
    export: Path | None
    out: Path | None
    is_json: bool

    def engine_for(self, engine: str | Engine, sites: Sequence[Scenario]) -> Engine:
        """Return an engine with the requested cells, for final statements on sites."""
        return final_engine(engine, sites, self.cell_m, self.cells, until=self.until)

    def threats(self, scenario: Scenario, engine: Engine) -> tuple[LoadCase, ...]:
        """Return the threats drawn by the seeds, with the user's place and mass of the charge.

        Fixed charges come in turn, each once before any repeats. Without noise a charge has one
        realisation: repeated ones are dropped.
        """
        drawn = in_turn(scenario, draw_threats(scenario, self.seeds))
        threats = tuple(
            LoadCase(self.given.fixed(scenario, threat.charge), threat.seed) for threat in drawn
        )
        return threats if engine.has_noise else one_of_each_charge(threats)

    def prepare_files(self, layouts: int) -> None:
        """Check the targets for some layouts before the blasts, so that no result is lost."""
        if self.export is not None:
            check_target(self.export, layouts)
        if self.out is not None:
            make_folder(self.out)


def cache_text(counts: BlastCounts) -> str:
    """Return the number of blasts run, and of those found in the cache, in words."""
    return (
        f"{counts.blasts:g} blasts run, {counts.cache_hits:g} known already "
        f"(cache hit rate {percent(counts.cache_hit_rate)})"
    )


def interval(estimate: Estimate) -> str:
    """Return an interval of shares in words; a dash for a single threat."""
    if isnan(estimate.low):
        return "-"
    return f"{percent(estimate.low)} to {percent(estimate.high)}"


def share_text(estimate: Estimate, error: float = nan, sampled: str = "charges") -> str:
    """Return a share with its errors: `48.5 % +- 1.4 (cells), +- 2.1 (95 %, charges)`.

    `sampled` names the samples of its interval.
    """
    half = points(estimate.value - estimate.low)
    return with_errors(percent(estimate.value), points(error), half and f"{half} (95 %, {sampled})")


def load_text(
    objective: ObjectiveSection, estimate: Estimate, error: float = nan, sampled: str = "charges"
) -> str:
    """Return a load with its unit and its errors; see `share_text`."""

    def number(load: float) -> str:
        return objective.text(load).removesuffix(f" {objective.unit}")

    half = "" if isnan(estimate.low) else number(estimate.value - estimate.low)
    cells = "" if isnan(error) else number(error)
    return with_errors(objective.text(estimate.value), cells, half and f"{half} (95 %, {sampled})")


def threats_text(count: int, seeds: range) -> str:
    """Return the threats of the means in words."""
    if count == 1:
        return f"seed {seeds[0]}"
    return f"means over {count} threats (seeds {seeds[0]} to {seeds[-1]})"


def print_if_all_charges(
    scenario: Scenario, charges: Iterable[AnyCharge | None], training: str = ""
) -> None:
    """Print a note if charges include all possible ones of a scenario, which are fixed.

    `training` has words on their part in a training.
    """
    count = len(fixed_charges(scenario))
    if count > 1 and are_all(scenario, charges):
        print_line(
            f"note: the site has {count} fixed charges, which all count here; {training}the "
            "interval is their spread, not an uncertainty about others"
        )


_LEFT_OUT: Final = ("scenario", "threats", "modules", "cases")
"""Parts of a record that `--json` leaves out; those of `--out` are complete."""


def print_json_record(
    record: Mapping[str, object],
    files: Sequence[Path],
    options: EvaluateOptions,
    counts: BlastCounts,
) -> bool:
    """Print a record as JSON, if that is wanted; return whether it is."""
    if options.is_json:
        rate = {"hits": counts.cache_hits, "hit_rate": counts.cache_hit_rate}
        cache = {"blasts": counts.blasts, **rate}
        more = {"cache": cache, "files": [str(path) for path in files]}
        print_json({key: x for key, x in {**record, **more}.items() if key not in _LEFT_OUT})
    return options.is_json


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


def asked_blasts(
    cases: Sequence[LoadCaseSet], engine: Engine
) -> Iterator[tuple[Engine | None, Scenario, AnyCharge]]:
    """Yield the blasts of an evaluation, for their cost: both layouts, and the worst threat."""
    for case in cases:
        for threat in case.threats:
            yield from [(engine, case.scenario, threat.charge)] * 2
    worst = cases[0]
    yield from [(engine.coarser, worst.scenario, worst.threats[0].charge)] * 2


def report_layout(plan: LayoutPlan, evaluator: BlastEvaluator, options: EvaluateOptions) -> None:
    """Evaluate a layout on the threats drawn by the seeds; print and write the result."""
    engine = evaluator.engine
    case = LoadCaseSet(plan.scenario, options.threats(plan.scenario, engine))
    options.prepare_files(1)
    if not options.is_json:
        print_line(engine.describe([plan.scenario]))
        print_cost(asked_blasts([case], engine))
    with progress_bar(f"{2 * len(case.threats)} blasts in {plan.scenario.name}") as progress:
        evaluation = compare(
            evaluator,
            [case],
            [plan.layout],
            options.processes,
            with_error=True,
            cvar_level=options.cvar_level,
            progress=progress,
        )
    written = [] if options.out is None else _write(evaluation, options.out)
    if options.export is not None:
        written += export_layouts({"layout": plan}, options.export)
    record = {
        **evaluation.to_dict(),
        "scenario_name": plan.scenario.name,
        "preset": plan.scenario.simulation.preset if engine.needs_calibration else None,
        "provenance": dict(plan.provenance),
    }
    if print_json_record(record, written, options, evaluator.counts):
        return
    _print_evaluation(evaluation, options.seeds)
    print_written(written)
    print_line(cache_text(evaluator.counts))


def _write(evaluation: Evaluation, out: Path) -> list[Path]:
    written = [evaluation.to_json(out / "evaluation.json")]
    tables = {
        "structures.csv": evaluation.table,
        "buildings.csv": evaluation.building_table,
        "modules.csv": evaluation.module_table,
        "threats.csv": evaluation.threat_table,
    }
    written += [write_csv(table, out / name) for name, table in tables.items()]
    return written + save_pictures(
        (out / "evaluation.png", partial(_figure, evaluation)),
        (out / LAYOUT_PICTURE, partial(layout_picture, evaluation.scenario, evaluation.layout)),
    )


def _figure(evaluation: Evaluation) -> "Figure":
    # Here, because pictures need the extra `render`.
    from blast_env.plots.evaluation_figures import evaluation_figure

    return evaluation_figure(evaluation)


def _print_evaluation(evaluation: Evaluation, seeds: range) -> None:
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
    print_if_all_charges(evaluation.scenario, [each.charge for each in evaluation.threats])
    for note in evaluation.notes:
        print_line(f"note: {note}")


def standing_lines(scenario: Scenario, buildings: "pd.DataFrame", column: str) -> Iterator[str]:
    """Yield the standing of the load on each building, with its reason.

    Args:
        scenario: It has the titles of the buildings.
        buildings: A table with `STANDING_COLUMNS`.
        column: The column with the name of the building.
    """
    for each in buildings.to_dict("records"):
        name = building_words(scenario, str(each[column]))
        yield f"standing of the load, {name}: {each['standing']} ({each['reason']})"


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
