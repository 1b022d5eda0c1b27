"""The impulse without a barrier, to which reductions refer."""

from dataclasses import dataclass

from agents.search.problem import LayoutProblem
from agents.search.result import Candidate
from blast_env.errors import BlastEnvError


@dataclass(frozen=True, eq=False)
class Unprotected:
    """What arrives at the protected structures without a barrier.

    Its blasts are for the reader of a result; they count in no search's budget.

    Attributes:
        problem: The threats and how they become one number.
        impulses_pa_s: One a threat, Pa*s.
    """

    problem: LayoutProblem
    impulses_pa_s: tuple[float, ...]

    @classmethod
    def of(cls, problem: LayoutProblem) -> "Unprotected":
        """Simulate the threats without a barrier.

        Raises:
            BlastEnvError: If nothing arrives under the first threat: there is nothing to reduce.
        """
        impulses_pa_s = tuple(problem.loads_pa_s([((), threat) for threat in problem.threats]))
        if not impulses_pa_s[0] > 0.0:
            raise BlastEnvError(
                f"{problem.scenario.name}: nothing arrives at the protected structures without a "
                f"barrier under {problem.threats[0]}: there is nothing to reduce"
            )
        return cls(problem, impulses_pa_s)

    @property
    def impulse_pa_s(self) -> float:
        """The one number for all threats, Pa*s."""
        return self.problem.combined_pa_s(self.impulses_pa_s)

    def reduction(self, candidate: Candidate) -> float:
        """Return by which share a layout lowers the impulse under the threats that it has met."""
        bare_pa_s = self.problem.combined_pa_s(self.impulses_pa_s[: candidate.threats])
        return 1.0 - candidate.impulse_pa_s / bare_pa_s
