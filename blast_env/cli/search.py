"""`blast-env search`: the layout with the least impulse that a number of blasts can find."""

from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Final

import numpy as np
import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from blast_env.atomic import make_folder
from blast_env.cli.output import (
    agents_extra,
    message_console,
    progress_bar,
    user_errors,
)
from blast_env.cli.search_output import (
    SearchOptions,
    SearchRun,
    ThreatName,
    percent,
    print_search,
    write_search,
)
from blast_env.envs.task import find_realisations, find_risk, find_threat_model
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, LayoutEvaluation, Threat, evaluate_against
from blast_env.evaluation.evaluate import CVAR_LEVEL
from blast_env.scenario import Charge, Scenario, load_layout, load_scenario

if TYPE_CHECKING:
    from agents.search import LayoutProblem, SearchMethod, SearchResult
    from agents.search import Progress as SearchProgress
    from agents.search.unprotected import Unprotected

_HELD_OUT: Final = 1_000_003
"""Added to the seed for threats that the search has not met."""


def search(
    method: Annotated[
        str,
        typer.Option(
            help="random, greedy, annealing, genetic, nsga2, exhaustive, wall_near_charge or "
            "wall_near_building."
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
    charge_position: Annotated[
        tuple[float, float] | None,
        typer.Option(help="x and y in m of a visible charge; drawn unless given."),
    ] = None,
    risk: Annotated[str, typer.Option(help="mean or cvar, over the charges.")] = "mean",
    cvar_level: Annotated[
        float, typer.Option(help="For the risk cvar; 0.8: the mean of the worst 20 %.")
    ] = CVAR_LEVEL,
    engine: Annotated[str, typer.Option(help="Engine that runs the blasts.")] = "event",
    processes: Annotated[int, typer.Option(min=1, help="Worker processes.")] = 1,
    start_from: Annotated[
        list[Path] | None, typer.Option(help="Layout file to begin with; more than one will do.")
    ] = None,
    held_out: Annotated[
        int, typer.Option(min=1, help="Threats that the result is checked on at the end.")
    ] = 32,
    cache: Annotated[
        Path | None, typer.Option(help="Folder in which blasts are kept for the next run.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for layout, history, front and figure.")
    ] = None,
) -> None:
    """Search for the layout with the least impulse on the protected structures.

    Ctrl-C ends the search and keeps the best layout so far. The result is checked on threats that
    the search has not met; those blasts do not count.
    """
    with user_errors(), agents_extra("a search"):
        options = SearchOptions(
            method=method,
            scenario=scenario,
            budget=budget,
            seed=seed,
            threat=threat,
            threats=threats,
            realisations=realisations,
            charge_position_m=charge_position,
            risk=risk,
            cvar_level=cvar_level,
            engine=engine,
            start_from=tuple(str(path) for path in start_from or ()),
        )
        evaluator = BlastEvaluator(load_scenario(scenario), engine, cache=cache)
        if out is not None:
            make_folder(out)
        run = _run(options, evaluator, processes)
        checked = _check(run, options, held_out)
        print_search(run, options, checked)
        if out is not None:
            write_search(run, options, checked, out)
    if run.result.interrupted:
        message_console().print("interrupted: the best layout so far was kept", style="yellow")
        raise typer.Exit(130)


def _run(options: SearchOptions, evaluator: BlastEvaluator, processes: int) -> SearchRun:
    from agents.search import LayoutProblem, find_search_method
    from agents.search.unprotected import Unprotected

    scenario = evaluator.scenario
    initial = tuple(load_layout(path, scenario) for path in options.start_from)
    method = find_search_method(options.method, initial)
    problem = LayoutProblem(
        evaluator,
        _threats(scenario, options, options.seed),
        find_risk(options.risk, options.cvar_level),
        processes,
    )
    unprotected = Unprotected.of(problem)
    hits, begun_s = evaluator.cache_hits, perf_counter()
    result = _with_progress(method, problem, unprotected, options)
    return SearchRun(result, unprotected, perf_counter() - begun_s, evaluator.cache_hits - hits)


def _threats(scenario: Scenario, options: SearchOptions, seed: int) -> tuple[Threat, ...]:
    """Return the threats of the search (its seed) or those that check it (another seed)."""
    from agents.search import hidden_threats, visible_threats

    model = find_threat_model(options.threat, options.threats)
    realisations = find_realisations(options.realisations, options.threat)
    if options.threat == "hidden":
        if options.charge_position_m is not None:
            raise BlastEnvError("--charge-position is for a visible threat: a hidden one is drawn")
        count = len(model.draw(scenario, np.random.default_rng(seed)))
        return hidden_threats(scenario, count, realisations, seed)
    return visible_threats(_visible_charge(scenario, options), realisations, seed)


def _visible_charge(scenario: Scenario, options: SearchOptions) -> Charge:
    """Return the charge that is known: always that of the search's own seed."""
    charge = scenario.sample_charge(np.random.default_rng(options.seed))
    if options.charge_position_m is None:
        return charge
    moved = Charge(options.charge_position_m, charge.tnt_kg)
    scenario.with_charge(moved)  # refuses a place that is not clear
    return moved


def _with_progress(
    method: "SearchMethod",
    problem: "LayoutProblem",
    unprotected: "Unprotected",
    options: SearchOptions,
) -> "SearchResult":
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

        def report(state: "SearchProgress") -> None:
            best = "-" if state.best is None else percent(unprotected.reduction(state.best))
            progress.update(task, completed=state.blasts, best=best)

        return method.search(problem, options.budget, options.seed, report)


def _check(run: SearchRun, options: SearchOptions, held_out: int) -> LayoutEvaluation:
    """Evaluate the layout on threats that the search has not met."""
    problem = run.unprotected.problem
    once = replace(options, realisations=1, threats=held_out)
    if options.threat == "visible":
        once = replace(options, realisations=held_out, threats=None)
    threats = _threats(problem.scenario, once, options.seed + _HELD_OUT)
    with progress_bar(f"check on {held_out} other threats") as progress:
        return evaluate_against(
            problem.evaluator,
            run.result.layout,
            threats,
            problem.processes,
            cvar_level=options.cvar_level,
            progress=progress,
        )
