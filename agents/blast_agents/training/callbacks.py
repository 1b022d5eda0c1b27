"""The callback that evaluates a training on held-out threats and keeps its weights."""

import json
from collections.abc import Callable
from time import perf_counter

from stable_baselines3.common.callbacks import BaseCallback

from blast_agents.training.agent import PolicyAgent
from blast_agents.training.cases import Selection
from blast_agents.training.environments import BatchVecEnv
from blast_agents.training.evaluations import (
    EvaluationRow,
    best_of,
    read_evaluations,
    write_evaluations,
)
from blast_agents.training.run_folder import RunConfiguration, RunFolder
from blast_agents.training.weights import write_model
from blast_env.site import Scenario


class ValidationCallback(BaseCallback):
    """Evaluates after every few updates, and writes evaluations, best weights and a checkpoint.

    The files are those of stable-baselines3's `EvalCallback` and `CheckpointCallback`. Unlike
    there, layouts are judged instead of episodes, after an update instead of before it, and each
    file is written whole.

    Args:
        folder: The run folder, whose evaluations are continued.
        configuration: Configuration of the run.
        scenario: A scenario of the size that the policy is for.
        selection: Cases that select the best weights.
        begins_trained: Whether to evaluate the weights before the first step, too.
        blasts: Blasts spent before the first step.
        began_s: Time of `perf_counter` at the start, s.
        show: Called with the share of the steps that is done.

    Raises:
        BlastEnvError: If the file of the evaluations is damaged.
    """

    def __init__(
        self,
        folder: RunFolder,
        configuration: RunConfiguration,
        scenario: Scenario,
        selection: Selection,
        begins_trained: bool,
        blasts: int,
        began_s: float,
        show: Callable[[float], None],
    ) -> None:
        super().__init__()
        self.folder, self.settings, self.scenario = folder, configuration.settings, scenario
        self.selection, self.begins_trained, self.show = selection, begins_trained, show
        self.rows = read_evaluations(folder.evaluations)
        self._rollouts, self._began_s = 0, began_s
        self._episodes, self._blasts, self._seconds = 0, blasts, 0.0
        self._counts: dict[int, tuple[int, int]] = {}
        self._recorded_at = -1  # of this training: rows may be of one that was interrupted

    def _on_training_start(self) -> None:
        before = [row for row in self.rows if row.timesteps <= self.num_timesteps]
        if before:
            last = before[-1]
            self._episodes, self._blasts, self._seconds = last.episodes, last.blasts, last.seconds
        if self.begins_trained:
            self._record()

    def _on_rollout_start(self) -> None:
        """Record the update after a rollout, which has no call of its own."""
        if self._rollouts and self._rollouts % self.settings.evaluation_interval == 0:
            self._record()

    def _on_step(self) -> bool:
        # The environments of a batch share their counts.
        is_batch = isinstance(self.training_env.unwrapped, BatchVecEnv)
        for index, info in enumerate(self.locals["infos"]):
            if self.locals["dones"][index] and not info["TimeLimit.truncated"]:
                self._episodes += 1
                self._counts[0 if is_batch else index] = info["blasts"], info["cache_hits"]
        self.show(min(self.num_timesteps / self.settings.steps, 1.0))
        return True

    def _on_rollout_end(self) -> None:
        self._rollouts += 1
        self.logger.record("blasts/simulated", self._spent)
        self.logger.record("blasts/cache_hits", sum(hits for _, hits in self._counts.values()))

    def _on_training_end(self) -> None:
        if self._recorded_at != self.num_timesteps:
            self._record()
        write_model(self.model, self.folder.last_model)

    @property
    def _spent(self) -> int:
        return self._blasts + sum(blasts for blasts, _ in self._counts.values())

    def _record(self) -> None:
        """Evaluate the weights, keep them if they are the best, and write a checkpoint."""
        policy = self.model.policy
        found = self.selection.evaluate(
            PolicyAgent(policy, self.scenario, self.settings.observation)  # type: ignore[arg-type]
        )
        row = EvaluationRow(
            self.num_timesteps,
            tuple(found.case_reductions.tolist()),
            tuple(map(len, found.layouts)),
            *found.reduction,
            self._episodes,
            self._spent,
            self._seconds + perf_counter() - self._began_s,
            json.dumps(self.settings.judging),
        )
        self.rows.append(row)
        if best_of(self.rows) is row:
            write_model(self.model, self.folder.best_model)
        write_evaluations(self.folder.evaluations, self.rows)
        write_model(self.model, self.folder.checkpoint(self.num_timesteps))
        self._recorded_at = self.num_timesteps
        self.logger.record("eval/reduction", row.reduction)
        self.logger.dump(self.num_timesteps)
