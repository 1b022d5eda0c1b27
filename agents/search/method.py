"""What all search methods have in common."""

from collections.abc import Callable
from typing import Protocol

from agents.search.problem import LayoutProblem
from agents.search.result import Progress, SearchResult

Report = Callable[[Progress], None]
"""Is told after every batch of blasts how far a search has come."""


class SearchMethod(Protocol):
    """Looks for the layout with the least impulse."""

    @property
    def name(self) -> str:
        """Name in tables and on the command line."""

    def search(
        self, problem: LayoutProblem, budget: int, seed: int, report: Report | None = None
    ) -> SearchResult:
        """Return the best layout that was found.

        The same arguments give the same result. Ctrl-C ends the search: the best so far is
        returned.

        Args:
            problem: What is minimised.
            budget: Most blasts that may be spent; see `SearchResult.blasts`.
            seed: Decides everything that is drawn.
            report: Is told how far it has come.

        Raises:
            BlastEnvError: If the method cannot do anything with the budget.
        """
