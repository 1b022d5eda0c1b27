"""Actions between two rollouts: seeds, evaluation, tables, checkpoint and learning curve."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import nan
from pathlib import Path
from statistics import fmean
from time import perf_counter
from typing import Final

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.utils import set_random_seed

from blast_agents.training.agent import Model, TrainedAgent
from blast_agents.training.cases import Selection
from blast_agents.training.checkpoint import Checkpoint, Counters
from blast_agents.training.hyperparameters import ALGORITHM_NAMES
from blast_agents.training.run_folder import EvaluationRow, RolloutRow, RunConfiguration, RunFolder
from blast_env.design.surrogate.engine import is_surrogate
from blast_env.plots.site_plan import write_heading
from blast_env.plots.style import number_on_axis, render_extra
from blast_env.site import Scenario

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter, PercentFormatter


def evaluate(so_far: Checkpoint, agent: TrainedAgent, selection: Selection) -> EvaluationRow:
    """Evaluate a policy on held-out threats, and keep its weights if they are the best."""
    reduction, counters = selection.reduction(agent), so_far.counters
    row = EvaluationRow(
        counters.steps, counters.episodes, *reduction, counters.blasts, counters.seconds
    )
    so_far.evaluations.append(row)
    if reduction.value > counters.best_reduction:
        so_far.counters = replace(
            counters, best_reduction=reduction.value, best_steps=counters.steps
        )
        weights = agent.policy.state_dict()
        so_far.best_policy = {name: value.clone() for name, value in weights.items()}
    return row


class TrainingRecorder(BaseCallback):
    """Makes rollouts independent units, and records their results.

    A rollout begins with new episodes and with seeds derived from the seed of the run and the
    number of the rollout. A run resumed from a checkpoint is therefore identical, to the last bit,
    to an uninterrupted one.

    Args:
        folder: The run folder.
        configuration: Configuration of the run.
        scenario: A scenario of the size that the policy is for.
        selection: Cases that select the best weights.
        progress: State of the run, which training continues.
        show: Called with the share of the steps that is done.
    """

    def __init__(
        self,
        folder: RunFolder,
        configuration: RunConfiguration,
        scenario: Scenario,
        selection: Selection,
        progress: Checkpoint,
        show: Callable[[float], None],
    ) -> None:
        super().__init__()
        self.folder, self.configuration, self.scenario = folder, configuration, scenario
        self.settings = configuration.settings
        self.selection, self.progress, self.show = selection, progress, show
        self.algorithm: Model
        self._episodes: list[tuple[float, float, float]] = []
        self._is_pending = False
        self._blasts: dict[int, tuple[int, int]] = {}
        self._before = progress.counters
        self._began = perf_counter()

    def _on_rollout_start(self) -> None:
        if self._is_pending:
            self._finish_rollout()
        number = self.progress.counters.rollouts
        sequence = np.random.SeedSequence((self.settings.seed, number))
        seed, environment_seed = (int(state) >> 1 for state in sequence.generate_state(2))
        set_random_seed(seed)
        self.training_env.seed(environment_seed)
        self.algorithm._last_obs = self.training_env.reset()  # type: ignore[assignment]
        self.algorithm._last_episode_starts = np.ones(self.training_env.num_envs, dtype=bool)
        self._episodes = []

    def _on_step(self) -> bool:
        for index, info in enumerate(self.locals["infos"]):
            if "reduction" not in info:
                continue
            modules = float(len(info["layout"]))
            self._episodes.append((float(info["episode"]["r"]), info["reduction"], modules))
            self._blasts[index] = (info["blasts"], info["cache_hits"])
        self.show(min(self.num_timesteps / self.settings.steps, 1.0))
        return True

    def _on_rollout_end(self) -> None:
        counters = self._counted()
        reward, reduction, modules = _means(self._episodes)
        row = RolloutRow(
            steps=counters.steps,
            episodes=len(self._episodes),
            reward=reward,
            reduction=reduction,
            modules=modules,
            blasts=counters.blasts,
            cache_hits=counters.cache_hits,
            seconds=counters.seconds,
        )
        self._log_rollout(row)
        self.progress.counters = counters
        self.progress.rollouts.append(row)
        self._is_pending = True

    def _on_training_end(self) -> None:
        if self._is_pending:
            self._finish_rollout()

    def _finish_rollout(self) -> None:
        """Record a rollout and its update: first in the checkpoint, then in the tables."""
        counters = self.progress.counters
        counters = replace(
            counters,
            rollouts=counters.rollouts + 1,
            updates=self.algorithm._n_updates,
            seconds=self._seconds(),
        )
        self.progress.counters = counters
        is_last = counters.steps >= self.settings.steps
        if is_last or counters.rollouts % self.settings.evaluation_interval == 0:
            self._evaluate()
        self.progress.save(self.folder.checkpoint, self.algorithm.policy)
        self.progress.write_tables(self.folder)
        self._is_pending = False

    def _evaluate(self) -> None:
        agent = TrainedAgent(
            self.algorithm.policy,
            self.scenario,
            self.settings.observation,
        )
        row = evaluate(self.progress, agent, self.selection)
        self.logger.record("evaluation/reduction", row.reduction)
        self.logger.dump(row.steps)

    def _counted(self) -> Counters:
        """Return the counters at the end of a rollout."""
        before, now = self._before, self.progress.counters
        return replace(
            now,
            steps=self.num_timesteps,
            episodes=now.episodes + len(self._episodes),
            blasts=before.blasts + sum(blasts for blasts, _ in self._blasts.values()),
            cache_hits=before.cache_hits + sum(hits for _, hits in self._blasts.values()),
            seconds=self._seconds(),
        )

    def _log_rollout(self, row: RolloutRow) -> None:
        """Log scalars to TensorBoard, which are written with those of stable-baselines3."""
        before = self.progress.rollouts[-1] if self.progress.rollouts else None
        blasts = row.blasts - (before.blasts if before else 0)
        seconds = row.seconds - (before.seconds if before else 0.0)
        self.logger.record("rollout/reward", row.reward)
        self.logger.record("rollout/reduction", row.reduction)
        self.logger.record("rollout/modules", row.modules)
        self.logger.record("blasts/per_second", blasts / max(seconds, 1e-9))
        self.logger.record("blasts/simulated", row.blasts)
        self.logger.record("blasts/cache_hits", row.cache_hits)

    def _seconds(self) -> float:
        return self._before.seconds + perf_counter() - self._began


def _means(episodes: Sequence[tuple[float, float, float]]) -> tuple[float, float, float]:
    """Return the means of reward, reduction and modules; NaN without a finished episode."""
    if not episodes:
        return nan, nan, nan
    reward, reduction, modules = (fmean(column) for column in zip(*episodes, strict=True))
    return reward, reduction, modules


# Okabe and Ito's colours, which are distinguishable with any colour vision.
_TRAINING: Final = "#56B4E9"
_HELD_OUT: Final = "#D55E00"
_BEST: Final = "#000000"


def learning_curve(progress: Checkpoint, configuration: RunConfiguration) -> Figure:
    """Return the figure of the reduction in training and on held-out threats over the blasts.

    Args:
        progress: The tables of the run.
        configuration: Configuration of the run.
    """
    settings, counters = configuration.settings, progress.counters
    spent = "guesses" if is_surrogate(settings.engine) else "blasts"
    figure = Figure(figsize=(9.0, 5.4), layout="constrained")
    axes = figure.add_subplot()
    _draw(axes, progress)
    axes.set_xlabel(f"{spent} spent on training")
    figure.legend(loc="outside lower center", ncols=2)  # where it hides nothing
    write_heading(
        figure,
        f"{ALGORITHM_NAMES[settings.algorithm]} on {Path(settings.scenario).stem}, "
        f"{settings.threat} threat",
        f"seed {settings.seed}, {counters.steps:,} steps, {counters.episodes:,} episodes, "
        f"{counters.blasts:,} {spent} with engine {settings.engine}, {counters.seconds:,.0f} s; "
        f"{settings.evaluation_cases} held-out threats",
    )
    return figure


def _draw(axes: Axes, progress: Checkpoint) -> None:
    rollouts, evaluations = progress.rollouts, progress.evaluations
    axes.plot(
        [row.blasts for row in rollouts],
        [row.reduction for row in rollouts],
        color=_TRAINING,
        label="training: layouts drawn from the policy",
    )
    if evaluations:
        blasts = [row.blasts for row in evaluations]
        value = np.array([row.reduction for row in evaluations])
        low = value - [row.low for row in evaluations]
        high = np.array([row.high for row in evaluations]) - value
        axes.errorbar(
            blasts,
            value,
            yerr=np.maximum([low, high], 0.0),
            color=_HELD_OUT,
            marker="o",
            markersize=4,
            capsize=3,
            label="held-out threats: proposed layouts, 95 % interval",
        )
        best = int(np.argmax(value))
        axes.plot(
            blasts[best],
            value[best],
            color=_BEST,
            marker="o",
            markersize=12,
            fillstyle="none",
            ls="",
            label=f"best weights: {100.0 * value[best]:.1f} %",
        )
    axes.set_ylabel("reduction of the load that counts")
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, symbol=" %"))
    axes.xaxis.set_major_formatter(FuncFormatter(number_on_axis))
    axes.grid(alpha=0.3)
