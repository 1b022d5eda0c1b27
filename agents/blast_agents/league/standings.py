"""Results of the entries of a track: means with their uncertainty, and costs."""

from dataclasses import dataclass
from math import isnan
from statistics import median
from typing import Final

import numpy as np

from blast_agents.league.entries import LeagueEntry, search_name
from blast_agents.league.tracks import Track
from blast_env.arrays import FloatArray
from blast_env.design.search import Proposal, ProposerKind
from blast_env.evaluation.comparison import Comparison, check_something_arrives
from blast_env.statistics import CVAR_LEVEL, Estimate, conditional_value_at_risk, reductions

REFERENCE_METHOD: Final = "genetic"
"""The reference of trained entries, with the track's budget, beside the best rule and search."""


@dataclass(frozen=True, eq=False)
class Result:
    """Results of an entry on all cases.

    Attributes:
        entry: The entry.
        proposals: One proposal per case; the cells are sorted.
        loads: Loads of the layouts, in the unit of the objective (cases, held-out threats).
    """

    entry: LeagueEntry
    proposals: tuple[Proposal, ...]
    loads: FloatArray

    @property
    def name(self) -> str:
        """Name of the entry."""
        return self.entry.name

    @property
    def is_rule(self) -> bool:
        """Whether the entry is a rule, which needs neither training nor blasts."""
        return self.entry.kind is ProposerKind.RULE

    @property
    def has_learnt(self) -> bool:
        """Whether the entry is an agent, or a search with an agent or a surrogate."""
        return self.entry.kind is ProposerKind.LEARNT

    @property
    def other_blasts_per_case(self) -> float:
        """Mean number of blasts per case of an engine other than the judge's."""
        return sum(each.other_blasts for each in self.proposals) / len(self.proposals)

    @property
    def cpu_s_per_case(self) -> float:
        """Mean processor time per case, in s."""
        return sum(each.cpu_s for each in self.proposals) / len(self.proposals)

    @property
    def blasts_per_case(self) -> float:
        """Mean number of blasts per case."""
        return sum(each.blasts for each in self.proposals) / len(self.proposals)

    @property
    def blasts(self) -> int:
        """All blasts spent, including those of training, without the held-out ones."""
        return self.entry.training.blasts + sum(each.blasts for each in self.proposals)

    @property
    def seconds(self) -> float:
        """Total time of training and proposals, each in one process, in s."""
        return self.entry.training.seconds + sum(each.seconds for each in self.proposals)

    @property
    def proposal_ms(self) -> float:
        """Median time of a proposal, in ms."""
        return 1000.0 * median(each.seconds for each in self.proposals)


@dataclass(frozen=True, eq=False)
class Standings:
    """The results of a track, under the same threats with and without a barrier.

    `Comparison` defines the means, intervals and differences.

    Attributes:
        track: The track.
        results: One result per entry.
        unprotected: Loads without a barrier (cases, held-out threats).
        engine: Name of the engine, with its cells.

    Raises:
        BlastEnvError: If nothing arrives at the protected structures of a case without a barrier.
    """

    track: Track
    results: tuple[Result, ...]
    unprotected: FloatArray
    engine: str

    def __post_init__(self) -> None:
        check_something_arrives(self.track.cases, self.unprotected)

    @property
    def noun(self) -> str:
        """Name of the load to reduce, from the objective of the first case."""
        return self.track.cases[0].scenario.objective.noun

    @property
    def has_one_case(self) -> bool:
        """Whether there is a single case, so that intervals and worst are over its threats."""
        return len(self.track.cases) == 1

    @property
    def reference(self) -> Result | None:
        """Genetic search with the track's budget; `None` if it did not enter."""
        name = search_name(REFERENCE_METHOD, self.track.reference_budget)
        return next((result for result in self.results if result.name == name), None)

    @property
    def references(self) -> tuple[Result, ...]:
        """The references of agents among the entries.

        They are the best rule, the reference, and the best search without training, by their mean
        reductions.
        """
        searches = [each for each in self.results if each.entry.budget and not each.has_learnt]

        def mean(result: Result) -> float:
            return self.reduction(result).value

        best = [max(each[::-1], key=mean, default=None) for each in (self.rules, searches)]
        found = (best[0], self.reference, best[1])
        return tuple(dict.fromkeys(each for each in found if each is not None))

    def comparison(self, result: Result) -> Comparison:
        """Return the comparison of an entry's layouts with no barrier."""
        return Comparison(
            cases=self.track.cases,
            layouts=tuple(proposal.layout for proposal in result.proposals),
            loads=result.loads,
            unprotected=self.unprotected,
            in_range=np.ones(self.unprotected.shape, dtype=bool),
        )

    def reduction(self, result: Result) -> Estimate:
        """Return the mean reduction with its 95 % interval."""
        return self.comparison(result).reduction

    @property
    def rules(self) -> tuple[Result, ...]:
        """The rules among the entries."""
        return tuple(result for result in self.results if result.is_rule)

    def samples(self, result: Result) -> FloatArray:
        """Return the reduction per case, or per threat of a single case (samples,)."""
        if not self.has_one_case:
            return self.comparison(result).case_reductions
        return reductions(result.loads[0], self.unprotected[0])

    def cvar_reduction(self, result: Result) -> float:
        """Return the mean reduction of the worst 20 % of the cases, or threats of a single one."""
        return -conditional_value_at_risk(-self.samples(result), CVAR_LEVEL)

    def win_share(self, result: Result, other: Result) -> float:
        """Return the share of samples in which an entry is better; a tie counts as half."""
        ahead = self.samples(result) - self.samples(other)
        return float(((ahead > 0.0) + 0.5 * (ahead == 0.0)).mean())

    def difference(self, result: Result, other: Result) -> Estimate:
        """Return the difference of the mean reductions, with its paired interval."""
        return self.comparison(result).difference(self.comparison(other))


@dataclass(frozen=True)
class LeagueVerdict:
    """Paired comparison of a trained entry with a reference.

    Attributes:
        result: Result of the trained agent or search.
        reference: Result of the rule or search.
        difference: Mean reduction of the former minus that of the latter.
        sample: Sample of the interval, e.g. `"16 cases"`.
    """

    result: Result
    reference: Result
    difference: Estimate
    sample: str

    @property
    def conclusion(self) -> str:
        """The conclusion from the interval."""
        if isnan(self.difference.low):
            return "one threat gives no interval"
        subject = "search" if self.result.blasts_per_case else "agent"
        if self.difference.low > 0.0:
            return f"the {subject} protects better"
        if self.difference.high < 0.0:
            return f"the {subject} protects worse"
        return "no difference shown: the interval contains 0"

    @property
    def text(self) -> str:
        """The verdict as a sentence."""
        value, low, high = (100.0 * each for each in self.difference)
        interval = "-" if isnan(low) else f"{low:+.1f} to {high:+.1f}"
        spent = f"It proposes in {self.result.proposal_ms:.1f} ms (median)."
        if self.result.blasts_per_case:
            spent = f"It spends {self.result.blasts_per_case:.0f} blasts a case."
        return (
            f"{self.result.name} minus {self.reference.name}: {value:+.1f} percentage points of "
            f"reduction (95 % interval {interval}, paired over {self.sample}); {self.conclusion}. "
            f"{spent}"
        )


def verdicts(standings: Standings) -> tuple[LeagueVerdict, ...]:
    """Return one verdict per trained entry and reference."""
    sample = f"{len(standings.track.cases)} cases"
    if standings.has_one_case:
        sample = f"{standings.unprotected.shape[1]} held-out threats of one case"
    return tuple(
        LeagueVerdict(result, reference, standings.difference(result, reference), sample)
        for result in standings.results
        if result.has_learnt
        for reference in standings.references
    )
