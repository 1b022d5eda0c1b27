"""Policies in a zone with a catalogue: a logit for every piece, and agents that place them."""

from pathlib import Path

import pytest
import torch
from blast_agents.policies.features import Planes, ZoneGeometry
from blast_agents.policies.spatial import SpatialMaskablePolicy, ZoneExtractor
from blast_agents.training import load_agent, train
from blast_agents.training.agent import logits_of

from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.envs.planes import GridObservation
from blast_env.geometry import Piece
from blast_env.layout import LayoutState
from blast_env.site import Charge, save_scenario
from tests.agents.training_runs import hyperparameters, settings
from tests.catalogue_sites import ITEMS, yard
from tests.design.search_cases import CALIBRATION

CHARGE = Charge((2.0, 6.0), 5.0)


def yard_policy(width: int = 8) -> tuple[SpatialMaskablePolicy, BlastBarrierEnv]:
    env = BlastBarrierEnv(yard(), observation="grid", action="place", engine="gas")
    torch.manual_seed(0)
    policy = SpatialMaskablePolicy(
        env.observation_space,
        env.action_space,
        lambda _: 1e-3,
        rows=14,
        columns=6,
        width=width,
        channels=GridObservation().channels_of(yard()),
    )
    return policy, env


def test_the_policy_has_a_logit_for_every_piece() -> None:
    policy, env = yard_policy()
    planes, _ = env.reset(seed=0)
    logits = logits_of(policy, torch.as_tensor(planes)[None])
    assert logits.shape == (1, 4 * 14 * 6 + 1)
    assert logits.softmax(dim=1)[0, -1].item() < 1e-3


def test_the_policy_sees_heights_and_places_around_its_cells() -> None:
    policy, env = yard_policy()
    catalogue = yard().zone.catalogue
    features = policy.features_extractor
    assert isinstance(features, ZoneExtractor)

    def cell_features(*layout: Piece) -> torch.Tensor:
        planes, _ = env.reset(seed=0, options={"layout": layout})
        near = torch.as_tensor(planes)[None]
        named = Planes(near, tuple(features.channels))
        geometry = ZoneGeometry.of(named, 14, 6)
        own = [geometry.crop(named[name]) for name in features.around]
        return torch.stack(own, dim=1)

    unprotected, protected = cell_features(), cell_features(Piece(5, 1, "wall", True))
    assert features.around[2:] == GridObservation().channels_of(yard())[-4:]
    assert protected[0, 0, 5:8, 1].tolist() == pytest.approx([2.0 / 12.0] * 3, abs=0.002)
    legal = torch.as_tensor(LayoutState.empty(yard()).legal.astype("float32"))
    torch.testing.assert_close(unprotected[0, 2:], legal)
    assert catalogue.element(int(legal.flatten().argmax())) == Piece(0, 0, "wall")


def test_an_agent_is_trained_on_pieces_and_proposes_them(tmp_path: Path) -> None:
    scenario = yard(
        corner_m=(4.0, 4.5), rows=6, columns=3, items=ITEMS[::2], budget=14.0
    ).model_copy(update={"calibration": CALIBRATION})
    save_scenario(scenario, tmp_path / "yard.toml")
    folder = tmp_path / "run"
    train(settings(tmp_path / "yard.toml"), hyperparameters(), folder)
    agent = load_agent(folder)
    layout = agent.propose(scenario, CHARGE)
    assert LayoutState.of(scenario, layout).layout == layout
    assert agent.propose(scenario, CHARGE) == layout
    drawn = set(agent.sample(scenario, CHARGE, count=6, seed=1))
    assert len(drawn) > 1
    assert all(LayoutState.of(scenario, draw).layout == draw for draw in drawn)
