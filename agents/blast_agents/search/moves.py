"""Small changes of layouts, every one of them legal."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import cos, hypot, pi, sin
from typing import Final

import numpy as np

from blast_env.arrays import BoolArray
from blast_env.geometry import Cell, Element, Layout, Piece
from blast_env.scenario import Placement, Scenario

Draw = Callable[[Scenario, np.random.Generator], Layout]
"""Draws a legal layout to begin with."""


_LEAST_WALL: Final = 2


def legal_part(scenario: Scenario, layout: Iterable[Element]) -> Placement:
    """Return the placement of a layout, in its order, leaving out what may not stand.

    Args:
        scenario: The scenario.
        layout: Modules or pieces, also of cells that do not exist.
    """
    placement = Placement.empty(scenario)
    rows, columns = placement.usable.shape
    for element in layout:
        row, column = element[:2]
        if not (0 <= row < rows and 0 <= column < columns):
            continue
        if placement.legal[placement.catalogue.variant_number(element), row, column]:
            placement = placement.place(element)
    return placement


def random_walls(scenario: Scenario, rng: np.random.Generator) -> Layout:
    """Return a layout of straight walls: where, in which direction and how long is random.

    It knows nothing of charge and structures, only that what stands in the way of a blast is a
    wall rather than lone modules. A wall ends where a cell may not take a module; there are as
    many walls as the stock lasts for.
    """
    placement = Placement.empty(scenario)
    while not placement.is_full:
        row, column = _one_of(placement.free, rng)
        angle = rng.uniform(0.0, pi)
        length = int(rng.integers(_LEAST_WALL, max(placement.stock_left, _LEAST_WALL) + 1))
        longest = max(abs(cos(angle)), abs(sin(angle)))
        steps = np.arange(length)[:, np.newaxis] * (sin(angle) / longest, cos(angle) / longest)
        for cell in (np.array((row, column)) + np.rint(steps).astype(int)).tolist():
            inside = all(
                0 <= at < size for at, size in zip(cell, placement.free.shape, strict=True)
            )
            if not inside or not placement.free[tuple(cell)]:
                break
            placement = placement.place((cell[0], cell[1]))
    return placement.layout


def random_part(scenario: Scenario, rng: np.random.Generator) -> Layout:
    """Return the first few modules of random walls, any number as likely, down to none."""
    layout = random_walls(scenario, rng)
    return layout[: int(rng.integers(len(layout) + 1))]


@dataclass(frozen=True)
class Moves:
    """Draws a neighbour of a layout.

    Attributes:
        scenario: The scenario.
        reach_cells: Standard deviation of the way that a module or a wall is moved.
        far_share: Share of the moves in which a module goes anywhere.
        wall_share: Share of the moves in which all modules near one of them move together.
        count_share: Share of the moves that add a module or take one away.
    """

    scenario: Scenario
    reach_cells: float = 2.0
    far_share: float = 0.2
    wall_share: float = 0.25
    count_share: float = 0.1

    def neighbour(self, layout: Layout, rng: np.random.Generator) -> Layout:
        """Return a layout that differs a little; all conditions of the build zone hold."""
        if not layout:
            return self._added(layout, rng)
        kind = rng.random()
        if kind < self.count_share:
            return self._added(layout, rng) if rng.random() < 0.7 else self._removed(layout, rng)
        if kind < self.count_share + self.wall_share:
            return self._wall_moved(layout, rng)
        if kind < self.count_share + self.wall_share + self.far_share:
            return self._swapped(layout, rng)
        return self._moved(layout, rng)

    def _added(self, layout: Layout, rng: np.random.Generator) -> Layout:
        """Add a module beside another one; if nothing may be added, move one."""
        placement = Placement(self.scenario, layout)
        if placement.is_full:
            return self._moved(layout, rng) if layout else layout
        if not layout:
            return (_one_of(placement.free, rng),)
        return placement.place(self._near(placement.free, _any_of(layout, rng), rng)).layout

    def _removed(self, layout: Layout, rng: np.random.Generator) -> Layout:
        return _without(layout, int(rng.integers(len(layout))))

    def _moved(self, layout: Layout, rng: np.random.Generator) -> Layout:
        """Move one module a little way, from where it is or to beside another one."""
        index = int(rng.integers(len(layout)))
        rest = Placement(self.scenario, _without(layout, index))
        to_another = len(layout) > 1 and rng.random() < 0.5
        beside = _any_of(rest.layout, rng) if to_another else layout[index]
        return rest.place(self._near(rest.free, beside, rng, layout[index])).layout

    def _swapped(self, layout: Layout, rng: np.random.Generator) -> Layout:
        """Take one module away and put one on any cell."""
        rest = Placement(self.scenario, _without(layout, int(rng.integers(len(layout)))))
        return rest.place(_one_of(rest.free, rng)).layout

    def _wall_moved(self, layout: Layout, rng: np.random.Generator) -> Layout:
        """Move the modules that hang together with one of them, or all, by the same way."""
        wall = _connected(layout, _any_of(layout, rng))
        if rng.random() < 0.3:
            wall = set(layout)
        up, right = np.rint(rng.normal(0.0, self.reach_cells, 2)).astype(int).tolist()
        moved = [_shifted(each, up, right) for each in layout if each in wall]
        stay = [cell for cell in layout if cell not in wall]
        placement = legal_part(self.scenario, [*stay, *moved])
        # What cannot go along is put beside what could.
        while len(placement.layout) < len(layout) and not placement.is_full:
            if not placement.layout:
                return layout
            beside = _any_of(placement.layout, rng)
            placement = placement.place(self._near(placement.free, beside, rng))
        return placement.layout

    def _near(
        self, free: BoolArray, cell: Element, rng: np.random.Generator, but: Element | None = None
    ) -> Cell:
        """Return a free cell near another one; at least one cell besides `but` should be free."""
        rows, columns = np.nonzero(free)
        away = np.hypot(rows - cell[0], columns - cell[1])
        if but is not None:
            away[(rows == but[0]) & (columns == but[1])] = np.inf
        weight = np.exp(-0.5 * (away / self.reach_cells) ** 2)
        total = float(weight.sum())
        if total < 1e-12:
            index = int(np.argmin(away))
        else:
            index = int(np.searchsorted(np.cumsum(weight), rng.random() * total))
            index = min(index, len(rows) - 1)
        return int(rows[index]), int(columns[index])


def _connected(layout: Layout, start: Element) -> set[Element]:
    """Return the modules that hang together with one, corners included."""
    found, todo, left = {start}, [start], set(layout) - {start}
    while todo:
        row, column = todo.pop()[:2]
        beside = {each for each in left if hypot(each[0] - row, each[1] - column) < 1.5}
        left -= beside
        found |= beside
        todo += sorted(beside)
    return found


def _shifted(element: Element, up: int, right: int) -> Element:
    """Return an element so many cells further up and to the right."""
    row, column = element[0] + up, element[1] + right
    return element._replace(row=row, column=column) if isinstance(element, Piece) else (row, column)


def _without(layout: Layout, index: int) -> Layout:
    return layout[:index] + layout[index + 1 :]


def _any_of(layout: Layout, rng: np.random.Generator) -> Element:
    return layout[int(rng.integers(len(layout)))]


def _one_of(cells: BoolArray, rng: np.random.Generator) -> Cell:
    """Return one of the true cells (rows, columns), all as likely."""
    chosen = np.flatnonzero(cells)
    row, column = divmod(int(chosen[rng.integers(len(chosen))]), cells.shape[1])
    return row, column
