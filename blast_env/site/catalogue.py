"""The catalogue of barrier items, and the variants in which each can be placed.

An item is a rectangle of modules that are placed together. This module alone defines the cells, the
height and the action number of a piece.
"""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.resources import files
from operator import index
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, StrictBool, StrictFloat, StrictInt, model_validator

from blast_env.bays import Bay
from blast_env.errors import LayoutError, suggestion, type_word, value_text
from blast_env.geometry import Cell, Element, Measure, Piece, Removal
from blast_env.problems import Problem, ScenarioError, unknown_name
from blast_env.sections import FOR_PEOPLE, Count, HashMark, Height, Name, Section, SparseSection
from blast_env.site.structures import FacadePart
from blast_env.vehicles.vehicle import CrashRating

Cost = Annotated[StrictFloat, Field(ge=1e-6, le=1e9)]
Mass = Annotated[StrictFloat, Field(ge=0.1, le=1e6)]
BaseWidth = Annotated[StrictFloat, Field(ge=0.01, le=20.0)]
Friction = Annotated[StrictFloat, Field(ge=0.0, le=2.0)]
Anchorage = Annotated[StrictFloat, Field(ge=0.0, le=1e9)]
_FILE: Final = "barriers.toml"


class Barrier(SparseSection):
    """A rectangle of modules that are placed together.

    Attributes:
        description: Description for readers.
        length_modules: Modules along its length: to the right, or upwards if it is turned.
        thickness_modules: Modules across its length.
        height_m: Height above the ground.
        cost: Cost of a piece outside all cost areas; in the stock list, 1 is about a metre of
            concrete road barrier.
        rotatable: Whether it may be turned by a right angle.
        mass_kg: Mass of a piece; that of a solid block of concrete unless given.
        base_width_m: Width of its base; its thickness unless given.
        anchorage_n: Horizontal capacity of the anchors of a piece, N; none unless given.
    """

    sparse: ClassVar = frozenset(
        {"mass_kg", "base_width_m", "friction", "anchorage_n", "crash_rating"}
    )

    description: Annotated[str, Field(max_length=200), FOR_PEOPLE, HashMark.NEVER] = ""
    length_modules: Count
    thickness_modules: Count = 1
    height_m: Height
    cost: Cost
    rotatable: StrictBool = True
    stops_vehicles: StrictBool = True
    mass_kg: Annotated[Mass | None, HashMark.NEVER] = None
    base_width_m: Annotated[BaseWidth | None, HashMark.NEVER] = None
    anchorage_n: Annotated[Anchorage | None, HashMark.NEVER] = None


class StockBarrier(Barrier):
    """A barrier of the stock list: an item of a catalogue without its number of pieces.

    Attributes:
        source: Source of the dimensions.
    """

    source: str


@cache
def stock_barriers() -> Mapping[str, StockBarrier]:
    """Return the barriers of the stock list by name."""
    text = files(__package__).joinpath(_FILE).read_text(encoding="utf-8")
    listed = tomllib.loads(text)
    barriers = {name: StockBarrier.model_validate(item) for name, item in listed.items()}
    return MappingProxyType(barriers)


MOST_ITEMS: Final = 20
"""Most items of a catalogue; each has an action for every cell and orientation."""

_SIZE_KEYS: Final = ("length_modules", "thickness_modules", "height_m")


class Item(Barrier):
    """A barrier of a catalogue.

    In a file `from_catalogue` names a barrier of the stock list (`stock_barriers`) with the
    defaults of all other keys but the stock; its size cannot be changed. The item has all values.

    Attributes:
        name: Name in layouts, tables and drawings.
        stock: Number of pieces.
        friction: Coefficient of friction with the ground; 0.5 unless given.
        crash_rating: Its crash rating; without one, it stops every vehicle. Vehicles without a
            motion ignore it.
        from_catalogue: Always `None`; its values are in the other attributes.
    """

    name: Name
    stock: Annotated[StrictInt, Field(ge=0, le=10_000)]
    friction: Annotated[Friction | None, HashMark.NEVER] = None
    crash_rating: Annotated[CrashRating | None, HashMark.IF_SET] = None
    from_catalogue: Annotated[str | None, Field(exclude=True)] = None

    @model_validator(mode="before")
    @classmethod
    def _from_stock_list(cls, given: Any) -> Any:
        """Fill in the values of the barrier named by `from_catalogue`."""
        if not isinstance(given, Mapping) or given.get("from_catalogue") is None:
            return given
        name, known = given["from_catalogue"], stock_barriers()
        if not isinstance(name, str):
            raise ScenarioError(
                "item", [Problem("from_catalogue", f"is {type_word(name)}, must be a string")]
            )
        if name not in known:
            problem = Problem("from_catalogue", unknown_name("barrier", name, known))
            raise ScenarioError("item", [problem])
        barrier = known[name].model_dump(exclude={"source"})
        own = {key: value for key, value in given.items() if key != "from_catalogue"}
        fixed = [key for key in _SIZE_KEYS if own.get(key, barrier[key]) != barrier[key]]
        if fixed:
            raise ScenarioError(
                "item",
                [Problem(key, f"must be left out: {name!r} has {barrier[key]:g}") for key in fixed],
            )
        return {"name": name, **barrier, **own}

    @model_validator(mode="after")
    def _check_rating(self) -> Self:
        """Refuse a crash rating of an item that stops no vehicle."""
        if self.crash_rating is not None and not self.stops_vehicles:
            message = "must be left out: stops_vehicles is false"
            raise ScenarioError("item", [Problem("crash_rating", message)])
        return self

    @property
    def orientations(self) -> tuple[bool, ...]:
        """The possible values of `turned`: false, and true if that makes a difference."""
        square = self.length_modules == self.thickness_modules
        return (False, True) if self.rotatable and not square else (False,)

    def footprint(self, turned: bool) -> tuple[int, int]:
        """Return the number of rows and of columns of cells that it covers."""
        size = self.thickness_modules, self.length_modules
        return size[::-1] if turned else size


class Hardening(FacadePart):
    """A measure of a layout that puts stronger components in some bays of facades.

    It can be taken once, covers no cell, and changes no load. `glazing` is the component with the
    new glass of the windows there, whose sizes and sills stay.

    Attributes:
        name: Name in layouts and tables.
        description: Description for readers.
        structures: Names of its structures; all with a facade unless given.
    """

    name: Name
    description: Annotated[str, Field(max_length=200), FOR_PEOPLE, HashMark.NEVER] = ""
    structures: Annotated[tuple[Name, ...], Field(min_length=1, max_length=100)] | None = None
    cost: Cost

    @model_validator(mode="after")
    def _check_component(self) -> Self:
        """Refuse a measure that changes nothing."""
        if self.glazing is None and self.wall is None:
            problem = Problem("glazing", "missing: glazing, wall or both must be given")
            raise ScenarioError("hardening", [problem])
        return self

    def covers(self, bay: Bay) -> bool:
        """Return whether it applies to a bay."""
        is_own = self.structures is None or bay.structure in self.structures
        return is_own and super().covers(bay)


class Demolition(Section):
    """A measure of a layout that removes structures.

    The structures no longer affect blasts and vehicles. Their ground stays closed to pieces.

    Attributes:
        name: Name in layouts and tables.
        description: Description for readers.
        structures: Names of the structures, none of them protected.
    """

    name: Name
    description: Annotated[str, Field(max_length=200), FOR_PEOPLE, HashMark.NEVER] = ""
    structures: Annotated[tuple[Name, ...], Field(min_length=1, max_length=100)]
    cost: Cost


AnyMeasure = Hardening | Demolition
"""A measure, which is taken or not and covers no cell."""

_KINDS: Final[Mapping[type, type[Measure]]] = {Hardening: Measure, Demolition: Removal}


class Variant(NamedTuple):
    """An item in one orientation, or a measure.

    Attributes:
        item: Index of the item in the catalogue.
        name: Its name; empty for the single module of a zone without a catalogue.
        turned: Whether its length runs upwards.
        rows: Rows of cells that it covers; 0 for a measure.
        columns: Columns of cells that it covers; 0 for a measure.
        height_m: Its height; `None` is the height of the air.
        cost: Cost of a piece outside all cost areas.
        crash_rating: Its crash rating; without one, it stops every vehicle.
        kind: Class of its elements.
    """

    item: int
    name: str
    turned: bool
    rows: int
    columns: int
    height_m: float | None
    cost: float
    stops_vehicles: bool
    crash_rating: CrashRating | None = None
    kind: type[Piece] = Piece

    @property
    def is_measure(self) -> bool:
        """Whether it covers no cell; its only place is cell (0, 0)."""
        return self.rows == 0

    def cells_at(self, row: int, column: int) -> Iterator[Cell]:
        """Yield the cells that it covers from a lower left cell, row by row."""
        for up in range(self.rows):
            for right in range(self.columns):
                yield row + up, column + right


class ModulePlace(NamedTuple):
    """One module of a layout.

    Attributes:
        height_m: Its height; `None` is the height of the air.
        piece: Name of its piece; empty for a single module.
    """

    cell: Cell
    height_m: float | None
    piece: str
    stops_vehicles: bool


@dataclass(frozen=True)
class Catalogue:
    """The variants that can be placed on the cells of a zone, with their action numbers.

    Without items the only variant is a single module, and the elements of a layout are cells; with
    items they are pieces. Action `variant * rows * columns + row * columns + column` places a
    variant with its lower left cell at (row, column); the action after the last one finishes. A
    measure is legal at cell (0, 0) alone.

    Attributes:
        variants: The variants: item by item, not turned before turned, then the measures.
        names: Names of the items, then of the measures; empty without a catalogue.
        stocks: Number of pieces of each item and measure; without items, of single modules.
        shape: Rows and columns of the zone.
    """

    variants: tuple[Variant, ...]
    names: tuple[str, ...]
    stocks: tuple[int, ...]
    shape: tuple[int, int]

    @classmethod
    def of_items(
        cls, items: Sequence[Item], measures: Sequence[AnyMeasure], shape: tuple[int, int]
    ) -> "Catalogue":
        """Return the catalogue of a zone with items and measures."""
        variants = tuple(
            Variant(
                number,
                item.name,
                turned,
                *item.footprint(turned),
                item.height_m,
                item.cost,
                item.stops_vehicles,
                item.crash_rating,
            )
            for number, item in enumerate(items)
            for turned in item.orientations
        )
        # Measures come behind the items and cover no cell.
        variants += tuple(
            Variant(
                number,
                measure.name,
                False,
                0,
                0,
                0.0,
                measure.cost,
                False,
                kind=_KINDS[type(measure)],
            )
            for number, measure in enumerate(measures, start=len(items))
        )
        names = (*(item.name for item in items), *(measure.name for measure in measures))
        stocks = (*(item.stock for item in items), *(1 for _ in measures))
        return cls(variants, names, stocks, shape)

    @classmethod
    def of_modules(
        cls, stock: int, height_m: float | None, cost: float, shape: tuple[int, int]
    ) -> "Catalogue":
        """Return the catalogue of a zone without items: the single module."""
        return cls((Variant(0, "", False, 1, 1, height_m, cost, True),), (), (stock,), shape)

    @property
    def sizes(self) -> Iterator[tuple[int, int]]:
        """Rows and columns of cells of each variant; none for measures."""
        return ((variant.rows, variant.columns) for variant in self.variants)

    @property
    def has_items(self) -> bool:
        """Whether layouts consist of pieces; otherwise they consist of cells."""
        return bool(self.names)

    @property
    def finish(self) -> int:
        """Number of the action that finishes, which is the last one."""
        return len(self.variants) * self.shape[0] * self.shape[1]

    def element(self, action: int) -> Element:
        """Return the element that an action below `finish` places."""
        place, column = divmod(action, self.shape[1])
        return self.element_at(*divmod(place, self.shape[0]), column)

    def element_at(self, variant: int, row: int, column: int) -> Element:
        """Return the element of a variant at a lower left cell."""
        if not self.has_items:
            return row, column
        chosen = self.variants[variant]
        return chosen.kind(row, column, chosen.name, chosen.turned)

    def action(self, element: Element) -> int:
        """Return the number of the action that places an element.

        Raises:
            LayoutError: If there is no such item or orientation, or the lower left cell is off
                the grid.
        """
        rows, columns = self.shape
        row, column = element[:2]
        if not (0 <= row < rows and 0 <= column < columns):
            raise LayoutError(
                f"{element_text(element)} is outside the build zone of {rows} rows and"
                f" {columns} columns"
            )
        return (self.variant_number(element) * rows + row) * columns + column

    def variant_number(self, element: Element) -> int:
        """Return the number of an element's variant.

        Raises:
            LayoutError: If there is no such item, or it cannot be turned.
        """
        if not isinstance(element, Piece):
            return 0
        number = self._numbers.get((element.item, element.turned))
        if number is None:
            raise LayoutError(f"{element_text(element)} {self.reason_against(element)}")
        return number

    def variant(self, element: Element) -> Variant:
        """Return the variant of an element.

        Raises:
            LayoutError: If there is no such item, or it cannot be turned.
        """
        return self.variants[self.variant_number(element)]

    def reason_against(self, element: Element) -> str | None:
        """Return the reason why an element does not exist at any cell, or `None` if it does."""
        if not isinstance(element, Piece) or (element.item, element.turned) in self._numbers:
            return None
        if element.item not in self.names:
            nearest = suggestion(element.item, self.names) or f"; known: {', '.join(self.names)}"
            return f"is not in the catalogue{nearest}"
        item = self.variants[self._numbers[element.item, False]]
        if item.is_measure:
            return "covers no cell: it is not turned"
        if item.rows == item.columns:
            return "is as long as it is thick: it is not turned"
        return "may not be turned: it is not rotatable"

    def cells(self, element: Element) -> tuple[Cell, ...]:
        """Return the cells that an element covers, its lower left one first, row by row.

        Raises:
            LayoutError: If there is no such item, or it cannot be turned.
        """
        return tuple(self.variant(element).cells_at(element[0], element[1]))

    def element_from(self, given: Any, place: str) -> Element:
        """Return an element of a layout as plain values.

        Args:
            given: (row, column), or with items (row, column, item, turned); `turned` is optional.
                NumPy numbers are accepted, and arrays for cells.
            place: Its place in the layout, for the error.

        Raises:
            LayoutError: If it has another form.
        """
        if not self.has_items:
            return cell_from(given, place)
        if type(given) is Piece and tuple(map(type, given)) == (int, int, str, bool):
            return self._of_its_kind(given)  # the usual case
        known = ", ".join(map(repr, self.names))
        if not isinstance(given, list | tuple):
            raise LayoutError(f"{place}: is {type_word(given)}, {_PIECE}; items: {known}")
        if len(given) not in (3, 4):
            raise LayoutError(f"{place}: has {len(given)} values, {_PIECE}; items: {known}")
        row, column, item, turned = (*given, False)[:4]
        numbers = _is_integer(row) and _is_integer(column)
        if not (numbers and isinstance(item, str) and isinstance(turned, bool | np.bool_)):
            words = ", ".join(map(type_word, given))
            raise LayoutError(f"{place}: is ({words}), {_PIECE}; items: {known}")
        return self._of_its_kind(Piece(index(row), index(column), str(item), bool(turned)))

    def _of_its_kind(self, piece: Piece) -> Piece:
        """Return a piece, as a `Measure` if its item is one."""
        number = self._numbers.get((piece.item, piece.turned))
        kind = Piece if number is None else self.variants[number].kind
        return piece if kind is Piece else kind(*piece)

    def layout_from(self, layout: Any) -> tuple[Element, ...]:
        """Return a layout as plain values, in order; see `element_from`.

        Raises:
            LayoutError: If it is not a sequence of elements; sets, floats and truth values are
                refused.
        """
        if isinstance(layout, np.ndarray) and layout.ndim == 3:
            return self._elements_of(layout)
        is_array = isinstance(layout, np.ndarray) and layout.ndim > 0
        if is_array or (isinstance(layout, Sequence) and not isinstance(layout, str | bytes)):
            return tuple(self.element_from(item, f"layout[{i}]") for i, item in enumerate(layout))
        what = "(row, column, item, turned)" if self.has_items else "(row, column) pairs"
        raise LayoutError(f"layout is {type_word(layout)}, must be a list of {what}")

    def table(self, layout: Sequence[Element]) -> NDArray[np.int8]:
        """Return a layout in an array whose shape is the same for all layouts.

        Args:
            layout: Elements of the catalogue.

        Returns:
            1 where a variant has its lower left cell, 0 elsewhere (variants, rows, columns). The
            order of the elements is lost; `layout_from` reads them, sorted as for an evaluation.
        """
        table = np.zeros((len(self.variants), *self.shape), dtype=np.int8)
        for element in layout:
            table[self.variant_number(element), element[0], element[1]] = 1
        return table

    def _elements_of(self, table: NDArray[np.integer]) -> tuple[Element, ...]:
        """Return the elements of an array as by `table`."""
        shape = (len(self.variants), *self.shape)
        if table.shape != shape or not np.isin(table, (0, 1)).all():
            raise LayoutError(
                f"layout is an array of the shape {table.shape}, must have {shape} and 0 or 1"
            )
        return tuple(sorted(map(self.element, np.flatnonzero(table).tolist())))

    @cached_property
    def _numbers(self) -> dict[tuple[str, bool], int]:
        """The number of each variant by name and orientation."""
        return {(variant.name, variant.turned): i for i, variant in enumerate(self.variants)}


_PAIR: Final = "must be a pair of integers (row, column)"
_PIECE: Final = "must be (row, column, item, turned), two integers, a name and a truth value"


def cell_from(given: Any, place: str) -> Cell:
    """Return a pair of integers as a cell.

    Args:
        given: (row, column); NumPy numbers and arrays are accepted.
        place: Its place in the layout, for the error.
    """
    if type(given) is tuple and tuple(map(type, given)) == (int, int):
        return given  # the usual case
    listed = given.tolist() if isinstance(given, np.ndarray | np.generic) else given
    if not isinstance(listed, list | tuple):
        raise LayoutError(f"{place}: is {type_word(listed)}, {_PAIR}")
    if len(listed) != 2:
        raise LayoutError(f"{place}: has {len(listed)} values, {_PAIR}")
    if not all(_is_integer(number) for number in listed):
        raise LayoutError(f"{place}: is ({', '.join(map(type_word, listed))}), {_PAIR}")
    return index(listed[0]), index(listed[1])


def _is_integer(value: Any) -> bool:
    """Return whether a value is an integer; `True` and 1.0 are not."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def cell_text(cell: Cell) -> str:
    """Return a cell for a message: `cell (3, 4)`."""
    return f"cell ({value_text(cell[0])}, {value_text(cell[1])})"


def element_text(element: Element) -> str:
    """Return an element for a message: `cell (3, 4)`, `'t_wall' at cell (3, 4), turned`."""
    if not isinstance(element, Piece):
        return cell_text(element)
    if isinstance(element, Measure):
        return f"measure {value_text(element.item)}"
    turned = ", turned," if element.turned else ""
    return f"{value_text(element.item)} at {cell_text((element.row, element.column))}{turned}"
