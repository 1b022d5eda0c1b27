"""Proposals of the agent of a run, for threats outside its training.

Imports torch, so the command imports this module only for `--run`.
"""

import json
from dataclasses import replace
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any, Final

from blast_agents.training import TrainedAgent, TrainingSettings, load_agent, newest_weights
from blast_agents.training.cases import unseen_cases
from blast_agents.training.hyperparameters import ALGORITHM_NAMES
from blast_agents.training.run_folder import RunFolder

from blast_env.cli.evaluation_report import (
    EvaluateOptions,
    asked_blasts,
    cache_text,
    print_if_all_charges,
    print_json_record,
    print_means,
    report_layout,
    threats_text,
)
from blast_env.cli.output import (
    print_cost,
    print_line,
    print_table,
    print_written,
    progress_bar,
)
from blast_env.envs.strategies import ScenarioSource, SingleScenario, scenario_source
from blast_env.evaluation import (
    BlastEvaluator,
    Evaluation,
    Evaluators,
    LoadCaseSet,
    SeedRange,
    compare,
)
from blast_env.evaluation.engines import JUDGE, Engine
from blast_env.evaluation.grid_error import percent
from blast_env.files import write_text
from blast_env.io.export import LayoutPlan, export_layouts
from blast_env.layout.build_scene import charge_against
from blast_env.plots.evaluation_figures import comparison_figure
from blast_env.plots.figures import save_figure
from blast_env.provenance import command, versions
from blast_env.site import save_scenario
from blast_env.sites import FAMILIES
from blast_env.tables import write_csv
from blast_env.units import MS_PER_S

_HEADERS: Final = (
    "scenario",
    "charge (m)",
    "kg TNT",
    "modules",
    "without (Pa s)",
    "with (Pa s)",
    "reduction",
)

_NO_BEST: Final = (
    "the run has no evaluation yet, so there are no best weights: the last ones propose"
)


def evaluate_run(run: Path, options: EvaluateOptions) -> None:
    """Evaluate the proposals of the agent of a run folder; print and write the result."""
    folder = RunFolder(run)
    configuration = folder.configuration()
    settings, weights = configuration.settings, newest_weights(run)
    agent = load_agent(run, weights)
    provenance = _provenance(run, settings, weights)
    note = _overlap(settings, options.seeds) if weights == "best" else _NO_BEST
    if note and not options.is_json:
        print_line(f"note: {note}")
    own = settings.judge  # gas dynamics judges final statements
    engine = own if own.name == options.engine != JUDGE else options.engine
    if settings.scenario in FAMILIES:
        source = scenario_source(settings.scenario)
        _report_cases(agent, settings, source, engine, provenance, options)
        return
    scenario = folder.scenario(configuration)
    if settings.threat == "hidden":  # one layout for all possible places of the charge
        used = options.engine_for(engine, [scenario])
        plan = LayoutPlan(scenario, agent.propose(scenario), provenance=provenance)
        report_layout(plan, BlastEvaluator(scenario, used, cache=options.cache), options)
    else:
        _report_cases(agent, settings, SingleScenario(scenario), engine, provenance, options)


def _report_cases(
    agent: TrainedAgent,
    settings: TrainingSettings,
    source: ScenarioSource,
    engine: str | Engine,
    provenance: dict[str, Any],
    options: EvaluateOptions,
) -> None:
    """Report on one layout per charge, or per site."""
    seeds = options.seeds
    options.prepare_files(len(seeds))
    cases = [_fixed(case, options) for case in unseen_cases(settings, source, seeds)]
    used = options.engine_for(engine, [each.scenario for each in cases])
    if not used.has_noise:  # the same charge again would be the same blast
        distinct: dict[object, LoadCaseSet] = {}
        for each in cases:
            distinct.setdefault((each.scenario.content_hash, each.charge), each)
        cases = [*distinct.values()]
    evaluators = Evaluators(used, options.cache)
    if not options.is_json:
        print_line(used.describe([case.scenario for case in cases]))
        print_cost(asked_blasts(cases, used))
    layouts, seconds = [], []
    for case in cases:
        began_s = perf_counter()
        layouts.append(agent.propose(case.scenario, case.charge))
        seconds.append(perf_counter() - began_s)
    is_family = settings.scenario in FAMILIES
    place = f"{len(cases)} generated sites" if is_family else cases[0].scenario.name
    with progress_bar(f"{2 * len(cases)} blasts in {place}") as progress:
        found = compare(
            evaluators,
            cases,
            layouts,
            options.processes,
            with_error=True,
            cvar_level=options.cvar_level,
            progress=progress,
        )
    record = {**found.to_dict(), "provenance": provenance}
    written = [] if options.out is None else _write(found, record, options.out)
    exported: list[Path] = []
    if options.export is not None:
        plans = _plans(found, provenance)
        exported = export_layouts(plans, options.export)
        if is_family:  # no other file holds the sites
            exported += _write_sites(plans, options.export)
    if print_json_record(record, [*written, *exported], options, evaluators.counts):
        return
    title = f"{ALGORITHM_NAMES[settings.algorithm]} of {provenance['run']}, a layout a row"
    _print_cases(found, f"{title}, {threats_text(len(cases), seeds)}")
    charges = [each.charge for each in cases]
    print_if_all_charges(cases[0].scenario, charges, "training may have met them, and ")
    milliseconds = MS_PER_S * median(seconds)
    print_line(f"proposed in {milliseconds:.1f} ms each (median), no blast spent on any")
    print_written(written)
    if exported:
        print_line(f"wrote {len(cases)} layouts to {options.export}, files: {len(exported)}")
    print_line(cache_text(evaluators.counts))


def _fixed(case: LoadCaseSet, options: EvaluateOptions) -> LoadCaseSet:
    threats = tuple(
        replace(threat, charge=options.given.fixed(case.scenario, threat.charge))
        for threat in case.threats
    )
    charge = None if case.charge is None else options.given.fixed(case.scenario, case.charge)
    return replace(case, threats=threats, charge=charge)


def _print_cases(comparison: Evaluation, title: str) -> None:
    cases, objective = comparison.case_table, comparison.cases[0].scenario.objective
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
        for row in cases.to_dict("records")
    ]
    print_table(title, _HEADERS, rows)
    outside = int((~cases["in_range"]).sum())
    if outside:
        print_line(f"note: {outside} threats are outside the range of the calibration (marked ~)")
    print_means(comparison, objective, "cases")
    if comparison.engine.needs_calibration:
        calibrations = dict.fromkeys(str(case.scenario.calibration) for case in comparison.cases)
        print_line(f"calibration {', '.join(calibrations)}")


def _write(comparison: Evaluation, record: dict[str, Any], out: Path) -> list[Path]:
    text = json.dumps(record, indent=2, allow_nan=False)
    path = write_text(out / "evaluation.json", text + "\n")
    table = write_csv(comparison.case_table, out / "cases.csv")
    return [path, table, save_figure(comparison_figure(comparison), out / "evaluation.png")]


def _plans(comparison: Evaluation, provenance: dict[str, Any]) -> dict[str, LayoutPlan]:
    """Return the layouts by the names of their files, numbered in the order of the table."""
    digits = len(str(len(comparison.cases)))
    pairs = zip(comparison.cases, comparison.layouts, strict=True)
    return {
        f"layout_{number:0{digits}}": LayoutPlan(
            case.scenario,
            layout,
            None if case.charge is None else charge_against(case.scenario, layout, case.charge),
            {**provenance, "seed": case.threats[0].seed},
        )
        for number, (case, layout) in enumerate(pairs, start=1)
    }


def _write_sites(plans: dict[str, LayoutPlan], folder: Path) -> list[Path]:
    """Write the scenario of each layout beside it."""
    paths = [folder / f"{name}_site.toml" for name in plans]
    for path, plan in zip(paths, plans.values(), strict=True):
        save_scenario(plan.scenario, path)
    return paths


def _provenance(run: Path, settings: TrainingSettings, weights: str) -> dict[str, Any]:
    return {
        "command": command(),
        "run": str(run),
        "weights": weights,
        "algorithm": settings.algorithm,
        "threat": settings.threat,
        "versions": versions(packages=("torch", "stable-baselines3", "numpy")),
    }


def _overlap(settings: TrainingSettings, seeds: range) -> str:
    """Return a note if the weights were selected by some of the threats; else an empty text."""
    if settings.scenario in FAMILIES:  # other sites, whatever the seeds
        return ""
    chosen_by = SeedRange.VALIDATION.seeds(
        settings.evaluation_first_seed, settings.evaluation_cases
    )
    both = range(max(seeds[0], chosen_by[0]), min(seeds[-1], chosen_by[-1]) + 1)
    if not both:
        return ""
    return f"the best weights were chosen by {len(both)} of these threats: judge by others"
