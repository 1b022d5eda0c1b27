"""Agents of run folders as entries of a league."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from blast_agents.league.entries import Agent, Search, Training
from blast_agents.league.tracks import Track
from blast_agents.search.from_policy import PolicySearch
from blast_agents.surrogate import RankedAgent, Surrogate, SurrogateSearch
from blast_agents.training import TrainedAgent, load_agent
from blast_agents.training.checkpoint import Checkpoint
from blast_agents.training.hyperparameters import ALGORITHM_NAMES
from blast_agents.training.run_folder import RunFolder, TrainingSettings
from blast_env.errors import BlastEnvError
from blast_env.sites import FAMILIES


@dataclass(frozen=True, eq=False)
class TrainedRun:
    """The agent of a run folder, and what it was trained for.

    Attributes:
        run: The folder.
        entry: The agent.
        threat: `"visible"` or `"hidden"`.
        scenario: Name of the scenario, for people.
        site: Content hash of the scenario, or the family of generated sites.
    """

    run: Path
    entry: Agent
    threat: Literal["visible", "hidden"]
    scenario: str
    site: str

    @classmethod
    def load(cls, run: Path) -> "TrainedRun":
        """Load the agent with the weights of its best evaluation.

        Raises:
            BlastEnvError: If it is no run folder, or damaged.
        """
        folder = RunFolder(run)
        configuration = folder.configuration()
        settings = configuration.settings
        name = f"{ALGORITHM_NAMES[settings.algorithm]} ({run.resolve().name})"
        return cls(
            run=run,
            entry=Agent(load_agent(run), name, _training(folder, settings)),
            threat=settings.threat,
            scenario=settings.scenario,
            site=settings.scenario
            if settings.scenario in FAMILIES
            else configuration.scenario_hash,
        )

    def search(self, budget: int) -> Search:
        """Return the agent with a search at test time: what it draws, and changes of the best."""
        agent = self._drawing
        method = PolicySearch(agent, agent.digest, name=f"{self.entry.name} with search")
        return Search(method, budget, has_learnt=True)

    def guided(self, surrogate: Surrogate, budget: int) -> Search:
        """Return the agent with a search in which a surrogate picks what gets a blast."""
        agent = self._drawing
        name = f"{self.entry.name} with search by the surrogate"
        digest = f"{surrogate.digest} {agent.digest}"
        method = SurrogateSearch(surrogate, digest, agent, name=name)
        return Search(method, budget, has_learnt=True)

    def ranked(self, surrogate: Surrogate) -> Agent:
        """Return the agent with a surrogate, which picks one of the layouts that it draws."""
        training = Training(
            self.entry.training.blasts + surrogate.fit.blasts,
            self.entry.training.seconds + surrogate.fit.seconds,
        )
        name = f"{self.entry.name}, ranked by the surrogate"
        return Agent(RankedAgent(self._drawing, surrogate), name, training)

    @property
    def _drawing(self) -> TrainedAgent:
        agent = self.entry.agent
        if not isinstance(agent, TrainedAgent):
            raise TypeError(f"{agent!r} draws no layouts")
        return agent

    def is_for(self, track: Track) -> bool:
        """Return whether a track asks what the agent was trained for."""
        return self.threat == track.threat and self.site == track.site


def check_runs(runs: Sequence[TrainedRun], tracks: Sequence[Track]) -> None:
    """Refuse an agent that was trained for none of the tracks.

    Raises:
        BlastEnvError: If there is one; the message says what it was trained for.
    """
    for run in runs:
        if not any(run.is_for(track) for track in tracks):
            names = ", ".join(track.name for track in tracks)
            raise BlastEnvError(
                f"{run.run}: was trained for a {run.threat} threat on {run.scenario!r} "
                f"({run.site[:12]}), which is none of the tracks "
                f"({names}) as they are now"
            )


def _training(folder: RunFolder, settings: TrainingSettings) -> Training:
    """Return what a run cost, without the one that it started from; guesses are no blasts.

    Each evaluation counts with a blast a case, and the cases without a barrier once: the most that
    it can have been, because a layout that comes again needs no blast.
    """
    checkpoint = Checkpoint.load(folder.checkpoint)
    selection = (len(checkpoint.evaluations) + 1) * settings.evaluation_cases
    blasts = 0 if settings.guesses else checkpoint.counters.blasts
    return Training(blasts + selection, checkpoint.counters.seconds)
