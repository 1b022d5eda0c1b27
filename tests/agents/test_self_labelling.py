"""The policy learns from layouts; labels are never worse than rules; runs survive interruptions."""

from dataclasses import astuple, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from blast_agents.training import load_agent, load_hyperparameters, resume, train
from blast_agents.training.agent import (
    Policy,
    TrainedAgent,
    as_tensor,
    fitted,
    logits_of,
    policy_for,
)
from blast_agents.training.cases import Selection, training_cases
from blast_agents.training.checkpoint import Checkpoint
from blast_agents.training.hyperparameters import AnyHyperparameters
from blast_agents.training.run_folder import (
    EvaluationRow,
    RolloutRow,
    RunConfiguration,
    read_rows,
    settings_from,
)
from blast_agents.training.self_labelling import (
    Demonstration,
    Judge,
    imitate,
    imitation_loss,
    race,
)

from blast_env.design.search.registry import layouts_by_rule
from blast_env.envs.strategies import SingleScenario
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator, Evaluators, LoadCaseSet
from blast_env.geometry import Layout
from blast_env.layout import LayoutState
from blast_env.site import Scenario, VehicleCharge, save_scenario
from blast_env.site.scene import Charge
from tests.agents.training_runs import hyperparameters, scenario_file, settings, small_scenario
from tests.catalogue_sites import yard_document
from tests.vehicle_sites import gate_site

SMALL: dict[str, Any] = {
    "n_envs": 1,
    "batch_size": 8,
    "policy_kwargs.width": 8,
    "policy_kwargs.critic_width": 8,
    "cases": 4,
    "cases_per_round": 2,
    "samples": 1,
    "neighbours": 2,
    "borrowed": 1,
    "first_updates": 4,
    "updates": 2,
}
STEPS = 30
"""The rules of four cases, then three rounds."""


def wide_yard(tnt_kg: float = 5.0) -> Scenario:
    """Return the yard with a charge that may be anywhere in an area."""
    area = {"kind": "rectangle", "corner_m": [1.0, 3.0], "size_m": [1.5, 6.0], "tnt_kg": tnt_kg}
    return Scenario.from_document(yard_document() | {"charge": [area]}, "wide yard")


def own(**changes: Any) -> AnyHyperparameters:
    return load_hyperparameters("self_labelling", "BlastBarrier-v0", {**SMALL, **changes})


def run_settings(scenario: Path, **changes: Any) -> Any:
    changes = {"algorithm": "self_labelling", "steps": STEPS, **changes}
    return settings(scenario, **changes)


def agent_for(scenario: Scenario, observation: str = "grid") -> TrainedAgent:
    """Return an agent that has learnt nothing."""
    chosen = run_settings(Path("anywhere"), observation=observation)
    policy = {"policy": "MlpPolicy"} if observation == "features" else {}
    configuration = RunConfiguration(
        settings=chosen,
        hyperparameters=fitted(own(**policy), chosen, scenario),
        scenario_hash=scenario.content_hash,
    )
    torch.manual_seed(0)
    return TrainedAgent(policy_for(configuration, scenario), scenario, observation)


def first_cases(scenario: Scenario, count: int, **changes: Any) -> tuple[LoadCaseSet, ...]:
    chosen = run_settings(Path("anywhere"), **changes)
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
            assert {scenario.zone.catalogue.element(each) for each in actions} <= set(layout)
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


@pytest.mark.parametrize(("observation", "count"), [("grid", 2), ("features", 1)])
def test_a_policy_learns_to_place_what_it_was_shown(observation: str, count: int) -> None:
    """With the spatial policy a layout for each of two charges, at both ends of the area.

    The last steps are small, so that no choice hangs on the rounding of a matrix product.
    """
    scenario = wide_yard()
    ordered = sorted(first_cases(scenario, 32), key=charge_y_m)
    cases = [ordered[0], ordered[-1]][:count]
    agent = agent_for(scenario, observation)
    layouts = [by_rule(each) for each in cases]
    shown = [Demonstration(*each, 0.4, observation) for each in zip(cases, layouts, strict=True)]
    rng = np.random.default_rng(0)
    for updates, learning_rate in ((120, 0.01), (60, 0.001)):
        loss = imitate(agent.policy, shown, updates, 8, learning_rate, 0.5, 0.5, rng)
    assert loss < 0.8
    for case, layout, each in zip(cases, layouts, shown, strict=True):
        assert sorted(agent.propose(scenario, case.charge)) == sorted(layout)
        assert lead(agent.policy, each) > 0.5


def test_sites_with_and_without_vehicles_are_learnt_side_by_side() -> None:
    with_vehicle, without = gate_site(), wide_yard()
    assert bool(with_vehicle.vehicles) > bool(without.vehicles)
    (case,) = first_cases(without, 1)
    lesson = Demonstration(case, by_rule(case), 0.4, "grid", among_vehicles=True)
    agent = TrainedAgent(agent_for(without).policy, with_vehicle)
    seen = agent._episode(without, case.charge).observe(LayoutState.empty(without))
    assert lesson.draw(np.random.default_rng(0)).observation.shape == seen.shape
    alone = replace(lesson, among_vehicles=False).draw(np.random.default_rng(0))
    assert len(alone.observation) < len(seen)


def test_a_race_ends_with_the_best_of_those_that_met_all_threats() -> None:
    scenario = small_scenario()
    (case,) = first_cases(scenario, 4, threat="hidden", hidden_threats=3)  # one layout for all
    assert (len(case.threats), case.charge) == (3, None)
    layouts = [(), ((0, 0),), ((3, 0), (4, 0)), ((3, 0), (4, 0), (5, 0))]
    judge = Judge(Evaluators("event"))
    (met,) = race(judge, [case], [layouts])
    assert sorted(len(each) for each in met.values()) == [1, 1, 2, 3]
    assert judge.asked == judge.evaluators.counts.blasts == 7
    evaluator = BlastEvaluator(scenario, "event")
    for layout, impulses in met.items():
        blasts = [evaluator.loads(layout, threat) for threat in case.threats]
        own = [each.protected_impulse_pa_s for each in blasts]
        assert impulses == tuple(own[: len(impulses)])


def test_no_case_comes_twice() -> None:
    (only,) = first_cases(gate_site(), 8)
    assert isinstance(only.charge, VehicleCharge)
    assert len(first_cases(wide_yard(), 8)) == 8


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run that is finished; not to be changed."""
    folder = tmp_path_factory.mktemp("finished")
    train(run_settings(scenario_file(folder)), own(), folder / "run")
    return folder / "run"


def outcome(run: Path) -> tuple[Any, ...]:
    """Return all that a run has come to, but for the time it took."""
    checkpoint = Checkpoint.load(run / "checkpoint.pt")
    rollouts = read_rows(run / "rollouts.csv", RolloutRow)
    evaluations = read_rows(run / "evaluations.csv", EvaluationRow)
    return (
        [astuple(replace(row, seconds=0.0)) for row in rollouts],
        [astuple(replace(row, seconds=0.0)) for row in evaluations],
        checkpoint.labels,
        {name: values.tolist() for name, values in checkpoint.policy.items()},
    )


def test_no_label_is_worse_than_a_rule_s_layout(finished: Path) -> None:
    checkpoint = Checkpoint.load(finished / "checkpoint.pt")
    scenario = small_scenario()
    cases = training_cases(checkpoint.configuration.settings, SingleScenario(scenario), 4)
    evaluator = BlastEvaluator(scenario, "event")
    for case, label in zip(cases, checkpoint.labels, strict=True):
        (threat,) = case.threats
        best = evaluator.loads(label.layout, threat).protected_impulse_pa_s
        assert label.load == (best,)
        for layout in layouts_by_rule(scenario, case.charge).values():
            assert best <= evaluator.loads(layout, threat).protected_impulse_pa_s
    rows = read_rows(finished / "rollouts.csv", RolloutRow)
    reached = [row.reward for row in rows]
    assert reached == sorted(reached)
    assert len(rows) > 2
    assert rows[-1].steps >= STEPS > rows[-2].steps
    assert all(row.blasts + row.cache_hits == row.steps for row in rows)


def test_an_interrupted_run_ends_as_if_it_had_not_been(finished: Path, tmp_path: Path) -> None:
    calls, rounds = [], 2

    def progress(share: float) -> None:
        calls.append(share)
        if len(calls) == rounds:
            raise KeyboardInterrupt

    run = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        train(run_settings(scenario_file(tmp_path)), own(), run, progress)
    assert len(read_rows(run / "rollouts.csv", RolloutRow)) == rounds
    resume(run)
    assert outcome(run) == outcome(finished)


def test_another_training_begins_with_the_weights_of_a_run(finished: Path, tmp_path: Path) -> None:
    """A step so small that nothing changes shows them."""
    chosen = settings(scenario_file(tmp_path), start_from=str(finished), steps=16)
    slow = hyperparameters({"learning_rate": 1e-12})
    train(chosen, slow, tmp_path / "run")
    before = Checkpoint.load(finished / "checkpoint.pt").best_policy
    after = Checkpoint.load(tmp_path / "run" / "checkpoint.pt").policy
    assert before.keys() == after.keys()
    assert all(torch.allclose(after[name], before[name], atol=1e-9) for name in before)
    other = tmp_path / "other.toml"
    save_scenario(wide_yard(), other)
    with pytest.raises(BlastEnvError, match="weights and configuration differ"):
        train(settings(other, start_from=str(finished), engine="gas"), slow, tmp_path / "none")
    assert not (tmp_path / "none").exists()


def test_it_learns_by_guesses_from_pieces_and_is_judged_by_gas(tmp_path: Path) -> None:
    scenario = tmp_path / "yard.toml"
    save_scenario(wide_yard(), scenario)
    small = own(cases=2, samples=1, neighbours=1, borrowed=0)
    chosen = run_settings(scenario, engine="surrogate", steps=21, evaluation_interval=100)
    result = train(chosen, small, tmp_path / "run")
    first, *_, last = result.progress.rollouts
    assert first.reward > 0.03  # the best rule of each case, at the safe end of its interval
    assert last.reward >= first.reward
    assert last.episodes <= 6
    (evaluation,) = result.progress.evaluations
    assert not (tmp_path / "run" / "blasts").exists()
    selection = Selection.of(chosen, SingleScenario(wide_yard()))
    assert selection.evaluators.engine.name == "gas"
    best = selection.reduction(load_agent(tmp_path / "run"))
    assert (best.value, best.low) == (evaluation.reduction, evaluation.low)


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
        train(run_settings(scenario_file(tmp_path), **changes), own(), tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_gas_dynamics_judges_an_agent_that_a_surrogate_trains() -> None:
    given = {"algorithm": "ppo", "scenario": "courtyard", "steps": 1, "engine": "own.json"}
    chosen = settings_from(given)
    assert chosen.judge.name == "gas"  # without the file
    assert settings_from({**given, "evaluation_engine": "event"}).judge.name == "event"
