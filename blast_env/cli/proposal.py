"""`blast-env search --method package`: a layout from the surrogate, and its verdict by gas."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from math import nan
from pathlib import Path
from time import perf_counter
from typing import Final

from blast_env.cli.evaluation_report import load_text, share_text
from blast_env.cli.options import GivenCharge
from blast_env.cli.output import (
    LAYOUT_NAME,
    LAYOUT_PICTURE,
    layout_picture,
    print_cost,
    print_line,
    print_table,
    print_written,
    progress_bar,
    save_pictures,
)
from blast_env.design.proposal import PackageProposer, chosen_proposer, problem_of
from blast_env.design.rules import expected_charge
from blast_env.design.search import DesignProblem, Progress, SearchResult, layouts_by_rule
from blast_env.errors import BlastEnvError
from blast_env.evaluation import Evaluation, Evaluators, LoadCaseSet, compare
from blast_env.evaluation.engines import JUDGE, find_engine
from blast_env.evaluation.grid_error import final_engine
from blast_env.files import make_folder
from blast_env.geometry import Layout, layout_counts
from blast_env.layout import LayoutState, write_layout
from blast_env.provenance import command, versions
from blast_env.runner import share_of
from blast_env.site import Scenario
from blast_env.site.scene import Charge
from blast_env.site.zone import source_bounds_m
from blast_env.statistics import Estimate
from blast_env.units import MS_PER_S

PACKAGE: Final = PackageProposer().name
_PROPOSAL: Final = "this proposal"
_NOTHING: Final = "no barrier"


def package_proposal(
    scenario: Scenario, given: GivenCharge, cells: str | None, processes: int, out: Path | None
) -> tuple[DesignProblem, Layout]:
    """Propose a layout without a blast, print it, and write it; return it with its problem."""
    scenario.zone  # noqa: B018  # refuses a scenario without one
    engine = find_engine(JUDGE, cells=cells)
    problem = problem_of(scenario, _charge(scenario, given), processes, engine)
    chosen, began_s = chosen_proposer(), perf_counter()
    with progress_bar(f"proposal for {scenario.name}") as progress:

        def report(state: Progress) -> None:
            progress(state.share)

        result = chosen.propose(problem, report=report)
    ms = MS_PER_S * (perf_counter() - began_s)
    print_line(f"{scenario.name}: {_words(scenario, result)}, by {result.by}, in {ms:,.0f} ms")
    if out is not None:
        _write(scenario, result.layout, chosen.source, out)
    return problem, result.layout


def _charge(scenario: Scenario, given: GivenCharge) -> Charge | None:
    """Return the charge at the user's place; `None` without one."""
    if given.place_m is None:
        if given.mass_kg is not None:
            raise BlastEnvError("--tnt-kg is given without --charge, the place of the charge")
        return None
    middle = expected_charge(scenario.charge)
    tnt_kg = middle.tnt_kg if given.mass_kg is None else given.mass_kg
    (x_m, y_m), charge = given.place_m, Charge(given.place_m, tnt_kg, middle.height_m)
    scenario.with_possible_charges((charge,))  # refuses one that is not clear, or out of bounds
    bounds = [source_bounds_m(source) for source in scenario.charge]
    if not any(
        each.left <= x_m <= each.right and each.bottom <= y_m <= each.top for each in bounds
    ):
        print_line(
            f"note: {scenario.name} never has a charge at ({x_m:g}, {y_m:g}) m: --verify the "
            "proposal"
        )
    return charge


def _words(scenario: Scenario, result: SearchResult) -> str:
    """Return the proposal in words, with its cost and its expected gain."""
    if not result.layout:
        return "nothing is proposed"
    placement = LayoutState.of(scenario, result.layout)
    cost = "" if scenario.zone.budget is None else f", cost {placement.cost:g}"
    gain = result.expectation
    return f"{layout_counts(result.layout)}{cost}{gain and f', {gain}'}"


def _write(scenario: Scenario, layout: Layout, source: Mapping[str, str], out: Path) -> None:
    make_folder(out)
    provenance = {**source, "command": command(), "versions": versions()}
    written = [write_layout(out / LAYOUT_NAME, scenario, layout, provenance)]
    picture = partial(layout_picture, scenario, layout)
    print_written(written + save_pictures((out / LAYOUT_PICTURE, picture)))


def verify_proposal(
    problem: DesignProblem, layout: Layout, budget: int | None, cells: str | None
) -> None:
    """Compare a proposal by gas dynamics with no barrier and the rules, within the budget."""
    if budget is not None and budget < 2:
        raise BlastEnvError(f"--budget is {budget}, must be at least 2 with --verify")
    case, rules = problem.case, layouts_by_rule(problem.scenario, problem.known_charge)
    layouts = {_NOTHING: (), _PROPOSAL: layout, **rules}
    if budget is not None:
        case = replace(case, threats=case.threats[: budget // 2])
        most = budget // len(case.threats)
        distinct = list(dict.fromkeys(layouts.values()))[:most]
        layouts = {name: each for name, each in layouts.items() if each in distinct}
    engine = final_engine(JUDGE, [problem.scenario], cells=cells)
    _print_verdict(_compared(Evaluators(engine), case, layouts, problem.processes), case)
    left_out = [name for name in rules if name not in layouts]
    if left_out:
        print_line(f"note: not compared, for lack of blasts: {', '.join(left_out)}")
    if len(case.threats) < len(problem.threats):
        print_line(f"note: {len(case.threats)} of {len(problem.threats)} charges were used")


def _compared(
    evaluators: Evaluators, case: LoadCaseSet, layouts: Mapping[str, Layout], processes: int
) -> dict[str, Evaluation]:
    """Return each layout compared with no barrier, with its error of the cells."""
    engine, distinct = evaluators.engine, list(dict.fromkeys(layouts.values()))
    print_line(engine.describe())
    asked = [(engine, each) for each in case.threats] + [(engine.coarser, case.threats[0])]
    print_cost((each, case.scenario, threat.charge) for each, threat in asked for _ in distinct)
    found = {}
    with progress_bar(f"{len(distinct) * len(case.threats)} blasts of gas dynamics") as progress:
        for number, each in enumerate(distinct):
            found[each] = compare(
                evaluators,
                [case],
                [each],
                processes,
                with_error=True,
                progress=share_of(progress, number, len(distinct)),
            )
    return {name: found[each] for name, each in layouts.items()}


def _print_verdict(found: Mapping[str, Evaluation], case: LoadCaseSet) -> None:
    """Print one row per layout: no barrier, the rules with the best last, and the proposal."""
    charges = f"{len(case.threats)} charges" if case.charge is None else "this charge"
    objective = case.scenario.objective
    loads = {
        name: case.objective_value(each.loads[0], each.layouts[0]) for name, each in found.items()
    }
    rules = sorted(loads.keys() - {_NOTHING, _PROPOSAL}, key=lambda name: -loads[name])
    rows = []
    for name in (_NOTHING, *rules, _PROPOSAL):
        each, load = found[name], Estimate(loads[name], nan, nan)
        share = share_text(each.reduction, each.reduction_error) if name != _NOTHING else "-"
        rows.append((name, load_text(objective, load, each.objective_error), share))
    title = f"{case.scenario.name}: judged by gas dynamics on {charges}"
    print_table(title, ("layout", "load", "reduction"), rows)
    error = found[_PROPOSAL].grid_error
    if error is not None:
        print_line(error.words)
    if rules and loads[rules[-1]] < loads[_PROPOSAL]:
        print_line(f"note: {rules[-1]} does better here than the proposal")
