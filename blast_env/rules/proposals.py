"""What the rules propose for a charge, in arrays: elements of their layouts, with values."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Final

import numpy as np

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.errors import BlastEnvError
from blast_env.geometry import Layout
from blast_env.layout import ById, LayoutState
from blast_env.rules.table import RuleRow
from blast_env.rules.walls import expected_charge, line_of_sight, seen_with
from blast_env.sections import PointM
from blast_env.site import AnyCharge, Scenario
from blast_env.sites import Visibility, cut_share_of
from blast_env.units import MODULE_SIDE_M

_HEIGHT_M: Final = 12.0
_ASIDE_M: Final = 20.0


@dataclass(frozen=True, eq=False)
class Proposals:
    """The layouts of rules on a site for a charge, computed when they are asked for.

    Attributes:
        scenario: The scenario.
        rules: The rules; one that has no layout for the scenario places nothing.
        charge: The charge as the rules know it; `None` for all of the scenario.
    """

    scenario: Scenario
    rules: tuple[RuleRow, ...]
    charge: AnyCharge | None = None

    @cached_property
    def layouts(self) -> tuple[Layout, ...]:
        """The layout of each rule, in its order of placement."""
        return tuple(rule.layout(self.scenario, self.charge) or () for rule in self.rules)

    @cached_property
    def are_there(self) -> BoolArray:
        """Whether each layout has so many elements (rules, most)."""
        counts = np.array([len(layout) for layout in self.layouts], dtype=np.int64)
        there: BoolArray = np.arange(counts.max(initial=1)) < counts[:, np.newaxis]
        return there

    @cached_property
    def numbers(self) -> IntArray:
        """Numbers in the catalogue of each layout's elements; 0 behind the last (rules, most)."""
        action = self.scenario.zone.catalogue.action
        numbers = np.zeros(self.are_there.shape, dtype=np.int64)
        numbers[self.are_there] = [action(element) for item in self.layouts for element in item]
        return numbers

    @cached_property
    def cut_shares(self) -> FloatArray:
        """The share of the lines of sight that each layout cuts, 0 to 1 (rules,)."""
        lines = Visibility.of(seen_with(self.scenario, self.charge))
        states = [LayoutState(self.scenario, layout) for layout in self.layouts]
        return np.array([cut_share_of(lines, state) for state in states])

    @cached_property
    def pieces(self) -> FloatArray:
        """Values of each element, from 0 to 1 (rules, most, 4).

        Cost / budget, or / the dearest element's cost without a budget; height / 12 m; distance
        along the line of sight / its length; distance to the left of it / 20 m + 0.5. The line
        leads from the mean place of the charge to the middle of the protected structures.
        """
        zone, costs = self.scenario.zone, LayoutState.empty(self.scenario).empty_zone.costs
        variants = zone.catalogue.variants
        number, row, column = np.unravel_index(self.numbers[self.are_there], costs.shape)
        # 1. Cost and height.
        heights_m = np.array([variant.height_m or _HEIGHT_M for variant in variants])
        cost = costs[number, row, column] / (zone.budget or costs.max(initial=1.0))
        # 2. The centre of each element, in the frame of the line of sight.
        sources = seen_with(self.scenario, self.charge).charge
        start_m = expected_charge(sources).position_m
        ahead_x, ahead_y, length_m = self._line_from(start_m)
        columns, rows = np.array([(item.columns, item.rows) for item in variants])[number].T
        x_m = zone.corner_m[0] + MODULE_SIDE_M * (column + columns / 2.0) - start_m[0]
        y_m = zone.corner_m[1] + MODULE_SIDE_M * (row + rows / 2.0) - start_m[1]
        along, aside_m = (x_m * ahead_x + y_m * ahead_y) / length_m, y_m * ahead_x - x_m * ahead_y
        # 3. As values from 0 to 1.
        values = np.zeros((*self.are_there.shape, 4))
        of_each = cost, heights_m[number] / _HEIGHT_M, along, aside_m / _ASIDE_M + 0.5
        values[self.are_there] = np.stack(of_each, axis=1).clip(0.0, 1.0)
        return values

    def _line_from(self, start_m: PointM) -> tuple[float, float, float]:
        """Return the direction and the length of the line of sight; (0, 0) at its very end."""
        try:
            return line_of_sight(self.scenario, start_m)
        except BlastEnvError:  # such as the mean of charges around a building
            return 0.0, 0.0, 1.0


@lru_cache(maxsize=512)
def proposals_for(site: ById, rules: tuple[RuleRow, ...], charge: AnyCharge | None) -> Proposals:
    """Return the proposals of rules; those of the last cases are kept.

    Args:
        site: The scenario; it has a build zone.
        rules: The rules.
        charge: The charge, if it is known.
    """
    return Proposals(site.scenario, rules, charge)
