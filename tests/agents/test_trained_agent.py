"""A trained agent proposes legal layouts at once, and loading one never runs code."""

from dataclasses import replace
from pathlib import Path
from shutil import copytree
from typing import Any

import numpy as np
import pytest
import torch
from blast_agents.policies.spatial import SpatialPolicy
from blast_agents.training import PolicyAgent, load_agent, load_archive, resume, train
from blast_agents.training.agent import logits_of, policy_for
from blast_agents.training.run_folder import RunConfiguration, RunFolder, TrainingSettings
from blast_agents.training.weights import read_parameters
from gymnasium import spaces
from stable_baselines3.common.save_util import save_to_zip_file

from blast_env import load_scenario
from blast_env.design.search import LayoutAgent
from blast_env.envs.observable import Observable
from blast_env.envs.planes import GridObservation
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.layout import LayoutState
from blast_env.site import Charge, PointSource, Scenario
from tests.agents.training_runs import hyperparameters, scenario_file, settings, small_scenario

CHARGES = (Charge((2.0, 5.5), 100.0), Charge((2.0, 8.5), 100.0), None)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run that is finished; not to be changed."""
    folder = tmp_path_factory.mktemp("run")
    train(settings(scenario_file(folder), steps=16), hyperparameters(), folder / "run")
    return folder / "run"


def untrained(scenario: Scenario) -> PolicyAgent:
    zone = scenario.zone
    torch.manual_seed(0)
    chosen = hyperparameters().model_copy(
        update={
            "policy_kwargs": hyperparameters().policy_kwargs.model_copy(
                update={"rows": zone.rows, "columns": zone.columns, "width": 24}
            )
        }
    )
    configuration = RunConfiguration(
        settings=TrainingSettings(algorithm="maskable_ppo", scenario="any", steps=1),
        hyperparameters=chosen,
        scenario_hash=scenario.content_hash,
    )
    return PolicyAgent(policy_for(configuration, scenario), scenario)


def test_proposals_are_legal_and_always_the_same(run: Path) -> None:
    agent: LayoutAgent = load_agent(run)
    for charge in CHARGES:
        layout = agent.propose(small_scenario(), charge)
        assert LayoutState.of(small_scenario(), layout).cells == layout
        assert layout == load_agent(run).propose(small_scenario(), charge)


@pytest.mark.parametrize("name", ["courtyard", "perimeter_gate", "street_junction"])
def test_proposals_keep_every_condition_of_a_bundled_site(name: str) -> None:
    """Budget, clearance, access way and no-build areas, by an agent that knows nothing of them."""
    scenario = load_scenario(name)
    layout = untrained(scenario).propose(scenario)
    assert LayoutState.of(scenario, layout).cells == layout


def test_an_agent_needs_no_calibration() -> None:
    scenario = load_scenario("courtyard")
    unprotected = scenario.model_copy(update={"calibration": None})
    agent = untrained(scenario)
    assert agent.propose(unprotected) == agent.propose(scenario)
    with pytest.raises(UnknownNameError, match="did you mean 'grid'"):
        replace(agent, observation="gird")


SPATIAL = "blast_agents.policies.spatial.SpatialMaskablePolicy"


@pytest.mark.parametrize(
    ("observation", "policy"),
    [("grid", SPATIAL), ("grid", "MlpPolicy"), ("features", "MlpPolicy")],
)
def test_an_agent_of_another_observation_learns_is_chosen_and_proposes(
    observation: str, policy: str, tmp_path: Path
) -> None:
    chosen = settings(scenario_file(tmp_path), steps=16, observation=observation)
    result = train(chosen, hyperparameters({"policy": policy}), tmp_path / "run")
    assert len(result.evaluations) == 1
    agent = load_agent(tmp_path / "run")
    assert agent.observation == observation
    for charge in CHARGES:
        layout = agent.propose(small_scenario(), charge)
        assert layout == LayoutState.of(small_scenario(), layout).cells


def test_the_spatial_policy_finds_channels_by_their_names() -> None:
    """Planes in another order are the same site."""
    scenario = load_scenario("courtyard")
    space = GridObservation().space(scenario)
    assert isinstance(space, spaces.Box)
    channels = GridObservation.channels
    policies = []
    for names in (channels, channels[::-1]):
        torch.manual_seed(0)
        policies.append(
            SpatialPolicy(
                space,
                spaces.Discrete(641),
                lambda _: 1e-3,
                rows=40,
                columns=16,
                width=8,
                channels=names,
            )
        )
    charge = PointSource(position_m=(5.0, 12.0), tnt_kg=100.0)
    observable = Observable(scenario, (charge,))
    seen = GridObservation().episode(observable).observe(LayoutState.empty(scenario))
    planes = torch.as_tensor(seen)[None]
    logits = logits_of(policies[0], planes)
    torch.testing.assert_close(logits_of(policies[1], planes.flip(1)), logits)


def test_a_policy_that_looks_at_planes_is_refused_where_there_are_none(tmp_path: Path) -> None:
    chosen = settings(scenario_file(tmp_path), observation="features")
    with pytest.raises(BlastEnvError, match=r"must be one of MlpPolicy for .* 'features'"):
        train(chosen, hyperparameters(), tmp_path / "run")


def test_samples_differ_and_follow_from_their_seed(run: Path) -> None:
    agent = load_agent(run)
    layouts = agent.sample(small_scenario(), CHARGES[0], count=6, seed=1)
    assert len(set(layouts)) > 1
    assert layouts == agent.sample(small_scenario(), CHARGES[0], count=6, seed=1)
    assert layouts != agent.sample(small_scenario(), CHARGES[0], count=6, seed=2)
    for layout in layouts:
        assert LayoutState.of(small_scenario(), layout).cells == layout
    for wrong, said in ({"count": 0}, "count is 0"), ({"count": 2.5}, "count is 2.5"):
        with pytest.raises(BlastEnvError, match=said):
            agent.sample(small_scenario(), **wrong)
    with pytest.raises(BlastEnvError, match="seed is -1"):
        agent.sample(small_scenario(), seed=-1)


def test_names_of_weights_and_algorithms_are_checked(run: Path) -> None:
    """Any other name had meant the last weights, or MaskablePPO."""
    wrong: Any = "Best"
    with pytest.raises(BlastEnvError, match="no weights 'Best', did you mean 'best'"):
        load_agent(run, wrong)
    wrong = "PPO"
    with pytest.raises(BlastEnvError, match="no algorithm 'PPO'"):
        load_archive(run / "best_model.zip", wrong, small_scenario(), trust_archive=True)


def test_the_charge_is_seen_when_it_is_told() -> None:
    scenario = load_scenario("courtyard")
    agent = untrained(scenario)
    layouts = {agent.propose(scenario, Charge((5.0, y_m), 100.0)) for y_m in (7.0, 15.0, 23.0)}
    assert len(layouts | {agent.propose(scenario)}) > 1
    with pytest.raises(BlastEnvError, match="must keep clear"):
        agent.propose(scenario, Charge((29.0, 15.0), 100.0))


def test_a_scenario_of_another_size_is_refused(run: Path) -> None:
    with pytest.raises(BlastEnvError, match="must be"):
        load_agent(run).propose(load_scenario("courtyard"))


def test_best_and_last_weights_can_be_told_apart(run: Path, tmp_path: Path) -> None:
    copy = RunFolder(Path(copytree(run, tmp_path / "run")))
    (last,) = copy.checkpoints.values()
    parameters = read_parameters(last)
    for values in parameters["policy"].values():
        values.zero_()
    save_to_zip_file(last, params=parameters)
    weights = load_agent(copy.path, "last").policy.state_dict()
    assert all(not values.any() for values in weights.values())
    assert any(values.any() for values in load_agent(copy.path).policy.state_dict().values())


class _Exploit:
    """What a pickle may do: make a file when it is read."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        return Path.touch, (self.path,)


def test_code_among_the_tensors_of_a_run_does_not_run(run: Path, tmp_path: Path) -> None:
    copy = RunFolder(Path(copytree(run, tmp_path / "run")))
    victim = tmp_path / "victim"
    save_to_zip_file(copy.best_model, params={"policy": {"a": _Exploit(victim)}})
    with pytest.raises(BlastEnvError, match="damaged"):
        load_agent(copy.path)
    assert not victim.exists()


def test_code_beside_the_tensors_of_a_run_does_not_run(run: Path, tmp_path: Path) -> None:
    """Libraries that load the whole archive do run it."""
    copy = RunFolder(Path(copytree(run, tmp_path / "run")))
    victim = tmp_path / "victim"
    (last,) = copy.checkpoints.values()
    for path in (copy.best_model, last):
        save_to_zip_file(path, {"a": _Exploit(victim)}, read_parameters(path))
    charge = CHARGES[0]
    expected = load_agent(run).propose(small_scenario(), charge)
    assert load_agent(copy.path).propose(small_scenario(), charge) == expected
    arguments = copy.path / "BlastBarrier-v0" / "args.yml"
    arguments.write_text(arguments.read_text().replace("steps: 16\n", "steps: 17\n"))
    assert resume(copy.path).evaluations[-1].timesteps == 32
    assert not victim.exists()
    with pytest.raises(BlastEnvError, match="cannot be read"):
        load_archive(path, "maskable_ppo", small_scenario(), trust_archive=True)
    assert victim.exists()


def test_an_archive_needs_trust(run: Path) -> None:
    archive = run / "best_model.zip"
    with pytest.raises(BlastEnvError, match="pickled code"):
        load_agent(archive)
    with pytest.raises(BlastEnvError, match="trust_archive is False, must be True"):
        load_archive(archive, "maskable_ppo", small_scenario())
    agent = load_archive(archive, "maskable_ppo", small_scenario(), trust_archive=True)
    charge = CHARGES[0]
    expected = load_agent(run).propose(small_scenario(), charge)
    assert agent.propose(small_scenario(), charge) == expected
    with pytest.raises(BlastEnvError, match=r"observation_space is .* must be .* 'courtyard'"):
        load_archive(archive, "maskable_ppo", "courtyard", trust_archive=True)


def test_what_is_no_archive_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "model.zip"
    path.write_bytes(np.arange(64, dtype=np.uint8).tobytes())
    with pytest.raises(BlastEnvError, match="cannot be read"):
        load_archive(path, "ppo", small_scenario(), trust_archive=True)
    with pytest.raises(
        BlastEnvError, match=r"none\.zip: cannot be read: .*No such file .*none\.zip'$"
    ):
        load_archive(tmp_path / "none.zip", "ppo", small_scenario(), trust_archive=True)
