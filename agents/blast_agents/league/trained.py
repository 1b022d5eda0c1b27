"""Agents of run folders, and surrogates, as entries of a league."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from blast_agents.league.entries import LeagueEntry, Training
from blast_agents.league.tracks import Track
from blast_agents.search import ProposerKind
from blast_agents.surrogate import LearntSearch, Surrogate, search_by
from blast_agents.training import TrainedAgent, load_agent
from blast_agents.training.checkpoint import Checkpoint
from blast_agents.training.hyperparameters import ALGORITHM_NAMES
from blast_agents.training.run_folder import RunConfiguration, RunFolder, TrainingSettings
from blast_env.errors import BlastEnvError
from blast_env.sites import FAMILIES


@dataclass(frozen=True, eq=False)
class TrainedRun:
    """The agent of a run folder, and what it was trained for.

    Attributes:
        run: The folder.
        agent: The agent, with the weights of its best evaluation.
        configuration: Of the run: scenario and threat, among others.
        training: What it cost.
    """

    run: Path
    agent: TrainedAgent
    configuration: RunConfiguration
    training: Training

    @classmethod
    def load(cls, run: Path) -> "TrainedRun":
        """Load the agent of a run folder.

        Raises:
            BlastEnvError: If it is no run folder, or damaged.
        """
        folder = RunFolder(run)
        configuration = folder.configuration()
        training = _training(folder, configuration.settings)
        return cls(run, load_agent(run), configuration, training)

    @property
    def name(self) -> str:
        """Name in tables."""
        algorithm = ALGORITHM_NAMES[self.configuration.settings.algorithm]
        return f"{algorithm} ({self.run.resolve().name})"

    @property
    def site(self) -> str:
        """Content hash of the scenario, or the family of generated sites."""
        scenario = self.configuration.settings.scenario
        return scenario if scenario in FAMILIES else self.configuration.scenario_hash

    @property
    def entry(self) -> LeagueEntry:
        """The agent by itself."""
        alone = LearntSearch(agent=self.agent, digest=self.agent.digest, name=self.name)
        return LeagueEntry(alone, kind=ProposerKind.LEARNT, training=self.training)

    def entries(
        self, budgets: Sequence[int], surrogate: Surrogate | None
    ) -> tuple[LeagueEntry, ...]:
        """Return the agent by itself, with searches, and the same once more with a surrogate.

        Args:
            budgets: Blasts that a search from the agent may spend on a case.
            surrogate: Picks one of the layouts that the agent draws, and what gets a blast.
        """
        digest = self.agent.digest
        own = LearntSearch(agent=self.agent, digest=digest, name=f"{self.name} with search")
        found = [
            self.entry,
            *(LeagueEntry(own, each, kind=ProposerKind.LEARNT) for each in budgets),
        ]
        if surrogate is None:
            return tuple(found)
        name = f"{self.name}, ranked by the surrogate"
        both = Training(
            self.training.blasts + surrogate.fit.blasts,
            self.training.seconds + surrogate.fit.seconds,
        )
        digest = f"{surrogate.digest} {digest}"
        ranked = LearntSearch(surrogate, self.agent, digest, name=name)
        guided = replace(ranked, name=f"{self.name} with search by the surrogate")
        found.append(LeagueEntry(ranked, kind=ProposerKind.LEARNT, training=both))
        return (*found, *(LeagueEntry(guided, each, kind=ProposerKind.LEARNT) for each in budgets))

    def is_for(self, track: Track) -> bool:
        """Return whether a track asks what the agent was trained for."""
        return (self.configuration.settings.threat, self.site) == (track.threat, track.site)


def surrogate_entries(surrogate: Surrogate, budgets: Sequence[int]) -> tuple[LeagueEntry, ...]:
    """Return a surrogate's own proposals, and its searches.

    Args:
        surrogate: The surrogate.
        budgets: Blasts that its searches may spend on a case.
    """
    search = search_by(surrogate)
    training = Training(surrogate.fit.blasts, surrogate.fit.seconds)
    alone = LeagueEntry(search, kind=ProposerKind.LEARNT, training=training)
    return (alone, *(LeagueEntry(search, each, kind=ProposerKind.LEARNT) for each in budgets))


def check_runs(runs: Sequence[TrainedRun], tracks: Sequence[Track]) -> None:
    """Refuse an agent that was trained for none of the tracks.

    Raises:
        BlastEnvError: If there is one; the message says what it was trained for.
    """
    for run in runs:
        if not any(run.is_for(track) for track in tracks):
            names, settings = ", ".join(track.name for track in tracks), run.configuration.settings
            raise BlastEnvError(
                f"{run.run}: was trained for a {settings.threat} threat on {settings.scenario!r} "
                f"({run.site[:12]}), which is none of the tracks ({names}) as they are now"
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
