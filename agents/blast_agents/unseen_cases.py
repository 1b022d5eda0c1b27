"""Cases that the training of an agent has not met, and what it proposes for them."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Final

from blast_agents.proposal import LayoutAgent, Proposal, timed_proposal
from blast_agents.search.problem import SEED_SPAN
from blast_agents.training.held_out import Case
from blast_agents.training.run_folder import TrainingSettings
from blast_env.envs.strategies import ScenarioSource, SingleScenario
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastCache, BlastEvaluator, draw_threats
from blast_env.physics.scene import Charge
from blast_env.scenario import Scenario
from blast_env.sites import HELD_OUT_SITES, SiteSource

FIRST_SEED: Final = SEED_SPAN
"""Seeds of the threats count from here: those of training, search and the choice of the best
weights are smaller."""


def unseen_cases(
    settings: TrainingSettings,
    source: ScenarioSource,
    seeds: Sequence[int],
    engine: str,
    cache: str | Path | BlastCache | None = None,
) -> tuple[Case, ...]:
    """Return a case a seed: a threat of the run's scenario, or of a held-out site each.

    Args:
        settings: Of the run.
        source: Of the run: its scenario, or generated sites. The sites are the first of those that
            training never sees; the weights were chosen on the last ones.
        seeds: At least one, none twice; each draws the charge, the fan and the air.
        engine: Engine that runs the blasts.
        cache: As for `BlastEvaluator`.

    Raises:
        BlastEnvError: If there are no seeds, one is repeated or negative, or there are not that
            many sites; also as for `BlastEvaluator`.
    """
    is_visible = settings.threat == "visible"
    if isinstance(source, SingleScenario):
        threats = draw_threats(source.scenario, seeds)
        evaluator = BlastEvaluator(source.scenario, engine, cache=cache)
        return tuple(Case(evaluator, threat, is_visible) for threat in threats)
    most = HELD_OUT_SITES - settings.evaluation_cases
    if not 1 <= len(seeds) <= most:
        raise BlastEnvError(f"seeds: there are {len(seeds)}, must be 1 to {most}, a site each")
    return tuple(
        Case(BlastEvaluator(site, engine, cache=cache), draw_threats(site, [seed])[0], is_visible)
        for site, seed in zip(SiteSource.held_out(len(seeds)), seeds, strict=True)
    )


def propose(agent: LayoutAgent, scenario: Scenario, charge: Charge | None) -> Proposal:
    """Return what an agent proposes, and how long it took."""
    return timed_proposal(partial(agent.propose, scenario, charge))
