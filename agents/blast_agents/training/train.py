"""Start and continuation of a training."""

import shlex
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np
from stable_baselines3.common.logger import configure

from blast_agents.training.agent import (
    Model,
    fitted,
    make_model,
    policy_for,
    torch_threads,
    weights_of,
)
from blast_agents.training.callbacks import ValidationCallback
from blast_agents.training.cases import Selection
from blast_agents.training.environments import make_environments
from blast_agents.training.evaluations import (
    EvaluationRow,
    check_judging,
    learning_curve,
    read_evaluations,
)
from blast_agents.training.hyperparameters import Hyperparameters
from blast_agents.training.imitation import imitate_rules
from blast_agents.training.run_folder import (
    RunConfiguration,
    RunFolder,
    TrainingSettings,
    check_scenario,
)
from blast_agents.training.weights import load_model, load_policy, read_parameters
from blast_env.envs.strategies import ScenarioSource, SingleScenario, scenario_source
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastEvaluator
from blast_env.plots.figures import save_figure
from blast_env.sites import FAMILIES


@dataclass(frozen=True, eq=False)
class TrainingResult:
    """The result of a run.

    Attributes:
        folder: The run folder.
        configuration: Configuration of the run.
        evaluations: The evaluations on held-out threats; the last one is of the last weights.
    """

    folder: RunFolder
    configuration: RunConfiguration
    evaluations: tuple[EvaluationRow, ...]


def train(
    settings: TrainingSettings,
    hyperparameters: Hyperparameters,
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
    given = RunConfiguration(settings, hyperparameters, scenario.content_hash)
    configuration = fitted(given, scenario)
    # Refuse unsuitable engines and weights before anything is written.
    BlastEvaluator(scenario, settings.blast_engine)
    selection = Selection.of(settings, source)
    if settings.start_from is not None:
        place = weights_of(settings.start_from)
        load_policy(policy_for(configuration, scenario), read_parameters(place), place)
    folder = RunFolder(Path(run))
    # Only the program's name: the place of its installation must not enter a shared run.
    command = shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]])
    folder.make(configuration, scenario, command)
    return _Run(folder, configuration, source, selection).go_on(progress)


def resume(
    run: str | Path,
    scenario: str | None = None,
    progress: Callable[[float], None] = lambda _: None,
) -> TrainingResult:
    """Continue a run from its last checkpoint to the configured number of steps.

    The steps after the checkpoint are made anew, with other random numbers.

    Args:
        run: The run folder.
        scenario: If given, it must be that of the run.
        progress: Called with the share of the steps that is done.

    Raises:
        BlastEnvError: If the folder is not a run folder, is damaged, or has another scenario; or if
            its settings of evaluations are others than those of the evaluations that it has.
    """
    folder = RunFolder(Path(run))
    configuration = folder.configuration()
    if scenario is not None:
        check_scenario(scenario_source(scenario).representative, configuration, scenario)
    own = folder.scenario(configuration)
    configuration = fitted(configuration, own)
    source: ScenarioSource = SingleScenario(own)
    if configuration.settings.scenario in FAMILIES:
        source = scenario_source(configuration.settings.scenario)
        check_scenario(source.representative, configuration, "generated sites")
    settings, selection = configuration.settings, Selection.of(configuration.settings, source)
    rows = read_evaluations(folder.evaluations)
    check_judging(rows, settings, len(selection.cases), folder.path)
    folder.clear_temporaries()
    return _Run(folder, configuration, source, selection).go_on(progress)


@dataclass(frozen=True, eq=False)
class _Run:
    """A run with its configuration and the sources of its scenarios and cases."""

    folder: RunFolder
    configuration: RunConfiguration
    source: ScenarioSource
    selection: Selection

    def go_on(self, show: Callable[[float], None]) -> TrainingResult:
        """Train from the last checkpoint, or the beginning, to the end."""
        settings, path = self.configuration.settings, self.folder.path
        steps = max(self.folder.checkpoints, default=0)
        if steps < settings.steps:
            try:
                with torch_threads(settings.torch_threads):
                    self._learn(steps, show)
            except (EOFError, ConnectionError) as error:
                raise BlastEnvError(
                    f"{path}: a process with an environment has ended, for lack of memory or "
                    "because it was killed; --resume continues it"
                ) from error
            except OSError as error:
                raise BlastEnvError(
                    f"{path}: cannot be written: {error.strerror or error}; --resume continues"
                ) from error
        rows = tuple(read_evaluations(self.folder.evaluations))
        if not rows:
            raise BlastEnvError(f"{self.folder.evaluations}: there is no such file")
        curve = learning_curve(self.folder, self.configuration, rows)
        save_figure(curve, self.folder.learning_curve)
        return TrainingResult(self.folder, self.configuration, rows)

    def _learn(self, steps: int, show: Callable[[float], None]) -> None:
        """Train from a checkpoint, or from the beginning if there are no steps yet."""
        settings, folder, began_s = self.configuration.settings, self.folder, perf_counter()
        environments = make_environments(
            self.configuration, self.source, folder.monitor(steps), folder.blasts
        )
        try:
            # Further steps are under other threats than the first ones.
            sequence = np.random.SeedSequence((settings.seed, steps))
            seed = int(sequence.generate_state(1)[0])
            model = make_model(self.configuration, environments, seed)
            checkpoint = folder.checkpoints.get(steps)
            begins_trained, blasts = False, 0
            if checkpoint is not None:
                load_model(model, read_parameters(checkpoint), checkpoint)
                model.num_timesteps = steps
            else:
                begins_trained, blasts = self._begin(model)
            callback = ValidationCallback(
                folder,
                self.configuration,
                self.source.representative,
                self.selection,
                begins_trained,
                blasts,
                began_s,
                show,
            )
            model.set_logger(configure(str(folder.tensorboard), ["tensorboard"]))
            model.learn(settings.steps - steps, callback=callback, reset_num_timesteps=steps == 0)
            model.logger.close()
        finally:
            # After Ctrl-C the processes have already ended.
            with suppress(EOFError, OSError):
                environments.close()

    def _begin(self, model: Model) -> tuple[bool, int]:
        """Give a model its first weights.

        Returns:
            Whether they are other than random ones, and the number of blasts spent.
        """
        start_from = self.configuration.settings.start_from
        if start_from is not None:
            place = weights_of(start_from)
            load_policy(model.policy, read_parameters(place), place)
        has_learnt, blasts = imitate_rules(
            model.policy, self.configuration, self.source, self.folder.blasts
        )
        return has_learnt or start_from is not None, blasts
