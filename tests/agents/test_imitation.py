"""A warm start teaches the best layout by rule of each case; other weights can begin a run, too."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from blast_agents.training import Hyperparameters, load_agent, resume, train
from blast_agents.training.agent import (
    Policy,
    PolicyAgent,
    as_tensor,
    fitted,
    logits_of,
    policy_for,
)
from blast_agents.training.cases import Selection, training_cases
from blast_agents.training.imitation import Demonstration, best_by_rule, imitate, imitation_loss
from blast_agents.training.run_folder import RunConfiguration, RunFolder, settings_from
from blast_agents.training.weights import read_parameters

from blast_env.design.search import layouts_by_rule
from blast_env.envs.strategies import SingleScenario
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, Evaluators, LoadCaseSet
from blast_env.geometry import Layout
from blast_env.layout import LayoutState
from blast_env.site import Charge, Scenario, VehicleCharge, save_scenario
from tests.agents.training_runs import hyperparameters, scenario_file, settings, small_scenario
from tests.catalogue_sites import wide_yard
from tests.vehicle_sites import gate_site

SLOW = {"learning_rate": 1e-12}
"""A step so small that nothing changes in training."""


def warm(**changes: Any) -> Hyperparameters:
    """Return hyperparameters with a short warm start."""
    return hyperparameters({"imitation_updates": 4, "imitation_cases": 4, **changes})


def agent_for(scenario: Scenario, observation: str = "grid") -> PolicyAgent:
    """Return an agent that has learnt nothing."""
    chosen = settings(Path("anywhere"), observation=observation)
    policy = {"policy": "MlpPolicy"} if observation == "features" else {}
    given = RunConfiguration(chosen, hyperparameters(policy), scenario.content_hash)
    configuration = fitted(given, scenario)
    torch.manual_seed(0)
    return PolicyAgent(policy_for(configuration, scenario), scenario, observation)


def first_cases(scenario: Scenario, count: int, **changes: Any) -> tuple[LoadCaseSet, ...]:
    chosen = settings(Path("anywhere"), **changes)
    return training_cases(chosen, SingleScenario(scenario), count)


def by_rule(case: LoadCaseSet, name: str = "wall near the charge") -> Layout:
    return layouts_by_rule(case.scenario, case.charge)[name]


@pytest.mark.parametrize("scenario", [small_scenario(), wide_yard()], ids=["modules", "pieces"])
def test_what_is_wanted_is_legal_at_every_moment_and_leads_to_the_layout(
    scenario: Scenario,
) -> None:
    (case,) = first_cases(scenario, 1)
    layout = tuple(sorted(by_rule(case)))
    demonstration = Demonstration(case, layout, 0.5)
    finish = scenario.zone.catalogue.finish
    rng = np.random.default_rng(0)
    wanted_counts = set()
    for _ in range(50):
        step = demonstration.draw(rng)
        assert (step.legal & step.wanted).sum() == step.wanted.sum() > 0
        actions = np.flatnonzero(step.wanted).tolist()
        wanted_counts.add(len(actions) if actions != [finish] else 0)
        if actions != [finish]:
            assert {scenario.zone.catalogue.element(action) for action in actions} <= set(layout)
    full = LayoutState(scenario, layout).is_full
    assert wanted_counts == set(range(1 if full else 0, len(layout) + 1))


def test_the_loss_counts_wanted_actions_alike_and_illegal_ones_not_at_all() -> None:
    logits = torch.tensor([[0.0, 0.0, 50.0, 0.0, 0.0]])
    legal = torch.tensor([[True, True, False, True, True]])
    wanted = torch.tensor([[True, True, False, False, False]])
    assert imitation_loss(logits, legal, wanted).item() == pytest.approx(np.log(4.0))
    surer = torch.tensor([[9.0, 9.0, 50.0, 0.0, 0.0]])
    assert imitation_loss(surer, legal, wanted).item() == pytest.approx(np.log(2.0), abs=1e-3)


def charge_y_m(case: LoadCaseSet) -> float:
    assert isinstance(case.charge, Charge)
    return case.charge.position_m[1]


def lead(policy: Policy, demonstration: Demonstration) -> float:
    """Return by how much the likeliest wanted action is ahead of all others, in logits.

    At each of 32 moments in the placing of a layout, the least.
    """
    rng = np.random.default_rng(1)
    steps = [demonstration.draw(rng) for _ in range(32)]
    legal = torch.as_tensor(np.stack([step.legal for step in steps]))
    wanted = torch.as_tensor(np.stack([step.wanted for step in steps]))
    logits = logits_of(policy, as_tensor(policy, np.stack([step.observation for step in steps])))
    best = logits.masked_fill(~wanted, -torch.inf).amax(dim=1)
    other = logits.masked_fill(wanted | ~legal, -torch.inf).amax(dim=1)
    return (best - other).min().item()


@pytest.mark.parametrize(
    ("observation", "count", "updates"), [("grid", 2, 150), ("features", 1, 60)]
)
def test_a_policy_learns_to_place_what_it_was_shown(
    observation: str, count: int, updates: int
) -> None:
    """With the spatial policy a layout for each of two charges, at both ends of the area.

    The last steps are small, so that no choice hangs on the rounding of a matrix product.
    """
    scenario = wide_yard()
    ordered = sorted(first_cases(scenario, 32), key=charge_y_m)
    cases = [ordered[0], ordered[-1]][:count]
    agent = agent_for(scenario, observation)
    layouts = [by_rule(case) for case in cases]
    shown = [Demonstration(*pair, 0.4, observation) for pair in zip(cases, layouts, strict=True)]
    chosen = warm(imitation_updates=updates, learning_rate="lin_1e-2", batch_size=8)
    loss = imitate(agent.policy, shown, chosen, np.random.default_rng(0))
    assert loss < 0.8
    for case, layout, demonstration in zip(cases, layouts, shown, strict=True):
        assert sorted(agent.propose(scenario, case.charge)) == sorted(layout)
        assert lead(agent.policy, demonstration) > 0.2


def test_sites_with_and_without_vehicles_are_learnt_side_by_side() -> None:
    with_vehicle, without = gate_site(), wide_yard()
    assert bool(with_vehicle.vehicles) > bool(without.vehicles)
    (case,) = first_cases(without, 1)
    lesson = Demonstration(case, by_rule(case), 0.4, "grid", among_vehicles=True)
    agent = PolicyAgent(agent_for(without).policy, with_vehicle)
    seen = agent._episode(without, case.charge).observe(LayoutState.empty(without))
    assert lesson.draw(np.random.default_rng(0)).observation.shape == seen.shape
    alone = replace(lesson, among_vehicles=False).draw(np.random.default_rng(0))
    assert len(alone.observation) < len(seen)


def test_no_case_comes_twice() -> None:
    (only,) = first_cases(gate_site(), 8)
    assert isinstance(only.charge, VehicleCharge)
    assert len(first_cases(wide_yard(), 8)) == 8


@pytest.mark.parametrize("threat", ["visible", "hidden"])
def test_the_best_by_rule_is_that_of_blasts_under_the_threats_of_the_case(threat: str) -> None:
    scenario = small_scenario()
    cases = first_cases(scenario, 3, threat=threat, hidden_threats=3)
    assert [len(case.threats) for case in cases] == ([1] * 3 if threat == "visible" else [3])
    evaluators = Evaluators("event")
    found = best_by_rule(evaluators, cases)
    evaluator = BlastEvaluator(scenario, "event")
    for case, (layout, reduction) in zip(cases, found, strict=True):
        loads = [
            np.mean([evaluator.loads(item, t).protected_impulse_pa_s for t in case.threats])
            for item in ((), layout, *layouts_by_rule(scenario, case.charge).values())
        ]
        assert loads[1] == min(loads)
        assert reduction == pytest.approx(1.0 - loads[1] / loads[0])
    assert evaluators.counts.blasts == len(evaluators._store)


def test_a_run_begins_with_an_evaluation_of_its_warm_start(tmp_path: Path) -> None:
    """A continued run does not learn the rules again."""
    run, scenario = tmp_path / "run", scenario_file(tmp_path)

    def stop(share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(settings(scenario, steps=16), warm(**SLOW), run, stop)
    start = read_parameters(RunFolder(run).checkpoint(0))["policy"]
    result = resume(run)
    assert [row.timesteps for row in result.evaluations] == [0, 16]
    end = read_parameters(RunFolder(run).checkpoint(16))["policy"]
    assert all(torch.allclose(end[name], values, atol=1e-9) for name, values in start.items())


def test_another_training_begins_with_the_weights_of_a_run(tmp_path: Path) -> None:
    first, scenario = tmp_path / "first", scenario_file(tmp_path)
    train(settings(scenario, steps=16), hyperparameters(), first)
    chosen = settings(scenario, start_from=str(first), steps=16)
    result = train(chosen, hyperparameters(SLOW), tmp_path / "run")
    assert [row.timesteps for row in result.evaluations] == [0, 16]
    before = read_parameters(RunFolder(first).best_model)["policy"]
    after = read_parameters(RunFolder(tmp_path / "run").last_model)["policy"]
    assert before.keys() == after.keys()
    assert all(torch.allclose(after[name], before[name], atol=1e-9) for name in before)
    other = tmp_path / "other.toml"
    save_scenario(wide_yard(), other)
    with pytest.raises(BlastEnvError, match="weights and configuration differ"):
        train(
            settings(other, start_from=str(first), engine="gas"), hyperparameters(), tmp_path / "no"
        )
    assert not (tmp_path / "no").exists()


def test_it_learns_by_guesses_from_pieces_and_is_judged_by_gas(tmp_path: Path) -> None:
    scenario = tmp_path / "yard.toml"
    save_scenario(wide_yard(), scenario)
    chosen = settings(scenario, engine="surrogate", steps=16, evaluation_interval=100)
    result = train(chosen, warm(), tmp_path / "run")
    first, last = result.evaluations
    assert (first.timesteps, last.timesteps) == (0, 16)
    assert 0 < first.blasts < last.blasts  # those of the rules count
    assert not (tmp_path / "run" / "blasts").exists()
    selection = Selection.of(chosen, SingleScenario(wide_yard()))
    assert selection.evaluators.engine.name == "gas"
    best = selection.evaluate(load_agent(tmp_path / "run")).reduction
    assert best.value == max(first.reduction, last.reduction)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"engine": "gass"}, "did you mean 'gas'"),
        ({"engine": "surrogat"}, "did you mean 'surrogate'"),
        ({"engine": "surrogate", "cell_m": 0.5}, "engine 'surrogate' has no cells"),
        ({"engine": "none.json"}, "none.json: there is no such file"),
        ({"evaluation_engine": "surrogate"}, "must be an engine that runs blasts"),
    ],
)
def test_what_it_cannot_do_is_refused_before_anything_is_written(
    tmp_path: Path, changes: dict[str, str], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        train(settings(scenario_file(tmp_path), **changes), warm(), tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_gas_dynamics_judges_an_agent_that_a_surrogate_trains() -> None:
    given = {"algorithm": "ppo", "scenario": "courtyard", "steps": 1, "engine": "own.json"}
    chosen = settings_from(given)
    assert chosen.judge.name == "gas"  # without the file
    assert settings_from({**given, "evaluation_engine": "event"}).judge.name == "event"
