"""Cases that no training has met, and layouts that are each judged on their own case."""

from itertools import pairwise

import pytest
from blast_agents.training.cases import Selection, training_cases
from blast_agents.training.run_folder import TrainingSettings

from blast_env.benchmark import site_problems
from blast_env.envs.strategies import SingleScenario
from blast_env.evaluation import Evaluators, LoadCaseSet, compare, draw_threats, evaluate_layout
from blast_env.site import Charge, PointSource, Scenario
from blast_env.sites import HELD_OUT_SITES, SiteSource
from tests.agents.training_runs import small_scenario

SETTINGS = TrainingSettings(algorithm="ppo", scenario="any", steps=1)
WALLS = (((2, 0), (3, 0), (4, 0)), (), ((4, 5), (5, 5)))


def cases_of(*scenarios_and_seeds: tuple[Scenario, int]) -> tuple[LoadCaseSet, ...]:
    """Return a case with one threat, drawn by a seed, for each scenario."""
    return tuple(
        LoadCaseSet(scenario, draw_threats(scenario, [seed]))
        for scenario, seed in scenarios_and_seeds
    )


def test_each_layout_meets_the_threat_of_its_case_alone() -> None:
    site = small_scenario()
    comparison = compare(Evaluators("event"), cases_of(*((site, k) for k in range(3))), WALLS)
    for index, (threat, layout) in enumerate(zip(draw_threats(site, range(3)), WALLS, strict=True)):
        expected = evaluate_layout(site, layout, engine="event", threats=[threat])
        assert comparison.loads[index, 0] == pytest.approx(expected.impulse_pa_s.value)
    assert comparison.case_reductions[1] == 0.0


def test_every_case_counts_alike_in_the_reduction() -> None:
    site = small_scenario()
    cases = cases_of(*((site, seed) for seed in range(4)))
    comparison = compare(Evaluators("event"), cases, [WALLS[0]] * 4)
    expected = evaluate_layout(site, WALLS[0], range(4), engine="event")
    reductions = [outcome.reduction for outcome in expected.outcomes]
    assert comparison.case_reductions.tolist() == pytest.approx(reductions)
    assert comparison.reduction.value == pytest.approx(sum(reductions) / 4)


def test_generated_sites_choose_weights_by_the_last_ones_held_out() -> None:
    settings = SETTINGS.model_copy(update={"scenario": "sites", "evaluation_cases": 2})
    cases = Selection.of(settings, SiteSource.training()).cases
    last = SiteSource(HELD_OUT_SITES - 2, 2)
    assert [case.scenario for case in cases] == list(last)
    judged = [site_problem.scenario for site_problem in site_problems("sites", 3)]
    assert judged == list(SiteSource.held_out(3))


def test_sites_are_evaluated_in_the_order_of_their_cases_with_progress() -> None:
    """Cases of two scenarios, in turns, must not change places."""
    first, second = small_scenario(), small_scenario()
    mixed = cases_of((first, 0), (second, 2), (first, 1), (second, 3))
    shares: list[float] = []
    evaluators = Evaluators("event")
    comparison = compare(evaluators, mixed, [WALLS[0]] * 4, progress=shares.append)
    assert comparison.cases == mixed
    assert all(early <= late for early, late in pairwise(shares))
    assert shares[-1] == pytest.approx(1.0)
    alone = compare(evaluators, mixed[0::2], [WALLS[0]] * 2)
    assert comparison.loads[0::2].tolist() == alone.loads.tolist()


def test_fixed_charges_come_in_turn_in_training_and_selection() -> None:
    places = ((3.0, 6.5), (3.0, 9.0), (3.0, 11.5))
    points = tuple(PointSource(kind="point", position_m=place, tnt_kg=20.0) for place in places)
    source = SingleScenario(small_scenario().model_copy(update={"charge": points}))
    for cases in (
        training_cases(SETTINGS, source, 3),
        Selection.of(SETTINGS.model_copy(update={"evaluation_cases": 3}), source).cases,
    ):
        met = {case.charge.position_m for case in cases if isinstance(case.charge, Charge)}
        assert met == set(places)
    assert len(training_cases(SETTINGS, source, 9)) == 3


@pytest.mark.parametrize(("engine", "count"), [("event", 9), ("gas", 3)])
def test_a_fixed_charge_again_is_no_evidence_without_noise(engine: str, count: int) -> None:
    """Sixteen evaluations at three places gave an interval a sixth as wide."""
    places = ((3.0, 6.5), (3.0, 9.0), (3.0, 11.5))
    points = tuple(PointSource(kind="point", position_m=place, tnt_kg=20.0) for place in places)
    site = SingleScenario(small_scenario().model_copy(update={"charge": points}))
    chosen = SETTINGS.model_copy(update={"evaluation_cases": 9, "evaluation_engine": engine})
    for threat in ("visible", "hidden"):
        cases = Selection.of(chosen.model_copy(update={"threat": threat}), site).cases
        assert len(cases) == count
        assert len({case.threats[0].charge for case in cases}) == 3
