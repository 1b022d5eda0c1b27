"""Layouts of several environments that grow in place, with their legal places, in arrays."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from sys import getrefcount
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.geometry import Element, Layout
from blast_env.layout.placement import LayoutState, LegalLayout
from blast_env.site import VehicleSource
from blast_env.site.catalogue import Catalogue
from blast_env.site.models import Scenario
from blast_env.site.zone import BuildZone

if TYPE_CHECKING:
    from blast_env.layout.obstacles import ObstacleTable
    from blast_env.vehicles.vehicle import AccessWay

_MOST_ROOMS: Final = 4


def _references(rooms: Sequence[NDArray[np.float32]]) -> list[int]:
    """Return how many references each room has, those of the list and of the count included."""
    return list(map(getrefcount, rooms))


_NOBODY: Final = _references([np.empty(0, dtype=np.float32)])[0]
"""Number of references to a kept room that nobody has; interpreters count differently."""


@dataclass(frozen=True, eq=False)
class PlacementRules:
    """What the legal places after a placement follow from, on one site.

    Attributes:
        costs: Cost of each variant by its lower left cell (variants, rows, columns).
        dearest: The largest of these costs at a place that is legal on the empty site.
        passable: Cells that are free of structures (rows, columns).
        variants: Rows, columns and item of each variant, 0 and 0 of a measure (variants, 3).
    """

    scenario: Scenario
    zone: BuildZone
    catalogue: Catalogue
    costs: FloatArray
    dearest: float
    passable: BoolArray
    variants: IntArray
    _elements: dict[int, Element] = field(default_factory=dict, init=False, repr=False)

    def element(self, number: int) -> Element:
        """Return an element by its number; each is made once."""
        found = self._elements.get(number)
        if found is None:
            found = self._elements[number] = self.catalogue.element(number)
        return found

    @cached_property
    def limits(self) -> tuple[FloatArray, float, float, float]:
        """The costs, the budget (NaN without one), the same with an allowance, and `dearest`."""
        zone = self.zone
        if zone.budget is None:
            return self.costs, np.nan, np.nan, self.dearest
        return self.costs, zone.budget, zone.cost_limit, self.dearest

    @cached_property
    def obstacles(self) -> "ObstacleTable":
        """What the elements are for vehicles."""
        from blast_env.layout.obstacles import ObstacleTable  # most sites have no vehicle

        return ObstacleTable(self.scenario, self.catalogue)

    @classmethod
    def of(cls, start: LayoutState) -> "PlacementRules":
        """Return the rules on the site of a layout."""
        scenario, empty = start.scenario, start.empty_zone
        dearest = float(empty.costs[empty.fits].max(initial=0.0))
        variants = np.array(
            [(variant.rows, variant.columns, variant.item) for variant in empty.catalogue.variants],
            dtype=np.int64,
        ).reshape(-1, 3)
        return cls(
            *(scenario, scenario.zone, empty.catalogue, empty.costs.copy(), dearest),
            *(empty.passable.copy(), variants),  # Numba would compile for read-only ones anew
        )


class LayoutBatch:
    """Layouts that grow piece by piece; their legal places are those of `LayoutState`.

    A piece takes away the places that it overlaps, those of an item that is used up, those beyond
    the budget, and those that would close the access way: nothing becomes legal again. So an array
    of the legal places is updated, where `LayoutState` finds them anew.

    Args:
        start: A layout on a site of the common size.
        rules: The rules of placing on this site.
        count: Number of layouts.

    Attributes:
        legal: Whether each variant may be placed (layouts, variants, rows, columns).
        occupancy: Number of the variant on each cell from 1, or 0 (layouts, rows, columns).
        table: 1 where a variant has its lower left cell (layouts, variants, rows, columns).
        left: Pieces left in all, then of each item (layouts, 1 + items).
        stock: Pieces at first in all, then of each item (layouts, 1 + items).
        budget_left: Remaining budget; 0 without one (layouts,).
        budget: Budget at first; NaN without one (layouts,).
        is_full: Whether nothing more can be placed (layouts,).
        placed: Number of elements in each (layouts,).
        rules: The rules for each layout.
    """

    def __init__(self, start: LayoutState, rules: PlacementRules, count: int) -> None:
        shape = start.legal.shape
        self.legal: BoolArray = np.zeros((count, *shape), dtype=np.bool_)
        self.occupancy: NDArray[np.uint8] = np.zeros((count, *shape[1:]), dtype=np.uint8)
        self.table: NDArray[np.int8] = np.zeros((count, *shape), dtype=np.int8)
        self.left: IntArray = np.zeros((count, 1 + len(start.catalogue.stocks)), dtype=np.int64)
        self.stock: IntArray = np.ones_like(self.left)
        self.budget_left: FloatArray = np.zeros(count)
        self.budget: FloatArray = np.full(count, np.nan)
        self.is_full: BoolArray = np.zeros(count, dtype=np.bool_)
        self.placed: IntArray = np.zeros(count, dtype=np.int64)
        self.rules: list[PlacementRules] = [rules] * count
        self._numbers: IntArray = np.zeros((count, max(start.stock_left, 1)), dtype=np.int64)
        self._sites: IntArray = np.zeros(count, dtype=np.int64)  # the same number, the same rules
        self._rooms: list[NDArray[np.float32]] = []

    def begin(self, indices: Sequence[int], rules: PlacementRules, start: LayoutState) -> None:
        """Put a layout in the place of others."""
        if not indices:
            return
        catalogue = rules.catalogue
        table = np.zeros(self.table.shape[1:], dtype=np.int8)
        # 1. The layout as arrays. Stock is counted for the zone, and behind it for each item.
        left = np.array([start.stock_left, *catalogue.stocks])
        numbers = [catalogue.action(element) for element in start.layout]
        for element in start.layout:
            number = catalogue.variant_number(element)
            table[number, element[0], element[1]] = 1
            if catalogue.has_items:
                left[1 + catalogue.variants[number].item] -= 1
        if not catalogue.has_items:
            left[1] = start.stock_left
        # 2. Room for as many elements as the new site has in stock.
        more = rules.zone.stock - self._numbers.shape[1]
        if more > 0:
            self._numbers = np.pad(self._numbers, ((0, 0), (0, more)))
        # 3. The rows of the layouts that begin anew.
        rows = slice(None) if len(indices) == len(self.rules) else np.array(indices)
        self.legal[rows], self.occupancy[rows] = start.legal, start.occupancy
        self.table[rows], self.left[rows] = table, left
        self.stock[rows] = rules.zone.stock, *catalogue.stocks
        self.budget_left[rows] = start.budget_left or 0.0
        self.budget[rows] = rules.zone.budget or np.nan
        self.is_full[rows] = not start.legal.any()
        self._numbers[rows, : len(numbers)], self.placed[rows] = numbers, len(numbers)
        self._sites[rows] = id(rules)
        for index in indices:
            self.rules[index] = rules

    def place(self, indices: Sequence[int] | IntArray, numbers: Sequence[int] | IntArray) -> None:
        """Place an element on a legal place in each of some layouts.

        Args:
            indices: The layouts, different ones (n,).
            numbers: The number of the element in the catalogue, for each (n,).
        """
        if not len(indices):
            return
        indices, numbers = np.asarray(indices), np.asarray(numbers)
        arrays = self.legal, self.occupancy, self.table, self.left, self._numbers, self.placed
        # Budgets and access ways are those of a site: layouts on one site at once.
        sites = self._sites[indices]
        distinct = dict.fromkeys(sites.tolist())
        for site in distinct:
            own, added = indices, numbers
            if len(distinct) > 1:
                is_own = sites == site
                own, added = indices[is_own], numbers[is_own]
            rules = self.rules[own[0]]
            limits = self.budget_left, self.is_full, *rules.limits
            _kernels().place(own, added, rules.variants, *arrays, *limits)
            if rules.zone.access_way is not None:
                self._keep_open(own, rules.zone.access_way)

    def _keep_open(self, indices: IntArray, way: "AccessWay") -> None:
        """Take away places that would close the access way, in layouts of the same rules."""
        from blast_env.vehicles.access_kernels import keep_open  # as in `_kernels`

        rules = self.rules[indices[0]]
        sizes = np.ascontiguousarray(rules.variants[:, :2])
        arrays = rules.passable, self.occupancy, sizes
        keep_open(indices, *arrays, way.width_cells, way.is_upwards, self.legal)
        _kernels().find_full(indices, self.legal, self.is_full)

    def elements(self, index: int) -> Layout:
        """Return the elements of a layout, in the order of placement."""
        of_number, count = self.rules[index].element, int(self.placed[index])
        return tuple(map(of_number, self._numbers[index, :count].tolist()))

    def checked(self, index: int) -> LegalLayout:
        """Return the same, marked as checked by its rules."""
        layout = LegalLayout(self.elements(index))
        layout.scenario, layout.worst = self.rules[index].scenario, {}
        return layout

    def find_worst(self, coming: Mapping[int, tuple[LegalLayout, Iterable[VehicleSource]]]) -> None:
        """Find the worst places of vehicles on plain ground against layouts, which have them then.

        Args:
            coming: The layouts as checked, and the vehicles that come to each of them.
        """
        # Places of a vehicle against all layouts on its site are found at once.
        groups: dict[tuple[int, int], tuple[VehicleSource, list[int]]] = {}
        for index, (_, vehicles) in coming.items():
            for source in vehicles:
                key = id(self.rules[index]), id(source)
                groups.setdefault(key, (source, []))[1].append(index)
        for source, own in groups.values():
            rules = self.rules[own[0]]
            ground = rules.scenario.vehicle_ground(source).plain
            if ground is None or rules.zone.removable:
                continue
            arrays = rules.obstacles.boxes_m, rules.obstacles.kinds, self._numbers[own]
            places = ground.worst_of_many(*arrays, self.placed[own])
            for index, worst in zip(own, places, strict=True):
                if worst is not None:
                    coming[index][0].worst[id(source)] = worst

    def state(self, index: int) -> LayoutState:
        """Return a layout as it is now."""
        # What `LayoutState` would find from the elements is here already.
        state = LayoutState(self.rules[index].scenario, self.elements(index))
        legal, occupancy = self.legal[index].copy(), self.occupancy[index].copy()
        legal.flags.writeable = False
        vars(state).update(legal=legal, occupancy=occupancy)
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
            self.rules if are_all else [self.rules[index] for index in chosen],
            lambda position: self.elements(chosen[position]),
            *(legal, self.occupancy[rows], self.left[rows], self.stock[rows]),
            *(self.budget_left[rows], self.budget[rows]),
            self._numbers[rows],
            self.placed[rows],
            self._room,
        )

    def _room(self, shape: tuple[int, ...]) -> NDArray[np.float32]:
        """Return room for observations: that of earlier ones which nobody has any more, or new one.

        The pages of new memory take longer than to write the observations.
        """
        # An observation is a view. It refers to the room only where that has its own memory, not
        # where it lies in the bytes of a pickle (protocol 5).
        for kept, references in zip(self._rooms, _references(self._rooms), strict=True):
            if kept.shape == shape and references == _NOBODY and kept.base is None:
                return kept
        made = np.empty(shape, dtype=np.float32)
        self._rooms = [*self._rooms[-_MOST_ROOMS + 1 :], made]
        return made


@cache
def _kernels() -> Any:
    from blast_env.layout import batch_kernels  # Numba takes long to import

    return batch_kernels


class Placements(NamedTuple):
    """Several layouts, in arrays; see `LayoutBatch` for the other attributes.

    Attributes:
        layout: Returns the elements of one, by its position.
        numbers: Numbers of the elements of each (layouts, most).
        room: Returns an array of a shape for observations, with any content.
    """

    rules: Sequence[PlacementRules]
    layout: Callable[[int], Layout]
    legal: BoolArray
    occupancy: NDArray[np.uint8]
    left: IntArray
    stock: IntArray
    budget_left: FloatArray
    budget: FloatArray
    numbers: IntArray
    placed: IntArray
    room: Callable[[tuple[int, ...]], NDArray[np.float32]]

    @classmethod
    def of(cls, state: LayoutState) -> "Placements":
        """Return a single layout."""
        left = np.array([[state.stock_left, *state.stocks_left]])
        zone = state.scenario.zone
        numbers = [state.catalogue.action(element) for element in state.layout]
        return cls(
            *([PlacementRules.of(state)], lambda _: state.layout),
            *(np.array([state.legal]), state.occupancy[np.newaxis]),  # not read-only, as others
            *(left, np.array([[zone.stock, *state.catalogue.stocks]])),
            *(np.array([state.budget_left or 0.0]), np.array([zone.budget or np.nan])),
            *(np.array([numbers], dtype=np.int64), np.array([len(numbers)])),
            lambda shape: np.empty(shape, dtype=np.float32),
        )
