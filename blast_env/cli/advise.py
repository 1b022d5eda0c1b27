"""`blast-env advise`: the protection for a budget by kind of measure, and the cost to pass."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
from itertools import cycle, islice
from pathlib import Path
from typing import Annotated

import typer

from blast_env.answers.advise import advice_answer, advice_figure
from blast_env.answers.terminal import print_parts
from blast_env.cli.command import PICTURES, writes
from blast_env.cli.options import (
    CELLS_HELP,
    FINAL_CELLS,
    TARGET_HELP,
    CacheOption,
    CellOption,
    ChargeInput,
    ChargeOption,
    DrawsOption,
    MassErrorOption,
    ProcessesOption,
    ScenarioArgument,
    TntOption,
    resume_words,
    wanted_level,
)
from blast_env.cli.output import blasts_running, print_written, resumable, save_figures
from blast_env.design.search import DesignProblem
from blast_env.design.search.advice import kinds_for, most_blasts
from blast_env.design.search.advised import ROUNDS, AdviceJudge, advised, site_with_target
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, LoadCaseSet
from blast_env.evaluation.engines import JUDGE, choosing_engine, final_engine
from blast_env.layout import write_layout
from blast_env.provenance import versions
from blast_env.response.levels import LevelOfProtection
from blast_env.site import load_scenario

_BudgetCostOption = Annotated[
    float | None, typer.Option(help="Most that may be spent; else the zone's budget.")
]
_TargetProbabilityOption = Annotated[
    float | None,
    typer.Option(
        help="Least probability of the level; else the scenario's, else none.", min=0.5, max=0.999
    ),
]
_CellsOption = Annotated[
    str | None,
    typer.Option(help=CELLS_HELP, show_default="coarse on sites wider than 40 m, else uniform"),
]
_JudgeCellOption = Annotated[
    float | None,
    typer.Option(
        "--judge-cell",
        help="Side of the cells for judging the layouts found, m.",
        show_default=FINAL_CELLS,
    ),
]


def advise(
    scenario: ScenarioArgument,
    budget_cost: _BudgetCostOption = None,
    target: str | None = typer.Option(None, help=TARGET_HELP.format("medium")),
    target_probability: _TargetProbabilityOption = None,
    mass_error: MassErrorOption = 0.1,
    charges: DrawsOption = 16,
    budget: int = typer.Option(60, help="Most blasts of a search.", min=1),
    rounds: int = typer.Option(ROUNDS, help="Most searches for each kind.", min=1),
    seed: int = typer.Option(0, help="Seed of the draws.", min=0),
    cell_m: CellOption = None,
    cells: _CellsOption = None,
    judge_cell_m: _JudgeCellOption = None,
    out: Path | None = writes("Layout file of the best layout of all", ".json"),
    picture: Path | None = writes("Picture of cost against level of protection", *PICTURES),
    charge: ChargeOption = None,
    tnt_kg: TntOption = None,
    cache: CacheOption = None,
    processes: ProcessesOption = 1,
) -> None:
    """Compare the protection for a budget: stand-off, shielding, hardening, and all combined.

    For each kind the command searches for the cheapest layout that reaches the target, by gas
    dynamics with cells twice as large as those of final statements, or for the one with the least
    shortfall if none does. The layouts found are judged again with final cells, and with peaks as
    sharp as Kingery and Bulmash's: cells clip peaks, and those of 0.5 m halve them. If a layout
    fails there, the search is repeated with a margin to the target. Hardening needs no further
    blasts.
    """
    level = wanted_level(target, load_scenario(scenario), LevelOfProtection.MEDIUM)
    site = site_with_target(load_scenario(scenario), level, target_probability, budget_cost)
    threats = ChargeInput.of(charge, tnt_kg).threats(site, charges)
    if budget < len(threats):
        raise BlastEnvError(
            f"budget is {budget} blasts, must be at least {len(threats)}: one per charge"
        )
    engine = choosing_engine(JUDGE, [site], cell_m, cells)
    judge = final_engine(JUDGE, [site], judge_cell_m)
    evaluator = BlastEvaluator(site, engine, cache=cache)
    problem = DesignProblem(evaluator, LoadCaseSet(site, threats), processes)
    judging = AdviceJudge(problem, BlastEvaluator(site, judge, cache=cache), mass_error)
    with resumable(resume_words(cache)), _running(judging, rounds, budget) as progress:
        found = advised(judging, budget, rounds, seed, progress)
    print_parts(advice_answer(found))
    made = {"method": "advise", "seed": seed, "versions": versions(engine.version)}
    written = [] if out is None else [write_layout(out, site, found.best.layout, made)]
    print_written([*written, *save_figures((picture, partial(advice_figure, found)))])


def _running(
    judging: AdviceJudge, rounds: int, budget: int
) -> AbstractContextManager[Callable[..., None]]:
    """Say what will run at most, and show the progress."""
    site, problem = judging.scenario, judging.problem
    kinds, threats = kinds_for(site), problem.threats
    engine, judge = problem.evaluator.engine, judging.engine
    words = (
        f"{len(kinds)} kinds, at most {rounds} searches of {budget} blasts each, {engine.words}; "
        f"each result is judged with {len(threats)}, {judge.words}"
    )
    blasts, barriers = most_blasts(site, kinds, rounds, budget, len(threats))
    coarse, fine = (
        [own.cost(site, threat.charge) for threat in threats] for own in (engine, judge)
    )
    costs = [*islice(cycle(coarse), blasts), *fine * barriers]
    return blasts_running(f"{len(kinds)} kinds", words, costs)
