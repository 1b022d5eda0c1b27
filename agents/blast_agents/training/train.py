"""Training, and going on with a training that was interrupted."""

import shlex
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from stable_baselines3.common.logger import configure
from stable_baselines3.common.vec_env import VecEnv

from blast_agents.training.agent import (
    Checkpoint,
    Model,
    fitted,
    make_model,
    torch_threads,
)
from blast_agents.training.cases import Selection
from blast_agents.training.environments import make_environments, training_source
from blast_agents.training.hyperparameters import Hyperparameters
from blast_agents.training.learning_curve import save_learning_curve
from blast_agents.training.recorder import Progress, Recorder
from blast_agents.training.run_folder import (
    EvaluationRow,
    RolloutRow,
    RunConfiguration,
    RunFolder,
    TrainingSettings,
    check_scenario,
    read_rows,
)
from blast_env.envs.strategies import ScenarioSource, SingleScenario
from blast_env.errors import BlastEnvError
from blast_env.sites import SITES


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
    selection = Selection.of(
        settings, source
    )  # refuses an unknown engine before anything is written
    folder = RunFolder(Path(run))
    folder.create(configuration, scenario, shlex.join(sys.argv))
    return _run(_Run(folder, configuration, source, selection), Progress(), None, progress)


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
    selection = Selection.of(configuration.settings, source)
    job = _Run(folder, configuration, source, selection)
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
        selection: What the best weights are chosen by.
    """

    folder: RunFolder
    configuration: RunConfiguration
    source: ScenarioSource
    selection: Selection


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
    recorder = Recorder(job.folder, settings, scenario, job.selection, so_far, show)
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
