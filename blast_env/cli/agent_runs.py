"""Proposals of the agent of a run, for threats outside its training.

Imports torch, so the command imports this module only for `--run`.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

from blast_agents.training import TrainedAgent, TrainingSettings, load_agent
from blast_agents.training.cases import unseen_cases
from blast_agents.training.run_folder import RunFolder

from blast_env.cli.options import EvaluateOptions
from blast_env.cli.output import print_line
from blast_env.envs.strategies import ScenarioSource, SingleScenario, scenario_source
from blast_env.evaluation import (
    BlastEvaluator,
    Evaluators,
    LoadCaseSet,
    SeedRange,
)
from blast_env.evaluation.engines import JUDGE, Engine
from blast_env.geometry import Layout
from blast_env.provenance import command, versions
from blast_env.sites import FAMILIES

Proposals: TypeAlias = tuple[
    Evaluators | BlastEvaluator, list[LoadCaseSet], list[Layout], dict[str, Any]
]
"""What runs the blasts, the cases, the layout of each, and the origin of the layouts."""


def proposals(run: Path, options: EvaluateOptions) -> Proposals:
    """Return the layouts that the agent of a run folder proposes; print a note on its weights."""
    folder = RunFolder(run)
    configuration = folder.configuration()
    settings, agent = configuration.settings, load_agent(run)
    provenance = _provenance(run, settings)
    note = _overlap(settings, options.seeds)
    if note and not options.is_json:
        print_line(f"note: {note}")
    own = settings.judge  # gas dynamics judges final statements
    engine = own if own.name == options.engine != JUDGE else options.engine
    if settings.scenario in FAMILIES:
        source = scenario_source(settings.scenario)
        return _of_cases(agent, settings, source, engine, provenance, options)
    scenario = folder.scenario(configuration)
    if settings.threat == "hidden":  # one layout for all possible places of the charge
        used = options.engine_for(engine, [scenario])
        case = LoadCaseSet(scenario, options.threats(scenario, used))
        evaluator = BlastEvaluator(scenario, used, cache=options.cache)
        return evaluator, [case], [agent.propose(scenario)], provenance
    return _of_cases(agent, settings, SingleScenario(scenario), engine, provenance, options)


def _of_cases(
    agent: TrainedAgent,
    settings: TrainingSettings,
    source: ScenarioSource,
    engine: str | Engine,
    provenance: dict[str, Any],
    options: EvaluateOptions,
) -> Proposals:
    """Return one layout per charge, or per site."""
    unseen = unseen_cases(settings, source, options.seeds)
    cases = [_fixed(case, options) for case in unseen]
    used = options.engine_for(engine, [each.scenario for each in cases])
    if not used.has_noise:  # the same charge again would be the same blast
        distinct: dict[object, LoadCaseSet] = {}
        for each in cases:
            distinct.setdefault((each.scenario.content_hash, each.charge), each)
        cases = [*distinct.values()]
    layouts = [agent.propose(case.scenario, case.charge) for case in cases]
    return Evaluators(used, options.cache), cases, layouts, provenance


def _fixed(case: LoadCaseSet, options: EvaluateOptions) -> LoadCaseSet:
    threats = tuple(
        replace(threat, charge=options.given.fixed(case.scenario, threat.charge))
        for threat in case.threats
    )
    charge = None if case.charge is None else options.given.fixed(case.scenario, case.charge)
    return replace(case, threats=threats, charge=charge)


def _provenance(run: Path, settings: TrainingSettings) -> dict[str, Any]:
    return {
        "command": command(),
        "run": str(run),
        "weights": "best",
        "algorithm": settings.algorithm,
        "threat": settings.threat,
        "versions": versions(packages=("torch", "stable-baselines3", "numpy")),
    }


def _overlap(settings: TrainingSettings, seeds: range) -> str:
    """Return a note if the weights were selected by some of the threats; else an empty text."""
    if settings.scenario in FAMILIES:  # other sites, whatever the seeds
        return ""
    chosen_by = SeedRange.VALIDATION.seeds(
        settings.evaluation_first_seed, settings.evaluation_cases
    )
    both = range(max(seeds[0], chosen_by[0]), min(seeds[-1], chosen_by[-1]) + 1)
    if not both:
        return ""
    return f"the best weights were chosen by {len(both)} of these threats: judge by others"
