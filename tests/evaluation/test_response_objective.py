"""The response of facades as what counts: one blast a barrier, rewards, targets, searches."""

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from blast_env.design.search import DesignProblem, find_proposer
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, LoadCase, LoadCaseSet
from blast_env.evaluation.engines import find_engine
from blast_env.geometry import Measure
from blast_env.layout import LayoutState
from blast_env.response import LevelOfProtection, peak_corrected, peak_factor, respond
from blast_env.site import Charge, Scenario
from blast_env.surrogate import SurrogateEngine
from tests.catalogue_sites import WALL
from tests.evaluation.cases import evaluate_against
from tests.site.test_hardening import TAKEN, glazed_yard

THREAT = LoadCase(Charge((2.0, 6.0), 5.0), 0)
DAMAGE = glazed_yard(charges="mean")
PANELS = Measure.named("panels")


@pytest.fixture(scope="module")
def evaluator() -> BlastEvaluator:
    """One that has met the empty site and the walls, two blasts."""
    found = BlastEvaluator(DAMAGE, "gas")
    found.loads_of_many([((), THREAT), (WALL, THREAT)])
    return found


def test_measures_need_no_blast(evaluator: BlastEvaluator) -> None:
    before = evaluator.counts.blasts
    unprotected, hardened = evaluator.loads_of_many([((), THREAT), ((TAKEN, PANELS), THREAT)])
    evaluator.loads((*WALL, TAKEN), THREAT)
    assert evaluator.counts.blasts == before == 2
    assert hardened.load(DAMAGE.objective) < unprotected.load(DAMAGE.objective)
    assert hardened.protected_impulse_pa_s == unprotected.protected_impulse_pa_s


def test_loads_with_measures_are_those_of_a_blast_with_them(evaluator: BlastEvaluator) -> None:
    """What `result.bays` says of a hardened site, the evaluator works out without a blast.

    Peaks that cells clip are made up for: the worse of both counts.
    """
    engine = find_engine("gas")
    result = engine.blast(DAMAGE, (TAKEN,), 0, THREAT.charge).run()
    own = result.bay_loads.response  # type: ignore[attr-defined]
    histories = peak_corrected(own.time_s, own.pressure_pa, peak_factor(0.5, THREAT.charge.tnt_kg))
    sharp = respond(own.bays, *histories)
    damage = np.zeros(len(own.bays))
    for bay in (own, sharp):
        damage[bay.glazed] = np.maximum(damage[bay.glazed], bay.glazing.hazard)
        damage[bay.walled] = np.maximum(damage[bay.walled], bay.walls.damage)
    area_m2 = np.array([bay.bay.area_m2 for bay in own.bays])
    loads = evaluator.loads((TAKEN,), THREAT)
    assert loads.load(DAMAGE.objective) == pytest.approx(area_m2 @ damage / area_m2.sum())
    assert loads.level == min(own.level_of_protection, sharp.level_of_protection)


def test_cache_keeps_the_damage_of_bays(tmp_path: Path, evaluator: BlastEvaluator) -> None:
    first = BlastEvaluator(DAMAGE, "surrogate", cache=tmp_path)
    load = first.loads((TAKEN,), THREAT).load(DAMAGE.objective)
    second = BlastEvaluator(DAMAGE, "surrogate", cache=tmp_path)
    assert second.loads((TAKEN,), THREAT).load(DAMAGE.objective) == load
    assert second.counts.blasts == 0
    again = pickle.loads(pickle.dumps(evaluator))
    assert again.loads((TAKEN,), THREAT).load(DAMAGE.objective) == (
        evaluator.loads((TAKEN,), THREAT).load(DAMAGE.objective)
    )


def test_with_a_target_the_cheapest_layout_that_reaches_it_is_worth_most() -> None:
    objective = glazed_yard(target="low").objective
    assert objective.level is LevelOfProtection.LOW
    damage, area_m2 = np.array([2.9, 3.0, 4.5]), np.array([1.0, 1.0, 2.0])
    assert objective.response(damage, area_m2) == pytest.approx((1.0 + 2.0 * 2.5) / 4.0)
    assert objective.response(damage[:1], area_m2[:1]) == 0.0
    passes, dearer, fails = (
        objective.objective_value(*case) for case in ((0, 0.2), (0, 1.0), (1e-6, 0.0))
    )
    assert passes < dearer < fails


def test_case_counts_the_cost_of_a_layout_that_passes() -> None:
    scenario = glazed_yard(target="medium")
    case = LoadCaseSet(scenario, (THREAT,))
    assert case.objective_value([0.0], (TAKEN,)) == pytest.approx(5.0 / 20.0)
    assert case.objective_value([0.3], (TAKEN,)) == pytest.approx(1.3)
    assert case.combined([0.3]) == pytest.approx(0.3)


def test_rewards_are_what_counts_and_info_says_the_level(tmp_path: Path) -> None:
    surrogate = SurrogateEngine()
    site = glazed_yard(target="medium")
    env = BlastBarrierEnv(site, "incremental", action="place", engine=surrogate)
    env.reset(seed=0)
    catalogue = LayoutState.empty(site).catalogue
    paid = 0.0
    for action in (catalogue.action(TAKEN), catalogue.finish):
        _, reward, terminated, _, info = env.step(action)
        paid += float(reward)
    assert terminated
    assert paid == pytest.approx(-info["response"] / info["unprotected_response"])
    assert info["reward_terms"].keys() == {"response", "invalid_actions"}
    assert info["level_of_protection"] in {level.label for level in LevelOfProtection}
    assert env.placement.layout == (TAKEN,)


@pytest.mark.parametrize("method", ["population_annealing", "genetic", "nsga2", "random"])
def test_searches_harden_without_spending_blasts_on_it(method: str) -> None:
    pytest.importorskip("pymoo")
    scenario = glazed_yard(charges="mean")
    problem = DesignProblem(BlastEvaluator(scenario, "surrogate"), LoadCaseSet(scenario, (THREAT,)))
    metered = replace(problem, budget=30)
    assert metered.unprotected[0] > 0.0
    result = find_proposer(method).propose(metered, 30, 1)
    assert result.load is not None
    assert result.load < metered.unprotected[0]
    assert result.blasts == metered.blasts <= 30
    tried = {step.layout for step in result.history}
    assert any(isinstance(element, Measure) for layout in tried for element in layout)


def test_particles_know_no_response() -> None:
    with pytest.raises(BlastEnvError, match=r"objective.kind is 'response', but engine 'event'"):
        BlastEvaluator(DAMAGE, "event")


def test_evaluation_reports_the_shares_of_the_objective(evaluator: BlastEvaluator) -> None:
    evaluation = evaluate_against(evaluator, (*WALL, TAKEN), [THREAT])
    assert evaluation.load < evaluation.unprotected_load <= 5.0
    assert evaluation.mean_reduction == pytest.approx(
        1.0 - evaluation.load / evaluation.unprotected_load
    )


def test_a_protected_building_without_a_facade_is_named_since_it_counts_as_nothing() -> None:
    document = DAMAGE.model_dump(mode="json", exclude_none=True)
    (hut,) = document["structures"]
    shed = {key: value for key, value in hut.items() if key != "facade"}
    document["structures"].append(shed | {"name": "shed", "corner_m": [7.5, 0.5], "rows": 4})
    site = Scenario.from_document(document, "yard")
    found = evaluate_against(BlastEvaluator(site, "gas"), (), [THREAT])
    assert "shed: protected, but without a facade: its response counts as 0" in found.notes
    assert found.table["structure"].tolist() == ["hut", "shed"]
