"""Placement of modules and pieces in a build zone: legal places and legal layouts."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import fsum
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import BoolArray
from blast_env.errors import LayoutError
from blast_env.geometry import Cell, Element, Layout, Measure, Piece
from blast_env.site.blast_site import Charge
from blast_env.site.catalogue import Catalogue, ModulePlace, cell_text, element_text
from blast_env.site.models import AnyScenario, Scenario, find_scenario
from blast_env.site.sources import AnyCharge, charge_from
from blast_env.site.zone import (
    NO_ZONE,
    BuildZone,
    EmptyZone,
    empty_zone,
    reason_against,
    reasons_against,
)
from blast_env.vehicles.vehicle import closing_places, is_open

if TYPE_CHECKING:  # most sites have no vehicle
    from blast_env.vehicles.worst_places import WorstPlaces


@dataclass(frozen=True, eq=False)
class ById:
    """A scenario as a cache key, compared by identity, because comparison by value is slow."""

    scenario: Scenario

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ById) and other.scenario is self.scenario

    def __hash__(self) -> int:
        return id(self.scenario)


class LegalLayout(tuple[Element, ...]):
    """A layout that was checked against all conditions of a build zone.

    It equals the plain tuple, and is one on its way to other processes.

    Attributes:
        scenario: The scenario.
        worst: The worst places of vehicles against it as far as they are known, by the identity of
            the vehicle, which they have; see `worst_places`.
    """

    scenario: Scenario
    worst: "dict[int, WorstPlaces]"

    @classmethod
    def of(cls, scenario: Scenario, elements: Iterable[Element]) -> Self:
        """Return a layout of elements that were checked."""
        layout = cls(elements)
        layout.scenario, layout.worst = scenario, {}
        return layout

    def in_order(self, elements: Iterable[Element]) -> Self:
        """Return the same elements in another order, or without what vehicles do not meet."""
        layout = self.of(self.scenario, elements)
        layout.worst = self.worst
        return layout

    def __reduce__(self) -> tuple[type[Layout], tuple[Layout]]:
        """Pickle the plain tuple."""
        return tuple, (tuple(self),)


@dataclass(frozen=True)
class LayoutState:
    """An immutable partial layout; placing an element returns another placement.

    The elements are single modules on cells or, if the build zone has a catalogue, pieces.

    `LayoutState.empty`, `LayoutState.of` and `place` ensure all conditions of the build zone; the
    constructor itself checks nothing. Legality does not depend on the order of the elements, and
    every subset of a legal layout is legal.

    Attributes:
        scenario: The scenario.
        layout: The modules' cells, or the pieces, in the order of placement.
    """

    scenario: Scenario
    layout: Layout

    @classmethod
    def empty(cls, scenario: AnyScenario) -> "LayoutState":
        """Return the empty placement.

        Args:
            scenario: The scenario, or its bundled name or path.
        """
        return _empty_of(ById(find_scenario(scenario)))

    @classmethod
    def of(cls, scenario: AnyScenario, layout: Sequence[Element]) -> "LayoutState":
        """Return the placement of a whole layout.

        Args:
            scenario: The scenario, or its bundled name or path.
            layout: (row, column) of each module; with a catalogue, pieces (row, column, item,
                turned). NumPy integers and arrays are accepted.

        Raises:
            LayoutError: If an element has another form, lies outside the build zone, is repeated,
                or is not available after those before it.
        """
        empty = cls.empty(scenario)
        whole = empty.with_legal(empty.catalogue.layout_from(layout))
        return whole if whole._is_sound else _placed_one_by_one(empty, whole.layout)

    @cached_property
    def checked(self) -> LegalLayout:
        """The layout, marked as checked by `of` and `place`."""
        layout = LegalLayout(self.layout)
        layout.scenario, layout.worst = self.scenario, {}
        return layout

    def place(self, element: Element) -> "LayoutState":
        """Return the placement with one more module or piece.

        Args:
            element: (row, column), or a piece.

        Raises:
            LayoutError: If it is not available; the message is that of `explain`.
        """
        element = self.catalogue.element_from(element, self._word)
        if not self._is_known_legal(element):
            reason = self.explain(element)
            if reason is not None:
                raise LayoutError(reason)
        placed = LayoutState(self.scenario, (*self.layout, element))
        # Deriving them anew would double the time of a step of the environment.
        occupancy = self.occupancy.copy()
        self._stand(occupancy, element)
        vars(placed).update(empty_zone=self.empty_zone, occupancy=occupancy)
        if "_room" in vars(self):
            vars(placed)["_room"] = self._room_beside(element)
        return placed

    def with_legal(self, elements: Iterable[Element]) -> "LayoutState":
        """Return the placement with further elements, which are known to be legal together."""
        placed = LayoutState(self.scenario, (*self.layout, *elements))
        vars(placed).update(empty_zone=self.empty_zone)
        return placed

    def with_those_legal(self, elements: Sequence[Element]) -> "LayoutState":
        """Return the placement with further elements, in their order, without illegal ones."""
        with suppress(LayoutError):
            whole = self.with_legal(self.catalogue.layout_from(elements))
            if whole._is_sound:
                return whole
        placement = self
        for element in elements:
            with suppress(LayoutError):
                placement = placement.place(element)
        return placement

    def _is_known_legal(self, element: Element) -> bool:
        """Return whether the mask has been computed and has the element."""
        legal: BoolArray | None = vars(self).get("legal")
        row, column = element[:2]
        if legal is None or not self._zone.has((row, column)):
            return False
        if self.catalogue.reason_against(element) is not None:
            return False
        return bool(legal[self.catalogue.variant_number(element), row, column])

    def explain(self, element: Element) -> str | None:
        """Return the reason why an element cannot be placed, as a sentence, or `None` if it can.

        Args:
            element: (row, column), or a piece, which need not exist in the catalogue.

        Raises:
            LayoutError: If it has neither form.
        """
        element = self.catalogue.element_from(element, self._word)
        reason = self._reason_against_site(element) or self._reason_against_taken(element)
        if reason is not None:
            return f"{element_text(element)} {reason}"
        reason = self._reason_against_stock(element)
        if reason is not None:
            return reason
        reason = self._reason_against_cost(element) or self._reason_against_closing(element)
        return None if reason is None else f"{element_text(element)} {reason}"

    def reasons_against(self, cells: BoolArray) -> dict[str, int]:
        """Return the reasons why cells of a mask are not usable, with the number of cells."""
        return reasons_against(self.scenario.surroundings(self._zone), cells)

    def explain_vehicles(self) -> tuple[str, ...]:
        """Return a sentence per vehicle with its stand-off, way and speeds against the layout."""
        from blast_env.layout.obstacles import obstacles_of  # most sites have no vehicle

        obstacles = obstacles_of(self.scenario, self.layout)
        return tuple(
            self.scenario.vehicle_ground(source, self.layout).explain(
                f"the vehicle with {source.tnt_kg:g} kg TNT", obstacles
            )
            for source in self.scenario.vehicles
        )

    @cached_property
    def legal(self) -> BoolArray:
        """Whether each variant may be placed at each lower left cell, read-only.

        Shape (variants, rows, columns) as in `Catalogue`: raveled, it is a mask of actions.
        (1, 0, 0) without a build zone.
        """
        # 1. Free and usable ground; 2. the budget; 3. the stock; 4. the access way.
        item_of = [variant.item for variant in self.catalogue.variants]
        legal = self._room.copy()
        if self._zone.budget is not None:
            legal &= self.costs <= self._spendable
        in_stock = np.array(self.stocks_left)[item_of] > 0
        legal &= in_stock[:, np.newaxis, np.newaxis]
        if self._zone.access_way is not None:
            legal &= ~self._closing
        legal.flags.writeable = False
        return legal

    @cached_property
    def _room(self) -> BoolArray:
        """Whether each variant has free and usable ground at each lower left cell."""
        return self.empty_zone.places(self.empty_zone.usable & ~self._taken)

    def _room_beside(self, element: Element) -> BoolArray:
        """Return the room that a further element leaves."""
        room, (row, column) = self._room.copy(), element[:2]
        own = self.catalogue.variant(element)
        if own.is_measure:  # it covers no cell
            return room
        for left, variant in zip(room, self.catalogue.variants, strict=True):
            if not variant.is_measure:
                # The lower left cells from which it would reach the element.
                low, first = max(row - variant.rows + 1, 0), max(column - variant.columns + 1, 0)
                left[low : row + own.rows, first : column + own.columns] = False
        return room

    @cached_property
    def occupancy(self) -> NDArray[np.uint8]:
        """Number of the variant on each cell, from 1, or 0 (rows, columns); not to be changed."""
        occupancy = np.zeros(self._zone.shape, dtype=np.uint8)
        for element in self.layout:
            self._stand(occupancy, element)
        return occupancy

    def _stand(self, occupancy: NDArray[np.uint8], element: Element) -> None:
        number = self.catalogue.variant_number(element)
        variant = self.catalogue.variants[number]
        row, column = element[:2]
        occupancy[row : row + variant.rows, column : column + variant.columns] = number + 1

    @cached_property
    def free(self) -> BoolArray:
        """Whether each cell may take a module, shape (rows, columns), read-only.

        With a catalogue: whether it may be the lower left cell of some piece. (0, 0) without a
        build zone.
        """
        free: BoolArray = np.any(self.legal, axis=0) if len(self.legal) > 1 else self.legal[0]
        free.flags.writeable = False
        return free

    @cached_property
    def open_ground(self) -> BoolArray:
        """Whether some legal piece could cover each cell (rows, columns), read-only."""
        if not self.catalogue.has_items:
            return self.free
        # Each variant covers the cells up and to the right of its lower left one.
        ground = np.zeros(self._zone.shape, dtype=bool)
        rows, columns = ground.shape
        for legal, variant in zip(self.legal, self.catalogue.variants, strict=True):
            for up, right in variant.cells_at(0, 0):
                ground[up:, right:] |= legal[: rows - up, : columns - right]
        ground.flags.writeable = False
        return ground

    def limited_to(self, possible: BoolArray) -> "LayoutState":
        """Return the placement with `legal` restricted to a subset.

        Args:
            possible: A subset of `legal`, of the same shape.
        """
        limited = LayoutState(self.scenario, self.layout)
        vars(limited).update(empty_zone=self.empty_zone, occupancy=self.occupancy, legal=possible)
        return limited

    def places(self, cells: BoolArray) -> BoolArray:
        """Return whether each variant at each lower left cell covers only the given cells.

        Args:
            cells: Mask of the cells (rows, columns).

        Returns:
            Shape (variants, rows, columns), without regard to the layout, stock and budget.
        """
        return self.empty_zone.places(cells)

    @cached_property
    def empty_zone(self) -> EmptyZone:
        """The build zone without modules."""
        return empty_zone(self.scenario.surroundings(self._zone))

    @property
    def usable(self) -> BoolArray:
        """Whether each cell may take a module on the empty site, read-only.

        Shape (rows, columns), without regard to layout, stock, budget and access way.
        """
        return self.empty_zone.usable

    @property
    def costs(self) -> NDArray[np.float64]:
        """Cost of each variant by its lower left cell (variants, rows, columns), read-only."""
        return self.empty_zone.costs

    @property
    def catalogue(self) -> Catalogue:
        """The catalogue, which numbers the actions."""
        return self.empty_zone.catalogue

    @property
    def modules(self) -> tuple[ModulePlace, ...]:
        """The modules with their heights, piece by piece."""
        return self._zone.modules(self.layout)

    @cached_property
    def cells(self) -> tuple[Cell, ...]:
        """The cells with a module, piece by piece."""
        cells: list[Cell] = []
        for element in self.layout:
            cells += self.catalogue.cells(element) if isinstance(element, Piece) else (element,)
        return tuple(cells)

    @property
    def is_full(self) -> bool:
        """Whether no element can be placed."""
        return not self.legal.any()

    @property
    def stock_left(self) -> int:
        """Number of modules, or of pieces in all, that remain in the stock."""
        return self._zone.stock - len(self.layout)

    @cached_property
    def stocks_left(self) -> tuple[int, ...]:
        """Number of pieces of each item that remain in the stock."""
        catalogue, most = self.catalogue, self.stock_left
        if not catalogue.has_items:
            return (most,)
        placed = Counter(element.item for element in self.layout if isinstance(element, Piece))
        left = zip(catalogue.stocks, catalogue.names, strict=True)
        return tuple(min(stock - placed[name], most) for stock, name in left)

    @cached_property
    def cost(self) -> float:
        """Total cost of the layout."""
        # Summed exactly, so that the order of the layout does not matter.
        costs = self.empty_zone.costs
        number = self.catalogue.variant_number
        return fsum(costs[number(element), element[0], element[1]] for element in self.layout)

    @property
    def budget_left(self) -> float | None:
        """Remaining budget; `None` without one."""
        budget = self._zone.budget
        return None if budget is None else max(0.0, budget - self.cost)

    @property
    def _word(self) -> str:
        """Word for an element in errors."""
        return "piece" if self.catalogue.has_items else "cell"

    @property
    def _zone(self) -> BuildZone:
        """The build zone; one without cells if the scenario has none."""
        return self.scenario.build_zone or NO_ZONE

    @property
    def _spendable(self) -> float:
        """Largest cost of the next element."""
        return self._zone.cost_limit - self.cost

    @property
    def _taken(self) -> BoolArray:
        """Whether each cell has a module (rows, columns)."""
        taken: BoolArray = self.occupancy > 0
        return taken

    @cached_property
    def _closing(self) -> BoolArray:
        """Whether each variant would close the zone's access way (variants, rows, columns)."""
        way = self._zone.access_way
        assert way is not None
        passable = self.empty_zone.passable & ~self._taken
        return np.stack([*closing_places(way, passable, self.catalogue.sizes)])

    @property
    def _is_sound(self) -> bool:
        """Whether the layout as a whole keeps every condition."""
        zone, catalogue = self._zone, self.catalogue
        if not self.layout:
            return True
        if any(catalogue.reason_against(element) is not None for element in self.layout):
            return False
        if any(isinstance(element, Measure) and element[:2] != (0, 0) for element in self.layout):
            return False
        # From cheap to costly checks; the last one searches a way across the site.
        if min(self.stock_left, *self.stocks_left) < 0 or len(set(self.cells)) < len(self.cells):
            return False
        if not all(map(zone.has, self.cells)):
            return False
        if self._spendable < 0.0 or not self.empty_zone.usable[self._taken].all():
            return False
        if len(self.empty_zone.levels) and any(map(self._straddles, self.layout)):
            return False
        passable = self.empty_zone.passable & ~self._taken
        return zone.access_way is None or is_open(zone.access_way, passable)

    def _reason_against_site(self, element: Element) -> str | None:
        """Return the reason why an element is illegal even alone, or `None` if it is legal."""
        zone = self._zone
        if zone is NO_ZONE:
            return "is not usable: the scenario has no build zone"
        reason = self.catalogue.reason_against(element)
        if reason is not None:
            return reason
        if isinstance(element, Measure):
            return None if element[:2] == (0, 0) else "covers no cell: row and column must be 0"
        size = f"the build zone of {zone.rows} rows and {zone.columns} columns"
        if not zone.has((element[0], element[1])):
            return f"is outside {size}"
        cells = self.catalogue.cells(element)
        if not zone.has(cells[-1]):
            return f"sticks out of {size}"
        for cell in cells:
            if not self.empty_zone.usable[cell]:
                reason = reason_against(self.scenario.surroundings(self._zone), cell)
                return _of_cell(element, cell, reason)
        return "would straddle the edge of a terrace" if self._straddles(element) else None

    def _straddles(self, element: Element) -> bool:
        """Return whether the ground below an element has several heights."""
        ground = self.empty_zone.ground_m
        return len({ground[cell] for cell in self.catalogue.cells(element)}) > 1

    def _reason_against_taken(self, element: Element) -> str | None:
        """Return the conflict with a placed element, or `None` if there is none."""
        if not isinstance(element, Piece):
            return "is taken by a module" if element in self.layout else None
        for cell in self.catalogue.cells(element):
            if self._taken[cell]:
                other = next(
                    element for element in self.layout if cell in self.catalogue.cells(element)
                )
                return _of_cell(element, cell, f"is taken by {element_text(other)}")
        return None

    def _reason_against_stock(self, element: Element) -> str | None:
        """Return the message of an exhausted stock, or `None` if it is not."""
        if self.stock_left == 0:
            what = "piece" if self.catalogue.has_items else "module"
            return f"the stock of {_counted(len(self.layout), what)} is used up"
        item = self.catalogue.variant(element).item
        if self.stocks_left[item] > 0:
            return None
        stock = _counted(self.catalogue.stocks[item], f"{self.catalogue.names[item]!r}", "")
        return f"the stock of {stock} is used up"

    def _reason_against_cost(self, element: Element) -> str | None:
        """Return the message of an exceeded budget, or `None` if it is not."""
        cost = self.costs[self.catalogue.variant_number(element), element[0], element[1]]
        budget = self._zone.budget
        if budget is None or cost <= self._spendable:
            return None
        return (
            f"costs {cost:.10g}, but only {self.budget_left:.10g} of the budget of"
            f" {budget:.10g} is left"
        )

    def _reason_against_closing(self, element: Element) -> str | None:
        """Return the message of a closed access way, or `None` if it stays open."""
        way, number = self._zone.access_way, self.catalogue.variant_number(element)
        if way is None or not self._closing[number, *element[:2]]:
            return None
        return f"would close the {way.description}"

    def __reduce__(self) -> tuple[Callable[..., "LayoutState"], tuple[Any, ...]]:
        """Pickle scenario and layout alone: cached arrays would come back writeable."""
        return LayoutState, (self.scenario, self.layout)


@lru_cache(maxsize=16)
def _empty_of(site: ById) -> LayoutState:
    """Return the empty placement; one for all callers, so that its mask is computed once."""
    return LayoutState(site.scenario, ())


def _placed_one_by_one(empty: LayoutState, layout: Layout) -> LayoutState:
    """Place a layout in order, or raise the error of the first illegal element."""
    placement = empty
    for element in layout:
        if element in placement.layout:
            raise LayoutError(f"{element_text(element)} is repeated")
        if placement._reason_against_site(element) is None:
            _check_stock(placement, layout, element)
        placement = placement.place(element)
    return placement


def _check_stock(placement: LayoutState, layout: Layout, element: Element) -> None:
    """Refuse an element beyond the stock (`LayoutError`)."""
    catalogue, what = placement.catalogue, "modules"
    asked, most = len(layout), len(placement.layout)
    if isinstance(element, Piece):
        what = "pieces"
        if placement.stock_left > 0:
            what = f"of {element.item!r}"
            asked = sum(piece.item == element.item for piece in layout if isinstance(piece, Piece))
            most = catalogue.stocks[catalogue.variant(element).item]
    if placement.stock_left == 0 or placement._reason_against_stock(element) is not None:
        raise LayoutError(
            f"{element_text(element)} is beyond the stock:"
            f" the layout has {asked} {what}, must have at most {most}"
        )


def _of_cell(element: Element, cell: Cell, reason: str | None) -> str | None:
    """Return a reason against a cell, worded for an element that covers it."""
    if reason is None or not isinstance(element, Piece):
        return reason
    return f"would stand on {cell_text(cell)}, which {reason}"


def _counted(count: int, word: str, plural: str = "s") -> str:
    return f"1 {word}" if count == 1 else f"{count} {word}{plural}"


def usable_cells(scenario: AnyScenario) -> NDArray[np.bool_]:
    """Return whether each cell may have a module on the empty site.

    No-build areas, structures, their clearance and the charge exclude cells. `LayoutState` checks
    the conditions that depend on the layout (stock, budget, access way).

    Args:
        scenario: The scenario, or its bundled name or path.

    Returns:
        An array of shape (rows, columns), read-only; (0, 0) without a build zone.
    """
    return LayoutState.empty(scenario).usable


def kept_clear(scenario: Scenario, charge: AnyCharge | None) -> Scenario:
    """Return a scenario on whose site no piece can be placed on a known charge, either.

    It is the scenario itself, unless a charge from elsewhere takes cells of the build zone.

    Args:
        scenario: The scenario; its possible charges are kept clear in any case.
        charge: The charge; `None` for one of the possible ones.

    Raises:
        ScenarioError: If the charge is out of bounds, or not clear of a structure or the border.
        BlastEnvError: If it has another form.
    """
    known = None if charge is None else charge_from(charge)
    if not isinstance(known, Charge) or scenario.may_have(known):
        return scenario
    with_it = scenario.with_possible_charges((known,))
    takes_none = np.array_equal(usable_cells(with_it), usable_cells(scenario))
    return scenario if takes_none else with_it


def load_relevant(layout: Iterable[Element]) -> Layout:
    """Return the elements that affect loads: all but the measures that harden facades."""
    return tuple([element for element in layout if type(element) is not Measure])


def check_layout(scenario: AnyScenario, layout: Sequence[Element]) -> Layout:
    """Return a legal layout as plain values, in order.

    Args:
        scenario: The scenario of the layout, or its bundled name or path.
        layout: (row, column) of each module, or pieces. NumPy integers and arrays are accepted.

    Raises:
        LayoutError: As `LayoutState.of`, if an element cannot be placed.
    """
    # Checked before against this very scenario: a blast is asked for several times.
    if isinstance(layout, LegalLayout) and layout.scenario is scenario:
        return layout
    if isinstance(layout, tuple) and not layout:
        return ()
    return LayoutState.of(scenario, layout).layout
