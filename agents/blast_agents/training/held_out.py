"""Evaluating an agent on threats that its training has not met."""

from dataclasses import dataclass

import numpy as np

from blast_agents.proposal import LayoutAgent
from blast_agents.training.environments import held_out_scenarios
from blast_agents.training.run_folder import TrainingSettings
from blast_env.envs.strategies import ScenarioSource
from blast_env.evaluation import BlastEvaluator, Threat, draw_threats
from blast_env.physics.scene import Charge
from blast_env.statistics import Estimate, reduction_estimate


@dataclass(frozen=True, eq=False)
class Case:
    """A threat that an agent is asked to protect against.

    Attributes:
        evaluator: Runs the blasts of the case's scenario, and remembers those without a barrier.
        threat: The charge and the seed of its blast.
        is_visible: Whether the agent is told where the charge is.
    """

    evaluator: BlastEvaluator
    threat: Threat
    is_visible: bool

    @property
    def told_charge(self) -> Charge | None:
        """The charge, if the agent is told where it is."""
        return self.threat.charge if self.is_visible else None

    def impulses_psi_s(self, agent: LayoutAgent) -> tuple[float, float]:
        """Return the impulse with the agent's layout, and without a barrier, psi*s."""
        layout = agent.propose(self.evaluator.scenario, self.told_charge)
        pairs = [(layout, self.threat), ((), self.threat)]
        with_barrier, without = self.evaluator.loads_of_many(pairs)
        return with_barrier.protected_impulse_psi_s, without.protected_impulse_psi_s


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Cases on which the best weights of a run are chosen.

    Attributes:
        cases: The cases.
    """

    cases: tuple[Case, ...]

    @classmethod
    def of(cls, settings: TrainingSettings, source: ScenarioSource) -> "HeldOut":
        """Draw the cases of a run; they follow from the settings alone.

        Raises:
            CalibrationError: If the scenario has no calibration for the engine.
            UnknownNameError: If there is no such engine.
        """
        first = settings.evaluation_first_seed
        seeds = range(first, first + settings.evaluation_cases)
        scenarios = held_out_scenarios(source, len(seeds))
        evaluators = {
            scenario.content_hash: BlastEvaluator(scenario, settings.engine)
            for scenario in scenarios
        }
        return cls(
            tuple(
                Case(
                    evaluators[scenario.content_hash],
                    draw_threats(scenario, [seed])[0],
                    settings.threat == "visible",
                )
                for scenario, seed in zip(scenarios, seeds, strict=True)
            )
        )

    def reduction(self, agent: LayoutAgent) -> Estimate:
        """Return the reduction over all cases, with its 95 % interval."""
        impulses = np.array([case.impulses_psi_s(agent) for case in self.cases])
        return reduction_estimate(impulses[:, 0], impulses[:, 1])
