"""Placing modules: which cells are free, and layouts that are legal."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import fsum
from operator import index
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import BoolArray
from blast_env.errors import LayoutError
from blast_env.geometry import Cell
from blast_env.scenario.files import AnyScenario, find_scenario
from blast_env.scenario.models import Scenario
from blast_env.scenario.problems import type_word, value_text
from blast_env.scenario.zone import (
    NO_ZONE,
    BuildZone,
    EmptyZone,
    Surroundings,
    closing_cells,
    empty_zone,
    is_open,
    reason_against,
)

_PAIR: Final = "must be a pair of integers (row, column)"


def cells_from(layout: Any) -> tuple[Cell, ...]:
    """Return the cells of a layout as plain integers, in their order.

    Args:
        layout: A list of (row, column). NumPy integers and arrays are welcome.

    Raises:
        LayoutError: If it is anything else: a set has no order, and floats and truth values are
            no integers.
    """
    is_array = isinstance(layout, np.ndarray) and layout.ndim > 0
    if is_array or (isinstance(layout, Sequence) and not isinstance(layout, str | bytes)):
        return tuple(cell_from(item, f"layout[{i}]") for i, item in enumerate(layout))
    raise LayoutError(f"layout is {type_word(layout)}, must be a list of (row, column) pairs")


def cell_from(item: Any, place: str) -> Cell:
    """Return a pair of integers as a cell.

    Args:
        item: (row, column), as for `cells_from`.
        place: Where it comes from, for the error.

    Raises:
        LayoutError: If it is anything else.
    """
    if type(item) is tuple and tuple(map(type, item)) == (int, int):
        return item  # the usual case
    listed = item.tolist() if isinstance(item, np.ndarray | np.generic) else item
    if not isinstance(listed, list | tuple):
        raise LayoutError(f"{place}: is {type_word(listed)}, {_PAIR}")
    if len(listed) != 2:
        raise LayoutError(f"{place}: has {len(listed)} values, {_PAIR}")
    if not all(_is_integer(number) for number in listed):
        raise LayoutError(f"{place}: is ({', '.join(map(type_word, listed))}), {_PAIR}")
    return index(listed[0]), index(listed[1])


def cell_text(cell: Cell) -> str:
    """Return a cell for a message: `cell (3, 4)`."""
    return f"cell ({value_text(cell[0])}, {value_text(cell[1])})"


def _is_integer(value: Any) -> bool:
    """Whether the value is an integer; `True` and 1.0 are not."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


@dataclass(frozen=True)
class Placement:
    """A layout in the making: immutable, every module placed gives another placement.

    Made with `Placement.empty`, `Placement.of` and `place`, which keep every condition of the
    build zone; the constructor itself checks nothing. What may stand depends on which cells are
    taken, not on their order, and whatever may stand may also stand with fewer modules around it.

    Attributes:
        scenario: The scenario.
        cells: (row, column) of each module, in the order in which they were placed.
    """

    scenario: Scenario
    cells: tuple[Cell, ...]

    @classmethod
    def empty(cls, scenario: AnyScenario) -> "Placement":
        """Return the placement without modules.

        Args:
            scenario: The scenario, or its bundled name or path.
        """
        return cls(find_scenario(scenario), ())

    @classmethod
    def of(cls, scenario: AnyScenario, cells: Sequence[Cell]) -> "Placement":
        """Return the placement of a whole layout.

        Args:
            scenario: The scenario, or its bundled name or path.
            cells: (row, column) of each module. NumPy integers and arrays are welcome.

        Raises:
            LayoutError: If a cell is not a pair of integers, lies outside the build zone, is
                repeated or not available once the cells before it are taken.
        """
        layout = cells_from(cells)
        whole = cls(find_scenario(scenario), layout)
        return whole if whole._is_sound else _placed_one_by_one(whole.scenario, layout)

    def place(self, cell: Cell) -> "Placement":
        """Return the placement with one more module.

        Args:
            cell: (row, column).

        Raises:
            LayoutError: If the cell is not available; the message is that of `explain`.
        """
        cell = cell_from(cell, "cell")
        reason = self.explain(cell)
        if reason is not None:
            raise LayoutError(reason)
        placed = Placement(self.scenario, (*self.cells, cell))
        # To look it up takes as long as all the rest of a step of the environment.
        vars(placed)["_empty_zone"] = self._empty_zone
        return placed

    def explain(self, cell: Cell) -> str | None:
        """Return a sentence that says why a cell is not available, or `None` if it is.

        Args:
            cell: (row, column), also of a cell that does not exist.

        Raises:
            LayoutError: If it is not a pair of integers.
        """
        cell = cell_from(cell, "cell")
        reason = self._reason_against_site(cell)
        if reason is None and cell in self.cells:
            reason = "is taken by a module"
        if reason is not None:
            return f"{cell_text(cell)} {reason}"
        if self.stock_left == 0:
            return f"the stock of {_counted_modules(len(self.cells))} is used up"
        reason = self._reason_against_cost(cell) or self._reason_against_closing(cell)
        return None if reason is None else f"{cell_text(cell)} {reason}"

    @cached_property
    def free(self) -> BoolArray:
        """Which cells may take a module now, shape (rows, columns), read-only.

        (0, 0) without a build zone.
        """
        free = np.zeros(self._zone.shape, dtype=bool)
        if self.stock_left > 0:
            affordable = self._empty_zone.module_costs <= self._spendable
            free = self._empty_zone.usable & affordable & ~self._taken & ~self._closing
        free.flags.writeable = False
        return free

    @property
    def usable(self) -> BoolArray:
        """Which cells may ever take a module, as far as the site is concerned, read-only.

        Shape (rows, columns). Neither the modules nor stock, budget and access way count here.
        """
        return self._empty_zone.usable

    @property
    def module_costs(self) -> NDArray[np.float64]:
        """What a module on each cell costs, shape (rows, columns), read-only."""
        return self._empty_zone.module_costs

    @property
    def is_full(self) -> bool:
        """Whether no cell may take another module."""
        return not self.free.any()

    @property
    def stock_left(self) -> int:
        """How many modules of the stock are left."""
        return self._zone.stock - len(self.cells)

    @cached_property
    def cost(self) -> float:
        """What the modules cost together."""
        # Summed exactly, so that the order of the cells does not matter.
        return fsum(self._empty_zone.module_costs[cell] for cell in self.cells)

    @property
    def budget_left(self) -> float | None:
        """What is left of the budget; `None` without one."""
        budget = self._zone.budget
        return None if budget is None else max(0.0, budget - self.cost)

    @property
    def _zone(self) -> BuildZone:
        """The build zone; one without cells where the scenario has none."""
        return self.scenario.build_zone or NO_ZONE

    @property
    def _spendable(self) -> float:
        """What the next module may cost."""
        return self._zone.cost_limit - self.cost

    @cached_property
    def _empty_zone(self) -> EmptyZone:
        """What holds for the cells without the modules."""
        return empty_zone(self._surroundings)

    @property
    def _surroundings(self) -> Surroundings:
        scenario = self.scenario
        return Surroundings(
            self._zone, scenario.structures, scenario.charge, scenario.charge_radius_m
        )

    @cached_property
    def _taken(self) -> BoolArray:
        """Which cells hold a module, shape (rows, columns)."""
        taken = np.zeros(self._zone.shape, dtype=bool)
        if self.cells:
            taken[tuple(zip(*self.cells, strict=True))] = True
        return taken

    @cached_property
    def _closing(self) -> BoolArray:
        """On which cells a module would close the access way, shape (rows, columns)."""
        way = self._zone.access_way
        if way is None:
            return np.zeros(self._zone.shape, dtype=bool)
        return closing_cells(way, self._empty_zone.passable & ~self._taken)

    @property
    def _is_sound(self) -> bool:
        """Whether all cells together keep every condition."""
        zone = self._zone
        if not self.cells:
            return True
        if self.stock_left < 0 or len(set(self.cells)) < len(self.cells):
            return False
        if not all(map(zone.has, self.cells)):
            return False
        if self._spendable < 0.0 or not self._empty_zone.usable[self._taken].all():
            return False
        passable = self._empty_zone.passable & ~self._taken
        return zone.access_way is None or is_open(zone.access_way, passable)

    def _reason_against_site(self, cell: Cell) -> str | None:
        """Return why a cell may not be used even without modules, or `None` if it may."""
        zone = self._zone
        if zone is NO_ZONE:
            return "is not usable: the scenario has no build zone"
        if not zone.has(cell):
            return f"is outside the build zone of {zone.rows} rows and {zone.columns} columns"
        if self._empty_zone.usable[cell]:
            return None
        return reason_against(self._surroundings, cell)

    def _reason_against_cost(self, cell: Cell) -> str | None:
        """Return why a module on a cell cannot be paid for, or `None` if it can."""
        cost = self._empty_zone.module_costs[cell]
        budget = self._zone.budget
        if budget is None or cost <= self._spendable:
            return None
        return (
            f"costs {cost:.10g}, but only {self.budget_left:.10g} of the budget of"
            f" {budget:.10g} is left"
        )

    def _reason_against_closing(self, cell: Cell) -> str | None:
        """Return why a module on a cell would be in the way, or `None` if it would not."""
        way = self._zone.access_way
        if way is None or not self._closing[cell]:
            return None
        return f"would close the {way.description}"

    def __reduce__(self) -> tuple[Callable[..., "Placement"], tuple[Any, ...]]:
        """Pickle only what cannot be worked out again: arrays would come back writeable."""
        return Placement, (self.scenario, self.cells)


def _placed_one_by_one(scenario: Scenario, layout: tuple[Cell, ...]) -> Placement:
    """Place the cells of a layout in their order, or raise the error for the first that fails."""
    placement = Placement.empty(scenario)
    for cell in layout:
        if cell in placement.cells:
            raise LayoutError(f"{cell_text(cell)} is repeated")
        reason = placement._reason_against_site(cell)
        if reason is None and placement.stock_left == 0:
            raise LayoutError(
                f"{cell_text(cell)} is beyond the stock:"
                f" the layout has {len(layout)} modules, must have at most {len(placement.cells)}"
            )
        placement = placement.place(cell)
    return placement


def _counted_modules(count: int) -> str:
    return "1 module" if count == 1 else f"{count} modules"


def usable_cells(scenario: AnyScenario) -> NDArray[np.bool_]:
    """Return which cells may hold a module as far as the site is concerned.

    That leaves out keep-outs, structures, their clearance and the charge; what depends on the
    modules already placed (stock, budget, access way) is for `Placement` to say.

    Args:
        scenario: The scenario, or its bundled name or path.

    Returns:
        An array of shape (rows, columns), read-only; (0, 0) without a build zone.
    """
    return Placement.empty(scenario).usable


def check_layout(scenario: AnyScenario, layout: Sequence[Cell]) -> tuple[Cell, ...]:
    """Return the cells of a layout as plain integers, in their order.

    Args:
        scenario: The scenario that the layout is for, or its bundled name or path.
        layout: (row, column) of each module. NumPy integers and arrays are welcome.

    Raises:
        LayoutError: As `Placement.of` does, if a cell is not available.
    """
    return Placement.of(scenario, layout).cells
