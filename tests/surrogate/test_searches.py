"""Searches by guesses."""

import random
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from blast_env.design.search import (
    DesignProblem,
    Guesses,
    SurrogateSearch,
    improved,
    layouts_by_rule,
)
from blast_env.design.search.learnt import case_for
from blast_env.evaluation import BlastEvaluator, LoadCase, LoadCaseSet, draw_threats
from blast_env.geometry import Layout
from blast_env.layout import LayoutState, draw_threat
from blast_env.site import AnyCharge, Charge, Scenario, load_scenario
from studies.surrogate import verdict
from tests.surrogate.cases import FAST, YARD, by_hand, case


def test_a_search_by_guesses_is_never_worse_than_what_it_begins_with() -> None:
    guesses = Guesses.of(by_hand(), case())
    begin = [(), *layouts_by_rule(YARD).values()]
    ranked = improved(guesses, begin, 20, np.random.default_rng(0))
    loads = guesses.loads(ranked)
    assert (np.diff(loads) >= 0.0).all()
    assert loads[0] <= guesses.loads([tuple(sorted(layout)) for layout in begin]).min()
    assert len(ranked) > len(begin)
    for layout in ranked:
        assert LayoutState.of(YARD, layout).layout == layout


def test_without_a_blast_it_proposes_the_same_legal_layout_again() -> None:
    agent = SurrogateSearch(by_hand(), changes=8)
    for charge in (None, Charge((1.5, 5.0), 5.0)):
        layout = agent.at_once(YARD, charge)
        assert layout == agent.at_once(YARD, charge)
        assert LayoutState.of(YARD, layout).layout == layout
        assert layout


class Drawing:
    """An agent that proposes nothing and draws rules' layouts, twice each."""

    def propose(self, _scenario: Scenario, _charge: AnyCharge | None = None, /) -> Layout:
        return ()

    def sample(
        self, scenario: Scenario, charge: AnyCharge | None = None, count: int = 8, _seed: int = 0, /
    ) -> list[Layout]:
        return (2 * list(layouts_by_rule(scenario, charge).values()))[:count]


@pytest.mark.parametrize("charge", [None, Charge((1.5, 5.0), 5.0)], ids=["hidden", "known"])
def test_of_what_rules_and_an_agent_propose_it_takes_what_the_surrogate_likes_best(
    charge: Charge | None,
) -> None:
    """An agent that draws something better than all rules is followed, one of rules is not."""
    surrogate = by_hand(2)
    begin = [(), *layouts_by_rule(YARD, charge).values()]
    guesses = Guesses.of(surrogate, case_for(YARD, charge))
    best = improved(guesses, begin, 60, np.random.default_rng(1))[0]
    alone, with_rules = (
        SurrogateSearch(surrogate, agent, ranked=3, changes=0).at_once(YARD, charge)
        for agent in (None, Drawing())
    )
    assert alone == with_rules != best

    class Better(Drawing):
        def sample(self, *_: object) -> list[Layout]:
            return [best]

    assert SurrogateSearch(surrogate, Better(), changes=0).at_once(YARD, charge) == best
    changed = SurrogateSearch(surrogate, Better(), changes=16).at_once(YARD, charge)
    assert guesses.loads([changed]) <= guesses.loads([best])


def test_where_the_response_counts_no_agent_is_asked() -> None:
    class Unasked(Drawing):
        def propose(self, *_: object) -> Layout:
            raise AssertionError

    site = load_scenario("guard_post")
    alone, beside = (
        SurrogateSearch(by_hand(), agent, changes=0).at_once(site, draw_threat(site, 0))
        for agent in (None, Unasked())
    )
    assert alone == beside


def test_a_search_keeps_to_its_blasts_and_finds_what_rules_find() -> None:
    """With blasts for all rules it is at least as good as the best of them."""
    problem = DesignProblem(BlastEvaluator(YARD, FAST), case())
    ruled = {
        tuple(sorted(layout)) for layout in layouts_by_rule(YARD, problem.known_charge).values()
    }
    budget = len(ruled) + 2
    method = SurrogateSearch(by_hand(), digest="digest", guesses=12, drawn=4)
    result = method.propose(problem, budget, 0)
    assert result.blasts <= budget
    assert result.load is not None
    assert result.load <= min(map(problem.load, ruled))
    assert result == method.propose(problem, budget, 0)
    assert replace(method, guesses=13) != method
    # From an agent it begins with what that proposes, whatever the surrogate thinks of it.
    assert result.layout != Drawing().propose(YARD)
    first = replace(method, agent=Drawing()).propose(problem, 1, 0)
    assert (first.layout, first.blasts) == (Drawing().propose(YARD), 1)
    guided = replace(method, agent=Drawing()).propose(problem, budget, 0)
    assert guided.load is not None
    assert guided.load <= min(map(problem.load, Drawing().sample(YARD, problem.known_charge, 3)))


@dataclass(eq=False)
class WrongBy(DesignProblem):
    """Blasts of which the surrogate is wrong by a factor of the layout, wherever the charge is."""

    met: dict[Layout, int] = field(default_factory=dict)

    def loads(self, pairs: Sequence[tuple[Layout, LoadCase]]) -> list[float]:
        for layout, _ in pairs:
            self.met[layout] = self.met.get(layout, 0) + 1
        return [self.true_load(layout, (threat,)) for layout, threat in pairs]

    def true_load(self, layout: Layout, threats: tuple[LoadCase, ...]) -> float:
        factor = 0.7 + 0.6 * random.Random(repr(layout)).random()
        return factor * Guesses.of(by_hand(), LoadCaseSet(YARD, threats)).loads([layout]).item()


def test_against_a_hidden_charge_it_chooses_by_all_places_though_few_are_met() -> None:
    problem = WrongBy(BlastEvaluator(YARD, FAST), case(10))
    assert problem.known_charge is None
    method = SurrogateSearch(by_hand(), digest="digest", guesses=30, drawn=4)
    result = method.propose(problem, 40, 0)
    assert result.blasts == sum(problem.met.values()) <= 40
    assert result.threats == 10  # the chosen one has met all
    assert set(problem.met.values()) == {4, 10}
    best = min(problem.met, key=lambda layout: problem.true_load(layout, problem.threats))
    assert result.layout == best


def test_a_verdict_holds_promise_and_rules_against_blasts() -> None:
    evaluator = BlastEvaluator(YARD, FAST)
    agent, threat = SurrogateSearch(by_hand(), changes=2), draw_threats(YARD, [3])[0]
    found = verdict(by_hand(), 2, evaluator, threat)
    unprotected = evaluator.loads((), threat).protected_impulse_pa_s
    proposed = evaluator.loads(agent.at_once(YARD, threat.charge), threat)
    assert found.reduction == pytest.approx(1.0 - proposed.protected_impulse_pa_s / unprotected)
    assert set(found.rules) == set(layouts_by_rule(YARD, threat.charge))
    assert found.promised < 1.0
    assert found.ms > 0.0
