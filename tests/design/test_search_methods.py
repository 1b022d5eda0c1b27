"""Every search method: how near it comes to a known optimum, and what holds for all of them."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest

from blast_env.design.search import (
    DesignProblem,
    GeneticSearch,
    Layout,
    PopulationAnnealingSearch,
    ProposerKind,
    RandomSearch,
    SearchResult,
    SurrogateSearch,
    find_proposer,
    layouts_by_rule,
    proposers,
    widened,
)
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.evaluation import BlastEvaluator, LoadCase
from blast_env.evaluation.cases import search_set
from blast_env.layout import LayoutState
from blast_env.rules import wall_near_charge
from blast_env.site import AnyCharge, Charge, Scenario
from tests.design.search_cases import (
    WatchedEvaluator,
    ballistic,
    every_layout,
    small_problem,
    small_scenario,
)
from tests.evaluation.engines.rays import RaysEngine
from tests.evaluation.engines.shade import ShadeEngine

ALL_BLASTS = 598
FROM_RULES = ("population_annealing", "genetic")
DRAWN = ("random", *FROM_RULES, "nsga2")
SEEDS = range(2)


@pytest.fixture(scope="module")
def problem() -> DesignProblem:
    """The small problem; what one test has simulated costs the others no time."""
    return small_problem()


@pytest.fixture(scope="module")
def optimum(problem: DesignProblem) -> Layout:
    layouts = every_layout(problem)
    assert len(layouts) == 299
    return min(layouts, key=problem.load)


def gap(problem: DesignProblem, result: SearchResult, optimum: Layout) -> float:
    """Return what a result misses of the optimum, as a share of the impulse without a barrier."""
    return (problem.load(result.layout) - problem.load(optimum)) / problem.load(())


@pytest.mark.parametrize(
    ("name", "budget", "most"),
    [
        ("random", ALL_BLASTS // 10, 0.01),
        ("population_annealing", ALL_BLASTS // 10, 0.005),
        ("genetic", ALL_BLASTS // 10, 0.005),
        ("nsga2", ALL_BLASTS // 10, 0.01),  # also looks for layouts with fewer modules
        ("wall_near_charge", 0, 0.01),
        ("wall_near_building", 0, 0.04),
    ],
)
def test_gaps_to_the_optimum(
    name: str, budget: int, most: float, problem: DesignProblem, optimum: Layout
) -> None:
    """Mean over seeds with a tenth of the blasts of all layouts.

    The optimum takes 86 % off the impulse; one random layout after the other would do too on 299.
    """
    method = find_proposer(name)
    results = [method.propose(problem, budget, seed) for seed in SEEDS]
    assert max(result.blasts for result in results) <= budget
    gaps = [gap(problem, result, optimum) for result in results]
    assert min(gaps) >= 0.0
    assert float(np.mean(gaps)) <= most


@pytest.mark.parametrize("name", DRAWN)
def test_the_seed_decides_everything(name: str, problem: DesignProblem) -> None:
    method = find_proposer(name)
    assert method.propose(problem, 20, 3) == method.propose(problem, 20, 3)
    histories = {method.propose(problem, 20, seed).history for seed in range(4)}
    assert len(histories) > 1


def test_the_number_of_processes_changes_nothing(problem: DesignProblem) -> None:
    fresh = small_problem(BlastEvaluator(small_scenario(), RaysEngine()), processes=2)
    assert GeneticSearch().propose(fresh, 24, 1) == GeneticSearch().propose(problem, 24, 1)


@pytest.mark.parametrize("name", DRAWN)
@pytest.mark.parametrize("budget", [1, 7, 33])
def test_blasts_are_counted_and_never_exceed_the_budget(name: str, budget: int) -> None:
    """Distinct pairs that were asked for; nearly all of the budget is spent."""
    asked: list[tuple[Layout, LoadCase]] = []
    watched = WatchedEvaluator(small_scenario(), asked.extend)
    result = find_proposer(name).propose(small_problem(watched), budget, 0)
    assert result.blasts == len(asked) == len(set(asked)) <= budget
    assert result.blasts >= 0.7 * budget
    assert result.budget == budget


@pytest.mark.parametrize("name", DRAWN)
def test_histories_say_what_was_best_when(name: str, problem: DesignProblem) -> None:
    result = find_proposer(name).propose(problem, 60, 2)
    for earlier, later in pairwise(result.history):
        assert earlier.blasts < later.blasts
        more = later.threats > earlier.threats
        assert more or later.load < earlier.load
    last = result.history[-1]
    assert (last.layout, last.load) == (result.layout, result.load)
    assert 0 < last.blasts <= 60
    table = result.history_table()
    assert table["modules"].tolist() == [len(step.layout) for step in result.history]


@pytest.mark.parametrize("name", DRAWN)
def test_an_interruption_keeps_the_best_so_far(name: str, problem: DesignProblem) -> None:
    interrupted = find_proposer(name).propose(_interrupted_after(30), 100, 0)
    whole = find_proposer(name).propose(problem, 100, 0)
    assert interrupted.interrupted
    assert not whole.interrupted
    assert 0 < interrupted.blasts <= 30
    by_then = [step for step in whole.history if step.blasts <= interrupted.blasts]
    assert interrupted.layout == by_then[-1].layout


def _interrupted_after(blasts: int) -> DesignProblem:
    """Return the small problem; Ctrl-C comes when more blasts are asked for."""
    left = [blasts]

    def watch(pairs: list[tuple[Layout, LoadCase]]) -> None:
        left[0] -= len(pairs)
        if left[0] < 0:
            raise KeyboardInterrupt

    return small_problem(WatchedEvaluator(small_scenario(), watch))


@pytest.mark.parametrize("method", DRAWN)
def test_layouts_are_legal_on_real_sites(method: str) -> None:
    """With no-build areas, a budget and an access way, against a hidden charge."""
    scenario = ballistic("street_junction")
    evaluator = BlastEvaluator(scenario, "event")
    problem = DesignProblem(evaluator, search_set(scenario, None, 1, 0, charges=3))
    result = find_proposer(method).propose(problem, 10, 0)
    assert (
        LayoutState.of(scenario, result.layout).cells == result.layout == (*sorted(result.layout),)
    )


@pytest.mark.parametrize("name", DRAWN)
def test_it_ends_when_there_is_nothing_new_left(name: str) -> None:
    """Two cells and one module make three layouts, however large the budget."""
    evaluator = BlastEvaluator(small_scenario(rows=2, columns=1, stock=1), RaysEngine())
    problem = small_problem(evaluator)
    result = find_proposer(name).propose(problem, 100, 0)
    assert result.blasts <= 6
    assert result.layout in (((0, 0),), ((1, 0),))


@pytest.mark.parametrize("name", ["random", *FROM_RULES, "nsga2"])
def test_it_can_begin_with_given_layouts(name: str, optimum: Layout) -> None:
    """They are among the first that are assessed, and a good one is not simply lost."""
    asked: list[list[tuple[Layout, LoadCase]]] = []
    watched = small_problem(WatchedEvaluator(small_scenario(), asked.append))
    method = find_proposer(name, (optimum,))
    result = method.propose(watched, 40, 0)
    assert method.name == result.method == name
    assert optimum in {layout for layout, _ in asked[0]}
    assert gap(watched, result, optimum) <= 0.01


def test_what_is_no_method_or_begins_with_no_layouts_is_told() -> None:
    with pytest.raises(BlastEnvError, match="best_rule begins with no layouts"):
        find_proposer("best_rule", (((0, 0),),))
    with pytest.raises(UnknownNameError, match="no search method 'genetik', did you mean 'genet"):
        find_proposer("genetik")


def test_a_rule_against_a_hidden_charge_stands_in_the_middle() -> None:
    scenario = ballistic("courtyard")
    evaluator = BlastEvaluator(scenario, "event")
    problem = DesignProblem(evaluator, search_set(scenario, None, 1, 0, charges=8))
    middle = Charge((5.0, 15.0), 100.0)
    found = find_proposer("wall_near_charge").propose(problem, 0)
    assert found.layout == tuple(sorted(wall_near_charge(scenario, middle)))


def test_the_front_is_near_the_true_one(problem: DesignProblem, optimum: Layout) -> None:
    """For each number of modules the gap to the best layout with at most as many."""
    result = find_proposer("nsga2").propose(problem, ALL_BLASTS // 2, 1)
    bare_pa_s = problem.load(())
    layouts = every_layout(problem)
    assert [len(candidate.layout) for candidate in result.front] == [0, 1, 2, 3]
    for candidate in result.front:
        true_pa_s = min(
            problem.load(layout) for layout in layouts if len(layout) <= len(candidate.layout)
        )
        assert (problem.load(candidate.layout) - true_pa_s) / bare_pa_s <= 0.01
    assert result.layout == result.front[-1].layout
    assert len(result.front_table()) == 4


def test_every_proposer_has_its_name_and_a_title_of_its_own() -> None:
    rows = proposers()
    assert all(find_proposer(name).name == name for name in rows)
    assert len({row.title for row in rows.values()}) == len(rows)
    assert {*DRAWN, "best_rule"} == set(proposers(ProposerKind.SEARCH))


def test_the_best_rule_is_chosen_by_a_blast_each(problem: DesignProblem) -> None:
    layouts = set(layouts_by_rule(problem.scenario, problem.known_charge).values())
    result = find_proposer("best_rule").propose(problem, 100, 0)
    assert result.blasts == len(layouts) * len(problem.threats)
    assert result.layout in layouts
    assert problem.load(result.layout) == min(map(problem.load, layouts))


@pytest.mark.parametrize("name", FROM_RULES)
def test_what_begins_with_the_rules_is_never_worse(problem: DesignProblem, name: str) -> None:
    """With as many blasts as tell all that is tried apart under one threat."""
    (threat, *_) = problem.threats
    case = replace(problem.case, threats=(threat,), realisations=1)
    alone = DesignProblem(problem.evaluator, case)
    best = find_proposer("best_rule").propose(alone, 9, 0)
    found = find_proposer(name).propose(alone, 20, 0)
    assert found.method == name
    assert alone.load(found.layout) <= alone.load(best.layout)


@dataclass(frozen=True)
class OneLayoutAgent:
    """Proposes and draws always the same."""

    layout: Layout

    def propose(self, _: Scenario, _charge: AnyCharge | None = None) -> Layout:
        return self.layout

    def sample(
        self, _: Scenario, _charge: AnyCharge | None = None, count: int = 8, _seed: int = 0
    ) -> list[Layout]:
        return [self.layout] * count


def test_a_search_from_a_policy_ends_no_worse_than_it_and_the_rules(problem: DesignProblem) -> None:
    agent = OneLayoutAgent(((0, 0), (1, 0)))
    search = SurrogateSearch(agent=agent, digest="one")
    result = search.propose(problem, 60, 0)
    rules = find_proposer("best_rule").propose(problem, 100, 0)
    bound = min(problem.load(agent.layout), problem.load(rules.layout))
    assert problem.load(result.layout) <= 1.02 * bound  # by one threat of two at first
    assert result.blasts <= 60
    assert result == search.propose(problem, 60, 0)
    assert "OneLayoutAgent" not in repr(search)


def test_genetic_search_beats_random_search_on_the_courtyard() -> None:
    """At equal cost: what makes it a baseline worth beating."""
    scenario = ballistic("courtyard")
    evaluator = BlastEvaluator(scenario, RaysEngine())
    problem = DesignProblem(evaluator, search_set(scenario, None, 1, 0, charges=1))
    genetic, drawn = (
        problem.load(find_proposer(name).propose(problem, 100, 0).layout)
        for name in ("genetic", "random")
    )
    assert genetic < 0.5 * drawn


@pytest.mark.parametrize("share", [0.5, 0.0])
def test_annealing_takes_what_is_far_better_and_ends_where_nothing_is_left(share: float) -> None:
    """However cold it is; a wall that leaves nothing cannot be bettered, nor is it a scale."""
    evaluator = BlastEvaluator(small_scenario(), ShadeEngine(share=share))
    problem = small_problem(evaluator, realisations=1)
    search = PopulationAnnealingSearch(from_rules=False, draw=lambda _, __: (), hot=1e-4, cold=1e-5)
    result = search.propose(problem, 60, 0)
    assert problem.load(result.layout) <= 0.5 ** len(result.layout) * problem.load(())
    assert len(result.layout) > 1 or share == 0.0


@pytest.mark.parametrize(("width", "walkers"), [(1, 4), (6, 6), (1000, 10)])
def test_more_workers_get_more_walkers_as_far_as_each_makes_eight_moves(
    width: int, walkers: int
) -> None:
    batches: list[int] = []
    evaluator = WatchedEvaluator(small_scenario(), lambda asked: batches.append(len(asked)))
    problem = small_problem(evaluator, realisations=1)
    found = widened(PopulationAnnealingSearch(from_rules=False), width)
    assert isinstance(found, PopulationAnnealingSearch)
    found.propose(problem, budget=80)
    assert 0.7 * walkers < max(batches[1:]) <= walkers  # some neighbours are known or equal
    assert widened(RandomSearch(), width) == RandomSearch()
