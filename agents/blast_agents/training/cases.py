"""Cases for agents: those that the best weights are chosen by, and those that judge in the end."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from blast_agents.search import LayoutAgent
from blast_agents.training.run_folder import TrainingSettings
from blast_env.envs.strategies import ScenarioSource, SingleScenario
from blast_env.errors import BlastEnvError
from blast_env.evaluation import Case, Evaluators, SeedRange, compare, draw_threats
from blast_env.scenario import Scenario
from blast_env.sites import FAMILIES, HELD_OUT_SITES, SITES, SiteSource
from blast_env.sites.generate import AnyRanges
from blast_env.statistics import Estimate


@dataclass(frozen=True, eq=False)
class Selection:
    """Cases by which the best weights of a run are chosen.

    Attributes:
        cases: The cases.
        evaluators: Run their blasts, and remember those without a barrier.
        processes: Worker processes for them.
    """

    cases: tuple[Case, ...]
    evaluators: Evaluators
    processes: int = 1

    @classmethod
    def of(
        cls, settings: TrainingSettings, source: ScenarioSource, processes: int = 1
    ) -> "Selection":
        """Draw the cases of a run; they follow from the settings alone.

        Of generated sites they are the last of those that training never sees.

        Args:
            settings: Of the run.
            source: Of the run.
            processes: Worker processes for the blasts; they change nothing but the time.

        Raises:
            CalibrationError: If the scenario has no calibration for the judge.
            UnknownNameError: If there is no such engine.
            BlastEnvError: If there are to be more cases than seeds or sites for them.
        """
        count = settings.evaluation_cases
        seeds = SeedRange.SELECTION.seeds(settings.evaluation_first_seed, count)
        if isinstance(source, SingleScenario):
            scenarios: Sequence[Scenario] = (source.scenario,) * count
        else:
            sites = SiteSource(HELD_OUT_SITES - count, count, _ranges_of(source))
            scenarios = tuple(sites)
        evaluators = Evaluators(settings.judge, most=count)
        evaluators.of(scenarios[0])  # refuses an unknown engine before anything is written
        return cls(_cases(settings, scenarios, seeds), evaluators, processes)

    def reduction(self, agent: LayoutAgent) -> Estimate:
        """Return the reduction over all cases, with its 95 % interval.

        Raises:
            BlastEnvError: If nothing arrives in a case even without a barrier.
        """
        layouts = [agent.propose(case.scenario, case.charge) for case in self.cases]
        return compare(self.evaluators, self.cases, layouts, self.processes).reduction


def training_cases(
    settings: TrainingSettings, source: ScenarioSource, count: int
) -> tuple[Case, ...]:
    """Return cases to learn from; they follow from the settings alone, and none comes twice.

    Args:
        settings: Of the run; with a hidden charge, each case has `hidden_threats` charges.
        source: Of the run: its scenario, or generated sites.
        count: How many are drawn. There are fewer where the scenario has no more charges, as one
            with points or vehicles alone, and only one of a known site with a hidden charge.
    """
    hidden = settings.threat == "hidden"
    known_site = isinstance(source, SingleScenario)
    threats = settings.hidden_threats if hidden else 1
    cases: dict[object, Case] = {}
    for index in range(1 if hidden and known_site else count):
        sequence = np.random.SeedSequence((settings.seed, index))
        scenario = source.sample(np.random.default_rng(sequence))
        seeds = SeedRange.TRAINING.draw_distinct(np.random.default_rng(sequence), threats)
        drawn = draw_threats(scenario, seeds)
        case = Case(
            scenario,
            drawn,
            charge=None if hidden else drawn[0].charge,
            name=f"{scenario.name} {index + 1}",
            seed=index,
        )
        cases.setdefault((scenario.content_hash, *case.charges), case)
    return tuple(cases.values())


def unseen_cases(
    settings: TrainingSettings, source: ScenarioSource, seeds: Sequence[int]
) -> tuple[Case, ...]:
    """Return a case a seed: a threat of the run's scenario, or of a held-out site each.

    Args:
        settings: Of the run.
        source: Of the run: its scenario, or generated sites. The sites are the first of those that
            training never sees; the weights were chosen on the last ones.
        seeds: At least one, none twice, of `SeedRange.JUDGEMENT` unless something special is
            asked; each draws the charge, the fan and the air.

    Raises:
        BlastEnvError: If there are no seeds, one is repeated or negative, or there are not that
            many sites.
    """
    if isinstance(source, SingleScenario):
        return _cases(settings, (source.scenario,) * len(seeds), seeds)
    most = HELD_OUT_SITES - settings.evaluation_cases
    if not 1 <= len(seeds) <= most:
        raise BlastEnvError(f"seeds: there are {len(seeds)}, must be 1 to {most}, a site each")
    sites = SiteSource.held_out(len(seeds), _ranges_of(source))
    return _cases(settings, tuple(sites), seeds)


def _ranges_of(source: ScenarioSource) -> AnyRanges:
    """Return the family that the sites of a source are of."""
    return source.ranges if isinstance(source, SiteSource) else FAMILIES[SITES]


def _cases(
    settings: TrainingSettings, scenarios: Sequence[Scenario], seeds: Sequence[int]
) -> tuple[Case, ...]:
    """Return a case of one threat for each scenario with its seed."""
    if len(set(seeds)) < len(seeds):
        raise BlastEnvError("seeds: one is there twice, must be none twice")
    cases = []
    for number, (scenario, seed) in enumerate(zip(scenarios, seeds, strict=True), start=1):
        threats = draw_threats(scenario, [seed])
        told = threats[0].charge if settings.threat == "visible" else None
        cases.append(Case(scenario, threats, charge=told, name=f"{scenario.name} {number}"))
    return tuple(cases)
