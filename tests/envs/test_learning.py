"""Plain PPO, with the defaults of its library, learns the environment in a thousand steps."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv

from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.evaluation import BlastLoads, StructureLoad
from blast_env.geometry import Element
from blast_env.layout import charge_against
from blast_env.site import AnyCharge, Scenario
from tests.envs.small import small_document
from tests.evaluation.engines.shade import ShadeEngine

ENVIRONMENTS = 16
STEPS = 64
"""Of each environment."""

HELD_OUT = range(10_000, 10_024)
LEAST_LEAD = 0.05
"""Over random actions and first weights. Of ten seeds the least lead over random is 0.22."""


@dataclass(frozen=True)
class SightEngine(ShadeEngine):
    """A formula instead of a blast, as quick as the environment itself.

    A module takes 30 % off the load of a structure if it is within 1 m of the line from the charge
    to the structure's centre.
    """

    share: float = 0.7

    def loads(
        self, scenario: Scenario, layout: Sequence[Element], charge: AnyCharge, seed: int
    ) -> BlastLoads:
        """Return 1,000 Pa s on each structure, less what modules take off."""
        start = np.array(charge_against(scenario, layout, charge).position_m)
        x_m, y_m = scenario.zone.centres_m
        places = np.array([(x_m[cell[:2]], y_m[cell[:2]]) for cell in layout]).reshape(-1, 2)
        loads = []
        for structure in scenario.structures:
            along = np.array(structure.rectangle_m.centre) - start
            across = np.array([-along[1], along[0]]) / np.hypot(*along)
            beside_m = (places - start) @ across
            left = self.share ** int((np.abs(beside_m) < 1.0).sum())
            loads.append(
                StructureLoad.on(structure, 1000.0 * left, notes=("a formula, not a blast",))
            )
        modules = [structure.rows * structure.columns for structure in scenario.structures]
        return BlastLoads(tuple(loads), np.repeat([load.impulse_pa_s for load in loads], modules))


def environment() -> BlastBarrierEnv:
    """Return an environment with a building, a shed beside it, and a charge on 2 m of road."""
    document = small_document(stock=4)
    document["charge"] = [{**document["charge"][0], "start_m": (3.0, 8.0), "end_m": (3.0, 10.0)}]
    document["structures"] = document["structures"][:2]
    scenario = Scenario.model_validate(document)
    return BlastBarrierEnv(scenario, observation="features", engine=SightEngine(), realisations=1)


def reduction(env: BlastBarrierEnv, agent: PPO | None) -> float:
    """Return the mean reduction on held-out threats by an agent, or by random actions."""
    rng, reductions = np.random.default_rng(0), []
    for seed in HELD_OUT:
        observation, _ = env.reset(seed=seed)
        ended = False
        while not ended:
            action: Any
            if agent is None:
                action = rng.integers(env.action_space.nvec)  # type: ignore[attr-defined]
            else:
                action = agent.predict(observation, deterministic=True)[0]
            observation, _, ended, _, info = env.step(action)
        reductions.append(info["reduction"])
    return float(np.mean(reductions))


@pytest.fixture
def one_thread() -> Iterator[None]:
    """Threads of torch wait for each other longer than such small networks take."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.mark.usefixtures("one_thread")
@pytest.mark.slow
def test_it_learns_with_the_defaults_of_the_library() -> None:
    """Deterministic and without a mask: it does not get stuck on an occupied cell.

    But for environments in step, whose actions cost one pass of the network, all is as it comes.
    Some first weights are as good as what is learnt; those of this seed take nothing off.
    """
    env, together = environment(), DummyVecEnv([environment] * ENVIRONMENTS)
    agent = PPO("MlpPolicy", together, n_steps=STEPS, seed=3, device="cpu")
    random, untrained = reduction(env, None), reduction(env, agent)
    agent.learn(ENVIRONMENTS * STEPS)
    assert reduction(env, agent) > max(random, untrained) + LEAST_LEAD
