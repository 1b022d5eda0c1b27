"""What all episodes of an environment have in common, and how one of them starts."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.envs.arguments import real_number, strategy, whole_number
from blast_env.envs.episode import Episode
from blast_env.envs.features_observation import FeaturesObservation
from blast_env.envs.grid_observation import GridObservation, GridWithLoadObservation
from blast_env.envs.objective import Evaluators, Objective
from blast_env.envs.observation import Observation, Sight
from blast_env.envs.reset_options import ResetOptions, with_possible_charges
from blast_env.envs.risk import ConditionalValueAtRisk, MeanRisk, Risk
from blast_env.envs.scenario_source import ScenarioSource, check_size
from blast_env.envs.threat_model import HiddenThreat, ThreatModel, VisibleThreat
from blast_env.errors import BlastEnvError
from blast_env.evaluation.threats import Threat
from blast_env.scenario import Charge, Placement

OBSERVATIONS: Final[Mapping[str, Observation]] = MappingProxyType(
    {
        "grid": GridObservation(),
        "grid_with_load": GridWithLoadObservation(),
        "features": FeaturesObservation(),
    }
)
"""The observations that have names."""

VISIBLE_REALISATIONS: Final = 2
"""Blasts for a visible charge unless an argument says otherwise (`scripts.measure_noise`)."""

HIDDEN_THREATS: Final = 16
"""Charges for a hidden threat, one blast each, unless an argument says otherwise; likewise."""


@dataclass(frozen=True, eq=False)
class Task:
    """What is placed where, against what, and what is seen of it.

    Attributes:
        source: Gives each episode its scenario.
        threat_model: Draws the charges of an episode.
        realisations: Blasts for each charge, with different fan and air.
        risk: How the impulses of several charges become one.
        observation: What is seen.
        evaluators: Run the blasts.
    """

    source: ScenarioSource
    threat_model: ThreatModel
    realisations: int
    risk: Risk
    observation: Observation
    evaluators: Evaluators

    def start(self, rng: np.random.Generator, options: ResetOptions) -> Episode:
        """Draw an episode; always as much of the stream, whatever the options fix.

        Raises:
            LayoutError: If the layout of the options does not fit the build zone.
            ScenarioError: If the charge of the options is not clear of a structure or the border.
            BlastEnvError: If the scenario has another size than the representative one.
        """
        scenario = self.source.sample(rng)
        check_size(scenario, self.source.representative)
        drawn = self.threat_model.draw(scenario, rng)
        seeds = rng.integers(2**31, size=(len(drawn), self.realisations))
        if options.blast_seed is not None:
            seeds = options.blast_seed + np.arange(seeds.size).reshape(seeds.shape)
        charges = tuple(options.charge(each) for each in drawn)
        possible = with_possible_charges(scenario, charges) if options.fix_charge else scenario
        evaluator = self.evaluators.of(scenario)
        sight = Sight(scenario, self.threat_model.shown(scenario, charges), evaluator)
        placement = Placement.of(possible, options.layout)
        return Episode(
            sight=sight,
            objective=Objective(evaluator, _threats(charges, seeds), self.risk),
            observation=self.observation.episode(sight),
            initial=placement.cells,
            placement=placement,
        )


def find_threat_model(threat: str | ThreatModel, threats: int | None) -> ThreatModel:
    """Return the threat model for the arguments `threat` and `threats`.

    Raises:
        UnknownNameError: If there is no threat model of that name.
        BlastEnvError: If the number of threats is out of bounds, or is given for a threat model
            that does not ask for it.
    """
    count = HIDDEN_THREATS if threats is None else whole_number("threats", threats, 1, 1000)
    models: dict[str, ThreatModel] = {"visible": VisibleThreat(), "hidden": HiddenThreat(count)}
    chosen = strategy("threat", threat, models)
    if threats not in (None, 1) and threat != "hidden":
        raise BlastEnvError(f"threats is {threats}, must be 1 unless threat is 'hidden'")
    return chosen


def find_realisations(realisations: int | None, threat: str | ThreatModel) -> int:
    """Return the number of blasts for each charge for the arguments `realisations` and `threat`.

    Raises:
        BlastEnvError: If the number is out of bounds.
    """
    if realisations is None:
        return VISIBLE_REALISATIONS if threat == "visible" else 1
    return whole_number("realisations", realisations, 1, 1000)


def find_risk(risk: str | Risk, cvar_level: float) -> Risk:
    """Return the risk measure for the arguments `risk` and `cvar_level`.

    Raises:
        UnknownNameError: If there is no risk measure of that name.
        BlastEnvError: If the level is no number or out of bounds.
    """
    level = real_number("cvar_level", cvar_level, 0.0, 1.0)
    measures: dict[str, Risk] = {"mean": MeanRisk(), "cvar": ConditionalValueAtRisk(level)}
    return strategy("risk", risk, measures)


def _threats(
    charges: tuple[Charge, ...], seeds: NDArray[np.int64]
) -> tuple[tuple[Threat, ...], ...]:
    """Return the realisations of each charge; `seeds` has the shape (charges, realisations)."""
    return tuple(
        tuple(Threat(charge, seed) for seed in of_charge)
        for charge, of_charge in zip(charges, seeds.tolist(), strict=True)
    )
