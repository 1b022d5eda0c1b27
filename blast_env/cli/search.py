"""What `blast-env search` prints and writes."""

from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any, Final, Literal

import numpy as np
import typer
from blast_agents.search import (
    SEARCH_METHODS,
    LayoutProblem,
    SearchMethod,
    SearchResult,
    find_search_method,
)
from blast_agents.search import Progress as SearchProgress
from blast_agents.surrogate import (
    Surrogate,
    SurrogateSearch,
    load_surrogate,
    packaged_surrogate,
)
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from blast_env.cli.cluster import ClusterAddress, running_on
from blast_env.cli.options import (
    CacheFolder,
    CellSide,
    ChargePlace,
    CvarLevel,
    Processes,
    TntMass,
    fixed_charge,
)
from blast_env.cli.output import (
    make_table,
    message_console,
    print_line,
    progress_bar,
    result_console,
    resume_with_cache,
    save_pictures,
    show_interruption,
    user_errors,
)
from blast_env.cli.pictures import LAYOUT_PICTURE, save_layout_picture
from blast_env.cli.targets import checked_targets
from blast_env.engines import Engine, find_engine
from blast_env.envs.episode import find_realisations, find_risk, find_threat_model
from blast_env.envs.strategies import HiddenThreat
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.evaluation import (
    BlastEvaluator,
    Case,
    LayoutEvaluation,
    SeedRange,
    Threat,
    draw_threats,
    evaluate_against,
)
from blast_env.evaluation.cases import practice_hidden, practice_visible
from blast_env.files import make_folder
from blast_env.geometry import layout_counts
from blast_env.provenance import command, versions
from blast_env.scenario import AnyCharge, Scenario, load_layout, load_scenario, write_layout
from blast_env.statistics import CVAR_LEVEL, ConditionalValueAtRisk, WorstRisk, reductions
from blast_env.tables import write_csv

ThreatName = Literal["visible", "hidden"]

LAYOUT_NAME: Final = "layout.json"
"""File of the layout in the folder of `--out`."""


@dataclass(frozen=True)
class SearchOptions:
    """What the command was called with; see `search`."""

    method: str
    scenario: str
    budget: int
    seed: int
    threat: ThreatName
    threats: int | None
    realisations: int | None
    charge_position_m: tuple[float, float] | None
    tnt_kg: float | None
    risk: str | None
    cvar_level: float
    engine: str
    cell_m: float | None
    start_from: tuple[str, ...]
    surrogate: str | None  # its digest


@dataclass(frozen=True, eq=False)
class SearchRun:
    """A search that has ended.

    Attributes:
        problem: What it was asked.
        result: What it found.
        seconds: How long it took.
        cache_hits: Loads that it asked for and that were known already.
    """

    problem: LayoutProblem
    result: SearchResult
    seconds: float
    cache_hits: int


def print_search(run: SearchRun, checked: LayoutEvaluation) -> None:
    """Print what the layout does against the search's threats and against others, and the cost."""
    result, problem = run.result, run.problem
    table = make_table(
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
    print_line(
        f"{layout_counts(result.layout, of=problem.stock)}; {result.blasts} of {result.budget} "
        f"blasts spent, {run.cache_hits} of the loads asked for known already; "
        f"{run.seconds:.1f} s"
    )
    print_line(problem.evaluator.engine.describe([problem.scenario]))


def write_search(
    run: SearchRun, options: SearchOptions, checked: LayoutEvaluation, out: Path
) -> None:
    """Write the layout, the history, the front and a figure, as far as there are such."""
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
    for path in written:
        print_line(f"wrote {path}")


def _save_figure(run: SearchRun, out: Path) -> list[Path]:
    # Here, because pictures need the extra `render`.
    from blast_agents.search.figure import search_figure

    from blast_env.rendering.figures import save_figure

    return [save_figure(search_figure(run.result, run.problem), out / "search.png")]


def _provenance(
    run: SearchRun, options: SearchOptions, checked: LayoutEvaluation
) -> dict[str, Any]:
    """Return what repeats the search, and what came out."""
    result, problem = run.result, run.problem
    low, high = (None if np.isnan(end) else float(end) for end in checked.ci95)
    return {
        "command": command(),
        "options": asdict(options),
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
            "held_out_threats": len(checked.threats),
            "held_out_reduction": checked.mean_reduction,
            "held_out_reduction_ci95": [low, high],
        },
    }


def _risk_text(problem: LayoutProblem) -> str:
    """Return what the loads under the search's threats are."""
    noun = problem.scenario.objective.noun
    words = f"{noun} of the protected structures"
    risk = problem.case.risk or problem.scenario.objective.risk
    if isinstance(risk, WorstRisk):
        return f"largest {words}"
    if isinstance(risk, ConditionalValueAtRisk):
        return f"{words}, mean of the worst {100.0 * (1.0 - risk.level):.3g} %"
    return f"mean {words}"


def percent(share: float) -> str:
    """Return a share for people."""
    return f"{100.0 * share:.1f} %"


def search(
    method: Annotated[
        str,
        typer.Option(
            help="random, greedy, annealing, genetic, nsga2, exhaustive, or a rule: "
            "(long_)wall_near_charge, (long_)wall_near_building, ring_around_charge, "
            "ring_around_building, line_of_posts, posts_and_wall or sight_lines; with a catalogue "
            "also surrogate: guesses of gas dynamics say what gets a blast."
        ),
    ] = "genetic",
    scenario: Annotated[str, typer.Option(help="Bundled name, or a scenario file.")] = "courtyard",
    budget: Annotated[int, typer.Option(min=1, help="Most blasts that may be spent.")] = 200,
    seed: Annotated[int, typer.Option(min=0, help="Decides threats and search.")] = 0,
    threat: Annotated[
        ThreatName,
        typer.Option(help="One charge that is known, or a layout for wherever it may be."),
    ] = "visible",
    threats: Annotated[
        int | None, typer.Option(min=1, help="Charges of a hidden threat; 16 unless given.")
    ] = None,
    realisations: Annotated[
        int | None,
        typer.Option(min=1, help="Blasts a charge; 2 (visible) or 1 (hidden) unless given."),
    ] = None,
    charge: ChargePlace = None,
    tnt_kg: TntMass = None,
    risk: Annotated[
        str | None,
        typer.Option(
            help="mean, cvar or worst, over the charges.",
            show_default="as the scenario's objective says",
        ),
    ] = None,
    cvar_level: CvarLevel = CVAR_LEVEL,
    engine: Annotated[
        str, typer.Option(help="event or pymunk (particles), or gas (gas dynamics).")
    ] = "event",
    cell: CellSide = None,
    processes: Processes = 1,
    cluster: ClusterAddress = None,
    start_from: Annotated[
        list[Path] | None, typer.Option(help="Layout file to begin with; more than one will do.")
    ] = None,
    surrogate: Annotated[
        Path | None,
        typer.Option(
            help="File of the surrogate for --method surrogate (studies.surrogate fit).",
            show_default="the package's",
        ),
    ] = None,
    held_out: Annotated[
        int, typer.Option(min=1, help="Threats that the result is checked on at the end.")
    ] = 32,
    cache: CacheFolder = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for layout, its plan, history, front and figure.")
    ] = None,
) -> None:
    """Search for the layout with the least impulse on the protected structures.

    Ctrl-C ends the search and keeps the best layout so far. The result is checked on threats that
    the search has not met; those blasts do not count.
    """
    with (
        user_errors(lambda: resume_with_cache(cache)),
        checked_targets(folders={"--out": out, "--cache": cache}),
        running_on(cluster),
    ):
        guessing = _surrogate(method, surrogate)
        options = SearchOptions(
            method=method,
            scenario=scenario,
            budget=budget,
            seed=seed,
            threat=threat,
            threats=threats,
            realisations=realisations,
            charge_position_m=charge,
            tnt_kg=tnt_kg,
            risk=risk,
            cvar_level=cvar_level,
            engine=engine,
            cell_m=cell,
            start_from=tuple(str(path) for path in start_from or ()),
            surrogate=None if guessing is None else guessing.digest,
        )
        evaluator = BlastEvaluator(load_scenario(scenario), find_engine(engine, cell), cache=cache)
        if out is not None:
            make_folder(out)
        chosen = _method(options, guessing, evaluator.scenario)
        run = _run(chosen, options, evaluator, processes)
        if run.result.interrupted and not run.result.history:
            raise KeyboardInterrupt  # nothing was found that could be kept
        checked = _check(run, options, held_out)
        print_search(run, checked)
        if out is not None:
            write_search(run, options, checked, out)
    if run.result.interrupted:
        layout = None if out is None else out / LAYOUT_NAME
        show_interruption(
            "the best layout so far was kept",
            "" if layout is None else f"--start-from {layout} begins with it",
            resume_with_cache(cache),
        )
        raise typer.Exit(130)


def _surrogate(method: str, path: Path | None) -> Surrogate | None:
    """Return the surrogate of a method that has one."""
    if method == SurrogateSearch.name:
        return packaged_surrogate() if path is None else load_surrogate(path)
    if path is not None:
        raise BlastEnvError(f"--surrogate is for --method {SurrogateSearch.name}, not {method}")
    return None


def _method(
    options: SearchOptions, surrogate: Surrogate | None, scenario: Scenario
) -> SearchMethod:
    initial = tuple(load_layout(path, scenario) for path in options.start_from)
    if surrogate is None:
        known = (*SEARCH_METHODS, SurrogateSearch.name)
        if options.method not in known:
            raise UnknownNameError("search method", options.method, known)
        return find_search_method(options.method, initial)
    if initial:
        raise BlastEnvError(f"{options.method} begins with no layouts: leave --start-from out")
    if not scenario.zone.items:
        raise BlastEnvError(
            f"{scenario.name} has no catalogue (build_zone.items): the surrogate knows nothing of "
            "single modules"
        )
    return SurrogateSearch(surrogate, surrogate.digest)


def _run(
    method: SearchMethod, options: SearchOptions, evaluator: BlastEvaluator, processes: int
) -> SearchRun:
    scenario = evaluator.scenario
    problem = LayoutProblem(evaluator, _practice(scenario, options, evaluator.engine), processes)
    problem.unprotected  # noqa: B018  # refuses a case in which nothing arrives
    hits, begun_s = evaluator.cache_hits, perf_counter()
    result = _with_progress(method, problem, options)
    return SearchRun(problem, result, perf_counter() - begun_s, evaluator.cache_hits - hits)


def _practice(scenario: Scenario, options: SearchOptions, engine: Engine) -> Case:
    """Return what the search may spend its blasts on."""
    model = find_threat_model(options.threat, options.threats)
    realisations = find_realisations(options.realisations, options.threat, engine)
    risk = find_risk(options.risk, options.cvar_level)
    if not isinstance(model, HiddenThreat):
        charge = _visible_charge(scenario, options)
        return practice_visible(scenario, charge, realisations, options.seed, risk)
    for option, value in (("--charge", options.charge_position_m), ("--tnt-kg", options.tnt_kg)):
        if value is not None:
            raise BlastEnvError(f"{option} is for a visible threat: a hidden one is drawn")
    return practice_hidden(scenario, model.threats, realisations, options.seed, risk)


def _visible_charge(scenario: Scenario, options: SearchOptions) -> AnyCharge:
    """Return the charge that is known: always that of the search's own seed."""
    drawn = scenario.sample_charge(np.random.default_rng(options.seed))
    return fixed_charge(scenario, drawn, options.charge_position_m, options.tnt_kg)


def _with_progress(
    method: SearchMethod, problem: LayoutProblem, options: SearchOptions
) -> SearchResult:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("blasts, best reduction {task.fields[best]}"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=message_console(), transient=True) as progress:
        label = f"{method.name} search in {problem.scenario.name}"
        task = progress.add_task(label, total=options.budget, best="-")

        def report(state: SearchProgress) -> None:
            best = "-" if state.best is None else percent(problem.reduction(state.best))
            progress.update(task, completed=state.blasts, best=best)

        return method.search(problem, options.budget, options.seed, report)


def _check(run: SearchRun, options: SearchOptions, held_out: int) -> LayoutEvaluation:
    """Evaluate the layout on threats that judge: the search has met none of them."""
    problem, seeds = run.problem, SeedRange.JUDGEMENT.seeds(0, held_out)
    if options.threat == "visible":
        threats = tuple(Threat(problem.charge, seed) for seed in seeds)
    else:
        threats = draw_threats(problem.scenario, seeds)
    with progress_bar(f"check on {held_out} other threats") as progress:
        return evaluate_against(
            problem.evaluator,
            run.result.layout,
            threats,
            problem.processes,
            cvar_level=options.cvar_level,
            progress=progress,
        )
