"""What the package proposes for a site: `blast_env.propose` and `blast_env.search`."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

from blast_agents.search.methods import BestRuleSearch
from blast_agents.search.problem import LayoutProblem, Proposer, Report, SearchResult
from blast_agents.search.registry import find_proposer, layouts_by_rule, proposer_row
from blast_env.engines import JUDGE, Engine
from blast_env.envs.episode import find_realisations
from blast_env.errors import import_extra
from blast_env.evaluation import BlastEvaluator, Case, SeedRange, Threat, draw_threats
from blast_env.evaluation.cases import one_of_each_charge, practice_hidden, practice_visible
from blast_env.geometry import Element, Layout, Removal
from blast_env.physics.scene import Charge
from blast_env.scenario import AnyCharge, AnyScenario, PointSource, find_scenario
from blast_env.sites import FAMILIES
from blast_env.statistics import reductions

if TYPE_CHECKING:  # half a second to import
    from blast_agents.surrogate.search import Guesses

HIDDEN_THREATS: Final = 8
"""Threats that layouts meet where the charge is not known."""

LEAST_GAIN: Final = 0.03
"""Share of the load that a layout must be expected to take off; otherwise nothing is proposed."""

LEAST_PIECE_GAIN: Final = 0.001
"""Share of the load that a piece must be expected to take off; otherwise it is left out."""


@dataclass(frozen=True)
class Chosen:
    """A proposer that was chosen for a site.

    Attributes:
        proposer: The proposer.
        by: What it goes by, in words.
        budget: Blasts that it takes to do all that it can.
        source: What repeats the proposal: which weights, surrogate or rules.
        is_guessed: Whether the surrogate's guesses choose.
    """

    proposer: Proposer
    by: str
    budget: int
    source: Mapping[str, str]
    is_guessed: bool = False

    def propose(
        self,
        problem: LayoutProblem,
        budget: int | None = None,
        seed: int = 0,
        report: Report | None = None,
    ) -> SearchResult:
        """Return the layout, what it is expected to gain, and in `by` what it comes from.

        It is empty where nothing is expected to gain `LEAST_GAIN`, by blasts or by guesses. What
        guesses choose is held against the layouts of the rules: see `worth_its_pieces`. Weights
        were judged on their site by gas dynamics: no rule takes their place by a guess.

        Args:
            problem: What is asked.
            budget: Most blasts, where it takes some.
            seed: Decides what is drawn.
            report: Is told how far it has come.

        Raises:
            KeyboardInterrupt: If it was interrupted: the best of some rules is no proposal.
        """
        blasts = self.budget if budget is None else min(budget, self.budget)
        result = self.proposer.propose(problem, blasts, seed, report)
        if result.interrupted:
            raise KeyboardInterrupt
        layout, by = result.layout, self.by
        gain: float | None = None
        rules = layouts_by_rule(problem.scenario, problem.told)
        if self.budget:  # which rule is it?
            by = f"{by}: {next(name for name, each in rules.items() if each == layout)}"
            gain = problem.reduction(result.history[-1])
        elif problem.scenario.zone.items:
            guesses = _guesses(problem)
            if self.is_guessed:
                layout = worth_its_pieces(guesses, layout, rules.values())
            else:
                by = f"{by}; the gain is a guess"
            gain = reductions(*guesses.loads([layout, ()])).item()
        if gain is not None and not gain >= LEAST_GAIN:  # NaN: nothing arrives
            by = (
                f"{by}: no layout is expected to take off {100.0 * LEAST_GAIN:g} %, the "
                f"best one {100.0 * gain:.1f} %"
            )
            layout, gain = (), 0.0
        return replace(result, method=PackageProposer.name, by=by, layout=layout, gain=gain)


def _guesses(problem: LayoutProblem) -> "Guesses":
    # Here, because it takes half a second to import.
    from blast_agents.surrogate import packaged_surrogate
    from blast_agents.surrogate.search import Guesses, case_for

    return Guesses.of(packaged_surrogate(), case_for(problem.scenario, problem.told))


def worth_its_pieces(guesses: "Guesses", layout: Layout, rules: Iterable[Layout]) -> Layout:
    """Return a layout without the pieces that bring nothing.

    Where a rule's layout is better by the same guesses, it takes the place of the layout. Each
    piece that takes off less than `LEAST_PIECE_GAIN` goes, those that bring least first, as long as
    the rest is not worse than the best rule's layout and gains `LEAST_GAIN`.

    Args:
        guesses: What a layout is worth.
        layout: The layout.
        rules: The layouts of the rules.
    """

    def load(each: Layout) -> float:
        return guesses.loads([each]).item()

    bare, ruled = load(()), [tuple(sorted(each)) for each in rules]
    best = min([layout, *ruled], key=load)
    most = min(map(load, ruled), default=bare)
    if load(best) <= (1.0 - LEAST_GAIN) * bare:
        most = min(most, (1.0 - LEAST_GAIN) * bare)

    def without(piece: Element) -> Layout:
        return tuple(each for each in best if each != piece)

    # A wall that is taken away stays away: something may stand in its place.
    pieces = [each for each in best if not isinstance(each, Removal)]
    guesses.loads([without(piece) for piece in pieces])  # all at once
    for piece in sorted(pieces, key=lambda each: load(without(each))):
        fewer = without(piece)
        if load(fewer) <= min(load(best) + LEAST_PIECE_GAIN * bare, most):
            best = fewer
    return best


def chosen_for(problem: LayoutProblem) -> Chosen:
    """Return what the package proposes by for a case: the first of these that can.

    1. Weights that were trained for the very scenario, where some come with the package.
    2. The surrogate, which was fitted to generated sites, where there is a catalogue. On generated
       sites it is better than the weights for all of them.
    3. The best rule by gas dynamics: a blast for each rule and threat.
    """
    scenario = problem.scenario
    # Here, because torch and the surrogate take seconds to import, and torch is an extra.
    with import_extra("agents", "proposals by trained weights"):
        from blast_agents.surrogate import LearntSearch, packaged_surrogate, search_by
        from blast_agents.training.packaged import packaged_agent

    found = packaged_agent(scenario, "hidden" if problem.told is None else "visible")
    if found is not None and found[1].scenario not in FAMILIES:
        agent, record = found
        weights = {"weights": record.configuration.scenario_hash[:12]}
        return Chosen(LearntSearch(agent=agent), f"the weights of {record.scenario}", 0, weights)
    if scenario.zone.items:
        surrogate = packaged_surrogate()
        known = {"surrogate": surrogate.digest}
        return Chosen(search_by(surrogate), "guesses of gas dynamics", 0, known, is_guessed=True)
    blasts = len(layouts_by_rule(scenario, problem.told)) * len(problem.threats)
    rules = {"method": BestRuleSearch.name}
    return Chosen(BestRuleSearch(), "the best rule by gas dynamics", blasts, rules)


@dataclass(frozen=True)
class PackageProposer:
    """Proposes what the package thinks best for a site; see `chosen_for`."""

    name: str = "package"

    def propose(
        self, problem: LayoutProblem, budget: int, seed: int = 0, report: Report | None = None
    ) -> SearchResult:
        """Return the layout, and in `by` what it comes from; only the best rule takes blasts."""
        found = chosen_for(problem).propose(problem, budget, seed, report)
        return replace(found, budget=budget)


def propose(
    scenario: AnyScenario,
    charge: AnyCharge | None = None,
    *,
    processes: int = 1,
    report: Report | None = None,
) -> SearchResult:
    """Return the layout that the package proposes for a site.

    That takes seconds, but blasts for each rule, some minutes, where single modules are placed and
    no weights were trained for the scenario; see `chosen_for`.

    Args:
        scenario: The scenario, or its bundled name or path; it has a build zone.
        charge: Where the charge is, if that is known; otherwise the layout is for all the places
            where the scenario may have one.
        processes: Worker processes for blasts, where it takes some.
        report: Is told how far it has come.

    Returns:
        The layout, and in `by` what it comes from.

    Raises:
        BlastEnvError: If there is no build zone, or nothing is protected.
        MissingExtraError: If the extra `agents` is not installed.
    """
    problem = problem_of(scenario, charge, processes)
    return chosen_for(problem).propose(problem, report=report)


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
        method: One of `blast_agents.search.proposers()`.
        budget: Most blasts that may be spent; that of the method unless given.
        charge: Where the charge is, if that is known; otherwise the layout is for all the places
            where the scenario may have one.
        threats: Charges that are drawn of one that is not known.
        seed: Decides everything that is drawn.
        engine: Name of the engine, or the engine; gas dynamics unless given.
        cache: Folder in which blasts are kept.
        initial: Layouts that the search begins with, beside those that it draws.
        processes: Worker processes; they change nothing but the time.
        report: Is told how far it has come.

    Raises:
        UnknownNameError: If there is no such method, scenario or engine.
        BlastEnvError: If there is no build zone, nothing arrives at what is protected, or the
            method cannot do anything with the budget.
    """
    found = find_scenario(scenario)
    evaluator = BlastEvaluator(found, engine, cache=cache)
    if charge is None:
        case = practice_hidden(found, threats, 1, seed)
    else:
        realisations = find_realisations(None, "visible", evaluator.engine)
        case = practice_visible(found, charge, realisations, seed)
    problem = LayoutProblem(evaluator, case, processes)
    proposer = find_proposer(method, tuple(tuple(each) for each in initial))
    blasts = proposer_row(method).budget if budget is None else budget
    return proposer.propose(problem, blasts, seed, report)


def problem_of(
    scenario: AnyScenario,
    charge: AnyCharge | None,
    processes: int = 1,
    engine: str | Engine = JUDGE,
) -> LayoutProblem:
    """Return what a proposal is asked and judged by: gas dynamics, and threats nobody has met.

    A charge that has only one place is known, whether it is given or not.
    """
    found = find_scenario(scenario)
    only = found.charge[0]
    if charge is None and len(found.charge) == 1 and isinstance(only, PointSource):
        charge = Charge(only.position_m, only.tnt_kg, only.height_m)
    first = SeedRange.JUDGEMENT.value.start
    if charge is not None:
        case = Case(found, (Threat(charge, first),), charge=charge)
    else:
        threats = draw_threats(found, range(first, first + HIDDEN_THREATS))
        case = Case(found, one_of_each_charge(threats))
    return LayoutProblem(BlastEvaluator(found, engine), case, processes)
