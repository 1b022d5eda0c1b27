"""What a training on guesses may pay: the guess, the end of its interval, or a lead on the rules.

`python -m studies.paid_guesses` prints the table of docs/researchers/how_agents_learn.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Final

import gymnasium as gym
import torch
import typer

from blast_env.answers.terminal import print_line
from blast_env.design.search import layouts_by_rule
from blast_env.design.search.learnt import Guesses
from blast_env.envs.barrier_env import BlastBarrierEnv
from blast_env.errors import BlastEnvError
from blast_env.evaluation import LoadCase, LoadCaseSet
from blast_env.evaluation.engines import find_engine
from blast_env.site import AnyCharge
from blast_env.statistics import mean_estimate
from blast_env.surrogate import Surrogate, SurrogateEngine, packaged_surrogate
from blast_env.surrogate.ensemble import GuessRequest
from blast_env.surrogate.guess import Guess
from blast_env.tables import markdown_table
from studies.first_hour import HELD_OUT, Judgement, Setting, judged, trained

_SITES: Final = ("control_room", "visitor_entrance")
_ALGORITHM: Final = "MaskablePPO"


class UpperEnds(Surrogate):
    """A surrogate whose guesses are the upper ends of their 95 % intervals."""

    def guesses(self, asked: Sequence[GuessRequest]) -> list[Guess]:
        """Return the upper ends of the predicted loads."""
        return [self.upper_ends(guess) for guess in super().guesses(asked)]


@dataclass(frozen=True)
class PaysUpperEnds(Setting):
    """Pays by the upper ends of intervals: less than the guess where the networks disagree."""

    @cached_property
    def training(self) -> SurrogateEngine:
        """The engine of the training."""
        one = packaged_surrogate()
        return SurrogateEngine(UpperEnds(one.mean, one.scale, one.impulse, one.peak, one.fit))


@dataclass(frozen=True)
class PaysLeads(Setting):
    """Pays the lead of the guess on that of the best rule against the same charge."""

    def learning(self, seed: int) -> gym.Env[Any, Any]:
        """Return the environment of a training."""
        env = super().learning(seed)
        if not isinstance(env, BlastBarrierEnv):
            raise BlastEnvError(f"{self.scenario}: must be one site, in one environment")
        if env.task.source.representative.vehicles:
            raise BlastEnvError(f"{self.scenario}: has a vehicle, whose place hangs on the layout")
        return LeadOnRules(env)


class LeadOnRules(gym.Wrapper[Any, Any, Any, Any]):
    """Takes the best rule's reduction, by guesses, off the last reward of each episode.

    Args:
        env: The environment, on one site, with a charge that is shown.
    """

    def __init__(self, env: BlastBarrierEnv) -> None:
        super().__init__(env)
        self._own = env
        self._best: dict[AnyCharge, float] = {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Take an action."""
        observation, reward, ended, truncated, info = self.env.step(action)
        if ended:
            (charge,) = info["charges"]
            if charge not in self._best:
                self._best[charge] = self._best_reduction(charge)
            reward = float(reward) - self._best[charge]
        return observation, float(reward), ended, truncated, info

    def _best_reduction(self, charge: AnyCharge) -> float:
        scenario = self._own.placement.scenario
        case = LoadCaseSet(scenario, (LoadCase(charge, 0),), charge=charge)
        layouts = [(), *layouts_by_rule(scenario, charge).values()]
        unprotected, *loads = Guesses.of(packaged_surrogate(), case).loads(layouts).tolist()
        return 1.0 - float(min(loads)) / float(unprotected)


def settings(site: str) -> dict[str, Setting]:
    """Return what is learnt on, by what it pays."""
    kinds = {
        "the guess": Setting,
        "the upper end of its interval": PaysUpperEnds,
        "the guess less that of the best rule": PaysLeads,
    }
    return {pays: kind(site, "surrogate", "relative") for pays, kind in kinds.items()}


def row(site: str, pays: str, judgements: Sequence[Judgement]) -> tuple[str, ...]:
    """Return the row of a table: means over trainings and threats, and leads on the best rule."""
    cells = [site, pays]
    for judgement in judgements:
        found = judgement.of(_ALGORITHM)
        means = 100.0 * found.mean(axis=1)
        lead, low, high = mean_estimate((found - judgement.best_rule).mean(axis=0)).scaled(100.0)
        cells += [
            f"{means.mean():.1f} ({means.min():.1f} to {means.max():.1f})",
            f"{lead:+.1f} ({low:.1f} to {high:.1f})",
        ]
    return tuple(cells)


def main(
    scenario: Annotated[
        list[str] | None, typer.Option(help="A site with fixed charges; may be given again.")
    ] = None,
    steps: Annotated[int, typer.Option(help="Steps of the environment in a training.")] = 20_480,
    seeds: Annotated[int, typer.Option(min=1, help="Trainings of each.")] = 3,
    threats: Annotated[int, typer.Option(min=2, help="Threats of the judgement.")] = 6,
    cache: Annotated[str | None, typer.Option(help="Folder for the blasts of gas.")] = None,
) -> None:
    """Train MaskablePPO on each site and each pay, and judge it by guesses and by gas."""
    torch.set_num_threads(1)
    rows, judges = [], (find_engine("surrogate"), find_engine("gas"))
    for site in scenario or _SITES:
        for pays, setting in settings(site).items():
            agents = {
                f"{_ALGORITHM}, seed {seed}": trained(_ALGORITHM, setting, steps, seed)
                for seed in range(seeds)
            }
            plain, chosen = settings(site)["the guess"], HELD_OUT[:threats]
            judgements = [judged(plain, judge, agents, chosen, cache) for judge in judges]
            rows.append(row(site, pays, judgements))
    of_each = ("reduction, %", "beside the best rule, points (95 %)")
    headers = (
        "site",
        "a training pays",
        *(f"by {by}: {what}" for by in ("guesses", "gas") for what in of_each),
    )
    print_line(markdown_table(headers, rows))


if __name__ == "__main__":
    typer.run(main)
