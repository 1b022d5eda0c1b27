"""`blast-env propose`: a layout from the surrogate."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import nan
from pathlib import Path
from time import perf_counter
from typing import Final

import numpy as np

from blast_env.cli.command import argument, option
from blast_env.cli.evaluation_report import load_text, share_text
from blast_env.cli.options import (
    CELLS_HELP,
    FINAL_CELLS,
    SCENARIO_HELP,
    ChargeOptions,
    ProcessOptions,
)
from blast_env.cli.output import (
    ResultTable,
    print_cost,
    print_line,
    print_written,
    progress_bar,
    result_console,
    save_layout_picture,
    save_pictures,
)
from blast_env.design.proposal import Chosen, chosen_proposer, problem_of
from blast_env.design.rules import expected_charge
from blast_env.design.search import DesignProblem, Progress, SearchResult, layouts_by_rule
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, Case, Comparison
from blast_env.evaluation.engines import JUDGE, find_engine
from blast_env.evaluation.grid_error import final_engine, grid_error
from blast_env.geometry import Layout, layout_counts
from blast_env.layout import LayoutFile, Placement
from blast_env.provenance import command, versions
from blast_env.site import Scenario, load_scenario
from blast_env.site.scene import Charge
from blast_env.site.zone import source_bounds_m
from blast_env.statistics import Estimate
from blast_env.units import MS_PER_S

_PROPOSAL: Final = "this proposal"
_NOTHING: Final = "no barrier"


@dataclass(frozen=True, kw_only=True)
class ProposeCommand(ChargeOptions, ProcessOptions):
    """Propose a layout for any site in seconds without a blast.

    The layout comes from the surrogate of gas dynamics, fitted to other sites. Nothing is proposed
    if the expected reduction is below 3 %. Without --charge, the layout is for all possible places
    of the charge.
    """

    scenario: str = argument(SCENARIO_HELP)
    verify: bool = option(False, "Compare it by gas dynamics with no barrier and the rules.")
    budget: int | None = option(
        None,
        "Most blasts of gas dynamics for --verify: limits the rules, then the charges that are "
        "compared. The error of the cells takes one more for each layout.",
        show_default="as many as are needed",
        min=2,
    )
    cells: str | None = option(
        None, CELLS_HELP, show_default=f"uniform; with --verify {FINAL_CELLS}"
    )
    out: Path | None = option(
        None, "JSON file for the layout; its picture is drawn beside it.", writes=(".json",)
    )

    def __call__(self) -> None:
        """Propose a layout, judge it if requested, and write it."""
        scenario = load_scenario(self.scenario)
        scenario.zone  # noqa: B018  # refuses a scenario without one
        engine = find_engine(JUDGE, cells=self.cells)
        problem = problem_of(scenario, self._charge(scenario), self.processes, engine)
        chosen, result = self._proposed(problem)
        print_line(f"{scenario.name}: {_words(scenario, result)}, by {result.by}")
        if self.verify:
            self._verify(problem, result.layout)
        else:
            print_line("no blast was run")
        if self.out is not None:
            self._write(scenario, result.layout, chosen.source, self.out)

    def _charge(self, scenario: Scenario) -> Charge | None:
        """Return the charge at the user's place; `None` without one."""
        if self.place_m is None:
            if self.mass_kg is not None:
                raise BlastEnvError("--tnt-kg is given without --charge, the place of the charge")
            return None
        middle = expected_charge(scenario.charge)
        tnt_kg = middle.tnt_kg if self.mass_kg is None else self.mass_kg
        (x_m, y_m), charge = self.place_m, Charge(self.place_m, tnt_kg, middle.height_m)
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

    def _proposed(self, problem: DesignProblem) -> tuple[Chosen, SearchResult]:
        """Return the proposer and its proposal; print the time of one without blasts."""
        chosen = chosen_proposer()
        if self.budget is not None and not self.verify:
            raise BlastEnvError("--budget is for --verify: the proposal itself takes no blast")
        began_s = perf_counter()
        with progress_bar(f"proposal for {problem.scenario.name}") as progress:

            def report(state: Progress) -> None:
                progress(state.share)

            result = chosen.propose(problem, report=report)
        ms = MS_PER_S * (perf_counter() - began_s)
        words = "" if self.verify else " (--verify evaluates it)"
        return chosen, replace(result, by=f"{result.by}{words}, in {ms:,.0f} ms")

    def _verify(self, problem: DesignProblem, layout: Layout) -> None:
        """Judge a proposal by gas dynamics beside no barrier and the rules, within the budget."""
        case, rules = problem.case, layouts_by_rule(problem.scenario, problem.told)
        layouts = {_NOTHING: (), _PROPOSAL: layout, **rules}
        if self.budget is not None:
            case = replace(case, threats=case.threats[: max(self.budget // 2, 1)])
            most = self.budget // len(case.threats)
            distinct = list(dict.fromkeys(layouts.values()))[:most]
            layouts = {name: each for name, each in layouts.items() if each in distinct}
        engine = final_engine(JUDGE, [problem.scenario], cells=self.cells)
        evaluator = BlastEvaluator(problem.scenario, engine)
        found = _compared(evaluator, case, layouts, problem.processes)
        _print_verdict(found, case)
        left_out = [name for name in rules if name not in layouts]
        if left_out:
            print_line(f"note: not compared, for lack of blasts: {', '.join(left_out)}")
        if len(case.threats) < len(problem.threats):
            print_line(f"note: {len(case.threats)} of {len(problem.threats)} charges were used")

    def _write(
        self, scenario: Scenario, layout: Layout, source: Mapping[str, str], out: Path
    ) -> None:
        provenance = {**source, "command": command(), "versions": versions()}
        written = [LayoutFile.of(scenario, layout, provenance).save(out)]
        picture = out.with_suffix(".png")
        written += save_pictures(lambda: [save_layout_picture(scenario, layout, picture)])
        print_written(written)


def _words(scenario: Scenario, result: SearchResult) -> str:
    """Return the proposal in words, with its cost and its expected gain."""
    if not result.layout:
        return "nothing is proposed"
    placement = Placement.of(scenario, result.layout)
    cost = "" if scenario.zone.budget is None else f", cost {placement.cost:g}"
    gain = result.expectation
    return f"{layout_counts(result.layout)}{cost}{gain and f', {gain}'}"


def _compared(
    evaluator: BlastEvaluator, case: Case, layouts: Mapping[str, Layout], processes: int
) -> dict[str, Comparison]:
    """Return layouts compared with no barrier, each with its error of the cells.

    That is from the charge with the largest load behind the proposal.
    """
    engine, coarser, threats = evaluator.engine, evaluator.coarser(), case.threats
    distinct = dict.fromkeys(layouts.values())
    print_line(engine.describe())
    asked = [(engine, each) for each in threats] + [(engine.coarser, threats[0])]
    print_cost((each, case.scenario, threat.charge) for each, threat in asked for _ in distinct)
    pairs = [(each, threat) for each in distinct for threat in threats]
    with progress_bar(f"{len(pairs)} blasts of gas dynamics") as progress:
        found = iter(evaluator.loads_of_many(pairs, processes, progress))
    blasts = {each: [next(found) for _ in threats] for each in distinct}
    objective = case.scenario.objective
    counted = {each: np.array([[x.load(objective) for x in blasts[each]]]) for each in distinct}
    worst = int(counted[layouts[_PROPOSAL]].argmax())
    return {
        name: Comparison(
            cases=(case,),
            layouts=(each,),
            loads=counted[each],
            unprotected=counted[()],
            in_range=np.array([[x.in_range for x in blasts[each]]]),
            grid_error=grid_error(
                coarser,
                case,
                each,
                threats[worst],
                (blasts[each][worst], blasts[()][worst]),
                processes,
            ),
        )
        for name, each in layouts.items()
    }


def _print_verdict(found: Mapping[str, Comparison], case: Case) -> None:
    """Print one row per layout: no barrier, the rules with the best last, and the proposal."""
    charges = f"{len(case.threats)} charges" if case.charge is None else "this charge"
    objective = case.scenario.objective
    loads = {name: case.counted(each.loads[0], each.layouts[0]) for name, each in found.items()}
    title = f"{case.scenario.name}: judged by gas dynamics on {charges}"
    table = ResultTable(title, ("layout", "load", "reduction"))
    rules = sorted(loads.keys() - {_NOTHING, _PROPOSAL}, key=lambda name: -loads[name])
    for name in (_NOTHING, *rules, _PROPOSAL):
        each, load = found[name], Estimate(loads[name], nan, nan)
        share = share_text(each.reduction, each.reduction_error) if name != _NOTHING else "-"
        table.add_row(name, load_text(objective, load, each.objective_error), share)
    result_console().print(table)
    error = found[_PROPOSAL].grid_error
    if error is not None:
        print_line(error.words)
    if rules and loads[rules[-1]] < loads[_PROPOSAL]:
        print_line(f"note: {rules[-1]} does better here than the proposal")
