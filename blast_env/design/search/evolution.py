"""Genetic search and NSGA-II on pymoo, which is imported on the first run."""

from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from blast_env.design.search.by_rule import rule_layouts
from blast_env.design.search.moves import Draw, Moves, random_part, random_walls
from blast_env.design.search.session import Plan, Search, SearchSession
from blast_env.geometry import Layout

_LEAST_POPULATION: Final = 6
_MOST_POPULATION: Final = 60


def population_size(layouts: int) -> int:
    """Return the population size of a search that can assess a number of layouts.

    Population and generations both grow with the square root of that number.
    """
    return int(np.clip(round(0.7 * layouts**0.5), _LEAST_POPULATION, _MOST_POPULATION))


_LEAST_GENERATIONS: Final = 8


def generation_size(population: int, plan: Plan, width: int) -> int:
    """Return the number of children of a generation: half of the population, or more.

    It is rounded up to as many as keep `width` blasts at work at the same time, as far as the
    budget pays for eight such generations.

    Args:
        population: Number of parents.
        plan: The division of the blasts.
        width: Number of blasts that can run at the same time.
    """
    at_once = min(-(-width // plan.threats), plan.exploring_layouts // _LEAST_GENERATIONS)
    return -(-max(2, population // 2) // max(at_once, 1)) * max(at_once, 1)


@dataclass(frozen=True)
class GeneticSearch(Search):
    """pymoo's `GA` with sampling, crossover, mutation and repair for layouts.

    The best initial layouts form the first population; then the best of parents and children
    survive. The population grows with the square root of the layouts that the budget pays for,
    and a generation has half as many children, or more with a width.

    Attributes:
        initial: Initial layouts, in addition to those of the rules and random ones.
        from_rules: Whether the layouts of the rules are among the initial ones.
        draw: Draws the random initial layouts.
        starting_share: Share of the exploration spent on random initial layouts.
        crossed_share: Share of the pairs of parents that are crossed; all children are mutated.
        more_moves: Probability of each further move of a child after the first.
        width: See `generation_size`; the population has as many layouts at least.
    """

    initial: tuple[Layout, ...] = ()
    from_rules: bool = True
    draw: Draw = random_walls
    starting_share: float = 0.25
    crossed_share: float = 0.5
    more_moves: float = 0.5
    width: int = 1
    name: str = "genetic"

    def explore(self, session: SearchSession) -> None:
        """Draw a population, and let it evolve.

        Raises:
            MissingExtraError: If the extra `search` is not installed.
        """
        # Here, because the other methods need no extra.
        from blast_env.design.search.operators import GA, evolve, operators

        scenario, plan = session.problem.scenario, session.plan
        size = population_size(plan.exploring_layouts)
        children = generation_size(size, plan, self.width)
        size = max(size, children)

        def objectives(layouts: list[Layout]) -> NDArray[np.float64]:
            return session.assess(layouts)[:, np.newaxis]

        # (1) A quarter of the exploration goes to random layouts and the rules'; (2) the best of
        # them are the first population, steady-state with half as many children as parents; (3)
        # pymoo evolves.
        count = max(size, round(self.starting_share * plan.exploring_layouts))
        drawn = (self.draw(scenario, session.rng) for _ in range(count))
        of_rules = rule_layouts(session.problem) if self.from_rules else ()
        session.assess([*self.initial, *of_rules, *drawn])
        first = session.ranked(plan.threats)[:size]
        made = operators(Moves(scenario), first, self.crossed_share, self.more_moves)
        algorithm = GA(pop_size=size, n_offsprings=children, **made)
        evolve(session, algorithm, objectives)


@dataclass(frozen=True)
class Nsga2Search(Search):
    """pymoo's `NSGA2` with the operators of the genetic search and two objectives.

    The objectives are the load and the number of modules or, with a catalogue, the cost. The
    result carries the Pareto front, which shows the benefit of each further module or expense. Its
    best layout is the end of the front with the least load.

    The reserve of the budget is spent on the other threats for the front and then, as far as it
    lasts, for the next fronts.

    Attributes:
        initial: Layouts of the first population, in addition to random ones.
        draw: Draws the random layouts of the first population.
        crossed_share: Share of the pairs of parents that are crossed; all children are mutated.
        more_moves: Probability of each further move of a child after the first.
        count_share: Share of the moves that add or remove a module or piece.
        width: As for `GeneticSearch`.
    """

    initial: tuple[Layout, ...] = ()
    draw: Draw = random_part
    crossed_share: float = 0.5
    more_moves: float = 0.5
    count_share: float = 0.4
    width: int = 1
    name: str = "nsga2"

    has_front: ClassVar[bool] = True

    def explore(self, session: SearchSession) -> None:
        """Draw a population, and let it evolve.

        Raises:
            MissingExtraError: If the extra `search` is not installed.
        """
        # Here, because the other methods need no extra.
        from blast_env.design.search.operators import NSGA2, evolve, operators

        problem = session.problem
        size = 2 * population_size(session.plan.exploring_layouts)
        children = generation_size(size, session.plan, self.width)
        size = max(size, children)

        def objectives(layouts: list[Layout]) -> NDArray[np.float64]:
            # Load and price conflict: NSGA-II (Deb and others 2002) keeps the non-dominated layouts
            # apart by their crowding distance.
            prices = [problem.price(layout) for layout in layouts]
            return np.column_stack([session.assess(layouts), prices])

        drawn = [self.draw(problem.scenario, session.rng) for _ in range(size)]
        moves = Moves(problem.scenario, count_share=self.count_share)
        first = [*self.initial, *drawn]
        made = operators(moves, first, self.crossed_share, self.more_moves)
        algorithm = NSGA2(pop_size=size, n_offsprings=children, **made)
        evolve(session, algorithm, objectives)

    def choose(self, session: SearchSession) -> None:
        """Assess the front under more threats."""
        session.confirm_front()
