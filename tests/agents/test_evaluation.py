"""Cases that no training has met, and layouts that are each judged on their own case."""

from itertools import pairwise

import numpy as np
import pytest
from blast_agents.evaluation import evaluate_layouts
from blast_agents.training.run_folder import TrainingSettings
from blast_agents.unseen_cases import FIRST_SEED, unseen_cases

from blast_env.envs.strategies import SingleScenario
from blast_env.errors import BlastEnvError
from blast_env.evaluation import draw_threats, evaluate_layout
from blast_env.sites import HELD_OUT_SITES, SiteSource
from tests.agents.training_runs import small_scenario

SOURCE = SingleScenario(small_scenario())
SETTINGS = TrainingSettings(algorithm="ppo", scenario="any", steps=1)
WALLS = (((2, 0), (3, 0), (4, 0)), (), ((4, 5), (5, 5)))


def test_each_layout_meets_the_threat_of_its_case_alone() -> None:
    cases = unseen_cases(SETTINGS, SOURCE, range(3), "event")
    evaluation = evaluate_layouts(cases, WALLS)
    threats = draw_threats(small_scenario(), range(3))
    for each, threat, layout in zip(evaluation.outcomes, threats, WALLS, strict=True):
        expected = evaluate_layout(small_scenario(), layout, threats=[threat])
        assert each.outcome.impulse_pa_s == pytest.approx(expected.impulse_pa_s.value)
        assert each.case.told_charge == threat.charge
    assert evaluation.outcomes[1].outcome.reduction == 0.0


def test_one_layout_for_all_cases_is_what_evaluate_layout_says() -> None:
    cases = unseen_cases(SETTINGS, SOURCE, range(4), "event")
    evaluation = evaluate_layouts(cases, [WALLS[0]] * 4, cvar_level=0.5)
    expected = evaluate_layout(small_scenario(), WALLS[0], range(4), cvar_level=0.5)
    assert evaluation.reduction == pytest.approx(expected.reduction)
    assert evaluation.impulse_pa_s == pytest.approx(expected.impulse_pa_s)
    assert evaluation.unprotected_impulse_pa_s == pytest.approx(expected.unprotected_impulse_pa_s)
    assert (evaluation.cvar, evaluation.unprotected_cvar) == pytest.approx(
        (expected.cvar, expected.unprotected_cvar)
    )
    assert evaluation.worst.outcome.threat == expected.worst.threat
    record = evaluation.to_dict()
    assert record["result"]["reduction"]["value"] == evaluation.reduction.value
    assert [case["layout"] for case in record["cases"]] == [[list(cell) for cell in WALLS[0]]] * 4


def test_generated_sites_are_held_out_and_not_those_that_the_weights_were_chosen_by() -> None:
    settings = SETTINGS.model_copy(update={"scenario": "sites", "threat": "hidden"})
    cases = unseen_cases(settings, SiteSource.training(), range(7, 10), "event")
    sites = [case.evaluator.scenario for case in cases]
    assert sites == list(SiteSource.held_out(3))
    assert [case.threat.seed for case in cases] == [7, 8, 9]
    assert all(case.told_charge is None for case in cases)
    with pytest.raises(BlastEnvError, match=f"must be 1 to {HELD_OUT_SITES - 16}, a site each"):
        unseen_cases(settings, SiteSource.training(), range(HELD_OUT_SITES), "event")


def test_sites_are_evaluated_in_the_order_of_their_cases_with_progress() -> None:
    """Cases of two evaluators, in turns, must not change places."""
    first = unseen_cases(SETTINGS, SOURCE, range(2), "event")
    second = unseen_cases(SETTINGS, SOURCE, range(2, 4), "event")
    mixed = [first[0], second[0], first[1], second[1]]
    shares: list[float] = []
    evaluation = evaluate_layouts(mixed, [WALLS[0]] * 4, progress=shares.append)
    assert [each.case for each in evaluation.outcomes] == mixed
    assert all(early <= late for early, late in pairwise(shares))
    assert shares[-1] == pytest.approx(1.0)
    alone = evaluate_layouts(first, [WALLS[0]] * 2)
    impulses = [each.outcome.impulse_psi_s for each in evaluation.outcomes]
    assert impulses[0::2] == [each.outcome.impulse_psi_s for each in alone.outcomes]


def test_no_training_draws_the_seeds_of_unseen_threats() -> None:
    assert SETTINGS.evaluation_first_seed + SETTINGS.evaluation_cases < FIRST_SEED
    assert np.iinfo(np.int32).max < FIRST_SEED  # seeds of blasts are drawn below
