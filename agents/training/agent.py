"""Trained agents: they propose layouts, and no blast is needed."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final, Literal

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from sb3_contrib import MaskablePPO
from stable_baselines3 import PPO

from agents.proposal import Layout
from agents.training.checkpoint import Checkpoint
from agents.training.model import Policy, logits_of, make_policy, torch_threads
from agents.training.run_folder import RunFolder
from blast_env.envs.grid_observation import GridEpisode, GridObservation
from blast_env.envs.objective import Evaluators
from blast_env.envs.observation import Array, Sight
from blast_env.envs.scenario_source import check_size, zone_of
from blast_env.errors import BlastEnvError
from blast_env.scenario import Charge, Placement, PointSource, Scenario

_ARCHIVE: Final = ".zip"
_ARCHIVES_HOLD_CODE: Final = "such archives may hold pickled code, which runs when they are read"
_SCHEDULES: Final = ("learning_rate", "lr_schedule", "clip_range", "clip_range_vf")
"""What only training needs; in RL Zoo's archives objects of classes that may not be installed."""


@dataclass(frozen=True, eq=False)
class TrainedAgent:
    """Places modules one after the other as a policy says; a `LayoutAgent`.

    Attributes:
        policy: The policy, of PPO or MaskablePPO, on `"grid"` observations.
        representative: A scenario of the size that the policy is for.
        engine: Engine of the training; no blast is run with it.
    """

    policy: Policy
    representative: Scenario
    engine: str

    @cached_property
    def _evaluators(self) -> Evaluators:
        return Evaluators(self.engine)

    def propose(self, scenario: Scenario, charge: Charge | None = None) -> Layout:
        """Return the layout of the most likely legal actions.

        Args:
            scenario: A scenario of the size of the one that the agent was trained on.
            charge: Where the charge is, one that the scenario may draw; `None` where it is
                hidden.

        Raises:
            BlastEnvError: If the scenario has another size, or no build zone.
        """
        return self._layouts(scenario, charge, None, 1)[0]

    def sample(
        self, scenario: Scenario, charge: Charge | None = None, count: int = 8, seed: int = 0
    ) -> tuple[Layout, ...]:
        """Return layouts of actions drawn as the policy would draw them in training.

        Args:
            scenario: As for `propose`.
            charge: As for `propose`.
            count: How many; some may be equal.
            seed: Decides them.

        Raises:
            BlastEnvError: As for `propose`, or if there are to be none.
        """
        if count < 1:
            raise BlastEnvError(f"count is {count}, must be at least 1")
        generator = torch.Generator().manual_seed(seed)
        return self._layouts(scenario, charge, generator, count)

    def _layouts(
        self, scenario: Scenario, charge: Charge | None, draw: torch.Generator | None, count: int
    ) -> tuple[Layout, ...]:
        check_size(scenario, self.representative)
        with torch_threads(1):  # for a few small sums more of them only wait
            return self._placed(scenario, charge, draw, count)

    def _placed(
        self, scenario: Scenario, charge: Charge | None, draw: torch.Generator | None, count: int
    ) -> tuple[Layout, ...]:
        episode = self._episode(scenario, charge)
        columns = zone_of(scenario).columns
        placements = [Placement.empty(scenario)] * count
        open_ones = [index for index in range(count) if not placements[index].is_full]
        while open_ones:
            observations = np.stack([episode.observe(placements[index]) for index in open_ones])
            free = np.stack([placements[index].free.ravel() for index in open_ones])
            going_on = []
            for index, action in zip(
                open_ones, self._actions(observations, free, draw), strict=True
            ):
                if action == free.shape[1]:
                    continue
                placements[index] = placements[index].place(divmod(action, columns))
                if not placements[index].is_full:
                    going_on.append(index)
            open_ones = going_on
        return tuple(placement.cells for placement in placements)

    def _episode(self, scenario: Scenario, charge: Charge | None) -> GridEpisode:
        sources = scenario.charge
        if charge is not None:
            sources = (PointSource(position_m=charge.position_m, tnt_kg=charge.tnt_kg),)
        return GridObservation().episode(Sight(scenario, sources, self._evaluators.of(scenario)))

    def _actions(
        self, observations: Array, free: NDArray[np.bool_], draw: torch.Generator | None
    ) -> list[int]:
        """Return the action for each observation; the last one, to finish, is always legal."""
        legal = torch.as_tensor(np.pad(free, ((0, 0), (0, 1)), constant_values=True))
        with torch.no_grad():
            logits = logits_of(self.policy, torch.as_tensor(observations))
            logits = logits.masked_fill(~legal, -torch.inf)
            if draw is None:
                chosen = logits.argmax(dim=1)
            else:
                chosen = torch.multinomial(logits.softmax(dim=1), 1, generator=draw)[:, 0]
        actions: list[int] = chosen.tolist()
        return actions


def load_agent(run: str | Path, weights: Literal["best", "last"] = "best") -> TrainedAgent:
    """Return the agent of a run folder.

    The policy is rebuilt from the run's configuration, and nothing but weights is read: no file
    of a run folder can hold code.

    Args:
        run: A run folder.
        weights: Those of the best evaluation, or the last ones.

    Raises:
        BlastEnvError: If it is no run folder, or damaged; also for an archive of
            stable-baselines3, which is for `load_archive`.
    """
    if Path(run).suffix == _ARCHIVE:
        raise BlastEnvError(
            f"{run}: is an archive of stable-baselines3 and no run folder; {_ARCHIVES_HOLD_CODE}: "
            "load_archive(..., trust_archive=True) reads it, if you trust its maker"
        )
    folder = RunFolder(Path(run))
    configuration = folder.configuration()
    scenario = folder.scenario(configuration)
    checkpoint = Checkpoint.load(folder.best if weights == "best" else folder.last)
    zone = zone_of(scenario)
    actions = spaces.Discrete(zone.rows * zone.columns + 1)
    policy = make_policy(configuration, GridObservation().space(scenario), actions)
    checkpoint.load_policy(policy, folder.path)
    policy.set_training_mode(False)
    return TrainedAgent(policy, scenario, configuration.settings.engine)


def load_archive(
    path: str | Path,
    algorithm: Literal["ppo", "maskable_ppo"],
    scenario: Scenario,
    *,
    trust_archive: bool = False,
    engine: str = "event",
) -> TrainedAgent:
    """Return the agent of an archive that stable-baselines3 or RL Zoo wrote.

    Such archives may hold pickled objects, and reading these runs whatever code their maker put
    in. So it takes a flag. RL Zoo need not be installed.

    Args:
        path: The archive, a `.zip` file.
        algorithm: Of the archive.
        scenario: A scenario of the size that the policy is for.
        trust_archive: Whether the archive may run code: only for one whose maker you trust.
        engine: An engine that the scenario's calibration knows; no blast is run with it.

    Raises:
        BlastEnvError: If the archive is not trusted, or cannot be read.
    """
    if not trust_archive:
        raise BlastEnvError(f"{path}: {_ARCHIVES_HOLD_CODE}; trust_archive is False, must be True")
    model = PPO if algorithm == "ppo" else MaskablePPO
    unread = dict.fromkeys(_SCHEDULES, 1.0)
    try:
        policy = model.load(path, device="cpu", custom_objects=unread).policy
    except (OSError, ImportError, ValueError, KeyError, RuntimeError, AttributeError) as error:
        raise BlastEnvError(f"{path}: cannot be read: {error}") from error
    policy.set_training_mode(False)
    return TrainedAgent(policy, scenario, engine)
