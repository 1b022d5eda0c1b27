"""Cases that no training has met, and layouts that are each judged on their own case."""

from itertools import pairwise

import pytest
from blast_agents.training.cases import Selection, training_cases, unseen_cases
from blast_agents.training.run_folder import TrainingSettings

from blast_env.envs.strategies import SingleScenario
from blast_env.errors import BlastEnvError
from blast_env.evaluation import Evaluators, compare, draw_threats, evaluate_layout
from blast_env.site import PointSource
from blast_env.site.blast_site import Charge
from blast_env.sites import HELD_OUT_SITES, SiteSource
from tests.agents.training_runs import small_scenario

SOURCE = SingleScenario(small_scenario())
SETTINGS = TrainingSettings(algorithm="ppo", scenario="any", steps=1)
WALLS = (((2, 0), (3, 0), (4, 0)), (), ((4, 5), (5, 5)))


def test_each_layout_meets_the_threat_of_its_case_alone() -> None:
    cases = unseen_cases(SETTINGS, SOURCE, range(3))
    comparison = compare(Evaluators("event"), cases, WALLS)
    threats = draw_threats(small_scenario(), range(3))
    for index, (threat, layout) in enumerate(zip(threats, WALLS, strict=True)):
        expected = evaluate_layout(small_scenario(), layout, engine="event", threats=[threat])
        assert comparison.loads[index, 0] == pytest.approx(expected.impulse_pa_s.value)
        assert cases[index].charge == threat.charge
    assert comparison.case_reductions[1] == 0.0


def test_the_record_has_what_the_comparison_found() -> None:
    cases = unseen_cases(SETTINGS, SOURCE, range(4))
    evaluators = Evaluators("event")
    comparison = compare(evaluators, cases, [WALLS[0]] * 4, cvar_level=0.5)
    expected = evaluate_layout(small_scenario(), WALLS[0], range(4), engine="event", cvar_level=0.5)
    assert comparison.mean == pytest.approx(expected.impulse_pa_s)
    assert comparison.unprotected_mean == pytest.approx(expected.unprotected_impulse_pa_s)
    assert (comparison.cvar, comparison.unprotected_cvar) == pytest.approx(
        (expected.cvar, expected.unprotected_cvar)
    )
    each = [outcome.reduction for outcome in expected.outcomes]
    assert comparison.reduction.value == pytest.approx(sum(each) / 4)  # every case counts alike
    record = comparison.to_dict()
    assert record["result"]["reduction"]["value"] == comparison.reduction.value
    assert [case["layout"] for case in record["cases"]] == [[list(cell) for cell in WALLS[0]]] * 4
    assert comparison.case_table["reduction"].tolist() == pytest.approx(each)


def test_generated_sites_are_held_out_and_not_those_that_the_weights_were_chosen_by() -> None:
    settings = SETTINGS.model_copy(update={"scenario": "sites", "threat": "hidden"})
    cases = unseen_cases(settings, SiteSource.training(), range(7, 10))
    sites = [case.scenario for case in cases]
    assert sites == list(SiteSource.held_out(3))
    assert [case.threats[0].seed for case in cases] == [7, 8, 9]
    assert all(case.charge is None for case in cases)
    with pytest.raises(BlastEnvError, match=f"must be 1 to {HELD_OUT_SITES - 16}, a site each"):
        unseen_cases(settings, SiteSource.training(), range(HELD_OUT_SITES))


def test_sites_are_evaluated_in_the_order_of_their_cases_with_progress() -> None:
    """Cases of two scenarios, in turns, must not change places."""
    first = unseen_cases(SETTINGS, SOURCE, range(2))
    second = unseen_cases(SETTINGS, SingleScenario(small_scenario()), range(2, 4))
    mixed = [first[0], second[0], first[1], second[1]]
    shares: list[float] = []
    evaluators = Evaluators("event")
    comparison = compare(evaluators, mixed, [WALLS[0]] * 4, progress=shares.append)
    assert list(comparison.cases) == mixed
    assert all(early <= late for early, late in pairwise(shares))
    assert shares[-1] == pytest.approx(1.0)
    alone = compare(evaluators, first, [WALLS[0]] * 2)
    assert comparison.loads[0::2].tolist() == alone.loads.tolist()


def test_fixed_charges_come_in_turn_in_training_selection_and_evaluation() -> None:
    places = ((3.0, 6.5), (3.0, 9.0), (3.0, 11.5))
    points = tuple(PointSource(kind="point", position_m=each, tnt_kg=20.0) for each in places)
    source = SingleScenario(small_scenario().model_copy(update={"charge": points}))
    for cases in (
        training_cases(SETTINGS, source, 3),
        unseen_cases(SETTINGS, source, range(3)),
        Selection.of(SETTINGS.model_copy(update={"evaluation_cases": 3}), source).cases,
    ):
        met = {case.charge.position_m for case in cases if isinstance(case.charge, Charge)}
        assert met == set(places)
    assert len(training_cases(SETTINGS, source, 9)) == 3
