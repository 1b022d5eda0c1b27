"""Search: what is asked and what it costs, neighbours and crossovers."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import blast_env
from blast_env import load_scenario
from blast_env.design.search import (
    BatchMoves,
    Layout,
    Moves,
    Plan,
    SearchEndedError,
    SearchSession,
    cut,
    random_walls,
    repaired,
)
from blast_env.errors import BlastEnvError, LayoutError
from blast_env.evaluation import BlastEvaluator, DesignProblem, LoadCase, LoadCaseSet
from blast_env.evaluation.cases import search_set
from blast_env.layout import LayoutState
from blast_env.rules import random_layout
from blast_env.site import Charge, ConditionalValueAtRisk, MeanRisk
from tests.agents.sites import site
from tests.design.search_cases import ballistic, small_problem, small_scenario

LAYOUTS = [((row, column),) for row in range(4) for column in range(3)]
WEST = Charge((5.0, 20.5), 100.0)


@pytest.fixture(scope="module")
def problem() -> DesignProblem:
    """The small problem with four threats; all tests share what it remembers."""
    return small_problem(realisations=4)


def session(problem: DesignProblem, budget: int, threats: int = 1) -> SearchSession:
    return SearchSession(problem, budget, Plan(threats, budget))


@pytest.mark.parametrize("risk", [MeanRisk(), ConditionalValueAtRisk(0.5)])
def test_the_number_is_the_environments(risk: MeanRisk | ConditionalValueAtRisk) -> None:
    """Mean over the realisations of a charge, then risk over the charges, as agents are paid."""
    scenario = ballistic("courtyard")
    evaluator = BlastEvaluator(scenario, "event")
    case = search_set(scenario, None, 2, 1, risk, charges=3)
    layout = ((9, 0), (10, 0), (11, 0))
    expected = DesignProblem(evaluator, case).assess(layout).impulse_pa_s
    found = DesignProblem(evaluator, case).load(layout)
    assert found == pytest.approx(expected, rel=1e-12)


def test_a_pair_of_layout_and_threat_is_paid_for_once(problem: DesignProblem) -> None:
    """In whatever order the cells are named; further threats cost only what is new."""
    it = session(problem, 100)
    it.assess([((0, 0), (1, 0)), ((1, 0), (0, 0)), ((2, 0),)])
    assert it.blasts == 2
    it.assess([((1, 0), (0, 0))], 3)
    assert it.blasts == 4
    it.assess([((2, 0),)])
    assert it.blasts == 4


@given(budget=st.integers(1, 12), threats=st.integers(1, 4))
def test_the_budget_is_used_as_far_as_it_goes_and_no_farther(budget: int, threats: int) -> None:
    """And what a cache knows is paid for all the same: else a search would find more again."""
    it = session(_SHARED, budget, threats)
    try:
        it.assess(LAYOUTS)
    except SearchEndedError:
        assert budget < len(LAYOUTS) * threats
    assert it.blasts == min(budget // threats, len(LAYOUTS)) * threats


_SHARED = small_problem(realisations=4)


def test_it_ends_when_nothing_new_is_asked(problem: DesignProblem) -> None:
    it = session(problem, 100)
    asked = 0

    def ask_for_ever() -> None:
        nonlocal asked
        while asked < 100_000:
            it.assess(LAYOUTS[:1])
            asked += 1

    it.run(ask_for_ever, lambda: None)
    assert it.blasts == 1
    assert asked < 100_000


def test_a_layout_that_has_met_more_threats_goes_before(problem: DesignProblem) -> None:
    """One that looks better under one threat does not replace one that has met two."""
    it = session(problem, 100)
    by_first = sorted(LAYOUTS, key=lambda layout: it.assess([layout])[0])
    best, worst = by_first[0], by_first[-1]
    assert it.best is not None
    assert it.best.layout == best
    it.assess([worst], 2)
    assert it.best.layout == worst
    it.assess([best], 2)
    assert it.best.layout == min(best, worst, key=lambda layout: it.assess([layout], 2)[0])


def test_the_lucky_one_is_found_out(problem: DesignProblem) -> None:
    """With blasts enough for all, the choice is the one by all threats, not by the first."""
    it = SearchSession(problem, 100, Plan(1, 12))
    it.run(lambda: _ask(it), it.confirm_best)
    assert it.best is not None
    impulses = {layout: problem.load(layout) for layout in LAYOUTS}
    assert it.best.threats == 4
    assert it.best.layout == min(impulses, key=lambda impulse: impulses[impulse])
    assert it.best.load == pytest.approx(min(impulses.values()))


def _ask(it: SearchSession) -> None:
    it.assess(LAYOUTS)


def test_the_front_is_the_front(problem: DesignProblem) -> None:
    it = session(problem, 100)
    pairs = [((0, 0), (1, 0)), ((1, 0), (2, 0)), ((2, 0), (3, 0))]
    it.assess([(), *LAYOUTS, *pairs])
    front = it.front()
    assert [len(candidate.layout) for candidate in front] == [0, 1, 2]
    for fewer, more in pairwise(front):
        assert fewer.load > more.load
    assert front[1].load == it.assess(LAYOUTS).min()


def test_it_reports_every_batch(problem: DesignProblem) -> None:
    seen: list[tuple[int, int]] = []
    it = SearchSession(
        problem, 9, Plan(1, 9), lambda state: seen.append((state.blasts, state.budget))
    )
    it.assess(LAYOUTS[:4])
    it.assess(LAYOUTS[2:6])
    assert seen == [(4, 9), (6, 9)]


def test_hidden_charges_come_first_and_spread() -> None:
    """A search that looks at the first three charges of the road has its middle and both ends."""
    scenario = ballistic("courtyard")
    threats = search_set(scenario, None, 2, seed=3, charges=16).threats
    assert [t.charge for t in threats[:16]] == [t.charge for t in threats[16:]]
    assert len({threat.seed for threat in threats}) == 32
    first, *others = (t.charge_against(scenario, ()).position_m[1] for t in threats[:16])
    assert abs(first - float(np.median([first, *others]))) < 2.0
    assert {min(others), max(others)} == {*others[:2]}


def test_a_known_charge_has_its_realisations() -> None:
    scenario = small_scenario()
    threats = search_set(scenario, WEST, 3, seed=1).threats
    assert {threat.charge for threat in threats} == {WEST}
    assert len({threat.seed for threat in threats}) == 3
    assert threats == search_set(scenario, WEST, 3, seed=1).threats
    assert threats != search_set(scenario, WEST, 3, seed=2).threats


@pytest.mark.parametrize(
    ("threats", "zoned", "words"),
    [
        ((), True, "there are none"),
        ((LoadCase(WEST, 1), LoadCase(WEST, 1)), True, "appears twice"),
        ((LoadCase(WEST, 1),), False, "no build zone"),
    ],
)
def test_problems_that_are_no_use_are_refused(
    threats: tuple[LoadCase, ...], zoned: bool, words: str
) -> None:
    scenario = small_scenario()
    scenario = scenario if zoned else scenario.model_copy(update={"build_zone": None})
    evaluator = BlastEvaluator(scenario, "event")
    with pytest.raises(BlastEnvError, match=words):
        DesignProblem(evaluator, LoadCaseSet(scenario, threats, realisations=len(threats)))


@pytest.mark.parametrize("budget", [-1, 2.5])
def test_a_budget_is_a_number_of_blasts(budget: Any) -> None:
    with pytest.raises(BlastEnvError, match=f"budget is {budget}, must be an integer from 0"):
        blast_env.search(small_scenario(), "random", budget, engine="event")


def test_questions_that_are_no_use_are_refused(problem: DesignProblem) -> None:
    with pytest.raises(LayoutError, match="outside the build zone"):
        session(problem, 10).assess([((9, 9),)])
    with pytest.raises(BlastEnvError, match="budget is 0 blasts, must be at least 1"):
        session(problem, 0)


# --- Neighbours, walls, crossovers: always legal, and they reach every layout.


SITES = {name: load_scenario(name) for name in ("courtyard", "perimeter_gate", "street_junction")}
SITES["budget_and_way"] = site(
    budget=9.0,
    clearance_m=1.0,
    cost_areas=[
        {"corner_m": (20.0, 15.0), "size_m": (5.0, 10.0), "module_cost": 2.0, "reason": "rock"}
    ],
    access_way={"width_m": 4.0, "between": "left_right"},
)


@given(name=st.sampled_from(sorted(SITES)), seed=st.integers(0, 10_000))
def test_every_neighbour_is_legal_and_close(name: str, seed: int) -> None:
    """A walk of many moves on sites with budgets and access ways.

    Where modules cost the same everywhere, their number changes by one at most.
    """
    scenario, rng = SITES[name], np.random.default_rng(seed)
    moves, layout = Moves(scenario, count_share=0.3), random_walls(scenario, rng)
    for _ in range(12):
        neighbour = moves.neighbour(layout, rng)
        assert LayoutState.of(scenario, neighbour).cells == neighbour
        assert len(neighbour) <= len(layout) + 1
        if name == "courtyard":
            assert len(neighbour) >= len(layout) - 1
        layout = neighbour


def test_neighbours_leave_out_what_is_illegal_in_a_layout() -> None:
    """In the courtyard: a hydrant's cell, a cell twice, one outside the zone, over the stock."""
    scenario, rng = load_scenario("courtyard"), np.random.default_rng(0)
    wall = [(row, 12) for row in range(16)]
    moves = Moves(scenario)
    for layout in (
        ((29, 11), *wall[:4]),
        (*wall[:4], wall[0]),
        ((40, 0), *wall[:4]),
        (*wall, (30, 2)),
    ):
        for _ in range(20):
            neighbour = moves.neighbour(layout, rng)
            assert LayoutState.of(scenario, neighbour).cells == neighbour


def test_a_whole_wall_can_move_at_once() -> None:
    scenario = site(stock=4)
    rng, moves = np.random.default_rng(0), Moves(scenario, count_share=0.0, wall_share=1.0)
    wall = ((8, 5), (9, 5), (10, 5), (11, 5))
    shifts = set()
    for _ in range(50):
        moved = sorted(moves.neighbour(wall, rng))
        steps = {(a[0] - b[0], a[1] - b[1]) for a, b in zip(moved, wall, strict=True)}
        if len(steps) == 1:
            shifts |= steps
    assert len(shifts) > 10


MANY = SITES | {name: load_scenario(name) for name in ("school_and_clinic", "hotel_forecourt")}


@given(name=st.sampled_from(sorted(MANY)), seed=st.integers(0, 10_000))
def test_neighbours_of_many_layouts_are_legal_and_close(name: str, seed: int) -> None:
    """A walk of many layouts at once, on sites with modules and with catalogues, and vehicles."""
    scenario, rng = MANY[name], np.random.default_rng(seed)
    moves = BatchMoves(scenario)
    best: list[Layout] = [random_layout(scenario, rng) for _ in range(3)]
    for _ in range(4):
        found = moves.near_best(best, 8, rng)
        most = max(map(len, best))
        for neighbour in found:
            assert LayoutState.of(scenario, neighbour).layout == neighbour
            assert neighbour == tuple(sorted(neighbour))
            assert len(neighbour) <= most + 2  # one for three, as budget and stock allow
        best = found


@pytest.mark.parametrize("name", ["courtyard", "school_and_clinic"])
def test_neighbours_of_many_layouts_are_many(name: str) -> None:
    """From the best one in most cases, and from none by an element; the same for the same seed."""
    scenario, moves = MANY[name], BatchMoves(MANY[name])
    alone = {*moves.near_best([()], 20, np.random.default_rng(0))}
    assert {len(layout) for layout in alone} == {1}
    assert len(alone) > 15
    first, second = (random_layout(scenario, np.random.default_rng(seed)) for seed in (0, 1))
    drawn, again = (
        moves.near_best([first, second], 60, np.random.default_rng(2)) for _ in range(2)
    )
    assert drawn == again
    assert len({*drawn}) > 40
    apart = [[len({*own} ^ {*layout}) for layout in (first, second)] for own in drawn]
    assert sum(to_first < to_second for to_first, to_second in apart) > 0.5 * len(apart)


def test_whole_walls_of_many_layouts_move_at_once() -> None:
    scenario = site(stock=4)
    moves = BatchMoves(scenario, count_share=0.0, wall_share=1.0)
    wall = ((8, 5), (9, 5), (10, 5), (11, 5))
    shifts = set()
    for moved in moves.near_best([wall], 50, np.random.default_rng(0)):
        steps = {(a[0] - b[0], a[1] - b[1]) for a, b in zip(moved, wall, strict=True)}
        if len(steps) == 1:
            shifts |= steps
    assert len(shifts) > 10


def test_random_walls_hang_together_more_than_random_modules() -> None:
    def neighbours(layout: Layout) -> int:
        return sum(
            max(abs(a[0] - b[0]), abs(a[1] - b[1])) == 1 for a in layout for b in layout if a < b
        )

    rng, scenario = np.random.default_rng(2), SITES["courtyard"]
    walls = sum(neighbours(random_walls(scenario, rng)) for _ in range(20))
    lone = sum(neighbours(random_layout(scenario, rng)) for _ in range(20))
    assert walls > 5 * lone


@given(seed=st.integers(0, 10_000))
def test_a_cut_takes_each_side_from_one_parent(seed: int) -> None:
    """Two columns side by side: one piece of the one, the complement of it of the other."""
    first, second = (tuple((row, column) for row in range(8)) for column in (0, 1))
    child = cut(first, second, np.random.default_rng(seed))
    assert len(child) == 8
    rows = sorted(node[0] for node in child if node[1] == 0)
    assert rows in (list(range(len(rows))), list(range(8 - len(rows), 8)))


def test_repair_keeps_a_legal_layout_as_it_is() -> None:
    scenario, rng = site(stock=3), np.random.default_rng(5)
    assert repaired(scenario, ((1, 1), (2, 2)), rng) == ((1, 1), (2, 2))
    assert len(repaired(scenario, tuple((1, column) for column in range(9)), rng)) == 3
