"""Another engine is one file and one line: with a name and loads it does all that the others do."""

import json
from importlib.metadata import EntryPoint, EntryPoints

import gymnasium as gym
import pytest

import blast_env
from blast_env.design.search import DesignProblem, find_proposer
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.evaluation import BlastEvaluator, LoadCaseSet, draw_threats, evaluate_layout
from blast_env.evaluation.engines import contract, find_engine
from blast_env.site import load_scenario
from tests.evaluation.engines.shade import ShadeEngine

COURTYARD = load_scenario("courtyard")
WALL = [(10, 0), (11, 0), (12, 0)]


@pytest.fixture(autouse=True)
def one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """Add the line of a package's pyproject.toml: `[project.entry-points."blast_env.engines"]`."""
    place = "tests.evaluation.engines.shade:ShadeEngine"
    line = EntryPoints([EntryPoint("shade", place, "blast_env.engines")])
    monkeypatch.setattr(contract, "entry_points", lambda group: line.select(group=group))


def test_it_is_found_by_its_name_and_described() -> None:
    assert find_engine("shade") == ShadeEngine()
    assert find_engine("shade").describe([COURTYARD]) == "engine shade 1"
    with pytest.raises(UnknownNameError, match="no engine 'shadow'"):
        find_engine("shadow")


def test_an_episode_is_played_with_it() -> None:
    env = gym.make("BlastBarrier-v0", scenario="courtyard", engine="shade")
    env.reset(seed=0)
    for action in ((0, 10, 0), (0, 11, 0)):
        _, _, ended, _, _ = env.step(action)
    _, reward, ended, _, info = env.step(env.unwrapped.finish)  # type: ignore[attr-defined]
    assert ended
    assert info["reduction"] == pytest.approx(1.0 - 0.9**2)
    assert info["reward_terms"]["impulse"] == pytest.approx(1.0 - 0.9**2)
    assert (info["calibration"], info["calibration_in_range"]) == ("none", False)
    assert "peak_pa" not in info
    assert reward == pytest.approx(sum(info["reward_terms"].values()))


def test_its_spec_survives_json() -> None:
    spec = gym.make("BlastBarrier-v0", engine="shade").spec
    assert spec is not None
    again = gym.make(gym.envs.registration.EnvSpec.from_json(spec.to_json()))
    assert again.unwrapped.task.engine == ShadeEngine()  # type: ignore[attr-defined]


def test_layouts_are_evaluated_and_reported_with_it() -> None:
    evaluation = evaluate_layout(COURTYARD, WALL, seeds=range(3), engine="shade")
    assert evaluation.mean_reduction == pytest.approx(1.0 - 0.9**3)
    (row,) = evaluation.table.to_dict("records")
    assert row["reduction"] == pytest.approx(1.0 - 0.9**3)
    record = json.loads(json.dumps(evaluation.to_dict()))
    assert (record["engine"], record["versions"]["engine"]) == ("shade", "shade 1")
    (note,) = evaluation.notes
    assert "3 of 3 threats are outside the validated range of a shade" in note


def test_a_search_uses_up_the_stock_with_it() -> None:
    evaluator = BlastEvaluator(COURTYARD, "shade")
    problem = DesignProblem(evaluator, LoadCaseSet(COURTYARD, draw_threats(COURTYARD, range(1))))
    found = find_proposer("random").propose(problem, 8, seed=0)
    best = max(found.history, key=lambda step: len(step.layout))
    assert found.load == pytest.approx(problem.load(()) * 0.9 ** len(best.layout))
    assert evaluator.counts.blasts <= 9


def test_without_a_blast_there_is_none_to_show() -> None:
    with pytest.raises(BlastEnvError, match="engine 'shade' predicts loads without a blast"):
        blast_env.simulate(COURTYARD, WALL, engine="shade")
    with pytest.raises(BlastEnvError, match="shade"):
        gym.make("BlastSimulator-v0", scenario="courtyard", engine="shade")


def test_a_scenario_that_counts_peaks_is_refused_where_it_knows_none() -> None:
    peaks = COURTYARD.model_copy(
        update={"objective": COURTYARD.objective.model_copy(update={"quantity": "peak"})}
    )
    with pytest.raises(BlastEnvError, match="engine 'shade' knows no overpressure"):
        BlastEvaluator(peaks, "shade")
