"""The proposals of the package for a site: `blast_env.propose` and `blast_env.search`."""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from blast_env.calibration import kingery_bulmash
from blast_env.design.search.problem import Report, SearchResult
from blast_env.design.search.registry import find_proposer, layouts_by_rule, proposer_row
from blast_env.envs.episode import find_realisations
from blast_env.errors import BlastEnvError
from blast_env.evaluation import (
    BlastEvaluator,
    DesignProblem,
    LoadCase,
    LoadCaseSet,
    SeedRange,
    draw_threats,
)
from blast_env.evaluation.cases import one_of_each_charge, search_set
from blast_env.evaluation.engines import JUDGE, Engine
from blast_env.geometry import Element, Layout, Removal
from blast_env.site import AnyCharge, AnyScenario, PointSource, find_scenario
from blast_env.site.blast_site import Charge
from blast_env.site.objective import Risk
from blast_env.statistics import reductions
from blast_env.vehicles.worst_places import stand_off_m

if TYPE_CHECKING:  # half a second to import
    from blast_env.design.search.learnt import Guesses

HIDDEN_THREATS: Final = 8
"""Number of threats for an unknown charge."""

LEAST_GAIN: Final = 0.03
"""Least predicted relative reduction of the load by a layout; otherwise nothing is proposed."""

LEAST_PIECE_GAIN: Final = 0.001
"""Least predicted relative reduction of the load by a piece; otherwise it is omitted."""


@dataclass(frozen=True)
class PackageProposer:
    """Proposes the best layout for a site by the surrogate of gas dynamics, without a blast.

    The surrogate was fitted to generated sites. Single modules are to it a catalogue of one item.
    """

    name: str = "package"

    def propose(
        self,
        problem: DesignProblem,
        budget: int = 0,
        seed: int = 0,
        report: Report | None = None,
    ) -> SearchResult:
        """Return the layout, its predicted gain, and its source in `by`.

        The layout is empty if the predicted gain is below `LEAST_GAIN`. It is compared with those
        of the rules: see `worth_its_pieces`.

        Args:
            problem: The problem.
            budget: Most blasts, none of which is spent.
            seed: Seed of all random draws.
            report: Called with the progress.
        """
        # Imported here because the import takes half a second.
        from blast_env.design.search.learnt import search_by
        from blast_env.surrogate import packaged_surrogate

        result = search_by(packaged_surrogate()).propose(problem, 0, seed, report)
        by, guesses = "the surrogate of gas dynamics", _guesses(problem)
        rules = layouts_by_rule(problem.scenario, problem.known_charge)
        layout = worth_its_pieces(guesses, result.layout, rules.values())
        gain = reductions(*guesses.loads([layout, ()])).item()
        if not gain >= LEAST_GAIN:  # NaN: nothing arrives
            by = (
                f"{by}: barriers bring little here, an expected reduction of {100.0 * gain:.1f} % "
                f"at best (proposed from {100.0 * LEAST_GAIN:g} %); {_remedy(problem)}"
            )
            layout, gain = (), 0.0
        return replace(result, method=self.name, by=by, layout=layout, gain=gain, budget=budget)


def _remedy(problem: DesignProblem) -> str:
    """Return the stand-off that would halve the largest impulse, and the way to other help."""
    walls = problem.scenario.loaded_walls
    charges = [each.charge_against(problem.scenario, ()) for each in problem.threats]
    scale = {each: float(np.cbrt(each.tnt_kg)) for each in charges}
    now_m = {each: max(stand_off_m(walls, each.position_m), scale[each]) for each in charges}
    worst = min(charges, key=lambda each: now_m[each] / scale[each])
    further = np.linspace(1.0, 4.0, 301)
    with suppress(BlastEnvError):  # beyond the range of the curves
        impulse = kingery_bulmash("reflected_impulse", now_m[worst] * further, worst.tnt_kg)
        half_m = now_m[worst] * further[int(np.argmax(impulse <= 0.5 * impulse[0]))]
        return (
            f"half the impulse takes a stand-off of {half_m:.0f} m instead of {now_m[worst]:.0f} m "
            f"({worst.tnt_kg:g} kg, by Kingery and Bulmash); for glass see "
            "assess --screen and advise"
        )
    return "for stand-off and glass see assess --screen and advise"


def _guesses(problem: DesignProblem) -> "Guesses":
    # Imported here because the import takes half a second.
    from blast_env.design.search.learnt import Guesses, case_for
    from blast_env.surrogate import packaged_surrogate

    return Guesses.of(packaged_surrogate(), case_for(problem.scenario, problem.known_charge))


def worth_its_pieces(guesses: "Guesses", layout: Layout, rules: Iterable[Layout]) -> Layout:
    """Return a layout without useless pieces, or that of a better rule.

    A rule's layout with a better prediction replaces the layout. Each piece that reduces the load
    by less than `LEAST_PIECE_GAIN` is then removed, the least useful first, as long as the rest is
    not worse than the best rule's layout and gains `LEAST_GAIN`.

    Args:
        guesses: Predicted loads of layouts.
        layout: The layout.
        rules: The layouts of the rules.
    """

    def load(each: Layout) -> float:
        return guesses.loads([each]).item()

    unprotected, ruled = load(()), [tuple(sorted(each)) for each in rules]
    best = min([layout, *ruled], key=load)
    most = min(map(load, ruled), default=unprotected)
    if load(best) <= (1.0 - LEAST_GAIN) * unprotected:
        most = min(most, (1.0 - LEAST_GAIN) * unprotected)

    def without(piece: Element) -> Layout:
        return tuple(each for each in best if each != piece)

    # Removed walls stay removed, because pieces may stand in their place.
    pieces = [each for each in best if not isinstance(each, Removal)]
    guesses.loads([without(piece) for piece in pieces])  # all at once
    for piece in sorted(pieces, key=lambda each: load(without(each))):
        fewer = without(piece)
        if load(fewer) <= min(load(best) + LEAST_PIECE_GAIN * unprotected, most):
            best = fewer
    return best


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
    proposer = find_proposer(method, tuple(tuple(each) for each in initial))
    blasts = proposer_row(method).budget if budget is None else budget
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
    evaluator = BlastEvaluator(scenario, engine, cache=cache)
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
    found = find_scenario(scenario)
    only = found.charge[0]
    if charge is None and len(found.charge) == 1 and isinstance(only, PointSource):
        charge = Charge(only.position_m, only.tnt_kg, only.height_m)
    first = SeedRange.TEST.value.start
    if charge is not None:
        case = LoadCaseSet(found, (LoadCase(charge, first),), charge=charge)
    else:
        threats = draw_threats(found, range(first, first + HIDDEN_THREATS))
        case = LoadCaseSet(found, one_of_each_charge(threats))
    return DesignProblem(BlastEvaluator(found, engine), case, processes)
