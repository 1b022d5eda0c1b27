"""Why plain PPO learned nothing by default: each cause taken away alone.

`python -m studies.causes` prints the tables of docs/researchers/training.md.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import typer

from blast_env.answers.terminal import print_line
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.envs.strategies import Transition
from blast_env.evaluation.engines import find_engine
from blast_env.evaluation.evaluator import Assessment
from blast_env.geometry import Layout
from blast_env.layout import LayoutState
from blast_env.plots.figures import save_figure
from blast_env.site import Catalogue, Scenario
from blast_env.statistics import Estimate, mean_estimate
from blast_env.units import PA_PER_PSI
from studies.first_hour import HELD_OUT, Curve, Setting, picture, reductions, trained


@dataclass(frozen=True)
class Deposit:
    """Minus the load, and a deposit that the first action pays and the end returns.

    Attributes:
        of_bare: The deposit as a multiple of the load without a barrier.
        in_psi_s: Whether the unit is psi s, otherwise the load without a barrier.
    """

    of_bare: float
    in_psi_s: bool

    def terms(self, scenario: Scenario) -> tuple[str, ...]:  # noqa: ARG002
        """Return `load` and `deposit`."""
        return "load", "deposit"

    def layouts(self, transition: Transition) -> Sequence[Layout]:
        """Return no barrier, at the beginning."""
        return ((),) if transition.begins else ()

    def __call__(
        self, transition: Transition, loads: Mapping[Layout, Assessment]
    ) -> Mapping[str, float]:
        """Return the terms."""
        found = {"load": 0.0, "deposit": 0.0}
        if not (transition.begins or transition.ended):
            return found
        bare = loads[()].load
        unit = PA_PER_PSI if self.in_psi_s else bare
        if transition.ended:
            found["load"] = -loads[transition.after].load / unit
        found["deposit"] = self.of_bare * bare / unit * (transition.ended - transition.begins)
        return found


def settings(scenario: str, engine: str) -> dict[str, Setting]:
    """Return what is learnt on: the former defaults, these without each cause, the present ones."""
    former = Setting(scenario, engine, Deposit(2.0, in_psi_s=True), "place")
    return {
        "all three, as until November 2026": former,
        "no deposit of twice the load": replace(former, reward=Deposit(0.0, in_psi_s=True)),
        "loads as shares, not in psi s": replace(former, reward=Deposit(2.0, in_psi_s=False)),
        "row and column, not numbers of cells": replace(former, action="dimensions"),
        "none, the present defaults": Setting(scenario, engine),
    }


def heaped(env: BlastBarrierEnv, action: int) -> Layout:
    """Return the layout of an action again and again, each time on the cell nearest to its own.

    That is what illegal actions placed until November 2026.
    """
    state = LayoutState.empty(env.task.source.representative)
    catalogue = state.catalogue
    variant, row, column = np.unravel_index(action, _shape(catalogue))
    up, right = np.indices(catalogue.shape)
    away = (up - row) ** 2.0 + (right - column) ** 2
    while state.legal[variant].any():
        near = np.where(state.legal[variant], away, np.inf).argmin()
        state = state.place(catalogue.element(int(variant) * away.size + int(near)))
    return state.layout


def repeated(env: BlastBarrierEnv, seeds: Sequence[int], lines: int = 4) -> dict[str, Estimate]:
    """Return the mean reductions of single actions, repeated to the end: as heaps and as walls.

    Args:
        env: The environment, with `action="place"`.
        seeds: Seeds of the episodes.
        lines: Number of rows and of columns from which cells are taken, of every variant.
    """
    catalogue = env.task.source.representative.zone.catalogue
    rows, columns = (
        np.linspace(0, side - 1, lines + 2).round().astype(int)[1:-1] for side in catalogue.shape
    )
    found: dict[str, list[float]] = {"heaps": [], "walls": []}
    for place in product(range(len(catalogue.variants)), rows, columns):
        action = int(np.ravel_multi_index(place, _shape(catalogue)))
        found["walls"] += reductions(env, action, seeds).tolist()
        heap = heaped(env, action)
        for seed in seeds:
            env.reset(seed=seed, options={"layout": heap})
            found["heaps"].append(env.step(env.finish)[-1]["reduction"])
    return {name: mean_estimate(np.array(item)) for name, item in found.items()}


def _shape(catalogue: Catalogue) -> tuple[int, int, int]:
    return len(catalogue.variants), *catalogue.shape


def main(
    steps: Annotated[int, typer.Option(help="Steps of the environment in a training.")] = 10_240,
    scenario: Annotated[str, typer.Option(help="The site.")] = "control_room",
    engine: Annotated[str, typer.Option(help="Engine of trainings and judgement.")] = "surrogate",
    seeds: Annotated[int, typer.Option(help="Trainings of each.")] = 1,
    threats: Annotated[int, typer.Option(help="Threats of the judgement.")] = 24,
    repeats: Annotated[int, typer.Option(help="Threats of repeated actions.")] = 2,
    out: Annotated[Path | None, typer.Option(help="Picture of the trainings.")] = None,
) -> None:
    """Train PPO with and without each cause; print reductions on held-out threats."""
    torch.set_num_threads(1)
    judge, judged = find_engine(engine), HELD_OUT[:threats]
    flat = Setting(scenario, engine, action="place").environment(judge)
    random = reductions(flat, None, judged).mean()
    print_line(f"random: {100.0 * random:.1f} %")
    for name, estimate in repeated(flat, HELD_OUT[:repeats]).items():
        print_line(f"single actions repeated, as {name}: {100.0 * estimate.value:.1f} %")
    curves = {}
    for name, setting in settings(scenario, engine).items():
        curve = curves[name] = Curve()
        agents = [
            trained("PPO", setting, steps, seed, None if seed else curve) for seed in range(seeds)
        ]
        env = setting.environment(judge)
        means = [100.0 * reductions(env, agent, judged).mean() for agent in agents]
        print_line(f"{name}: {', '.join(f'{mean:.1f}' for mean in means)} %")
    if out is not None:
        save_figure(picture(curves, {"random legal actions": float(random)}), out)


if __name__ == "__main__":
    typer.run(main)
