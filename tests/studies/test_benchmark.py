"""`python -m studies.benchmark`: its tables of the problems that come with the package."""

import numpy as np
import pytest
from typer.testing import CliRunner

from blast_env.benchmark import (
    DEFINITIONS,
    JUDGE_CELL_M,
    Definition,
    Run,
    RunJudgement,
    SubmissionJudgement,
    make,
    play,
    shipped_standings,
    stored_references,
)
from blast_env.benchmark.problem import shares_of
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.evaluation import BlastEvaluator, BlastStore
from blast_env.evaluation.engines import find_engine
from blast_env.geometry import Layout
from studies.benchmark import methods
from studies.benchmark.__main__ import app
from studies.benchmark.choice import Candidate, are_enough, candidates
from studies.benchmark.references import (
    entered,
    finders,
    mean_curve,
    named_definition,
    with_judged,
)
from tests.benchmark.row import RowEngine


def test_in_every_problem_the_best_known_layout_is_five_points_ahead() -> None:
    result = CliRunner().invoke(app, ["headroom"])
    assert result.exit_code == 0, result.output
    rows = [line.strip("| ").split(" | ") for line in result.stdout.splitlines()[2:]]
    assert {row[0].strip("`") for row in rows} == {*DEFINITIONS}
    assert all(float(row[-3]) >= 5.0 for row in rows)


def test_runs_of_the_standings_are_beside_the_references_of_today() -> None:
    known = stored_references()
    for entry in shipped_standings():
        for run in entry.runs:
            shares = known[run.problem].rule.shares["0.25"], known[run.problem].best.shares["0.25"]
            assert (run.rule, run.best) == shares, (entry.method, run.problem)


def test_a_finder_takes_off_five_points_more_than_the_rule_with_blasts() -> None:
    def submission(method: str, budget: int, share: float) -> SubmissionJudgement:
        run = RunJudgement("a", budget, 0, budget, (), share, 0.6, 0.5)
        return SubmissionJudgement(method, JUDGE_CELL_M, "gas", (run,))

    played = [submission("far", 50, 0.5), submission("near", 50, 0.56), submission("free", 0, 0.5)]
    assert finders("a", played) == ("far",)
    assert finders("b", played) == ()


def test_the_name_of_a_candidate_has_site_family_and_place() -> None:
    assert named_definition("control_room-known_2") == Definition("control_room", "known", 2)
    assert named_definition("site_6103-unseen-v2") == DEFINITIONS["site_6103-unseen-v2"]
    with pytest.raises(UnknownNameError, match="did you mean 'known'"):
        named_definition("control_room-knwn")


def test_a_curve_has_the_points_of_the_best_layout_by_then() -> None:
    """10 points behind the rule, then 10 ahead in one of two runs; the rule counts until then."""
    runs = [Run("a", 4, 0, 4, (), curve=((1, 0.7), (2, 0.5))), Run("a", 4, 1, 3, ())]
    curve = mean_curve(runs, {"a": 0.6}, np.arange(5))
    assert curve == pytest.approx([0.0, -5.0, 5.0, 5.0, 5.0])


def test_a_best_known_layout_is_better_than_the_rule_on_the_cells_of_a_search_too() -> None:
    """The empty layout is not, whatever the judge's cells say of it; the stored one is."""
    name, known = "control_room-known-v2", stored_references()
    stored = known[name].best

    def judged(layout: Layout, share: float) -> SubmissionJudgement:
        ends = known[name].rule.shares["0.25"], stored.shares["0.25"]
        return SubmissionJudgement(
            "mine", JUDGE_CELL_M, "gas", (RunJudgement(name, 50, 0, 50, layout, share, *ends),)
        )

    empty, better = judged((), 0.1), judged(stored.layout, 0.2)
    found = with_judged(known, [empty, better], BlastStore())[name].best
    assert (found.method, found.layout) == ("mine, 50 blasts, seed 0", stored.layout)
    # Stored shares may be of an older engine: the new one is that of a blast now.
    definition = DEFINITIONS[name]
    evaluator = BlastEvaluator(definition.scenario, find_engine("gas", 0.5))
    assert [found.shares["0.5"]] == shares_of(definition.case, [stored.layout], evaluator)
    assert with_judged(known, [empty], BlastStore()) == known


def test_a_trained_agent_spends_the_budget_on_its_layouts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its proposal and draws are complete layouts, and it trains without a blast."""
    small = {"_DRAWS": 4, "_GUESSED": 8, "_IMITATED": 2, "_ORDERS": 1, "_EPOCHS": 1, "_BATCH": 4}
    for key, value in small.items():
        monkeypatch.setattr(methods, key, value)
    problem = make("control_room-known-v2", 3, engine=RowEngine())
    (run,) = play(methods.imitation, [(lambda _: problem, 3, 0)])
    assert 1 <= run.blasts <= 3
    assert run.layout == min(problem.history, key=lambda step: step.share).layout
    assert all(step.layout for step in problem.history)
    free = make("control_room-known-v2", 0, engine=RowEngine())
    (run,) = play(methods.imitation, [(lambda _: free, 0, 0)])
    assert run.blasts == free.blasts == 0
    assert run.layout


def test_runs_enter_the_standings_beside_those_of_other_seeds() -> None:
    """The same seed is replaced; a problem that there is no longer goes; judges do not mix."""
    name = "control_room-known-v2"

    def judged(*runs: tuple[str, int, float], engine: str = "gas") -> SubmissionJudgement:
        own = (RunJudgement(of, 50, seed, 50, (), share, 0.6, 0.5) for of, seed, share in runs)
        return SubmissionJudgement("mine", JUDGE_CELL_M, engine, tuple(own))

    kept = judged(("gone", 0, 0.7), (name, 1, 0.7), (name, 0, 0.8))
    found = entered(kept, judged((name, 1, 0.6), (name, 2, 0.5)))
    assert [(run.seed, run.share) for run in found.runs] == [(0, 0.8), (1, 0.6), (2, 0.5)]
    with pytest.raises(BlastEnvError, match="judged by"):
        entered(kept, judged((name, 1, 0.6), engine="gas 8"))


@pytest.mark.parametrize(
    ("finders", "enough"),
    [
        (("genetic", "optuna_tpe", "surrogate"), True),
        (("genetic", "population_annealing", "optuna_tpe"), True),
        (("genetic", "surrogate", "imitation"), False),
        (("genetic", "optuna_tpe"), False),
    ],
)
def test_guesses_alone_choose_no_site(finders: tuple[str, ...], enough: bool) -> None:
    assert are_enough(finders) is enough


def test_a_site_has_room_with_both_sizes_of_the_cells() -> None:
    three = {"genetic": 0.03, "population_annealing": 0.05, "optuna_tpe": 0.03}
    assert Candidate("a", "ring", three, three).has_room
    assert not Candidate("a", "ring", three, {**three, "genetic": 0.02}).has_room
    assert not Candidate("a", "ring", three, dict.fromkeys(three, 0.04)).has_room
    assert not Candidate("a", "ring", three).has_room


def test_candidates_are_in_the_order_of_their_seeds() -> None:
    names = [own.name for own in candidates(("item_sites", "kerb_sites"), 5, 2)]
    sites = ("item_sites_5", "kerb_sites_5", "item_sites_6", "kerb_sites_6")
    assert names == [f"{site}-known-v2" for site in sites]
    with pytest.raises(UnknownNameError, match="did you mean 'item_sites'"):
        list(candidates(("item_site",), 5, 2))
