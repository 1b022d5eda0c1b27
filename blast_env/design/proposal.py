"""The proposals of the package for a site: `blast_env.propose` and `blast_env.search`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from blast_env.design.search.package import PackageProposer
from blast_env.design.search.problem import Report, SearchResult
from blast_env.design.search.registry import find_proposer, proposer_row
from blast_env.envs.strategies import find_realisations
from blast_env.evaluation import (
    BlastEvaluator,
    DesignProblem,
    LoadCase,
    LoadCaseSet,
    SeedRange,
    draw_threats,
)
from blast_env.evaluation.cases import one_per_charge, search_set
from blast_env.evaluation.engines import JUDGE, Engine
from blast_env.geometry import Layout
from blast_env.layout import kept_clear
from blast_env.site import AnyCharge, AnyScenario, PointSource, find_scenario
from blast_env.site.blast_site import Charge
from blast_env.site.objective import Risk
from blast_env.values import whole_number

HIDDEN_THREATS: Final = 8
"""Number of threats for an unknown charge."""

_MOST_BUDGET: Final = 1_000_000_000


def propose(
    scenario: AnyScenario,
    charge: AnyCharge | None = None,
    *,
    processes: int = 1,
    report: Report | None = None,
) -> SearchResult:
    """Return the layout that the package proposes for a site.

    This takes seconds, and no blast; see `PackageProposer`.

    Args:
        scenario: The scenario, or its bundled name or path; it has a build zone.
        charge: The charge, if it is known; otherwise the layout is for all charges of the scenario.
        processes: Worker processes for blasts, if any.
        report: Called with the progress.

    Returns:
        The layout, with its source in `by`.

    Raises:
        BlastEnvError: If the scenario has no build zone or no protected structure.
    """
    problem = problem_of(scenario, charge, processes)
    return PackageProposer().propose(problem, report=report)


def search(
    scenario: AnyScenario,
    method: str = "genetic",
    budget: int | None = None,
    *,
    charge: AnyCharge | None = None,
    threats: int = 16,
    seed: int = 0,
    engine: str | Engine = JUDGE,
    cache: str | Path | None = None,
    initial: Sequence[Layout] = (),
    processes: int = 1,
    report: Report | None = None,
) -> SearchResult:
    """Search for the layout with the least load on the protected structures.

    Args:
        scenario: The scenario, or its bundled name or path; it has a build zone.
        method: One of `blast_env.design.search.proposers()`.
        budget: Largest number of blasts; by default that of the method.
        charge: The charge, if it is known; otherwise the layout is for all charges of the scenario.
        threats: Number of threats to draw for an unknown charge.
        seed: Seed of all random draws.
        engine: Name of the engine, or the engine; gas dynamics by default.
        cache: Folder of stored blasts.
        initial: Initial layouts of the search, in addition to random ones.
        processes: Worker processes; results do not depend on their number.
        report: Called with the progress.

    Raises:
        UnknownNameError: If the method, scenario or engine is unknown.
        BlastEnvError: If the scenario has no build zone, nothing arrives at the protected
            structures, or the method is not applicable to the budget.
    """
    problem = search_problem(
        scenario, charge, engine, cache, threats=threats, seed=seed, processes=processes
    )
    proposer = find_proposer(method, tuple(tuple(layout) for layout in initial))
    blasts = proposer_row(method).budget
    if budget is not None:
        blasts = whole_number("budget", budget, 0, _MOST_BUDGET)
    return proposer.propose(problem, blasts, seed, report)


def search_problem(
    scenario: AnyScenario,
    charge: AnyCharge | None,
    engine: str | Engine = JUDGE,
    cache: str | Path | None = None,
    *,
    threats: int = 16,
    seed: int = 0,
    risk: Risk | None = None,
    processes: int = 1,
) -> DesignProblem:
    """Return the problem of a search; see `search` for the arguments.

    `risk` is the risk measure over the charges; that of the scenario's objective unless given.
    """
    site = kept_clear(find_scenario(scenario), charge)
    evaluator = BlastEvaluator(site, engine, cache=cache)
    known = "hidden" if charge is None else "visible"
    realisations = find_realisations(None, known, evaluator.engine)
    case = search_set(evaluator.scenario, charge, realisations, seed, risk, charges=threats)
    return DesignProblem(evaluator, case, processes)


def problem_of(
    scenario: AnyScenario,
    charge: AnyCharge | None,
    processes: int = 1,
    engine: str | Engine = JUDGE,
) -> DesignProblem:
    """Return the problem of a proposal and its judgement: by default gas dynamics, unseen threats.

    A charge with a single possible place is known, whether it is given or not.
    """
    found = kept_clear(find_scenario(scenario), charge)
    only = found.charge[0]
    if charge is None and len(found.charge) == 1 and isinstance(only, PointSource):
        charge = Charge(only.position_m, only.tnt_kg, only.height_m)
    first = SeedRange.TEST.value.start
    if charge is not None:
        case = LoadCaseSet(found, (LoadCase(charge, first),), charge=charge)
    else:
        threats = draw_threats(found, range(first, first + HIDDEN_THREATS))
        case = LoadCaseSet(found, one_per_charge(threats))
    return DesignProblem(BlastEvaluator(found, engine), case, processes)
