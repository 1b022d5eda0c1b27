"""An optimiser for `blast-env league --method own_optimiser:Descent`: plain Python."""

from blast_env.design.rules import random_layout
from blast_env.design.search import LayoutProblem, Report, SearchResult
from blast_env.design.search.moves import Moves
from blast_env.values import generator


class Descent:
    """Changes the best layout so far, again and again."""

    name = "descent"

    def propose(
        self,
        problem: LayoutProblem,
        budget: int,
        seed: int = 0,
        report: Report | None = None,  # noqa: ARG002
    ) -> SearchResult:
        """Return the best layout that the budget pays for."""
        rng, moves = generator(seed), Moves(problem.scenario)
        best = random_layout(problem.scenario, rng)
        least = problem.load(best)
        for _ in range(budget // len(problem.threats) - 1):
            changed = moves.neighbour(best, rng)
            load = problem.load(changed)
            if load < least:
                best, least = changed, load
        return SearchResult(best)
