"""What a scenario's objective counts is what is rewarded, searched for and reported."""

from typing import Any

import numpy as np
import pytest

from blast_env.answers import Number
from blast_env.answers.evaluate import means
from blast_env.design.search import DesignProblem
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, LoadCase, LoadCaseSet, draw_threats
from blast_env.evaluation.questions.grid_error import impulse_of
from blast_env.site import (
    Charge,
    ConditionalValueAtRisk,
    MeanRisk,
    ObjectiveSection,
    Scenario,
    ScenarioError,
    WorstRisk,
)
from tests.evaluation.cases import evaluate_against
from tests.gas_sites import WALL, hut, site_document

NEAR, FAR = (LoadCase(Charge(place, 5.0), 0) for place in ((2.0, 4.0), (2.0, 1.5)))


def site(**objective: Any) -> Scenario:
    return hut(objective=objective)


@pytest.fixture(scope="module")
def measured() -> tuple[dict[str, float], dict[str, float]]:
    """Impulse (Pa s) and peak (Pa) on the hut without and with the wall, under the near threat."""
    loads = BlastEvaluator(hut(), "gas").loads_of_many([((), NEAR), (WALL, NEAR)])
    unprotected, protected = (
        {"impulse": load.protected_impulse_pa_s, "peak": load.protected_peak_pa} for load in loads
    )
    return unprotected, protected


def test_impulse_is_what_counts_unless_something_else_is_said() -> None:
    assert hut().objective == ObjectiveSection()
    assert hut().content_hash == site(quantity="impulse", charges="mean").content_hash
    assert hut().content_hash != site(charges="worst").content_hash


def test_peaks_count_in_pascal(measured: tuple[dict[str, float], dict[str, float]]) -> None:
    evaluation = evaluate_against(BlastEvaluator(site(quantity="peak"), "gas"), WALL, [NEAR])
    unprotected, protected = measured
    assert evaluation.unprotected_load == pytest.approx(unprotected["peak"])
    assert evaluation.load == pytest.approx(protected["peak"])
    assert evaluation.mean_reduction == pytest.approx(1.0 - protected["peak"] / unprotected["peak"])
    # Impulses stay impulses in what is reported of them.
    assert evaluation.impulse_pa_s.value == pytest.approx(protected["impulse"])
    (row,) = evaluation.threat_table.to_dict("records")
    assert (row["peak_pa"], row["load"]) == pytest.approx((protected["peak"],) * 2)
    assert row["impulse_pa_s"] == pytest.approx(protected["impulse"])
    record = evaluation.to_dict()["result"]
    assert record["unit"] == "Pa"
    assert record["objective"]["load"] == evaluation.load


def test_both_add_shares_of_their_references_by_the_weights_of_a_structure(
    measured: tuple[dict[str, float], dict[str, float]],
) -> None:
    document = site_document(
        objective={
            "quantity": "both",
            "reference_impulse_pa_s": 50.0,
            "reference_peak_pa": 20_000.0,
        }
    )
    document["structures"][0] |= {"weight": 2.0, "peak_weight": 3.0}
    evaluator = BlastEvaluator(Scenario.from_document(document, "hut"), "gas")
    (loads,) = evaluator.loads_of_many([((), NEAR)])
    unprotected, _ = measured
    expected = 2.0 * unprotected["impulse"] / 50.0 + 3.0 * unprotected["peak"] / 20_000.0
    assert loads.load(evaluator.scenario.objective) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("charges", "risk"),
    [
        ({"charges": "mean"}, MeanRisk()),
        ({"charges": "worst"}, WorstRisk()),
        ({"charges": "cvar"}, ConditionalValueAtRisk(0.8)),
        ({"charges": "cvar", "cvar_level": 0.5}, ConditionalValueAtRisk(0.5)),
    ],
)
def test_several_charges_become_one_as_the_objective_says(
    charges: dict[str, Any], risk: MeanRisk | WorstRisk | ConditionalValueAtRisk
) -> None:
    case = LoadCaseSet(site(**charges), (NEAR, FAR))
    loads = np.array([3.0, 7.0])
    assert case.combined(loads) == risk(loads)
    assert LoadCaseSet(site(**charges), (NEAR, FAR), risk=MeanRisk()).combined(loads) == 5.0


def test_the_worst_charge_decides_in_evaluation_and_search() -> None:
    evaluator = BlastEvaluator(site(charges="worst"), "gas")
    evaluation = evaluate_against(evaluator, WALL, [NEAR, FAR])
    blasts = evaluation.blasts
    loads, unprotected = (
        blasts.values(name, impulse_of) for name in (blasts.judged, blasts.unprotected)
    )
    assert evaluation.load == max(loads)
    assert evaluation.mean_reduction == pytest.approx(1.0 - max(loads) / max(unprotected))
    assert np.isnan(evaluation.ci95).all()  # nothing is said of threats that were not met
    problem = DesignProblem(evaluator, LoadCaseSet(evaluator.scenario, (NEAR, FAR)))
    assert problem.load(WALL) == max(loads)


@pytest.mark.parametrize(("quantity", "term"), [("impulse", "impulse"), ("peak", "peak")])
@pytest.mark.parametrize("reward", ["terminal", "incremental"])
def test_the_reward_is_minus_what_counts(reward: str, quantity: str, term: str) -> None:
    env = BlastBarrierEnv(site(quantity=quantity), reward, action="place", engine="gas")
    env.reset(seed=0)
    paid = []
    for action in (0, env.placement.catalogue.finish):
        _, earned, ended, _, info = env.step(action)
        assert term in info["reward_terms"]
        paid.append(float(earned))
    assert ended
    name = "impulse_pa_s" if quantity == "impulse" else "peak_pa"
    assert sum(paid) == pytest.approx(-info[name] / info[f"unprotected_{name}"])


def test_particles_cannot_count_peaks() -> None:
    message = "objective.quantity is 'peak', but engine 'event' knows no overpressure"
    with pytest.raises(BlastEnvError, match=message):
        BlastEvaluator(site(quantity="peak"), "event")


def test_wrong_objectives_are_named_all_at_once() -> None:
    with pytest.raises(ScenarioError) as error:
        site(quantity="peek", charges="worse", cvar_level=1.0)
    text = str(error.value)
    for place in ("objective.quantity", "objective.charges", "objective.cvar_level"):
        assert place in text
    with pytest.raises(ScenarioError, match=r"objective\.reference_peak_pa: missing") as error:
        site(quantity="both", reference_impulse_pa_s=3.0, cvar_level=0.5)
    assert "objective.cvar_level: must be left out: charges is 'mean'" in str(error.value)
    with pytest.raises(ScenarioError, match="reference_peak_pa: must be left out"):
        site(quantity="impulse", reference_peak_pa=3.0)


def test_totals_are_printed_with_the_unit_of_what_counts() -> None:
    evaluator = BlastEvaluator(site(quantity="peak"), "gas")
    evaluation = evaluate_against(evaluator, WALL, draw_threats(evaluator.scenario, [0]))
    lines = means(evaluation, evaluator.scenario.objective)
    printed = "\n".join(line.text() for line in lines)
    assert f"without barrier: mean {evaluation.unprotected_load:,.0f} Pa," in printed
    assert "psi s" not in printed


class Cracking(ObjectiveSection):
    """An objective of one's own: impulse counts beyond what a wall bears, 100 Pa s."""

    def load(self, impulse_pa_s: float, *others: Any, **more: Any) -> float:
        return super().load(max(impulse_pa_s - 100.0, 0.0), *others, **more)

    @property
    def unit(self) -> str:
        return "Pa s of cracking"


def test_an_objective_of_ones_own_is_one_class_and_then_counts_everywhere(
    measured: tuple[dict[str, float], dict[str, float]],
) -> None:
    own = hut().model_copy(update={"objective": Cracking()})
    unprotected, protected = (value["impulse"] - 100.0 for value in measured)
    assert protected > 0.0
    evaluation = evaluate_against(BlastEvaluator(own, "gas"), WALL, [NEAR])
    assert (evaluation.unprotected_load, evaluation.load) == pytest.approx((unprotected, protected))
    expected = Number(protected, "Pa s of cracking").text()
    lines = [line.text() for line in means(evaluation, own.objective)]
    assert any(line.startswith(f"with barrier: mean {expected}") for line in lines)
    env = BlastBarrierEnv(scenario=own, action="place", engine="gas")
    env.reset(seed=0, options={"charge_position_m": (2.0, 4.0), "layout": WALL})
    _, _, _, _, info = env.step(env.placement.catalogue.finish)
    assert info["reward_terms"]["impulse"] == pytest.approx(1.0 - protected / unprotected)
    problem = DesignProblem(BlastEvaluator(own, "gas"), LoadCaseSet(own, (NEAR,)))
    assert problem.load(WALL) == pytest.approx(protected)
