"""Agents of run folders and surrogates as entries of a league."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from blast_agents.league.entries import LeagueEntry, Training
from blast_agents.league.tracks import Track
from blast_agents.training import TrainedAgent, load_agent
from blast_agents.training.checkpoint import Checkpoint
from blast_agents.training.hyperparameters import ALGORITHM_NAMES
from blast_agents.training.run_folder import RunConfiguration, RunFolder, TrainingSettings
from blast_env.design.search import ProposerKind
from blast_env.design.surrogate import LearntSearch, Surrogate, search_by
from blast_env.errors import BlastEnvError
from blast_env.sites import FAMILIES


@dataclass(frozen=True, eq=False)
class TrainedRun:
    """The agent of a run folder, with the configuration and cost of its training.

    Attributes:
        run: The folder.
        agent: The agent, with the weights of its best evaluation.
        configuration: Configuration of the run, including scenario and threat.
        training: Cost of the training.
    """

    run: Path
    agent: TrainedAgent
    configuration: RunConfiguration
    training: Training

    @classmethod
    def load(cls, run: Path) -> "TrainedRun":
        """Load the agent of a run folder.

        Raises:
            BlastEnvError: If it is not a run folder or is damaged.
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
        """The agent alone."""
        alone = LearntSearch(agent=self.agent, digest=self.agent.digest, name=self.name)
        return LeagueEntry(alone, kind=ProposerKind.LEARNT, training=self.training)

    def entries(
        self, budgets: Sequence[int], surrogate: Surrogate | None
    ) -> tuple[LeagueEntry, ...]:
        """Return the agent alone and with searches, and the same with a surrogate.

        Args:
            budgets: Blasts per case of the searches.
            surrogate: Ranks the agent's samples, and selects the layouts to simulate.
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
        """Return whether a track has the threat and site that the agent was trained for."""
        return (self.configuration.settings.threat, self.site) == (track.threat, track.site)


def surrogate_entries(surrogate: Surrogate, budgets: Sequence[int]) -> tuple[LeagueEntry, ...]:
    """Return the entries of a surrogate alone and of its searches.

    Args:
        surrogate: The surrogate.
        budgets: Blasts per case of its searches.
    """
    search = search_by(surrogate)
    training = Training(surrogate.fit.blasts, surrogate.fit.seconds)
    alone = LeagueEntry(search, kind=ProposerKind.LEARNT, training=training)
    return (alone, *(LeagueEntry(search, each, kind=ProposerKind.LEARNT) for each in budgets))


def check_runs(runs: Sequence[TrainedRun], tracks: Sequence[Track]) -> None:
    """Refuse agents trained for none of the tracks.

    Raises:
        BlastEnvError: If there is one; the message names its threat and scenario.
    """
    for run in runs:
        if not any(run.is_for(track) for track in tracks):
            names, settings = ", ".join(track.name for track in tracks), run.configuration.settings
            raise BlastEnvError(
                f"{run.run}: was trained for a {settings.threat} threat on {settings.scenario!r} "
                f"({run.site[:12]}), which is none of the tracks ({names}) as they are now"
            )


def _training(folder: RunFolder, settings: TrainingSettings) -> Training:
    """Return the cost of a run, without that of an initial run; predictions count as no blasts.

    Each evaluation counts one blast per case, and the unprotected cases count once. This is an
    upper bound, because repeated layouts need no blast.
    """
    checkpoint = Checkpoint.load(folder.checkpoint)
    selection = (len(checkpoint.evaluations) + 1) * settings.evaluation_cases
    blasts = 0 if settings.guesses else checkpoint.counters.blasts
    return Training(blasts + selection, checkpoint.counters.seconds)
