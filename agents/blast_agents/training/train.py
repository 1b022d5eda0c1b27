"""Start and continuation of a training."""

import shlex
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from stable_baselines3.common.logger import configure

from blast_agents.training.agent import check_fit, fitted, make_model, policy_for, torch_threads
from blast_agents.training.cases import Selection
from blast_agents.training.checkpoint import Checkpoint
from blast_agents.training.environments import make_environments
from blast_agents.training.hyperparameters import SELF_LABELLING, AnyHyperparameters
from blast_agents.training.recorder import TrainingRecorder, learning_curve
from blast_agents.training.run_folder import (
    RunConfiguration,
    RunFolder,
    TrainingSettings,
    check_scenario,
)
from blast_agents.training.self_labelling import SelfLabelling
from blast_env.envs.strategies import ScenarioSource, SingleScenario, scenario_source
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator
from blast_env.plots.figures import save_figure
from blast_env.site import Scenario
from blast_env.sites import FAMILIES


@dataclass(frozen=True, eq=False)
class TrainingResult:
    """The result of a run.

    Attributes:
        folder: The run folder.
        configuration: Configuration of the run.
        progress: Counters and tables.
    """

    folder: RunFolder
    configuration: RunConfiguration
    progress: Checkpoint


def train(
    settings: TrainingSettings,
    hyperparameters: AnyHyperparameters,
    run: str | Path,
    progress: Callable[[float], None] = lambda _: None,
) -> TrainingResult:
    """Train an agent.

    Args:
        settings: Algorithm, scenario, engine and evaluation.
        hyperparameters: The hyperparameters; `load_hyperparameters` returns the bundled ones.
        run: New or empty folder for all results.
        progress: Called with the share of the steps that is done.

    Raises:
        BlastEnvError: If the scenario or the folder is not usable, or the settings are not
            consistent.
    """
    source = scenario_source(settings.scenario)
    scenario = source.representative
    configuration = RunConfiguration(
        settings=settings,
        hyperparameters=fitted(hyperparameters, settings, scenario),
        scenario_hash=scenario.content_hash,
    )
    # Refuse unsuitable engines, for training and for selection, before anything is written.
    BlastEvaluator(scenario, settings.blast_engine)
    selection = _selection(configuration, source)
    folder = RunFolder(Path(run))
    start = _start(configuration, scenario)
    # Only the program's name: the place of its installation must not enter a shared run.
    command = shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]])
    with folder.making(configuration, scenario, command):
        start.save(folder.checkpoint)
    return _run(_Run(folder, configuration, source, selection), start, progress)


def resume(
    run: str | Path,
    scenario: str | None = None,
    progress: Callable[[float], None] = lambda _: None,
) -> TrainingResult:
    """Continue a run from its last checkpoint to the configured number of steps.

    At most one rollout is repeated, and the result is that of an uninterrupted run.

    Args:
        run: The run folder.
        scenario: If given, it must be that of the run.
        progress: Called with the share of the steps that is done.

    Raises:
        BlastEnvError: If the folder is not a run folder, is damaged, or has another scenario.
    """
    folder = RunFolder(Path(run))
    configuration = folder.configuration()
    if scenario is not None:
        check_scenario(scenario_source(scenario).representative, configuration, scenario)
    own = folder.scenario(configuration)
    check_fit(configuration, own, folder)
    source: ScenarioSource = SingleScenario(own)
    if configuration.settings.scenario in FAMILIES:
        source = scenario_source(configuration.settings.scenario)
        check_scenario(source.representative, configuration, "generated sites")
    selection = _selection(configuration, source)
    job = _Run(folder, configuration, source, selection)
    checkpoint = Checkpoint.load(folder.checkpoint)
    checkpoint.check_configuration(configuration, folder.path)
    folder.clear_temporaries()
    return _run(job, checkpoint, progress)


def _start(configuration: RunConfiguration, scenario: Scenario) -> Checkpoint:
    """Return the initial checkpoint of a run, with random weights or those of another run."""
    if configuration.settings.start_from is None:
        return Checkpoint.of_start(configuration)
    folder = RunFolder(Path(configuration.settings.start_from))
    weights = Checkpoint.load(folder.checkpoint).best_policy
    start = Checkpoint.of_start(configuration, weights)
    start.load_policy(policy_for(configuration, scenario), folder.path)  # refuses another size
    return start


def _selection(configuration: RunConfiguration, source: ScenarioSource) -> Selection:
    """Return the cases that select the best weights.

    Self-labelling runs their blasts in its worker processes.
    """
    is_own = configuration.settings.algorithm == SELF_LABELLING
    processes = configuration.hyperparameters.n_envs if is_own else 1
    return Selection.of(configuration.settings, source, processes)


@dataclass(frozen=True, eq=False)
class _Run:
    """A run with its configuration and the sources of its scenarios and cases."""

    folder: RunFolder
    configuration: RunConfiguration
    source: ScenarioSource
    selection: Selection


def _run(job: _Run, so_far: Checkpoint, show: Callable[[float], None]) -> TrainingResult:
    """Train from a checkpoint to the end."""
    settings = job.configuration.settings
    so_far.write_tables(job.folder)  # a killed run may have left them incomplete
    if so_far.counters.steps < settings.steps:
        learn = _learn_from_own_best if settings.algorithm == SELF_LABELLING else _learn_by_acting
        try:
            with torch_threads(settings.torch_threads):
                learn(job, so_far, show)
        except (EOFError, ConnectionError) as error:
            raise BlastEnvError(
                f"{job.folder.path}: a process with an environment has ended, for lack of memory "
                "or because it was killed; --resume continues it"
            ) from error
        except OSError as error:
            raise BlastEnvError(
                f"{job.folder.path}: cannot be written: {error.strerror or error}; "
                "--resume continues"
            ) from error
    save_figure(learning_curve(so_far, job.configuration), job.folder.learning_curve)
    return TrainingResult(job.folder, job.configuration, so_far)


def _learn_from_own_best(job: _Run, so_far: Checkpoint, show: Callable[[float], None]) -> None:
    """Train by self-labelling from a checkpoint."""
    training = SelfLabelling.of(job.folder, job.configuration, job.source, job.selection, so_far)
    while so_far.counters.steps < job.configuration.settings.steps:
        training.do_round()
        show(min(so_far.counters.steps / job.configuration.settings.steps, 1.0))


def _learn_by_acting(job: _Run, so_far: Checkpoint, show: Callable[[float], None]) -> None:
    """Train by PPO or MaskablePPO from a checkpoint."""
    settings = job.configuration.settings
    environments = make_environments(job.configuration, job.source)
    try:
        model = make_model(job.configuration, environments)
        so_far.load_into(model.policy, job.folder.checkpoint)
        if not so_far.is_start:
            model.num_timesteps = so_far.counters.steps
            model._n_updates = so_far.counters.updates
        scenario = job.source.representative
        recorder = TrainingRecorder(
            job.folder, job.configuration, scenario, job.selection, so_far, show
        )
        recorder.algorithm = model
        model.set_logger(configure(str(job.folder.tensorboard), ["tensorboard"]))
        left = settings.steps - so_far.counters.steps
        model.learn(left, callback=recorder, reset_num_timesteps=so_far.is_start)
        model.logger.close()
    finally:
        # After Ctrl-C the processes have already ended.
        with suppress(EOFError, OSError):
            environments.close()
