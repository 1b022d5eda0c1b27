"""How a search divides its blasts: many layouts under few threats, or few under many."""

from dataclasses import dataclass
from typing import Final

from agents.search.problem import LayoutProblem

LAYOUTS_PER_REALISATION: Final = 500
"""A known charge is met with one fan and air more for so many layouts that the budget pays for."""
CHARGES_PER_ROOT_BLAST: Final = 0.3
"""Of a hidden charge's places a layout meets so many times the square root of the budget."""
CONFIRMED_LAYOUTS: Final = 32
"""Layouts of which the blasts that are held back can pay for all threats."""
MOST_CONFIRMING_SHARE: Final = 0.2
"""Largest share of the budget that is held back to let the best layouts meet more threats."""


@dataclass(frozen=True)
class Plan:
    """How a search divides its blasts.

    Attributes:
        threats: How many threats a layout meets while the search explores.
        exploring_blasts: How many blasts it spends on exploring.
    """

    threats: int
    exploring_blasts: int

    @property
    def exploring_layouts(self) -> int:
        """How many layouts it can try, at least one."""
        return max(1, self.exploring_blasts // self.threats)

    @classmethod
    def of(cls, problem: LayoutProblem, budget: int) -> "Plan":
        """Return the plan for a budget.

        A layout's impulse differs little from one fan and air to the next, less than layouts do
        from each other: against a known charge it pays to try many layouts under one threat each,
        and to find out the lucky ones among the best at the end. It differs much from one place of
        the charge to the next: what stands well against one may do nothing against the others, so
        that against a hidden charge layouts meet several places from the start.
        """
        most = len(problem.threats)
        if len({threat.charge for threat in problem.threats}) == 1:
            wanted = budget // LAYOUTS_PER_REALISATION
        else:
            wanted = round(CHARGES_PER_ROOT_BLAST * budget**0.5)
        threats = max(1, min(wanted, most, budget))
        if threats == most:
            return cls.thorough(problem, budget)
        held_back = min(CONFIRMED_LAYOUTS * most, int(MOST_CONFIRMING_SHARE * budget))
        return cls(threats, budget - held_back)

    @classmethod
    def thorough(cls, problem: LayoutProblem, budget: int) -> "Plan":
        """Return the plan by which every layout meets every threat at once."""
        return cls(len(problem.threats), budget)
