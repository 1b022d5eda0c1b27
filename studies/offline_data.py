"""Write episodes of rules, random layouts and a trained agent as a data set of Minari.

`python -m studies.offline_data --scenario control_room` needs `pip install blast-env[datasets]`.
"""

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Final

import gymnasium as gym
import numpy as np
import typer

from blast_env.answers.terminal import print_line
from blast_env.cli.output import progress_bar, user_errors
from blast_env.design.search import layouts_by_rule
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.errors import import_extra
from blast_env.evaluation import SeedRange
from blast_env.values import whole_number

KINDS: Final = ("rules", "random", "agent")
"""Whose episodes there are, in turn; the agent only if a run is given."""

_FIRST: Final = SeedRange.TRAINING.value.start


def actions_of(env: BlastBarrierEnv, kind: str, number: int, agent: Any = None) -> Iterator[int]:
    """Yield the actions of one episode, each from the state that those before it have left.

    Args:
        env: The environment after `reset`, with `action="place"`.
        kind: One of `KINDS`.
        number: Number of the episode: rules take turns.
        agent: The trained agent, for `"agent"`.
    """
    catalogue, rng = env.placement.catalogue, np.random.default_rng(number)
    if kind == "rules":
        layouts = [*layouts_by_rule(env.placement.scenario).values()]
        for element in layouts[number % len(layouts)]:
            yield catalogue.action(element)
        yield catalogue.finish
    while True:
        if kind == "agent":
            observation = env.episodes.observe([0], env.observation_space)[0]
            yield int(agent.predict(observation, action_masks=env.action_masks())[0])
        else:
            yield int(rng.choice(np.flatnonzero(env.action_masks())))


def record(
    env: gym.Env[Any, Any],
    episodes: int,
    kinds: tuple[str, ...],
    agent: Any,
    progress: Any,
) -> dict[str, list[float]]:
    """Play episodes of the kinds in turn; return the reductions of each kind."""
    inner = env.unwrapped
    assert isinstance(inner, BlastBarrierEnv)
    found: dict[str, list[float]] = {kind: [] for kind in kinds}
    for number in range(episodes):
        kind = kinds[number % len(kinds)]
        env.reset(seed=_FIRST + number)
        for action in actions_of(inner, kind, number // len(kinds), agent):
            *_, terminated, truncated, info = env.step(np.int64(action))
            if terminated or truncated:
                found[kind].append(float(info["reduction"]))
                break
        progress((number + 1) / episodes)
    return found


def main(
    scenario: Annotated[str, typer.Option(help="Bundled name, path or item_sites.")] = "courtyard",
    engine: Annotated[str, typer.Option(help="Engine of the blasts.")] = "surrogate",
    episodes: Annotated[int, typer.Option(help="How many.")] = 300,
    run: Annotated[Path | None, typer.Option(help="Run of `train` whose agent plays.")] = None,
    name: Annotated[str, typer.Option(help="Name of the data set.")] = "blast/barrier-v0",
) -> None:
    """Play and write the data set into Minari's folder; print what it holds."""
    with user_errors(), import_extra("datasets", "data set of Minari"):
        from minari import DataCollector

        agent = None
        if run is not None:
            from blast_agents.training import load_agent

            agent = load_agent(run)
        kinds = KINDS if agent is not None else KINDS[:-1]
        whole_number("episodes", episodes, len(kinds), 1_000_000)
        env = gym.make(
            "BlastBarrier-v0",
            scenario=scenario,
            engine=engine,
            observation="features",
            action="place",
        )
        collector = DataCollector(env, record_infos=True)
        with progress_bar("episodes") as progress:
            found = record(collector, episodes, kinds, agent, progress)
        with warnings.catch_warnings():
            # Author and address are for whoever publishes it; Minari asks for them.
            warnings.simplefilter("ignore", UserWarning)
            data = collector.create_dataset(
                dataset_id=name,
                algorithm_name=", ".join(kinds),
                description=f"{episodes} episodes on {scenario}, loads by the engine {engine}",
            )
        collector.close()
        for kind, reductions in found.items():
            print_line(f"{kind}: {len(reductions)} episodes, {100 * np.mean(reductions):.1f} %")
        print_line(f"{data.total_steps:,} steps in {data.total_episodes} episodes: {name}")


if __name__ == "__main__":
    typer.run(main)
