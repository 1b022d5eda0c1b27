"""Counting blasts against a budget: what a search says of its own blasts counts nowhere."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from blast_env.errors import BlastEnvError
from blast_env.evaluation.cases import Threat
from blast_env.geometry import Element, Layout, met_by_blasts


class BudgetError(BlastEnvError):
    """A search asks for more blasts than its budget has."""


@dataclass(eq=False)
class BlastMeter:
    """Counts distinct pairs of layout and threat, and refuses those beyond a budget.

    Attributes:
        budget: Most pairs.
    """

    budget: int
    _asked: set[tuple[Layout, Threat]] = field(default_factory=set, init=False, repr=False)

    @property
    def blasts(self) -> int:
        """Pairs that were asked for so far; one that comes again counts once."""
        return len(self._asked)

    def add(self, pairs: Iterable[tuple[Sequence[Element], Threat]]) -> None:
        """Count pairs.

        Raises:
            BudgetError: If the budget does not pay for all of them; none is counted then.
        """
        asked = {(tuple(sorted(met_by_blasts(layout))), threat) for layout, threat in pairs}
        asked |= self._asked
        if len(asked) > self.budget:
            raise BudgetError(
                f"the search asks for {len(asked):,} blasts in all, the budget is {self.budget:,}"
            )
        self._asked = asked
