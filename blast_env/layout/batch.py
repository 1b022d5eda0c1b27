"""Layouts of several environments that grow in place, with their legal places, in arrays."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import fsum

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.geometry import Element, Layout
from blast_env.layout.placement import LayoutState
from blast_env.site.catalogue import Catalogue
from blast_env.site.models import Scenario
from blast_env.site.zone import BuildZone
from blast_env.vehicles.access_way import closing_places


@dataclass(frozen=True, eq=False)
class PlacementRules:
    """What the legal places after a placement follow from, on one site.

    Attributes:
        scenario: The scenario.
        zone: Its build zone.
        catalogue: The catalogue.
        costs: Cost of each variant by its lower left cell (variants, rows, columns).
        dearest: The largest of these costs at a place that is legal on the empty site.
        sizes: Rows and columns of each variant; 0 and 0 of a measure.
        passable: Cells that are free of structures (rows, columns).
        overlapping: Each variant that covers cells, with its rows and columns less one.
    """

    scenario: Scenario
    zone: BuildZone
    catalogue: Catalogue
    costs: FloatArray
    dearest: float
    sizes: tuple[tuple[int, int], ...]
    passable: BoolArray
    overlapping: tuple[tuple[int, int, int], ...]
    _elements: dict[int, Element] = field(default_factory=dict, init=False, repr=False)

    def element(self, number: int) -> Element:
        """Return an element by its number; each is made once."""
        found = self._elements.get(number)
        if found is None:
            found = self._elements[number] = self.catalogue.element(number)
        return found

    @classmethod
    def of(cls, start: LayoutState) -> "PlacementRules":
        """Return the rules on the site of a layout."""
        scenario, catalogue = start.scenario, start.catalogue
        sizes = tuple((each.rows, each.columns) for each in catalogue.variants)
        dearest = float(start.costs[start.fits].max(initial=0.0))
        overlapping = tuple(
            (number, rows - 1, columns - 1) for number, (rows, columns) in enumerate(sizes) if rows
        )
        return cls(
            *(scenario, scenario.zone, catalogue, start.costs, dearest, sizes, start.passable),
            overlapping,
        )


class LayoutBatch:
    """Layouts that grow piece by piece; their legal places are those of `LayoutState`.

    A piece takes away the places that it overlaps, those of an item that is used up, those beyond
    the budget, and those that would close the access way: nothing becomes legal again. So an array
    of the legal places is updated, where `LayoutState` finds them anew.

    Args:
        start: A layout on a site of the common size.
        count: Number of layouts.

    Attributes:
        legal: Whether each variant may be placed (layouts, variants, rows, columns).
        standing: Number of the variant on each cell from 1, or 0 (layouts, rows, columns).
        table: 1 where a variant has its lower left cell (layouts, variants, rows, columns).
        left: Pieces left in all, then of each item (layouts, 1 + items).
        budget_left: Remaining budget; 0 without one (layouts,).
        rules: The rules for each layout.
        layouts: The elements of each.
    """

    def __init__(self, start: LayoutState, count: int) -> None:
        shape = start.legal.shape
        self.legal: BoolArray = np.zeros((count, *shape), dtype=np.bool_)
        self.standing: NDArray[np.uint8] = np.zeros((count, *shape[1:]), dtype=np.uint8)
        self.table: NDArray[np.int8] = np.zeros((count, *shape), dtype=np.int8)
        self.left: IntArray = np.zeros((count, 1 + len(start.catalogue.stocks)), dtype=np.int64)
        self.budget_left: FloatArray = np.zeros(count)
        self.rules: list[PlacementRules] = [PlacementRules.of(start)] * count
        self.layouts: list[list[Element]] = [[] for _ in range(count)]
        self._spent: list[list[float]] = [[] for _ in range(count)]

    def begin(self, index: int, rules: PlacementRules, start: LayoutState) -> None:
        """Put a layout in the place of another one."""
        self.rules[index] = rules
        self.layouts[index] = list(start.layout)
        self.legal[index], self.standing[index] = start.legal, start.standing
        self.table[index] = 0
        self._spent[index] = []
        for element in start.layout:
            place = rules.catalogue.variant_number(element), element[0], element[1]
            self.table[index][place] = 1
            self._spent[index].append(float(rules.costs[place]))
        self.left[index, 0] = start.stock_left
        self.left[index, 1:] = rules.catalogue.stocks
        if rules.catalogue.has_items:
            for element in start.layout:
                self.left[index, 1 + rules.catalogue.variant(element).item] -= 1
        else:
            self.left[index, 1] = start.stock_left
        self.budget_left[index] = start.budget_left or 0.0

    def place(self, index: int, number: int) -> None:
        """Place an element on a legal place, by its number in the catalogue."""
        rules, legal, left = self.rules[index], self.legal[index], self.left[index]
        rows, columns = rules.catalogue.shape
        variant, cell = divmod(number, rows * columns)
        row, column = divmod(cell, columns)
        self.layouts[index].append(rules.element(number))
        self.table[index, variant, row, column] = 1
        high, wide = rules.sizes[variant]
        if high:
            self.standing[index, row : row + high, column : column + wide] = variant + 1
            above, beyond = row + high, column + wide
            for other, up, right in rules.overlapping:
                first, start = row - up, column - right
                legal[other, max(first, 0) : above, max(start, 0) : beyond] = False
        variants = rules.catalogue.variants
        item = variants[variant].item
        left[0] -= 1
        left[1 + item] -= 1
        if left[0] == 0:
            legal[:] = False
        elif left[1 + item] == 0:
            for other, each in enumerate(variants):
                if each.item == item:
                    legal[other] = False
        self._spent[index].append(float(rules.costs[variant, row, column]))
        self._limit_to_budget(index)
        if rules.zone.access_way is not None and high:
            passable = rules.passable & (self.standing[index] == 0)
            for own, closes in zip(
                legal, closing_places(rules.zone.access_way, passable, rules.sizes), strict=True
            ):
                own &= ~closes

    def _limit_to_budget(self, index: int) -> None:
        rules = self.rules[index]
        if rules.zone.budget is None:
            return
        spent = fsum(self._spent[index])  # exact, so that the order does not matter
        self.budget_left[index] = max(0.0, rules.zone.budget - spent)
        spendable = rules.zone.cost_limit - spent
        if spendable < rules.dearest:
            self.legal[index] &= rules.costs <= spendable

    def state(self, index: int) -> LayoutState:
        """Return a layout as it is now."""
        state = LayoutState(self.rules[index].scenario, tuple(self.layouts[index]))
        legal, standing = self.legal[index].copy(), self.standing[index].copy()
        legal.flags.writeable = False
        vars(state).update(legal=legal, standing=standing)
        return state

    def placements(
        self, chosen: Sequence[int], possible: Mapping[int, BoolArray] | None = None
    ) -> "Placements":
        """Return some of the layouts in arrays.

        Args:
            chosen: Their indices.
            possible: Legal places of some of them, in the place of all.
        """
        are_all = len(chosen) == len(self.rules)  # the usual case, without copies
        rows: slice | list[int] = slice(None) if are_all else list(chosen)
        legal = self.legal[rows]
        if possible:
            legal = legal.copy()
            for position, index in enumerate(chosen):
                if index in possible:
                    legal[position] = possible[index]
        return Placements(
            [self.rules[index] for index in chosen],
            [self.layouts[index] for index in chosen],
            *(legal, self.standing[rows], self.left[rows], self.budget_left[rows]),
        )


@dataclass(frozen=True, eq=False)
class Placements:
    """Several layouts, in arrays; see `LayoutBatch` for the attributes."""

    rules: Sequence[PlacementRules]
    layouts: Sequence[Sequence[Element]]
    legal: BoolArray
    standing: NDArray[np.uint8]
    left: IntArray
    budget_left: FloatArray

    @classmethod
    def of(cls, state: LayoutState) -> "Placements":
        """Return a single layout."""
        left = np.array([[state.stock_left, *state.stocks_left]])
        budget_left = np.array([state.budget_left or 0.0])
        arrays = state.legal[np.newaxis], state.standing[np.newaxis], left, budget_left
        return cls([PlacementRules.of(state)], [state.layout], *arrays)

    def layout(self, position: int) -> Layout:
        """Return a layout."""
        return tuple(self.layouts[position])
