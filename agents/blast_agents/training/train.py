"""What happens between two rollouts: seeds, evaluation, tables, checkpoint."""

import shlex
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from statistics import fmean
from time import perf_counter

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from stable_baselines3.common.utils import set_random_seed
from stable_baselines3.common.vec_env import VecEnv

from blast_agents.training.agent import (
    Checkpoint,
    Counters,
    Model,
    TrainedAgent,
    fitted,
    make_model,
    torch_threads,
)
from blast_agents.training.environments import make_environments, training_source
from blast_agents.training.held_out import HeldOut
from blast_agents.training.hyperparameters import Hyperparameters
from blast_agents.training.learning_curve import Progress, save_learning_curve
from blast_agents.training.run_folder import (
    SITES,
    EvaluationRow,
    RolloutRow,
    RunConfiguration,
    RunFolder,
    TrainingSettings,
    check_scenario,
    read_rows,
    write_rows,
)
from blast_env.envs.strategies import ScenarioSource, SingleScenario
from blast_env.errors import BlastEnvError
from blast_env.scenario import Scenario


@dataclass
class Episodes:
    """The episodes that ended in a rollout.

    Attributes:
        rewards: One an episode.
        reductions: One an episode.
        modules: One an episode.
    """

    rewards: list[float] = field(default_factory=list)
    reductions: list[float] = field(default_factory=list)
    modules: list[int] = field(default_factory=list)


class Recorder(BaseCallback):
    """Makes each rollout a unit of its own, and writes down what it brought.

    A rollout begins with fresh episodes and with seeds that follow from the seed of the run and
    the number of the rollout. So a run that goes on from a checkpoint is the same, to the last
    bit, as one that was never interrupted.

    Args:
        folder: Where everything is written.
        settings: Of the run.
        scenario: A scenario of the size that the policy is for.
        held_out: For the evaluations.
        progress: What the run has come to so far; goes on from here.
        show: Called with the share of the steps that is done.
    """

    def __init__(
        self,
        folder: RunFolder,
        settings: TrainingSettings,
        scenario: Scenario,
        held_out: HeldOut,
        progress: Progress,
        show: Callable[[float], None],
    ) -> None:
        super().__init__()
        self.folder, self.settings, self.scenario = folder, settings, scenario
        self.held_out, self.progress, self.show = held_out, progress, show
        self.algorithm: Model
        self._episodes = Episodes()
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
        self._episodes = Episodes()

    def _on_step(self) -> bool:
        for index, info in enumerate(self.locals["infos"]):
            if "reduction" not in info:
                continue
            self._episodes.rewards.append(float(info["episode"]["r"]))
            self._episodes.reductions.append(float(info["reduction"]))
            self._episodes.modules.append(len(info["layout"]))
            self._blasts[index] = (info["blasts"], info["cache_hits"])
        self.show(min(self.num_timesteps / self.settings.steps, 1.0))
        return True

    def _on_rollout_end(self) -> None:
        counters = self._counted()
        episodes = self._episodes
        row = RolloutRow(
            steps=counters.steps,
            episodes=len(episodes.rewards),
            reward=_mean(episodes.rewards),
            reduction=_mean(episodes.reductions),
            modules=_mean(episodes.modules),
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
        """Write down a rollout and its update; the checkpoint comes last."""
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
        write_rows(self.folder.rollouts, RolloutRow, self.progress.rollouts)
        self._checkpoint().save(self.folder.last)
        self._is_pending = False

    def _evaluate(self) -> None:
        agent = TrainedAgent(self.algorithm.policy, self.scenario, self.settings.engine)
        reduction = self.held_out.reduction(agent)
        counters = self.progress.counters
        row = EvaluationRow(
            counters.steps, counters.episodes, *reduction, counters.blasts, counters.seconds
        )
        self.progress.evaluations.append(row)
        write_rows(self.folder.evaluations, EvaluationRow, self.progress.evaluations)
        self.logger.record("evaluation/reduction", reduction.value)
        self.logger.dump(counters.steps)
        if reduction.value > counters.best_reduction:
            self.progress.counters = replace(
                counters, best_reduction=reduction.value, best_steps=counters.steps
            )
            self._checkpoint().save(self.folder.best)

    def _checkpoint(self) -> Checkpoint:
        policy = self.algorithm.policy
        return Checkpoint(
            policy.state_dict(), policy.optimizer.state_dict(), self.progress.counters
        )

    def _counted(self) -> Counters:
        """Return the counters at the end of a rollout."""
        before, now = self._before, self.progress.counters
        return replace(
            now,
            steps=self.num_timesteps,
            episodes=now.episodes + len(self._episodes.rewards),
            blasts=before.blasts + sum(blasts for blasts, _ in self._blasts.values()),
            cache_hits=before.cache_hits + sum(hits for _, hits in self._blasts.values()),
            seconds=self._seconds(),
        )

    def _log_rollout(self, row: RolloutRow) -> None:
        """Hand the scalars to TensorBoard, which are written with those of stable-baselines3."""
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


def _mean(values: list[float] | list[int]) -> float:
    """Return the mean; NaN where no episode ended."""
    return fmean(values) if values else float("nan")


@dataclass(frozen=True, eq=False)
class TrainingResult:
    """What a run has come to.

    Attributes:
        folder: The run folder.
        configuration: Of the run.
        progress: Counters and tables.
    """

    folder: RunFolder
    configuration: RunConfiguration
    progress: Progress


def train(
    settings: TrainingSettings,
    hyperparameters: Hyperparameters,
    run: str | Path,
    progress: Callable[[float], None] = lambda _: None,
) -> TrainingResult:
    """Train an agent.

    Args:
        settings: What is trained on what.
        hyperparameters: How; `load_hyperparameters` has those that come with the package.
        run: Folder for everything that comes of it; new or empty.
        progress: Called with the share of the steps that is done.

    Raises:
        BlastEnvError: If the scenario or the folder is of no use, or something does not fit.
    """
    source = training_source(settings.scenario)
    scenario = source.representative
    configuration = RunConfiguration(
        settings=settings,
        hyperparameters=fitted(hyperparameters, settings, scenario),
        scenario_hash=scenario.content_hash,
    )
    held_out = HeldOut.of(settings, source)  # refuses an unknown engine before anything is written
    folder = RunFolder(Path(run))
    folder.create(configuration, scenario, shlex.join(sys.argv))
    return _run(_Run(folder, configuration, source, held_out), Progress(), None, progress)


def resume(
    run: str | Path,
    scenario: str | None = None,
    progress: Callable[[float], None] = lambda _: None,
) -> TrainingResult:
    """Go on with a run from its last checkpoint, up to the steps that it was begun for.

    At most one rollout is lost, and the result is the one that it would have come to anyway.

    Args:
        run: The run folder.
        scenario: If given, it must be that of the run.
        progress: Called with the share of the steps that is done.

    Raises:
        BlastEnvError: If the folder is no run folder, damaged, or of another scenario.
    """
    folder = RunFolder(Path(run))
    configuration = folder.configuration()
    if scenario is not None:
        check_scenario(training_source(scenario).representative, configuration, scenario)
    own = folder.scenario(configuration)
    source: ScenarioSource = SingleScenario(own)
    if configuration.settings.scenario == SITES:
        source = training_source(SITES)
        check_scenario(source.representative, configuration, "generated sites")
    held_out = HeldOut.of(configuration.settings, source)
    job = _Run(folder, configuration, source, held_out)
    if not folder.last.exists() and not folder.best.exists():  # ended in the first rollout
        return _run(job, Progress(), None, progress)
    checkpoint = Checkpoint.load(folder.last)
    steps = checkpoint.counters.steps
    so_far = Progress(checkpoint.counters, read_rows(folder.rollouts, RolloutRow, steps))
    if so_far.counters.best_steps:
        so_far.evaluations = read_rows(folder.evaluations, EvaluationRow, steps)
    return _run(job, so_far, checkpoint, progress)


@dataclass(frozen=True, eq=False)
class _Run:
    """What a run needs.

    Attributes:
        folder: The run folder.
        configuration: Its configuration.
        source: Gives the episodes their scenario.
        held_out: For the evaluations.
    """

    folder: RunFolder
    configuration: RunConfiguration
    source: ScenarioSource
    held_out: HeldOut


def _run(
    job: _Run,
    so_far: Progress,
    checkpoint: Checkpoint | None,
    show: Callable[[float], None],
) -> TrainingResult:
    """Train from a checkpoint, or from the start, to the end."""
    settings = job.configuration.settings
    if so_far.counters.steps < settings.steps:
        environments = make_environments(job.configuration, job.source)
        try:
            with torch_threads(settings.torch_threads):
                _learn(job, so_far, checkpoint, environments, show)
        except (EOFError, ConnectionError) as error:
            raise BlastEnvError(
                f"{job.folder.path}: a process with an environment has ended, for want of memory "
                "or because it was killed; --resume goes on"
            ) from error
        finally:
            # After Ctrl-C the processes have ended already.
            with suppress(EOFError, OSError):
                environments.close()
    save_learning_curve(so_far, job.configuration, job.folder.learning_curve)
    return TrainingResult(job.folder, job.configuration, so_far)


def _learn(
    job: _Run,
    so_far: Progress,
    checkpoint: Checkpoint | None,
    environments: VecEnv,
    show: Callable[[float], None],
) -> None:
    """Train from a checkpoint, or from the start, on environments that are open."""
    settings = job.configuration.settings
    model = make_model(job.configuration, environments)
    if checkpoint is not None:
        _restore(model, checkpoint, job.folder)
    scenario = job.source.representative
    recorder = Recorder(job.folder, settings, scenario, job.held_out, so_far, show)
    recorder.algorithm = model
    model.set_logger(configure(str(job.folder.tensorboard), ["tensorboard"]))
    left = settings.steps - so_far.counters.steps
    model.learn(left, callback=recorder, reset_num_timesteps=checkpoint is None)
    model.logger.close()


def _restore(model: Model, checkpoint: Checkpoint, folder: RunFolder) -> None:
    """Bring a model to a checkpoint."""
    checkpoint.load_policy(model.policy, folder.last)
    try:
        model.policy.optimizer.load_state_dict(checkpoint.optimizer)
    except (ValueError, KeyError) as error:
        raise BlastEnvError(
            f"{folder.last}: the optimiser's state does not fit: {error}"
        ) from error
    model.num_timesteps = checkpoint.counters.steps
    model._n_updates = checkpoint.counters.updates
