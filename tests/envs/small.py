"""Small scenarios and thin blasts, which take little time, to test the barrier environment."""

from dataclasses import dataclass, replace
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.utils.env_checker import data_equivalence

from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.envs.strategies import ScenarioSource
from blast_env.evaluation.engines import ParticleEngine
from blast_env.evaluation.engines.particles import EventEngine
from blast_env.particles import Balls, BlastRun, CollisionType, Scene
from blast_env.site import Scenario, load_scenario
from tests import builders
from tests.builders import block, point, site_document, square

# Whatever the bundled scenarios use: other parameters would have no calibration.
_MODEL = load_scenario("courtyard")


@dataclass(frozen=True)
class ThinEngine(ParticleEngine):
    """Runs scenes without air and with every tenth ball of the charge: a blast in some 2 ms."""

    name: str = EventEngine().name
    version: str = EventEngine().version

    def start(self, scene: Scene) -> BlastRun:
        """Return a run of what is left of the scene."""
        balls = scene.balls
        kept = (balls.kind == CollisionType.ExplosionBall).nonzero()[0][::10]
        thin = Balls(
            kind=balls.kind[kept],
            position=balls.position[kept],
            velocity=balls.velocity[kept],
            mass=balls.mass[kept],
            radius=balls.radius[kept],
        )
        return EventEngine().start(replace(scene, balls=thin))


def small_document(**zone: Any) -> dict[str, Any]:
    """Return a document with two protected structures and another one, and a zone of 8 x 5."""
    road = {"kind": "segment", "start_m": (3.0, 6.0), "end_m": (3.0, 12.0), "tnt_kg": 100.0}
    hydrant = {"corner_m": (7.0, 9.0), "size_m": (1.0, 0.5), "reason": "hydrant"}
    return site_document(
        "small",
        (19.0, 18.0),
        [road | {"weight": 2.0}, point(8.5, 16.0, 20.0)],
        block("shed", 11.0, 14.0, 2, 4),
        block("house", 14.0, 5.0, 12, 4, protected=True, weight=2.0),
        square("store", 12.0, 1.0, 3, protected=True),
        build_zone=builders.zone(7.0, 7.0, 8, 5, stock=3, keep_outs=[hydrant]) | zone,
        calibration=_MODEL.calibration,
        simulation=_MODEL.simulation.model_dump(),
    )


def small_scenario(**zone: Any) -> Scenario:
    """Return the small scenario, with changes to its build zone."""
    return Scenario.model_validate(small_document(**zone))


def restricted_scenario() -> Scenario:
    """Return a small scenario with every condition that a build zone can have."""
    return small_scenario(
        corner_m=(7.0, 6.0),
        rows=14,
        columns=10,
        stock=12,
        clearance_m=1.0,
        cost_areas=[
            {"corner_m": (7.0, 6.0), "size_m": (2.5, 4.0), "reason": "rock", "module_cost": 2.5}
        ],
        budget=14.0,
        access_way={"width_m": 1.0, "between": "left_right"},
    )


def make(scenario: Scenario | ScenarioSource | None = None, **arguments: Any) -> BlastBarrierEnv:
    """Return an environment with one thin blast a charge, of the small scenario unless given.

    Its actions are numbers of cells, which tests write in one.
    """
    defaults: dict[str, Any] = {
        "scenario": scenario or small_scenario(),
        "action": "place",
        "realisations": 1,
        "engine": ThinEngine(),
    }
    arguments = defaults | arguments
    env = gym.make("BlastBarrier-v0", **arguments).unwrapped
    assert isinstance(env, BlastBarrierEnv)
    return env


def play(env: gym.Env, seed: int, policy_seed: int = 0, **options: Any) -> list[tuple]:
    """Return what every step of an episode of random legal actions returned, `reset` first."""
    rng = np.random.default_rng(policy_seed)
    observation, info = env.reset(seed=seed, options=options)
    steps: list[tuple] = [(observation, 0.0, False, False, info)]
    while not steps[-1][2]:
        mask = steps[-1][4]["action_mask"]
        steps.append(env.step(legal_action(env.action_space, mask, rng)))
    return steps


def legal_action(space: spaces.Space[Any], mask: np.ndarray, rng: np.random.Generator) -> Any:
    """Return a random action that the mask allows, of a vector number by number."""
    if isinstance(space, spaces.Discrete):
        return rng.choice(np.flatnonzero(mask))
    assert isinstance(space, spaces.MultiDiscrete)
    parts = np.split(mask, np.cumsum(space.nvec)[:-1])
    return np.array([rng.choice(np.flatnonzero(part)) for part in parts])


def same(first: Any, second: Any) -> bool:
    """Whether two things that an environment gave are equal to the last bit."""
    return data_equivalence(first, second, exact=True)


def batch_as_singles(**options: Any) -> gym.vector.VectorEnv:
    """Return a batch of three that gave in 12 steps what single environments give."""
    batch, singles = (
        gym.make_vec("BlastBarrier-v0", 3, vectorization_mode=mode, **options)
        for mode in ("vector_entry_point", "sync")
    )
    assert batch.action_space == singles.action_space
    assert batch.single_observation_space == singles.single_observation_space
    assert {batch.unwrapped.suggestions} == {*singles.get_attr("suggestions")}  # type: ignore[attr-defined]
    assert all(same(batch.unwrapped.finish, its) for its in singles.get_attr("finish"))  # type: ignore[attr-defined]
    assert same(batch.reset(seed=5)[0], singles.reset(seed=5)[0])
    batch.action_space.seed(1)
    for _ in range(12):
        actions = batch.action_space.sample()
        one, other = batch.step(actions), singles.step(actions)
        assert all(same(mine, its) for mine, its in zip(one[:4], other[:4], strict=True))
        assert same(one[4]["action_mask"], other[4]["action_mask"])
    return batch


def watch(env: gym.Env, seed: int, **options: object) -> tuple[list, list[float], dict]:
    """Return the observations, the rewards and the last information of an episode of a blast."""
    observation, info = env.reset(seed=seed, options=options)
    observations, rewards, ended = [observation], [], False
    while not ended:
        observation, reward, ended, truncated, info = env.step(0)
        assert not truncated
        observations.append(observation)
        rewards.append(float(reward))
    return observations, rewards, info
