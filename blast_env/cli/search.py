"""`blast-env search`: the layout with the least load, for a budget of blasts."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from itertools import cycle, islice
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from blast_env.cli.command import FOLDER, option
from blast_env.cli.options import (
    CELL_HELP,
    CELLS_HELP,
    CVAR_HELP,
    ENGINE_HELP,
    SCENARIO_HELP,
    CacheOptions,
    ChargeOptions,
    ClusterOptions,
    ProcessOptions,
    running_on,
)
from blast_env.cli.output import (
    LAYOUT_PICTURE,
    InterruptedCommandError,
    ResultTable,
    message_console,
    percent,
    print_cost,
    print_line,
    print_written,
    progress_bar,
    result_console,
    save_layout_picture,
    save_pictures,
)
from blast_env.design.search import (
    DesignProblem,
    Proposer,
    SearchResult,
    find_proposer,
    proposers,
)
from blast_env.design.search import Progress as SearchProgress
from blast_env.design.search.registry import DEFAULT_BUDGET, check_suits, proposer_row
from blast_env.envs.episode import find_realisations, find_risk, find_threat_model
from blast_env.envs.strategies import HiddenThreat
from blast_env.errors import BlastEnvError
from blast_env.evaluation import (
    BlastEvaluator,
    Case,
    LayoutEvaluation,
    SeedRange,
    Threat,
    draw_threats,
    evaluate_against,
)
from blast_env.evaluation.cases import one_of_each_charge, practice_hidden, practice_visible
from blast_env.evaluation.engines import JUDGE, Engine, find_engine
from blast_env.files import make_folder
from blast_env.geometry import layout_counts
from blast_env.layout import load_layout, write_layout
from blast_env.provenance import command, versions
from blast_env.site import Scenario, load_scenario
from blast_env.statistics import CVAR_LEVEL, ConditionalValueAtRisk, WorstRisk, reductions
from blast_env.tables import write_csv

if TYPE_CHECKING:
    from blast_env.design.surrogate import Surrogate

ThreatName = Literal["visible", "hidden"]

LAYOUT_NAME: Final = "layout.json"
"""File of the layout in the folder of `--out`."""

_SURROGATE: Final = "surrogate"
_NOT_OF_THE_SEARCH: Final = ("processes", "cluster", "cache", "out", "held_out", "surrogate")
"""Options that do not affect the result, or are recorded in another form."""


@dataclass(frozen=True, kw_only=True)
class SearchCommand(ChargeOptions, ProcessOptions, ClusterOptions, CacheOptions):
    """Search for the layout with the least load on the protected structures.

    Ctrl-C ends the search and keeps the best layout so far. The result is checked on threats
    outside the search; those blasts do not count.
    """

    method: str = option("genetic", f"{', '.join(proposers())}.")
    scenario: str = option("courtyard", SCENARIO_HELP)
    budget: int = option(DEFAULT_BUDGET, "Most blasts that may be spent.", min=1)
    seed: int = option(0, "Decides threats and search.", min=0)
    threat: ThreatName = option(
        "visible", "visible: one known charge; hidden: a layout for all possible charges."
    )
    threats: int | None = option(None, "Charges of a hidden threat; 16 unless given.", min=1)
    realisations: int | None = option(
        None,
        "Particle blasts per charge; 2 (visible) or 1 (hidden) unless given.",
        min=1,
    )
    risk: str | None = option(
        None,
        "mean, cvar or worst, over the charges.",
        show_default="as in the scenario's objective",
    )
    cvar_level: float = option(CVAR_LEVEL, CVAR_HELP)
    engine: str = option(JUDGE, ENGINE_HELP)
    cell_m: float | None = option(None, CELL_HELP)
    cells: str | None = option(None, CELLS_HELP, show_default="uniform")
    start_from: tuple[Path, ...] = option((), "Initial layout file; may be given again.")
    surrogate: Path | None = option(
        None,
        "File of the surrogate for --method surrogate (studies.surrogate fit).",
        show_default="the package's",
    )
    held_out: int = option(32, "Number of threats for the final check of the result.", min=1)
    out: Path | None = option(
        None, "Folder for layout, its plan, history, front and figure.", writes=FOLDER
    )

    def __call__(self) -> None:
        """Search, check the result, and write it."""
        with running_on(self.cluster):
            engine = find_engine(self.engine, self.cell_m, cells=self.cells)
            evaluator = BlastEvaluator(load_scenario(self.scenario), engine, cache=self.cache)
            if self.out is not None:
                make_folder(self.out)
            method, surrogate = self._method(evaluator.scenario)
            run = self._run(method, evaluator)
            if run.result.interrupted and not run.result.history:
                raise KeyboardInterrupt  # there is no layout to keep
            checked = self._check(run)
            print_search(run, checked)
            if self.out is not None:
                options = {**self._options(), "surrogate": surrogate}
                write_search(run, options, checked, self.out)
        if run.result.interrupted:
            layout = None if self.out is None else self.out / LAYOUT_NAME
            raise InterruptedCommandError(
                "the best layout so far was kept",
                "" if layout is None else f"--start-from {layout} begins with it",
                self.how_to_resume(),
            )

    def _options(self) -> dict[str, Any]:
        """Return the options that affect the result, as plain data."""
        named = {each.name: getattr(self, each.name) for each in fields(self)}
        named["start_from"] = [str(path) for path in self.start_from]
        return {name: each for name, each in named.items() if name not in _NOT_OF_THE_SEARCH}

    def _method(self, scenario: Scenario) -> "tuple[Proposer, str | None]":
        """Return the method, and the digest of its surrogate if it has one."""
        if self.surrogate is not None and self.method != _SURROGATE:
            raise BlastEnvError(f"--surrogate is for --method {_SURROGATE}, not {self.method}")
        proposer_row(self.method)  # refuses an unknown one
        guessing = self._surrogate() if self.method == _SURROGATE else None
        check_suits(self.method, scenario)
        initial = tuple(load_layout(path, scenario) for path in self.start_from)
        if guessing is None or initial:
            return find_proposer(self.method, initial), None
        # Here, because it takes half a second to import.
        from blast_env.design.surrogate import search_by

        return search_by(guessing), guessing.digest

    def _surrogate(self) -> "Surrogate":
        # Here, because it takes half a second to import.
        from blast_env.design.surrogate import load_surrogate, packaged_surrogate

        return packaged_surrogate() if self.surrogate is None else load_surrogate(self.surrogate)

    def _run(self, method: Proposer, evaluator: BlastEvaluator) -> "SearchRun":
        case = self._practice(evaluator.scenario, evaluator.engine)
        problem = DesignProblem(evaluator, case, self.processes)
        print_line(evaluator.engine.describe([evaluator.scenario]))
        turns = islice(cycle(case.threats), self.budget)
        print_cost((evaluator.engine, evaluator.scenario, each.charge) for each in turns)
        problem.unprotected  # noqa: B018  # refuses a case in which nothing arrives
        hits, begun_s = evaluator.cache_hits, perf_counter()
        result = self._with_progress(method, problem)
        return SearchRun(problem, result, perf_counter() - begun_s, evaluator.cache_hits - hits)

    def _practice(self, scenario: Scenario, engine: Engine) -> Case:
        """Return the load cases of the search."""
        model = find_threat_model(self.threat, self.threats)
        realisations = find_realisations(self.realisations, self.threat, engine)
        risk = find_risk(self.risk, self.cvar_level)
        if not isinstance(model, HiddenThreat):
            # The known charge is always drawn by the seed of the search.
            charge = self.fixed(scenario, scenario.sample_charge(np.random.default_rng(self.seed)))
            return practice_visible(scenario, charge, realisations, self.seed, risk)
        for flag, value in (("--charge", self.charge), ("--tnt-kg", self.tnt_kg)):
            if value is not None:
                raise BlastEnvError(f"{flag} is for a visible threat: a hidden one is drawn")
        return practice_hidden(scenario, model.threats, realisations, self.seed, risk)

    def _with_progress(self, method: Proposer, problem: DesignProblem) -> SearchResult:
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("blasts, best reduction {task.fields[best]}"),
            TimeRemainingColumn(),
        )
        with Progress(*columns, console=message_console(), transient=True) as progress:
            label = f"{method.name} search in {problem.scenario.name}"
            task = progress.add_task(label, total=self.budget, best="-")

            def report(state: SearchProgress) -> None:
                best = "-" if state.best is None else percent(state.best.reduction(problem))
                progress.update(task, completed=state.blasts, best=best)

            return method.propose(problem, self.budget, self.seed, report)

    def _check(self, run: "SearchRun") -> LayoutEvaluation | None:
        """Evaluate the layout on threats of judgement; `None` if the search used all of them.

        Without noise a charge is one blast: a charge used by the search is not held out.
        """
        problem, seeds = run.problem, SeedRange.JUDGEMENT.seeds(0, self.held_out)
        if self.threat == "hidden":
            threats = draw_threats(problem.scenario, seeds)
        else:
            threats = tuple(Threat(problem.threats[0].charge, seed) for seed in seeds)
        if not problem.evaluator.engine.has_noise:  # each charge is one blast
            met = {each.charge for each in problem.threats}
            threats = tuple(each for each in one_of_each_charge(threats) if each.charge not in met)
        if not threats:
            return None
        with progress_bar(f"check on {len(threats)} other threats") as progress:
            return evaluate_against(
                problem.evaluator,
                run.result.layout,
                threats,
                problem.processes,
                cvar_level=self.cvar_level,
                progress=progress,
            )


@dataclass(frozen=True, eq=False)
class SearchRun:
    """A finished search.

    Attributes:
        problem: Its problem.
        result: Its result.
        seconds: Its duration.
        cache_hits: Number of its loads found in the cache.
    """

    problem: DesignProblem
    result: SearchResult
    seconds: float
    cache_hits: int


def print_search(run: SearchRun, checked: LayoutEvaluation | None) -> None:
    """Print the effect of the layout on the search's threats and on others, and the cost."""
    result, problem = run.result, run.problem
    table = ResultTable(
        f"{problem.scenario.name}: {result.method} search, {_risk_text(problem)}",
        ("threats", "number", "without", "with", "reduction", "95 % interval"),
    )
    bare, load = problem.case.counted(problem.unprotected), problem.load(result.layout)
    counts = problem.scenario.objective
    table.add_row(
        "of the search",
        str(len(problem.threats)),
        counts.text(bare),
        counts.text(load),
        percent(reductions(load, bare).item()),
        "-",
    )
    if checked is not None:
        low, high = checked.ci95
        table.add_row(
            "held out",
            str(len(checked.threats)),
            counts.text(checked.unprotected_load),
            counts.text(checked.load),
            percent(checked.mean_reduction),
            "-" if np.isnan(low) else f"{percent(low)} to {percent(high)}",
        )
    result_console().print(table)
    if checked is None:
        print_line(
            "no threat is held out: with this engine a charge is one blast, and the search used "
            "every charge; `evaluate` takes other charges"
        )
    print_line(
        f"{layout_counts(result.layout, of=problem.stock)}; {result.blasts} of {result.budget} "
        f"blasts spent, {run.cache_hits} of the loads asked for known already; "
        f"{run.seconds:.1f} s"
    )


def write_search(
    run: SearchRun, options: Mapping[str, Any], checked: LayoutEvaluation | None, out: Path
) -> None:
    """Write the layout and its picture; the history, its figure and the front, if there are any."""
    result = run.result
    scenario = run.problem.scenario
    provenance = _provenance(run, options, checked)
    written = [write_layout(out / LAYOUT_NAME, scenario, result.layout, provenance)]
    written += save_pictures(
        lambda: [save_layout_picture(scenario, result.layout, out / LAYOUT_PICTURE)]
    )
    if result.history:
        written.append(write_csv(result.history_table(), out / "history.csv"))
        written += save_pictures(lambda: _save_figure(run, out))
    if result.front:
        written.append(write_csv(result.front_table(), out / "front.csv"))
    print_written(written)


def _save_figure(run: SearchRun, out: Path) -> list[Path]:
    # Here, because pictures need the extra `render`.
    from blast_env.design.search.figure import search_figure
    from blast_env.plots.figures import save_figure

    return [save_figure(search_figure(run.result, run.problem), out / "search.png")]


def _provenance(
    run: SearchRun, options: Mapping[str, Any], checked: LayoutEvaluation | None
) -> dict[str, Any]:
    result, problem = run.result, run.problem
    ends = () if checked is None else checked.ci95
    return {
        "command": command(),
        "options": options,
        "threats": [
            {
                "charge_position_m": charge.position_m,
                "charge_height_m": charge.height_m,
                "tnt_kg": charge.tnt_kg,
                "seed": threat.seed,
            }
            for threat in problem.threats
            for charge in [threat.charge_against(problem.scenario, result.layout)]
        ],
        "versions": versions(problem.evaluator.engine.version),
        "result": {
            "blasts": result.blasts,
            "interrupted": result.interrupted,
            "load": result.load,
            "unit": problem.scenario.objective.unit,
            "threats_met": result.threats,
            "held_out_threats": 0 if checked is None else len(checked.threats),
            "held_out_reduction": None if checked is None else checked.mean_reduction,
            "held_out_reduction_ci95": [None if np.isnan(end) else float(end) for end in ends],
        },
    }


def _risk_text(problem: DesignProblem) -> str:
    """Return the risk measure over the search's threats in words."""
    noun = problem.scenario.objective.noun
    words = f"{noun} of the protected structures"
    risk = problem.case.risk or problem.scenario.objective.risk
    if isinstance(risk, WorstRisk):
        return f"largest {words}"
    if isinstance(risk, ConditionalValueAtRisk):
        return f"{words}, mean of the worst {100.0 * (1.0 - risk.level):.3g} %"
    return f"mean {words}"
