"""PPO and MaskablePPO with the defaults of their libraries on a site, beside the rules.

`python -m studies.first_hour` prints the tables of docs/researchers/training.md.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from time import process_time
from typing import Annotated, Any, Final

import gymnasium as gym
import numpy as np
import torch
import typer
from blast_agents.training.environments import ThreatPool
from sb3_contrib import MaskablePPO
from stable_baselines3 import PPO

from blast_env.answers.terminal import print_line
from blast_env.arrays import FloatArray
from blast_env.design.search import layouts_by_rule
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.evaluation.engines import Engine, find_engine
from blast_env.evaluation.store import BlastStore
from blast_env.statistics import mean_estimate

HELD_OUT: Final = range(10_000, 10_048)
"""Seeds of the episodes of the judgement; gas dynamics judges the first ones."""

Agent = PPO | MaskablePPO
KNOWN: Final[dict[str, type[Agent]]] = {
    algorithm.__name__: algorithm for algorithm in (PPO, MaskablePPO)
}


@dataclass(frozen=True)
class Setting:
    """What is learnt on; observations are the vector `"features"`.

    Attributes:
        scenario: The site.
        engine: The engine of the training.
        reward: The reward.
        action: The action space.
    """

    scenario: str
    engine: str
    reward: str
    action: str

    def environment(
        self, engine: Engine, realisations: int | None = None, cache: str | None = None
    ) -> BlastBarrierEnv:
        """Return the environment with an engine."""
        return BlastBarrierEnv(
            self.scenario,
            reward=self.reward,
            observation="features",
            action=self.action,
            engine=engine,
            realisations=realisations,
            cache=BlastStore(cache, size=8192),
        )

    @cached_property
    def training(self) -> Engine:
        """The engine of the training, as `gymnasium.make(engine=...)` has it."""
        return find_engine(self.engine)


def trained(algorithm: str, setting: Setting, steps: int, seed: int) -> Agent:
    """Return an agent of the library's defaults; a noisy engine has 128 threats, met again."""
    env: gym.Env[Any, Any] = setting.environment(setting.training, realisations=1)
    if setting.training.has_noise:
        env = ThreatPool(env, 128, seed)
    agent: Agent = KNOWN[algorithm]("MlpPolicy", env, seed=seed, device="cpu")
    agent.learn(steps)
    return agent


def reductions(env: BlastBarrierEnv, agent: Agent | int | None, seeds: Sequence[int]) -> FloatArray:
    """Return the reduction in each episode by an agent, an action, or random legal actions."""
    found, rng = [], np.random.default_rng(0)
    for seed in seeds:
        observation, info = env.reset(seed=seed)
        ended = False
        while not ended:
            action: Any = agent
            if agent is None:
                action = rng.choice(np.flatnonzero(info["action_mask"]))
            elif isinstance(agent, MaskablePPO):
                masks = env.action_masks()
                action, _ = agent.predict(observation, deterministic=True, action_masks=masks)
            elif isinstance(agent, PPO):
                action, _ = agent.predict(observation, deterministic=True)
            observation, _, ended, _, info = env.step(action)
        found.append(info["reduction"])
    return np.array(found)


def by_rules(env: BlastBarrierEnv, seeds: Sequence[int]) -> Iterator[tuple[str, FloatArray]]:
    """Yield each rule with its reduction in each held-out episode."""
    found: dict[str, list[float]] = {}
    for seed in seeds:
        env.reset(seed=seed)
        scenario, finish = env.placement.scenario, env.placement.catalogue.finish
        (charge,) = env.step(finish)[-1]["charges"]
        for name, layout in layouts_by_rule(scenario, charge).items():
            env.reset(seed=seed, options={"layout": layout})
            *_, info = env.step(finish)
            found.setdefault(name, []).append(info["reduction"])
    for name, item in found.items():
        yield name, np.array(item)


def report(name: str, of_episodes: FloatArray, best: FloatArray | None = None) -> None:
    """Print a mean reduction with its 95 % interval, and the paired lead over the best rule."""
    value, low, _ = mean_estimate(of_episodes).scaled(100.0)
    lead = ""
    if best is not None:
        more, least, most = mean_estimate(of_episodes - best).scaled(100.0)
        lead = f"; {more:+.1f} points on the best rule ({least:.1f} to {most:.1f})"
    print_line(f"{name}: {value:.1f} % +- {value - low:.1f}{lead}")


def main(
    steps: Annotated[int, typer.Option(help="Steps of the environment in a training.")] = 20_480,
    algorithm: Annotated[
        list[str] | None, typer.Option(help="PPO or MaskablePPO; may be given again.")
    ] = None,
    scenario: Annotated[str, typer.Option(help="The site.")] = "courtyard",
    engine: Annotated[str, typer.Option(help="Engine of the training.")] = "event",
    reward: Annotated[str, typer.Option(help="Reward.")] = "terminal",
    action: Annotated[str, typer.Option(help="Action space.")] = "row",
    seeds: Annotated[int, typer.Option(help="Trainings of each.")] = 3,
    threats: Annotated[int, typer.Option(help="Threats of the judgement.")] = len(HELD_OUT),
    by_gas: Annotated[int, typer.Option(help="Threats that gas dynamics judges, too.")] = 12,
    cache: Annotated[str | None, typer.Option(help="Folder for the blasts of gas.")] = None,
) -> None:
    """Train, and judge on held-out threats; print one line for each rule and agent."""
    torch.set_num_threads(1)
    setting = Setting(scenario, engine, reward, action)
    agents: dict[str, Agent] = {}
    for kind in algorithm or KNOWN:
        for seed in range(seeds):
            began_s = process_time()
            agent = trained(kind, setting, steps, seed)
            agents[f"{kind}, seed {seed}, {process_time() - began_s:.0f} CPU s"] = agent
    for judge, judged in (
        (setting.training, HELD_OUT[:threats]),
        (find_engine("gas"), HELD_OUT[:by_gas]),
    ):
        if not judged:
            continue
        print_line(f"judged by {judge.name} on {len(judged)} threats")
        kept = cache if judge.name == "gas" else None
        env = setting.environment(judge, cache=kept)
        flat = replace(setting, action="place").environment(judge, cache=kept)
        rules = dict(by_rules(flat, judged))
        best = max(rules.values(), key=lambda rule: float(rule.mean()))
        for name, rule in rules.items():
            report(name, rule)
        if action == "row":
            report("the nearest row again and again", reductions(env, 0, judged), best)
        if judge is setting.training:
            report("random", reductions(flat, None, judged))
        for name, agent in agents.items():
            report(name, reductions(env, agent, judged), best)


if __name__ == "__main__":
    typer.run(main)
