"""PPO and MaskablePPO with the defaults of their libraries on sites, beside the rules.

`python -m studies.first_hour` prints the tables of docs/researchers/training.md.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from time import process_time
from typing import Annotated, Any, Final

import gymnasium as gym
import numpy as np
import torch
import typer
from blast_agents import packaged_agent
from blast_agents.training import BatchVecEnv
from blast_agents.training.environments import ThreatPool
from matplotlib.figure import Figure
from sb3_contrib import MaskablePPO
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv

from blast_env.answers.terminal import print_line
from blast_env.arrays import FloatArray
from blast_env.design.search import layouts_by_rule
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.envs.strategies import Reward
from blast_env.envs.vector_env import BlastBarrierVectorEnv
from blast_env.evaluation.engines import Engine, find_engine
from blast_env.evaluation.evaluator import BlastStore
from blast_env.layout import charge_against
from blast_env.plots.figures import save_figure
from blast_env.site import AnyCharge, Charge, Scenario, VehicleCharge, VehicleSource
from blast_env.sites import FAMILIES, Ranges, SiteSource
from blast_env.statistics import mean_estimate
from blast_env.tables import markdown_table

HELD_OUT: Final = range(10_000, 10_048)
"""Seeds of the episodes of the judgement; gas dynamics judges the first ones."""

RANDOM: Final = "random"

SUGGESTED: Final = "random suggestions"

_EPISODES: Final = 100
"""Episodes in a mean of a curve."""

ROLLOUT: Final = 2048
"""Steps of a rollout, the default of both algorithms for one environment."""

Agent = PPO | MaskablePPO
KNOWN: Final[dict[str, type[Agent]]] = {
    algorithm.__name__: algorithm for algorithm in (PPO, MaskablePPO)
}


@dataclass(frozen=True)
class Setting:
    """What is learnt on; observations are the vector `"features"`.

    Attributes:
        scenario: The site, or a family of generated ones.
        engine: The engine of the training.
        reward: The reward.
        action: The action space.
        envs: Number of environments in a batch, which shorten the rollouts of each.
    """

    scenario: str
    engine: str = "event"
    reward: str | Reward = "terminal"
    action: str = "dimensions"
    envs: int = 1

    def environment(
        self, engine: Engine, realisations: int | None = None, cache: str | None = None
    ) -> BlastBarrierEnv:
        """Return the environment of the judgement, of a family on held-out sites."""
        store = BlastStore(cache, size=8192)
        return BlastBarrierEnv(**self._arguments(engine, "held_out", realisations), cache=store)

    def learning(self, seed: int) -> gym.Env[Any, Any] | VecEnv:
        """Return the environment of a training: noisy threats, and generated sites, are met again.

        Of generated sites each environment of the batch has 64.
        """
        engine = self.training
        arguments = self._arguments(engine, "training", 1)
        if self.envs == 1:
            env = BlastBarrierEnv(**arguments, cache=BlastStore(size=8192))
            return ThreatPool(env, 128, seed) if engine.has_noise or self.family else env
        batch = BlastBarrierVectorEnv(self.envs, "Disabled", **arguments)
        again = range(self.envs) if self.family else ()
        pools = [{"size": 64, "seed": self.envs * seed + index} for index in again]
        return BatchVecEnv(batch, pools)

    @property
    def family(self) -> Ranges | None:
        """The family of generated sites; `None` for a single one."""
        return FAMILIES.get(self.scenario)

    def _arguments(self, engine: Engine, sites: str, realisations: int | None) -> dict[str, Any]:
        scenario: str | SiteSource = self.scenario
        if self.family is not None:
            scenario = getattr(SiteSource, sites)(ranges=self.family)
        return {
            "scenario": scenario,
            "reward": self.reward,
            "observation": "features",
            "action": self.action,
            "engine": engine,
            "realisations": realisations,
        }

    @cached_property
    def training(self) -> Engine:
        """The engine of the training, as `gymnasium.make(engine=...)` has it."""
        return find_engine(self.engine)


class Curve(BaseCallback):
    """Keeps the reductions of a training's episodes.

    Attributes:
        steps: Steps of the training at the end of each episode (episodes,).
        reductions: The reduction in each (episodes,).
    """

    def __init__(self) -> None:
        super().__init__()
        self.steps: list[int] = []
        self.reductions: list[float] = []

    def _on_step(self) -> bool:
        for ended, info in zip(self.locals["dones"], self.locals["infos"], strict=True):
            if ended:
                self.steps.append(self.num_timesteps)
                self.reductions.append(info["reduction"])
        return True


def picture(curves: Mapping[str, Curve], levels: Mapping[str, float]) -> Figure:
    """Return a figure of the reductions in training over its steps, means of 100 episodes.

    Args:
        curves: What each training met, by its name.
        levels: Mean reductions of what does not learn, by its name.
    """
    figure = Figure(figsize=(7.5, 4.0), layout="constrained")
    axes = figure.subplots()
    for name, curve in curves.items():
        kernel = np.full(min(_EPISODES, len(curve.steps)), 1.0) / min(_EPISODES, len(curve.steps))
        means = np.convolve(100.0 * np.array(curve.reductions), kernel, mode="valid")
        axes.plot(curve.steps[len(kernel) - 1 :], means, label=name)
    for (name, level), style in zip(levels.items(), ("--", ":", "-."), strict=False):
        axes.axhline(100.0 * level, color="0.5", linestyle=style, label=name)
    axes.set_xlabel("steps of the training")
    axes.set_ylabel("load taken off (%)")
    axes.legend(fontsize="small")
    return figure


def trained(
    algorithm: str, setting: Setting, steps: int, seed: int, curve: Curve | None = None
) -> Agent:
    """Return an agent of the library's defaults; several environments share a rollout's steps."""
    shared: dict[str, Any] = {} if setting.envs == 1 else {"n_steps": ROLLOUT // setting.envs}
    env = setting.learning(seed)
    agent: Agent = KNOWN[algorithm]("MlpPolicy", env, seed=seed, device="cpu", **shared)
    agent.learn(steps, callback=curve)
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


def _known(scenario: Scenario, charge: Charge) -> AnyCharge:
    """Return a charge as rules know it: a vehicle goes to the worst place that a layout leaves."""
    for source in scenario.charge:
        if isinstance(source, VehicleSource):
            for rank in range(source.places):
                vehicle = VehicleCharge(source, rank)
                if charge_against(scenario, (), vehicle) == charge:
                    return vehicle
    return charge


def by_rules(env: BlastBarrierEnv, seeds: Sequence[int]) -> Iterator[tuple[str, FloatArray]]:
    """Yield each rule with its reduction in each held-out episode; without a layout it is 0."""
    found: dict[str, FloatArray] = {}
    for position, seed in enumerate(seeds):
        env.reset(seed=seed)
        scenario, finish = env.placement.scenario, env.placement.catalogue.finish
        (charge,) = env.step(finish)[-1]["charges"]
        for name, layout in layouts_by_rule(scenario, _known(scenario, charge)).items():
            env.reset(seed=seed, options={"layout": layout})
            *_, info = env.step(finish)
            found.setdefault(name, np.zeros(len(seeds)))[position] = info["reduction"]
    yield from found.items()


def by_packaged_agent(env: BlastBarrierEnv, seeds: Sequence[int]) -> FloatArray:
    """Return the reduction by the packaged agent's proposal in each held-out episode."""
    agent, found = packaged_agent(), []
    for seed in seeds:
        env.reset(seed=seed)
        scenario, finish = env.placement.scenario, env.placement.catalogue.finish
        (charge,) = env.step(finish)[-1]["charges"]
        layout = agent.propose(scenario, _known(scenario, charge))
        env.reset(seed=seed, options={"layout": layout})
        found.append(env.step(finish)[-1]["reduction"])
    return np.array(found)


@dataclass(frozen=True, eq=False)
class Judgement:
    """What an engine says of methods on the held-out threats of a site.

    Attributes:
        site: The site.
        judge: Name of the engine.
        rules: Reductions by each rule (threats,).
        random: Those by random legal actions.
        trained: Those by each trained agent, by its name: algorithm, seed, cost.
        others: Those by any other method.
        charges: How many of the threats differ; fixed charges of a site are drawn again and again.
    """

    site: str
    judge: str
    rules: Mapping[str, FloatArray]
    random: FloatArray
    trained: Mapping[str, FloatArray]
    others: Mapping[str, FloatArray] = field(default_factory=dict)
    charges: int | None = None

    @cached_property
    def best_rule(self) -> FloatArray:
        """The reductions by the rule of the largest mean."""
        return max(self.rules.values(), key=lambda rule: float(rule.mean()))

    @cached_property
    def best_of_each(self) -> FloatArray:
        """The reductions by the best rule of each threat, which takes blasts of all to know."""
        best: FloatArray = np.max([*self.rules.values()], axis=0)
        return best

    @property
    def levels(self) -> dict[str, float]:
        """The mean reductions of what does not learn."""
        random = {"random legal actions": self.random}
        if SUGGESTED in self.others:
            random[SUGGESTED] = self.others[SUGGESTED]
        shown = {"the best rule": self.best_rule, **random}
        return {name: float(item.mean()) for name, item in shown.items()}

    def of(self, algorithm: str) -> FloatArray:
        """Return the reductions by the agents of an algorithm (agents, threats)."""
        named = (item for name, item in self.trained.items() if name.split(",")[0] == algorithm)
        return np.array([*named])

    def lines(self) -> Iterator[str]:
        """Yield a line for each method: mean, 95 % interval, and lead over the best rule."""
        different = "" if self.charges is None else f", of which {self.charges} differ"
        yield f"{self.site}, judged by {self.judge} on {len(self.random)} threats{different}"
        for name, item in (*self.rules.items(), (RANDOM, self.random)):
            yield f"{name}: {_mean(item)}"
        yield f"the best rule of each: {_mean(self.best_of_each)}"
        for name, item in (*self.others.items(), *self.trained.items()):
            leads = {"the best rule": self.best_rule, "the best rule of each": self.best_of_each}
            shown = (f"{_lead(item - beside)} on {what}" for what, beside in leads.items())
            yield f"{name}: {_mean(item)}; {'; '.join(shown)}"

    def row(self) -> tuple[str, ...]:
        """Return the row of the site in the table: means over threats and seeds, %."""
        cells = [self.site, self.judge, f"{100.0 * self.random.mean():.1f}"]
        suggested = self.others.get(SUGGESTED)
        cells.append("" if suggested is None else f"{100.0 * suggested.mean():.1f}")
        for algorithm, beside in zip(KNOWN, (self.random, self.best_rule), strict=True):
            found = self.of(algorithm)
            if algorithm == "MaskablePPO":
                cells.append(f"{100.0 * self.best_rule.mean():.1f}")
            if not len(found):
                cells += ["", ""]
                continue
            means = 100.0 * found.mean(axis=1)
            ends = f" ({means.min():.1f} to {means.max():.1f})" if len(means) > 1 else ""
            cells += [
                f"{means.mean():.1f}{ends}",
                f"{100.0 * (found - beside).mean():+.1f}",
            ]
        return tuple(cells)


HEADERS: Final = (
    "site",
    "judged by",
    "random",
    "random suggestions",
    "PPO",
    "its lead on random",
    "best rule",
    "MaskablePPO",
    "its lead on the best rule",
)


def _lead(of_episodes: FloatArray) -> str:
    more, least, most = mean_estimate(of_episodes).scaled(100.0)
    return f"{more:+.1f} points ({least:.1f} to {most:.1f})"


def _mean(of_episodes: FloatArray) -> str:
    value, low, _ = mean_estimate(of_episodes).scaled(100.0)
    return f"{value:.1f} % +- {value - low:.1f}"


def judged(
    setting: Setting,
    engine: Engine,
    agents: Mapping[str, Agent],
    seeds: Sequence[int],
    cache: str | None = None,
) -> Judgement:
    """Return what an engine says of agents, rules and random actions."""
    env = setting.environment(engine, cache=cache)
    flat = replace(setting, action="place").environment(engine, cache=cache)
    others = {}
    if setting.action == "row":
        others["the nearest row again and again"] = reductions(env, 0, seeds)
    if setting.action == "suggestion":
        others[SUGGESTED] = reductions(env, None, seeds)
    if setting.family is not None:
        others["packaged agent"] = by_packaged_agent(flat, seeds)
    return Judgement(
        setting.scenario,
        engine.name,
        dict(by_rules(flat, seeds)),
        reductions(flat, None, seeds),
        {name: reductions(env, agent, seeds) for name, agent in agents.items()},
        others,
        different_threats(flat, seeds),
    )


def different_threats(env: BlastBarrierEnv, seeds: Sequence[int]) -> int:
    """Return how many threats of seeds differ, with their sites."""
    met = set()
    for seed in seeds:
        _, info = env.reset(seed=seed)
        met.add((info["scenario_hash"], env.observable.sources))
    return len(met)


def main(
    steps: Annotated[int, typer.Option(help="Steps of the environment in a training.")] = 20_480,
    algorithm: Annotated[
        list[str] | None, typer.Option(help="PPO or MaskablePPO; may be given again.")
    ] = None,
    scenario: Annotated[
        list[str] | None,
        typer.Option(help="A site, courtyard by default, or a family; may be given again."),
    ] = None,
    engine: Annotated[str, typer.Option(help="Engine of the training.")] = "event",
    reward: Annotated[str, typer.Option(help="Reward.")] = "terminal",
    action: Annotated[str, typer.Option(help="Action space.")] = "dimensions",
    envs: Annotated[int, typer.Option(help="Environments in a batch of the training.")] = 1,
    seeds: Annotated[int, typer.Option(help="Trainings of each.")] = 3,
    threats: Annotated[int, typer.Option(help="Threats of the judgement.")] = len(HELD_OUT),
    by_gas: Annotated[int, typer.Option(help="Threats that gas dynamics judges, too.")] = 12,
    cache: Annotated[str | None, typer.Option(help="Folder for the blasts of gas.")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Picture of the first training of each algorithm.")
    ] = None,
) -> None:
    """Train, and judge on held-out threats: a line for each method, then a row for each site."""
    torch.set_num_threads(1)
    rows, gas = [], find_engine("gas")
    for site in scenario or ["courtyard"]:
        setting = Setting(site, engine, reward, action, envs)
        agents: dict[str, Agent] = {}
        curves: dict[str, Curve] = {}
        for kind in algorithm or KNOWN:
            for seed in range(seeds):
                began_s = process_time()
                curve = curves.setdefault(kind, Curve()) if seed == 0 else None
                agent = trained(kind, setting, steps, seed, curve)
                agents[f"{kind}, seed {seed}, {process_time() - began_s:.0f} CPU s"] = agent
        for judge, count, kept in ((setting.training, threats, None), (gas, by_gas, cache)):
            if count:
                judgement = judged(setting, judge, agents, HELD_OUT[:count], kept)
                for line in judgement.lines():
                    print_line(line)
                rows.append(judgement.row())
                if out is not None and judge is not gas:
                    save_figure(picture(curves, judgement.levels), out)
    print_line("\nReductions, %:\n\n" + markdown_table(HEADERS, rows))


if __name__ == "__main__":
    typer.run(main)
