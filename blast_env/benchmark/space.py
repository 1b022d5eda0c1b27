"""The layouts of a site as vectors, for general-purpose optimisers."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from blast_env.arrays import IntArray
from blast_env.errors import BlastEnvError, LayoutError
from blast_env.geometry import Cell, Element, Layout
from blast_env.layout import LayoutState
from blast_env.site import Scenario
from blast_env.values import whole_number

KEYS_PER_PIECE = 3
"""The variant, the row and the column."""


@dataclass(frozen=True, eq=False)
class LayoutSpace:
    """Two encodings of a layout as a vector: one choice per place, and random keys.

    **One choice per place.** A place is a cell that some variant may have as its lower left cell.
    Choice 0 is empty, choice k is the k-th variant that may stand there. Without a catalogue there
    is one variant, and choices are binary. Each measure that hardens facades follows as a further
    place. Not every vector is legal.

    **Random keys.** Any vector of numbers from 0 to 1 is a legal layout. Each piece of the stock
    has three keys: the variant (or none), the row and the column. A piece moves to the nearest
    legal place, and is left out if there is none. A measure takes keys as a piece does; its row
    and column do not matter.

    Attributes:
        scenario: The scenario; it has a build zone.
    """

    scenario: Scenario

    @cached_property
    def _empty(self) -> LayoutState:
        return LayoutState.empty(self.scenario)

    @cached_property
    def options(self) -> tuple[tuple[Element, ...], ...]:
        """The elements that may stand on each place, row by row; then each measure."""
        catalogue = self._empty.catalogue
        is_measure = np.array([variant.is_measure for variant in catalogue.variants])
        pieces = self._empty.legal & ~is_measure[:, None, None]
        found = [
            tuple(
                catalogue.element_at(int(variant), int(row), int(column))
                for variant in pieces[:, row, column].nonzero()[0]
            )
            for row, column in zip(*pieces.any(axis=0).nonzero(), strict=True)
        ]
        measures = self._empty.legal[:, :1, :1].any(axis=(1, 2)) & is_measure
        found += [(catalogue.element_at(int(index), 0, 0),) for index in measures.nonzero()[0]]
        return tuple(found)

    @cached_property
    def places(self) -> tuple[Cell, ...]:
        """The places, in the order of the vector; (0, 0) for a measure."""
        return tuple((options[0][0], options[0][1]) for options in self.options)

    @cached_property
    def choices(self) -> IntArray:
        """Number of choices per place, including the empty one (places,)."""
        counts: IntArray = np.array([1 + len(options) for options in self.options])
        return counts

    def layout(self, choices: Sequence[int] | IntArray) -> Layout:
        """Return the layout of a vector of choices, legal or not (`BenchmarkProblem.check`).

        Args:
            choices: One choice per place (places,).

        Raises:
            BlastEnvError: If their number is wrong, or a choice is no integer or out of bounds.
        """
        if len(choices) != len(self.options):
            raise BlastEnvError(f"choices: has {len(choices)}, must have {len(self.options)}")
        layout: list[Element] = []
        for index, (choice, options) in enumerate(zip(choices, self.options, strict=True)):
            own = whole_number(f"choices[{index}]", choice, 0, len(options))
            layout += options[own - 1 : own] if own else ()
        return tuple(layout)

    def choices_of(self, layout: Sequence[Element]) -> IntArray:
        """Return the vector of choices of a legal layout (places,).

        Raises:
            LayoutError: If it is not legal.
        """
        choices = np.zeros(len(self.options), dtype=np.int64)
        for element in LayoutState.of(self.scenario, layout).layout:
            place, choice = self._place_of[element]
            choices[place] = choice
        return choices

    @cached_property
    def key_sizes(self) -> tuple[int, int, int]:
        """Number of values per key of a piece: variants with the empty one, rows, columns.

        Variants that fit nowhere on the site, such as a wall across a narrow strip, do not count.
        """
        return 1 + len(self._fitting), *self._empty.catalogue.shape

    @property
    def keys(self) -> int:
        """Length of a vector of random keys."""
        return KEYS_PER_PIECE * self.most_pieces

    @cached_property
    def most_pieces(self) -> int:
        """Most pieces of a layout, by the stock and by the budget at the least costs."""
        zone, catalogue = self.scenario.zone, self._empty.catalogue
        if zone.budget is None:
            return min(zone.stock, sum(catalogue.stocks))
        dearest_first = np.where(self._empty.legal, self._empty.costs, np.inf).min(axis=(1, 2))
        costs: list[float] = []
        for item, stock in enumerate(catalogue.stocks):
            own = [
                c for c, v in zip(dearest_first, catalogue.variants, strict=True) if v.item == item
            ]
            costs += [min(own)] * stock
        within = np.cumsum(sorted(costs)) <= zone.cost_limit
        return min(zone.stock, int(within.sum()))

    def from_keys(self, keys: Sequence[float] | np.ndarray) -> Layout:
        """Return the legal layout of a vector of random keys.

        Args:
            keys: Numbers (keys,); those beyond 0 and 1 count as 0 and 1.

        Raises:
            BlastEnvError: If their number is wrong, or one is NaN or infinite.
        """
        given = np.asarray(keys, dtype=np.float64)
        if given.shape != (self.keys,):
            raise BlastEnvError(f"keys: has the shape {given.shape}, must have ({self.keys},)")
        if not np.isfinite(given).all():
            index = int(np.isfinite(given).argmin())
            raise BlastEnvError(f"keys[{index}] is {given[index]}, must be a finite number")
        placement = self._empty
        sizes = np.array(self.key_sizes)
        for own in np.clip(given, 0.0, 1.0).reshape(-1, KEYS_PER_PIECE):
            thing, row, column = np.minimum((own * sizes).astype(int), sizes - 1)
            if thing == len(self._fitting):
                continue
            variant = self._fitting[thing]
            rows, columns = placement.legal[variant].nonzero()
            if len(rows):
                nearest = int(np.argmin((rows - row) ** 2 + (columns - column) ** 2))
                place = variant, int(rows[nearest]), int(columns[nearest])
                placement = placement.place(placement.catalogue.element_at(*place))
        return placement.layout

    def reasons_against(self, layout: Sequence[Element]) -> tuple[str, ...]:
        """Return the reasons why a layout is illegal, one sentence per illegal element.

        Elements are placed in order; an illegal one is skipped.

        Raises:
            LayoutError: If it is not a list of cells or pieces.
        """
        placement, reasons = self._empty, []
        for element in placement.catalogue.layout_from(layout):
            try:
                placement = placement.place(element)
            except LayoutError as error:
                reasons.append(str(error))
        return tuple(reasons)

    @cached_property
    def _fitting(self) -> tuple[int, ...]:
        """The variants that may stand somewhere on the empty site."""
        return tuple(np.flatnonzero(self._empty.legal.any(axis=(1, 2))).tolist())

    @cached_property
    def _place_of(self) -> dict[Element, tuple[int, int]]:
        """Place and choice of each element that may stand on the empty site."""
        return {
            element: (place, choice)
            for place, options in enumerate(self.options)
            for choice, element in enumerate(options, start=1)
        }
