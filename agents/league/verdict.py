"""Agents against genetic search: the difference, and what may be said of it."""

from dataclasses import dataclass
from math import isnan

from agents.league.standings import Standings
from blast_env.evaluation import Estimate


@dataclass(frozen=True)
class Verdict:
    """A trained agent against the reference, case by case.

    Attributes:
        agent: Name of the agent.
        reference: Name of the search.
        difference: Mean reduction of the agent minus that of the search.
        sample: What the interval is over, e.g. `"16 cases"`.
        proposal_ms: Time from a case to the agent's layout, median, ms.
    """

    agent: str
    reference: str
    difference: Estimate
    sample: str
    proposal_ms: float

    @property
    def conclusion(self) -> str:
        """What may be said: the interval decides."""
        if isnan(self.difference.low):
            return "one threat says nothing about the others"
        if self.difference.low > 0.0:
            return "the agent protects better"
        if self.difference.high < 0.0:
            return "the agent protects worse"
        return "no difference shown: the interval contains 0"

    @property
    def text(self) -> str:
        """The verdict as a sentence."""
        value, low, high = (100.0 * each for each in self.difference)
        interval = "-" if isnan(low) else f"{low:+.1f} to {high:+.1f}"
        return (
            f"{self.agent} minus {self.reference}: {value:+.1f} percentage points of reduction "
            f"(95 % interval {interval}, paired over {self.sample}); {self.conclusion}. "
            f"It proposes in {self.proposal_ms:.1f} ms (median)."
        )


def verdicts(standings: Standings) -> tuple[Verdict, ...]:
    """Return a verdict for each agent; none if the search to compare with did not enter."""
    reference = standings.reference
    if reference is None:
        return ()
    count = len(standings.track.cases)
    sample = f"{count} cases"
    if standings.has_one_case:
        sample = f"{standings.unprotected_pa_s.shape[1]} held-out threats of one case"
    return tuple(
        Verdict(
            agent=result.name,
            reference=reference.name,
            difference=standings.difference(result, reference),
            sample=sample,
            proposal_ms=result.proposal_ms,
        )
        for result in standings.results
        if result.training is not None
    )
