"""Small changes of layouts; every result is legal."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from math import cos, pi, sin
from typing import Final

import numpy as np
from numpy.typing import NDArray

from blast_env.geometry import Element, Layout, Piece
from blast_env.layout import LayoutState
from blast_env.rules import random_element
from blast_env.site import Catalogue, Scenario

Draw = Callable[[Scenario, np.random.Generator], Layout]
"""Draws a legal initial layout."""

_LEAST_WALL: Final = 2


def legal_part(scenario: Scenario, layout: Sequence[Element]) -> LayoutState:
    """Return the placement of a layout, in its order, without its illegal elements.

    Args:
        layout: Modules or pieces; those on cells outside the zone are illegal.
    """
    return LayoutState.empty(scenario).with_those_legal(layout)


def random_walls(scenario: Scenario, rng: np.random.Generator) -> Layout:
    """Return a layout of straight walls of random position, direction and length.

    The layout is independent of the charge and the structures; walls obstruct a blast better than
    isolated modules. A wall ends at the first illegal cell, and walls are added until the stock is
    used up. With a catalogue, each wall consists of one item, drawn at random, in line.
    """
    placement = LayoutState.empty(scenario)
    grow = _with_pieces if placement.catalogue.has_items else _with_modules
    while not placement.is_full:
        placement = grow(placement, rng)
    return placement.layout


def _with_modules(placement: LayoutState, rng: np.random.Generator) -> LayoutState:
    """Add a straight wall of modules in any direction."""
    row, column = random_element(placement, rng)[:2]
    # A line of Bresenham's kind: the longer axis advances by one cell a step.
    angle = rng.uniform(0.0, pi)
    length = int(rng.integers(_LEAST_WALL, max(placement.stock_left, _LEAST_WALL) + 1))
    longest = max(abs(cos(angle)), abs(sin(angle)))
    steps = np.arange(length)[:, np.newaxis] * (sin(angle) / longest, cos(angle) / longest)
    cells = (np.array((row, column)) + np.rint(steps).astype(int)).tolist()
    return _as_far_as_legal(placement, [(cell[0], cell[1]) for cell in cells])


def _with_pieces(placement: LayoutState, rng: np.random.Generator) -> LayoutState:
    """Add pieces of one item in line, from one end to the other."""
    first = random_element(placement, rng)
    variant = placement.catalogue.variant(first)
    # Along the piece's own length; square ones in either direction.
    up, right = (variant.rows, 0) if variant.rows >= variant.columns else (0, variant.columns)
    if variant.rows == variant.columns and rng.random() < 0.5:
        up, right = right, up
    left = placement.stocks_left[variant.item]
    length = int(rng.integers(1, max(left, 1) + 1))
    wall = [_shifted(first, step * up, step * right) for step in range(length)]
    return _as_far_as_legal(placement, wall)


def _as_far_as_legal(placement: LayoutState, wall: Iterable[Element]) -> LayoutState:
    """Place the elements of a wall up to the first illegal one."""
    for element in wall:
        if not _is_legal(placement, element):
            break
        placement = placement.place(element)
    return placement


def _is_legal(placement: LayoutState, element: Element) -> bool:
    """Return whether an element may be placed; one outside the zone may not."""
    rows, columns = placement.usable.shape
    row, column = element[:2]
    if not (0 <= row < rows and 0 <= column < columns):
        return False
    return bool(placement.legal[placement.catalogue.variant_number(element), row, column])


def random_part(scenario: Scenario, rng: np.random.Generator) -> Layout:
    """Return the first modules of random walls, their number uniform from none to all."""
    layout = random_walls(scenario, rng)
    return layout[: int(rng.integers(len(layout) + 1))]


def drawn_by_rank(best: Sequence[Layout], rng: np.random.Generator) -> Layout:
    """Return one of some layouts, the best first; the probability falls with the rank."""
    # The best has 63 % of the draws, the next 23 %: exploitation with a way out.
    return best[min(int(rng.exponential(1.0)), len(best) - 1)]


@dataclass(frozen=True)
class Moves:
    """Draws a neighbour of a layout.

    Attributes:
        reach_cells: Standard deviation of the displacement of a module, a piece or a wall, in
            cells.
        far_share: Share of the moves that relocate a module or piece to a random place.
        wall_share: Share of the moves that displace a connected group of modules or pieces.
        count_share: Share of the moves that add or remove a module or piece.
        item_share: With a catalogue, share of the moves that replace a piece by up to three
            others (or the same one rotated), as stock and budget allow.
    """

    scenario: Scenario
    reach_cells: float = 2.0
    far_share: float = 0.2
    wall_share: float = 0.25
    count_share: float = 0.1
    item_share: float = 0.2
    # Layouts found to be legal, as plain values: the best ones come again and again.
    _legal: dict[Layout, Layout] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def near_best(self, best: Sequence[Layout], rng: np.random.Generator) -> Layout:
        """Return a sorted neighbour, one or two moves from a layout drawn in favour of the first.

        Args:
            best: Layouts, the best first; the probability falls exponentially with the rank.
            rng: Draws the layout and the moves.
        """
        layout = drawn_by_rank(best, rng)
        for _ in range(1 + int(rng.random() < 0.4)):
            layout = self.neighbour(layout, rng)
        return self._kept(tuple(sorted(layout)))

    def neighbour(self, layout: Layout, rng: np.random.Generator) -> Layout:
        """Return a slightly different layout that satisfies all conditions of the zone.

        Illegal elements of the layout are left out.
        """
        known = self._legal.get(layout)
        layout = self._kept(legal_part(self.scenario, layout).layout) if known is None else known
        return self._kept(self._changed(layout, rng))

    def _kept(self, layout: Layout) -> Layout:
        """Return a legal layout, known as such from now on."""
        return self._legal.setdefault(layout, layout)

    def _state(self, layout: Layout) -> LayoutState:
        """Return the placement of a legal layout."""
        return LayoutState.empty(self.scenario).with_legal(layout)

    def _changed(self, layout: Layout, rng: np.random.Generator) -> Layout:
        """Return a neighbour of a legal layout."""
        if not layout:
            return self._added(layout, rng)
        # One draw decides the kind of move; the shares stack up on the interval from 0 to 1.
        kind = rng.random()
        if kind < self.count_share:
            return self._added(layout, rng) if rng.random() < 0.7 else self._removed(layout, rng)
        if kind < self.count_share + self.wall_share:
            return self._wall_moved(layout, rng)
        if kind < self.count_share + self.wall_share + self.far_share:
            return self._swapped(layout, rng)
        if isinstance(layout[0], Piece) and kind > 1.0 - self.item_share:
            return self._exchanged(layout, rng)
        return self._moved(layout, rng)

    def _added(self, layout: Layout, rng: np.random.Generator) -> Layout:
        """Add an element near an existing one, or move one if none may be added."""
        placement = self._state(layout)
        if placement.is_full:
            return self._moved(layout, rng) if layout else layout
        if not layout:
            return (random_element(placement, rng),)
        return placement.place(self._near(placement, _any_of(layout, rng), rng)).layout

    def _removed(self, layout: Layout, rng: np.random.Generator) -> Layout:
        return _without(layout, int(rng.integers(len(layout))))

    def _moved(self, layout: Layout, rng: np.random.Generator) -> Layout:
        """Move an element near its present place or near another element; its item is kept."""
        index = int(rng.integers(len(layout)))
        rest = self._state(_without(layout, index))
        to_another = len(layout) > 1 and rng.random() < 0.5
        beside = _any_of(rest.layout, rng) if to_another else layout[index]
        return rest.place(self._near(rest, beside, rng, layout[index], like=layout[index])).layout

    def _swapped(self, layout: Layout, rng: np.random.Generator) -> Layout:
        """Remove an element and place another one at random."""
        rest = self._state(_without(layout, int(rng.integers(len(layout)))))
        return rest.place(random_element(rest, rng)).layout

    def _exchanged(self, layout: Layout, rng: np.random.Generator) -> Layout:
        """Replace one or two pieces by up to three others near the first.

        An expensive piece can become several cheap ones, and a long low wall a short high one.
        """
        index = int(rng.integers(len(layout)))
        there, rest = layout[index], _without(layout, index)
        if rest and rng.random() < 0.5:
            rest = _without(rest, int(rng.integers(len(rest))))
        placement = self._state(rest)
        wanted = 1 + int(rng.integers(3))
        while wanted and not placement.is_full:
            placement = placement.place(self._near(placement, there, rng, there))
            wanted -= 1
        return placement.layout

    def _wall_moved(self, layout: Layout, rng: np.random.Generator) -> Layout:
        """Displace a connected group, or the whole layout, by one random vector."""
        # A wall protects as a whole: moved piece by piece it would have gaps on the way.
        wall = self._connected(layout, _any_of(layout, rng))
        if rng.random() < 0.3:
            wall = set(layout)
        up, right = np.rint(rng.normal(0.0, self.reach_cells, 2)).astype(int).tolist()
        moved = [_shifted(element, up, right) for element in layout if element in wall]
        stay = [element for element in layout if element not in wall]
        placement = self._state(tuple(stay)).with_those_legal(moved)
        # Elements that cannot be displaced are placed near those that can.
        while len(placement.layout) < len(layout) and not placement.is_full:
            if not placement.layout:
                return layout
            beside = _any_of(placement.layout, rng)
            placement = placement.place(self._near(placement, beside, rng))
        return placement.layout

    def _near(
        self,
        placement: LayoutState,
        beside: Element,
        rng: np.random.Generator,
        but: Element | None = None,
        like: Element | None = None,
    ) -> Element:
        """Return a legal element near another, drawn with Gaussian weights of its distance.

        Args:
            placement: The placement; at least one element may be added.
            beside: The element to place it near.
            rng: Draws it.
            but: Excluded element, unless no other is legal.
            like: Preferred item; a random one if none of it may be placed, or with `None`.
        """
        catalogue = placement.catalogue
        own = _of_one_item(placement, rng, like) if catalogue.has_items else slice(None)
        numbers, rows, columns = np.nonzero(placement.legal[own])
        numbers += own.start or 0
        away = np.hypot(*_gaps(catalogue, (numbers, rows, columns), beside))
        if but is not None:
            same = numbers == catalogue.variant_number(but)
            away[same & (rows == but[0]) & (columns == but[1])] = np.inf
        # Inverse transform sampling; all weights underflow far from every legal place, where the
        # nearest is taken.
        weight = np.exp(-0.5 * (away / self.reach_cells) ** 2)
        total = float(weight.sum())
        if total < 1e-12:
            index = int(np.argmin(away))
        else:
            index = int(np.searchsorted(np.cumsum(weight), rng.random() * total))
            index = min(index, len(rows) - 1)
        return catalogue.element_at(int(numbers[index]), int(rows[index]), int(columns[index]))

    def _connected(self, layout: Layout, start: Element) -> set[Element]:
        """Return the elements connected with one element, by edges or corners."""
        catalogue = self.scenario.zone.catalogue
        found, todo, left = {start}, [start], set(layout) - {start}
        while todo and left:
            others = sorted(left)
            places = [(catalogue.variant_number(other), *other[:2]) for other in others]
            gaps = _gaps(catalogue, np.array(places).T, todo.pop())
            near = {other for other, gap in zip(others, np.hypot(*gaps), strict=True) if gap < 1.5}
            left -= near
            found |= near
            todo += sorted(near)
        return found


def _of_one_item(placement: LayoutState, rng: np.random.Generator, like: Element | None) -> slice:
    """Return the variants of one item that has a legal place.

    It is the item of `like`, or a random one if that has no legal place or `like` is `None`.
    """
    catalogue, legal = placement.catalogue, placement.legal
    if like is not None:
        wanted = _variants_of(catalogue, catalogue.variant(like).item)
        if legal[wanted].any():
            return wanted
    every = [_variants_of(catalogue, item) for item in range(len(catalogue.names))]
    possible = [own for own in every if legal[own].any()]
    return possible[int(rng.integers(len(possible)))]


def _variants_of(catalogue: Catalogue, item: int) -> slice:
    """Return the variants of an item, which lie one behind the other."""
    numbers = [number for number, own in enumerate(catalogue.variants) if own.item == item]
    return slice(numbers[0], numbers[-1] + 1)


def _gaps(
    catalogue: Catalogue, places: Sequence[NDArray[np.int64]] | NDArray[np.int64], beside: Element
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the distances in rows and columns between places and an element; 1 if they touch.

    Places are the numbers of the variants, and the rows and columns of their lower left cells.
    """
    numbers, rows, columns = places
    sizes = np.array([*catalogue.sizes])[numbers]
    own = catalogue.variant(beside)
    up = np.maximum(rows - beside[0] - (own.rows - 1), beside[0] - rows - (sizes[:, 0] - 1))
    right = np.maximum(
        columns - beside[1] - (own.columns - 1), beside[1] - columns - (sizes[:, 1] - 1)
    )
    return np.maximum(up, 0), np.maximum(right, 0)


def _shifted(element: Element, up: int, right: int) -> Element:
    """Return an element displaced by a number of cells upwards and to the right."""
    row, column = element[0] + up, element[1] + right
    return element._replace(row=row, column=column) if isinstance(element, Piece) else (row, column)


def _without(layout: Layout, index: int) -> Layout:
    return layout[:index] + layout[index + 1 :]


def _any_of(layout: Layout, rng: np.random.Generator) -> Element:
    return layout[int(rng.integers(len(layout)))]
