"""Evaluations of layouts: what they say, that it adds up, and that it can be repeated."""

import json
from pathlib import Path

import numpy as np
import pytest

from blast_env import Charge, simulate
from blast_env.errors import BlastEnvError, LayoutError
from blast_env.evaluation import BlastEvaluator, Evaluation, LoadCase, draw_threats, evaluate_layout
from blast_env.evaluation.engines.particles import PARTICLES_OVERRATE
from blast_env.site import Scenario
from tests.builders import block
from tests.evaluation.cases import (
    BEHIND_SHADOW,
    COURTYARD,
    FEW,
    SEEDS,
    SHADOW,
    THREATS,
    WALL,
    evaluate_against,
)
from tests.scenarios import BALLISTIC_COURTYARD


def test_no_barrier_reduces_by_exactly_nothing(evaluator: BlastEvaluator) -> None:
    evaluation = evaluate_against(evaluator, (), THREATS)
    assert evaluation.mean_reduction == 0.0
    assert evaluation.ci95 == (0.0, 0.0)
    assert evaluation.impulse_pa_s == evaluation.unprotected_impulse_pa_s
    assert evaluation.cvar == evaluation.unprotected_cvar
    assert (evaluation.threat_table.reduction == 0.0).all()
    assert (evaluation.module_table.reduction.dropna() == 0.0).all()


def test_a_wall_across_the_line_of_sight_reduces(evaluator: BlastEvaluator) -> None:
    """Most of the impulse comes straight from the charge, also in dense air."""
    evaluation = evaluate_against(evaluator, SHADOW, BEHIND_SHADOW)
    assert evaluation.mean_reduction > 0.7
    low, high = evaluation.ci95
    assert 0.0 < low < evaluation.mean_reduction < high <= 1.0
    assert evaluation.impulse_pa_s.high < evaluation.unprotected_impulse_pa_s.low


def test_the_numbers_are_those_of_the_blasts(evaluation: Evaluation) -> None:
    """Worked out again from `simulate`, without anything of this package."""
    with_wall, without = (
        np.array(
            [
                simulate(COURTYARD, cells, seed=seed, engine="event").impulse("building").pa_s
                for seed in SEEDS
            ]
        )
        for cells in (WALL, ())
    )
    assert evaluation.impulse_pa_s.value == pytest.approx(with_wall.mean())
    assert evaluation.unprotected_impulse_pa_s.value == pytest.approx(without.mean())
    assert evaluation.mean_reduction == pytest.approx(1.0 - with_wall.sum() / without.sum())
    assert evaluation.cvar == pytest.approx(with_wall.max())  # 20 % of four threats: the worst
    worst = int(with_wall.argmax())
    assert evaluation.worst.threat == THREATS[worst]
    assert evaluation.worst.impulse_pa_s == pytest.approx(with_wall[worst])
    assert evaluation.worst.reduction == pytest.approx(1.0 - with_wall[worst] / without[worst])
    assert evaluation.threat_table.impulse_pa_s.to_numpy() == pytest.approx(with_wall)
    assert evaluation.threat_table.charge_y_m.tolist() == [
        outcome.charge.position_m[1] for outcome in evaluation.outcomes
    ]


def test_modules_are_named_as_in_a_blast(evaluation: Evaluation) -> None:
    modules = simulate(COURTYARD, seed=0, engine="event").modules
    columns = ["module_id", "structure", "x_m", "y_m"]
    assert evaluation.module_table[columns].equals(modules[columns])


def test_evaluate_layout_draws_the_threats_of_its_seeds(evaluation: Evaluation) -> None:
    """In two processes and with the cells in another order: the same to the last digit."""
    again = evaluate_layout(COURTYARD, WALL[::-1], SEEDS, processes=2, engine="event")
    assert again.to_dict() == evaluation.to_dict()


def test_threats_may_be_given_instead_of_seeds(evaluator: BlastEvaluator) -> None:
    light = [LoadCase(Charge((10.0, 15.0), 15.0), seed) for seed in (0, 1)]
    evaluation = evaluate_layout(COURTYARD, FEW, threats=[*light, THREATS[0]], engine="event")
    assert evaluation.threats == (*light, THREATS[0])
    assert not evaluation.in_range
    assert evaluation.threat_table.in_range.tolist() == [False, False, True]
    assert evaluation.table.threats_in_range.tolist() == [1]
    of_model, note = evaluation.notes
    assert of_model == PARTICLES_OVERRATE
    assert note == (
        "building: 2 of 3 threats are outside the range of calibration 'ballistic_kb_100kg', "
        "e.g. charge 15 kg TNT is not 100 kg"
    )


def test_a_file_repeats_its_evaluation(tmp_path: Path) -> None:
    evaluation = evaluate_layout(BALLISTIC_COURTYARD, FEW, (0, 1), engine="event")
    path = evaluation.to_json(tmp_path / "evaluation.json")
    content = json.loads(path.read_text(encoding="utf-8"))
    assert content == evaluation.to_dict()
    scenario = Scenario.from_document(content["scenario"], "evaluation.json")
    assert scenario.content_hash == content["scenario_hash"]
    threats = [
        LoadCase(Charge((row["charge_x_m"], row["charge_y_m"]), row["tnt_kg"]), row["seed"])
        for row in content["threats"]
    ]
    layout = [tuple(cell) for cell in content["layout"]]
    again = evaluate_layout(scenario, layout, engine=content["engine"], threats=threats)
    assert again.to_dict() == content


def test_a_file_has_versions_units_and_no_numbers_that_json_does_not_know(
    evaluator: BlastEvaluator, tmp_path: Path
) -> None:
    """A single threat has no interval, and the modules inside a building are never hit."""
    evaluation = evaluate_against(evaluator, FEW, THREATS[:1])
    text = evaluation.to_json(tmp_path / "one.json").read_text(encoding="utf-8")
    content = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} in the file"))
    assert content["result"]["reduction"]["ci95_low"] is None
    assert content["modules"][12]["reduction"] is None
    assert content["versions"]["engine"].startswith("event 1 (numba ")
    assert content["calibration"] == "ballistic_kb_100kg"
    assert content["result"]["cvar"] == content["threats"][0]["load"]


def test_unusable_arguments_are_named(evaluator: BlastEvaluator) -> None:
    with pytest.raises(LayoutError, match=r"cell \(20, 0\) must stay empty"):
        evaluate_layout(COURTYARD, [(20, 0)], SEEDS, engine="event")
    with pytest.raises(BlastEnvError, match="seeds: there are none"):
        evaluate_layout(COURTYARD, FEW, [], engine="event")
    with pytest.raises(BlastEnvError, match=r"seeds\[1\] is -1, must be an integer from 0"):
        evaluate_layout(COURTYARD, FEW, [0, -1], engine="event")
    with pytest.raises(BlastEnvError, match="processes is -2, must be a whole number"):
        evaluate_layout(COURTYARD, FEW, SEEDS, processes=-2, engine="event")
    with pytest.raises(BlastEnvError, match="cvar_level is 1, must be at least 0 and below 1"):
        evaluate_layout(COURTYARD, FEW, SEEDS, engine="event", cvar_level=1.0)
    with pytest.raises(BlastEnvError, match="threats: there are none"):
        evaluate_layout(COURTYARD, FEW, engine="event", threats=[])
    with pytest.raises(BlastEnvError, match=r"threats\[1\] .* appears twice"):
        evaluate_layout(COURTYARD, FEW, engine="event", threats=[THREATS[0]] * 2)


def test_a_structure_that_nothing_reaches_has_nothing_to_reduce() -> None:
    """The protected block stands in a closed yard of other blocks."""
    document = COURTYARD.model_dump()
    sizes = {"left": ((26.0, 9.0), 24, 2), "right": ((31.0, 9.0), 24, 2)}
    sizes |= {"bottom": ((27.0, 9.0), 2, 8), "top": ((27.0, 20.0), 2, 8)}
    document["structures"] = [
        *document["structures"],
        *(block(name, *corner, *size) for name, (corner, *size) in sizes.items()),
    ]
    yard = Scenario.from_document(document, "yard")
    threats = draw_threats(yard, [0])
    with pytest.raises(BlastEnvError, match="nothing arrives at the protected structures"):
        evaluate_layout(yard, (), engine="event", threats=threats)
