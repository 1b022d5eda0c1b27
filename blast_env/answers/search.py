"""The answers of `search`: the effect of the layout found, and of one proposed without a blast."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Final

from blast_env.answers.assess import cells_words
from blast_env.answers.document import (
    AnyCell,
    AnyPart,
    Line,
    Number,
    Table,
    charge_text,
    interval,
    lines,
)
from blast_env.answers.left_out import left_out_words
from blast_env.design.by_atlas import WORSE
from blast_env.design.search import DesignProblem, SearchResult
from blast_env.evaluation import Evaluation
from blast_env.geometry import Layout, layout_counts
from blast_env.layout import LayoutState
from blast_env.site import Scenario
from blast_env.site.blast_site import Charge
from blast_env.site.objective import ConditionalValueAtRisk, WorstRisk
from blast_env.statistics import reductions

_SEARCH_HEADERS: Final = ("threats", "number", "without", "with", "reduction", "95 % interval")


@dataclass(frozen=True, eq=False)
class SearchRun:
    """A finished search.

    Attributes:
        seconds: Its duration.
        cache_hits: Number of its loads found in the cache.
    """

    problem: DesignProblem
    result: SearchResult
    seconds: float
    cache_hits: int


def search_answer(run: SearchRun, checked: Evaluation | None) -> Iterator[AnyPart]:
    """Yield the effect of the layout on the search's threats and on others, and the cost."""
    result, problem = run.result, run.problem
    unprotected, load = (
        problem.case.objective_value(problem.unprotected),
        problem.load(result.layout),
    )
    number = partial(Number.load, problem.scenario.objective)
    rows: list[tuple[AnyCell, ...]] = [
        (
            *("of the search", str(len(problem.threats)), number(unprotected), number(load)),
            *(Number.share(reductions(load, unprotected).item()), "-"),
        )
    ]
    if checked is not None:
        rows.append(
            (
                *("held out", str(len(checked.threats))),
                *(number(checked.unprotected_load), number(checked.load)),
                Number.share(checked.mean_reduction),
                interval(checked.reduction),
            )
        )
    title = f"{problem.scenario.name}: {result.method} search, {_risk_text(problem)}"
    yield Table.of(title, _SEARCH_HEADERS, rows)
    if checked is None:
        yield Line.of(
            "no threat is held out: with this engine a charge is one blast, and the search used "
            "all that were drawn; `evaluate` takes other charges"
        )
    charges = [threat.charge for threat in problem.threats]
    if len({*charges}) == 1 and isinstance(charges[0], Charge):
        yield Line.of(f"the charge of the search: {charge_text(charges[0])}")
    left_out = left_out_words(problem.scenario, charges, result.layout)
    yield from lines((f"note: {words}" for words in left_out), "flag")
    if result.by and not result.layout:
        yield Line.of(f"nothing is placed: {result.by}")
    if result.by == WORSE:
        yield Line.of(f"{result.method}: {result.by}", kind="flag")
    yield Line.of(
        f"{layout_counts(result.layout, of=problem.stock)}; {result.blasts} of {result.budget} "
        f"blasts spent, {run.cache_hits} of the loads asked for known already; "
        f"{run.seconds:.1f} s"
    )


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


def judged_answer(
    scenario: Scenario, layouts: Mapping[str, Layout], found: Mapping[Layout, Evaluation]
) -> Iterator[AnyPart]:
    """Yield one row per layout: no barrier, the rules by load, the proposal; and its grid error.

    Args:
        layouts: The layouts by name: no barrier, the proposal, the rules.
    """
    loads = {name: found[layout].load for name, layout in layouts.items()}
    nothing, proposal, *rules = layouts
    best_last = sorted(rules, key=lambda name: -loads[name])
    rows: list[tuple[AnyCell, ...]] = []
    for name in (nothing, *best_last, proposal):
        own = found[layouts[name]]
        share = Number.share(own.mean_reduction, own.reduction_error)
        gone = "-" if name == nothing else share.sampled_by(own.reduction, "charges", 0.01)
        rows.append((name, Number.load(scenario.objective, loads[name], own.objective_error), gone))
    judged = found[layouts[proposal]]
    charges = f"{len(judged.threats)} charges" if judged.case.charge is None else "this charge"
    title = f"{scenario.name}: judged by gas dynamics on {charges}"
    yield Table.of(title, ("layout", "load", "reduction"), rows)
    if judged.grid_error is not None:
        yield Line.of(cells_words(judged.grid_error))
    worse = [name for name in best_last if loads[name] > loads[nothing]]
    if worse:
        yield Line.of(f"these make the site worse: {', '.join(worse)}", kind="flag")
    if best_last and loads[best_last[-1]] < loads[proposal]:
        yield Line.of(f"note: {best_last[-1]} does better here than the proposal")


def proposal_words(scenario: Scenario, result: SearchResult) -> str:
    """Return the proposal in words, with its cost and its expected gain."""
    if not result.layout:
        return "nothing is proposed"
    placement = LayoutState.of(scenario, result.layout)
    cost = "" if scenario.zone.budget is None else f", {scenario.zone.priced(placement.cost)}"
    gain = result.expectation
    return f"{layout_counts(result.layout)}{cost}{gain and f', {gain}'}"
