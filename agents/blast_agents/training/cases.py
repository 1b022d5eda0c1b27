"""Cases for agents: for training, and for the selection of the best weights."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from blast_agents.training.run_folder import TrainingSettings
from blast_env.design.search import LayoutAgent
from blast_env.envs.strategies import ScenarioSource, SingleScenario
from blast_env.evaluation import (
    Evaluation,
    Evaluators,
    LoadCase,
    LoadCaseSet,
    SeedRange,
    compare,
    draw_threats,
)
from blast_env.evaluation.cases import in_turn, judged_threats
from blast_env.site import Scenario
from blast_env.sites import FAMILIES, HELD_OUT_SITES, SITES, SiteSource


@dataclass(frozen=True, eq=False)
class Selection:
    """Cases that select the best weights of a run.

    Attributes:
        cases: The cases.
        evaluators: Run their blasts, and cache those without a barrier.
    """

    cases: tuple[LoadCaseSet, ...]
    evaluators: Evaluators

    @classmethod
    def of(cls, settings: TrainingSettings, source: ScenarioSource) -> "Selection":
        """Draw the cases of a run, which depend only on the settings.

        Generated sites are the last ones of the held-out sites. Of a site with a few fixed charges
        there are as many cases: a charge again is no further evidence without noise.

        Args:
            settings: Settings of the run.
            source: Source of the run's scenarios.

        Raises:
            CalibrationError: If the scenario has no calibration for the judge.
            UnknownNameError: If the engine is unknown.
            BlastEnvError: If there are fewer seeds or sites than cases.
        """
        count = settings.evaluation_cases
        seeds = SeedRange.VALIDATION.seeds(settings.evaluation_first_seed, count)
        if isinstance(source, SingleScenario):
            scenarios: Sequence[Scenario] = (source.scenario,) * count
        else:
            ranges = source.ranges if isinstance(source, SiteSource) else FAMILIES[SITES]
            scenarios = tuple(SiteSource(HELD_OUT_SITES - count, count, ranges))
        evaluators = Evaluators(settings.judge, most=count)
        evaluators.of(scenarios[0])  # refuses an unknown engine before anything is written
        return cls(_cases(settings, scenarios, seeds), evaluators)

    def evaluate(self, agent: LayoutAgent) -> Evaluation:
        """Return the evaluation of an agent's layouts over all cases.

        Raises:
            BlastEnvError: If nothing arrives in a case even without a barrier.
        """
        layouts = [agent.propose(case.scenario, case.charge) for case in self.cases]
        return compare(self.evaluators, self.cases, layouts)


def training_cases(
    settings: TrainingSettings, source: ScenarioSource, count: int
) -> tuple[LoadCaseSet, ...]:
    """Return distinct training cases, which depend only on the settings.

    Args:
        settings: Settings of the run; with a hidden charge, each case has `hidden_threats` threats.
        source: Source of the run: its scenario, or generated sites.
        count: Number of draws. Fewer cases result if the scenario has fewer charges, such as
            points or vehicles, and only one for a single site with a hidden charge.
    """
    hidden = settings.threat == "hidden"
    known_site = isinstance(source, SingleScenario)
    threats = settings.hidden_threats if hidden else 1
    drawn: list[tuple[Scenario, tuple[LoadCase, ...]]] = []
    for index in range(1 if hidden and known_site else count):
        sequence = np.random.SeedSequence((settings.seed, index))
        scenario = source.sample(np.random.default_rng(sequence))
        seeds = SeedRange.TRAINING.draw_distinct(np.random.default_rng(sequence), threats)
        drawn.append((scenario, draw_threats(scenario, seeds)))
    if known_site and not hidden:
        shown = in_turn(drawn[0][0], [first for _, (first,) in drawn])
        drawn = [(drawn[0][0], (load_case,)) for load_case in shown]
    cases: dict[object, LoadCaseSet] = {}
    for index, (scenario, of_case) in enumerate(drawn):
        case = LoadCaseSet(
            scenario,
            of_case,
            charge=None if hidden else of_case[0].charge,
            name=f"{scenario.name} {index + 1}",
            seed=index,
        )
        cases.setdefault((scenario.content_hash, *case.charges), case)
    return tuple(cases.values())


def _cases(
    settings: TrainingSettings, scenarios: Sequence[Scenario], seeds: Sequence[int]
) -> tuple[LoadCaseSet, ...]:
    """Return one case with one threat per scenario and seed; a fixed charge of one site once."""
    if all(scenario is scenarios[0] for scenario in scenarios):
        found = judged_threats(scenarios[0], seeds, has_noise=settings.judge.has_noise)
        pairs = [(scenarios[0], threat) for threat in found]
    else:
        drawn = zip(scenarios, seeds, strict=True)
        pairs = [(scenario, draw_threats(scenario, [seed])[0]) for scenario, seed in drawn]
    cases = []
    for number, (scenario, threat) in enumerate(pairs, start=1):
        known_charge = threat.charge if settings.threat == "visible" else None
        cases.append(
            LoadCaseSet(scenario, (threat,), charge=known_charge, name=f"{scenario.name} {number}")
        )
    return tuple(cases)
