"""`blast-env advise`: the verdict first, each kind of measure, and blasts for barriers alone."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from typer.testing import CliRunner

import blast_env
from blast_env.cli import app
from blast_env.design.search import (
    DesignProblem,
    MeasureKind,
    advise,
    advise_until,
    against_several,
    kinds_for,
    only,
)
from blast_env.design.search.advice import most_blasts
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, LoadCaseSet
from blast_env.evaluation.questions.probability import LevelProbability
from blast_env.evaluation.questions.verdict import Verdict
from blast_env.geometry import Layout, Measure, standing
from blast_env.layout import LayoutState, load_layout
from blast_env.plots import DamagePrice, cheapest
from blast_env.site import Charge
from blast_env.surrogate import SurrogateEngine
from tests.evaluation.test_response_objective import THREAT
from tests.site.test_hardening import glazed_yard


def run(*words: str | Path) -> str:
    """Return what is printed, without the progress, which depends on the time."""
    done = CliRunner().invoke(app, ["advise", *map(str, words)])
    assert done.exit_code in (0, 2), done.output
    return done.stdout


def test_each_kind_has_nothing_but_its_own_in_stock() -> None:
    scenario = glazed_yard(target="medium")
    assert kinds_for(scenario) == (
        MeasureKind.NOTHING,
        MeasureKind.SHIELD,
        MeasureKind.HARDEN,
        MeasureKind.TOGETHER,
    )
    for kind, has_pieces, has_measures in (
        (MeasureKind.NOTHING, False, False),
        (MeasureKind.SHIELD, True, False),
        (MeasureKind.HARDEN, False, True),
        (MeasureKind.TOGETHER, True, True),
    ):
        placement = LayoutState.empty(only(scenario, kind))
        legal = {
            isinstance(placement.catalogue.element(action), Measure)
            for action in placement.legal.ravel().nonzero()[0].tolist()
        }
        assert (False in legal, True in legal) == (has_pieces, has_measures)


def test_hardening_takes_the_best_choice_of_measures_with_one_blast() -> None:
    scenario = glazed_yard(target="medium")
    problem = DesignProblem(BlastEvaluator(scenario, "surrogate"), LoadCaseSet(scenario, (THREAT,)))
    found = advise(problem, MeasureKind.HARDEN, 5)
    assert found.blasts == 1
    assert standing(found.layout) == ()
    glass, panels = Measure.named("glass"), Measure.named("panels")
    choices = ((), (glass,), (panels,), (glass, panels))
    assert found.worth == min(problem.load(layout) for layout in choices)
    together = advise(problem, MeasureKind.TOGETHER, 12, begin_with=(found.layout,))
    assert together.worth <= found.worth
    assert together.blasts <= 12
    with pytest.raises(BlastEnvError, match="budget is 0 blasts, must be at least 1"):
        advise(problem, MeasureKind.HARDEN, 0)


@pytest.mark.parametrize("budget", [2, 7])
def test_advice_takes_at_most_the_blasts_told(budget: int) -> None:
    scenario = glazed_yard(target="low")
    threats = (THREAT, replace(THREAT, charge=Charge((2.0, 6.0), 2.0)))
    case = LoadCaseSet(scenario, threats)
    problem = DesignProblem(BlastEvaluator(scenario, SurrogateEngine()), case)
    judged: set[Layout] = set()

    def judge(layout: Layout) -> Verdict:
        judged.add(standing(layout))
        return Verdict.FAILS

    for kind in kinds_for(scenario):
        advise_until(judge, problem, kind, budget, rounds=2)
    blasts, barriers = most_blasts(scenario, kinds_for(scenario), 2, budget, len(threats))
    assert len(threats) <= problem.evaluator.counts.blasts <= blasts
    assert 1 <= len(judged) <= barriers


def test_the_verdict_comes_first_and_the_best_layout_is_written(tmp_path: Path) -> None:
    site, out = tmp_path / "yard.toml", tmp_path / "best.json"
    blast_env.save_scenario(glazed_yard(charges="mean"), site)
    picture = tmp_path / "cost.svg"
    options = ("--tnt-kg", "1", "--budget", "2", "--rounds", "2", "--judge-cell", "0.5")
    files = ("--out", out, "--picture", picture)
    text = run(site, *options, *files, "--target", "low", "--budget-cost", "15")
    first, cost, verdict = text.splitlines()[:3]
    # No barrier, and 2 searches of 1 more for 2 of the 4 kinds, each judged once.
    assert cost.startswith("up to 10 blasts of gas")
    assert first.startswith("4 kinds, at most 2 searches of 2 blasts each, gas, cells of 0.5 m; ")
    assert first.endswith("each result is judged with 1, gas, cells of 0.5 m")
    assert "walled_yard" in verdict
    assert all(
        kind.value in text for kind in (MeasureKind.NOTHING, MeasureKind.SHIELD, MeasureKind.HARDEN)
    )
    assert load_layout(out) is not None
    assert "<svg" in picture.read_text("utf-8")


def test_rings_are_the_points_of_their_layouts_where_both_have_the_same_cells(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of panes alone: a wall panel that is worse does not count there."""
    shown = []

    def keep(*arguments: Any) -> Figure:
        shown.append(arguments[1])
        return Figure()

    monkeypatch.setattr("blast_env.plots.cost_level.cost_level_figure", keep)
    site = tmp_path / "yard.toml"
    blast_env.save_scenario(glazed_yard(charges="mean", measure="glazing"), site)
    options = ("--tnt-kg", "1", "--budget", "2", "--judge-cell", "0.5", "--rounds", "1")
    run(site, *options, "--target", "low", "--picture", tmp_path / "cost.png")
    assert shown[-1]
    for point, ring in shown[-1]:
        assert ring == pytest.approx(point, rel=1e-6)


def test_all_that_was_looked_at_has_a_cost_and_a_damage() -> None:
    """As many as barriers times choices of measures; what passes is not worse than the target."""
    scenario = glazed_yard(target="medium")
    problem = DesignProblem(BlastEvaluator(scenario, "surrogate"), LoadCaseSet(scenario, (THREAT,)))
    found = advise(problem, MeasureKind.HARDEN, 5)
    assert [layout.cost for layout in found.tried] == [0.0, 5.0, 4.0, 9.0]
    front = cheapest([DamagePrice(layout.cost, layout.damage) for layout in found.tried])
    assert [layout.damage for layout in front] == sorted(
        (layout.damage for layout in front), reverse=True
    )
    assert front[0].cost == 0.0
    assert front[-1].damage == min(layout.damage for layout in found.tried)


def test_what_a_judge_fails_is_searched_for_again_with_a_margin() -> None:
    """The judge is stricter than the search: it wants more glass, or a wall, than would do."""
    scenario = glazed_yard(target="medium")
    threat = replace(THREAT, charge=Charge((2.0, 4.0), 2.0))
    problem = DesignProblem(BlastEvaluator(scenario, "surrogate"), LoadCaseSet(scenario, (threat,)))
    once = advise(problem, MeasureKind.TOGETHER, 12)

    def judge(layout: Layout) -> Verdict:
        return Verdict.FAILS if layout == once.layout else Verdict.PASSES

    found = advise_until(judge, problem, MeasureKind.TOGETHER, 12, rounds=3, margin=0.05)
    assert judge(found.layout) is Verdict.PASSES
    assert found.passes
    assert found.best.damage < once.best.damage - 0.05
    assert found.best.cost > once.best.cost
    assert once.blasts < found.blasts <= 24
    alone = advise_until(judge, problem, MeasureKind.TOGETHER, 12)
    assert alone.best == once.best


def test_a_search_begins_with_rules_against_each_charge_for_a_share_of_the_budget() -> None:
    """The mean of two charges is where none is: a wall before each of them is another layout."""
    scenario = only(glazed_yard(target="medium"), MeasureKind.SHIELD)
    charges = [Charge((2.0, y_m), 5.0) for y_m in (2.0, 10.0)]
    layouts = list(against_several(scenario, charges))
    costs = [LayoutState(scenario, layout).cost for layout in layouts]
    assert 0.0 < max(costs) <= (scenario.zone.budget or 0.0)
    middle = scenario.zone.rows / 2
    assert any(min(x[0] for x in layout) < middle < max(x[0] for x in layout) for layout in layouts)
    assert list(against_several(scenario, charges[:1])) == []


def test_a_layout_passes_with_the_probability_that_is_wanted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every layout has the level with 0.9, by draws of no blast."""
    likely = LevelProbability(np.repeat([2, 0], [90, 10]), np.full((100, 5), 0.5))
    monkeypatch.setattr("blast_env.design.search.advised.level_probability", lambda *_: likely)
    site = tmp_path / "yard.toml"
    blast_env.save_scenario(glazed_yard(charges="mean"), site)
    options = ("--tnt-kg", "0.02", "--budget", "1", "--rounds", "1", "--judge-cell", "0.5")
    asked = ("--target", "low", "--target-probability")
    passed, failed = (run(site, *options, *asked, share) for share in ("0.85", "0.95"))
    assert "the empty site reaches 'low' with 0.90 (flagged)." in passed
    assert (
        "nothing that was tried reaches 'low' with a probability of 0.95; the best has 0.90."
        in failed
    )
