"""The layouts of a site as vectors, for optimisers that know nothing of sites."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from blast_env.arrays import IntArray
from blast_env.errors import BlastEnvError, LayoutError
from blast_env.geometry import Cell, Element, Layout
from blast_env.scenario import Placement, Scenario

KEYS_PER_PIECE = 3
"""What is set down, and in which row and column."""


@dataclass(frozen=True, eq=False)
class LayoutSpace:
    """Two forms of a layout as a vector: a choice a place, and random keys.

    **A choice a place.** A place is a cell on which something may have its lower left cell. Choice
    0 is nothing, choice k is the k-th thing that may stand there: one without a catalogue, so that
    choices are binary, more with one. Each measure that hardens facades follows as a place of its
    own. Not every vector is legal.

    **Random keys.** Any vector of numbers from 0 to 1 is a legal layout. There are three keys for
    each piece of the stock: what is set down (or nothing), and where. If it may not stand there, it
    stands on the nearest place where it may; if there is none, it is left out. A measure is set
    down like a piece, wherever that is.

    Attributes:
        scenario: The scenario; it has a build zone.
    """

    scenario: Scenario

    @cached_property
    def _empty(self) -> Placement:
        return Placement.empty(self.scenario)

    @cached_property
    def options(self) -> tuple[tuple[Element, ...], ...]:
        """What may stand on each place, place by place, row by row; then each measure."""
        catalogue = self._empty.catalogue
        is_measure = np.array([each.is_measure for each in catalogue.variants])
        pieces = self._empty.legal & ~is_measure[:, None, None]
        found = [
            tuple(
                catalogue.element_at(int(variant), int(row), int(column))
                for variant in pieces[:, row, column].nonzero()[0]
            )
            for row, column in zip(*pieces.any(axis=0).nonzero(), strict=True)
        ]
        measures = self._empty.legal[:, :1, :1].any(axis=(1, 2)) & is_measure
        found += [(catalogue.element_at(int(each), 0, 0),) for each in measures.nonzero()[0]]
        return tuple(found)

    @cached_property
    def places(self) -> tuple[Cell, ...]:
        """The places, in the order of the vector; (0, 0) for a measure."""
        return tuple((options[0][0], options[0][1]) for options in self.options)

    @cached_property
    def choices(self) -> IntArray:
        """How many choices each place has, nothing among them (places,); 2: it is binary."""
        counts: IntArray = np.array([1 + len(options) for options in self.options])
        return counts

    @property
    def is_binary(self) -> bool:
        """Whether a place holds a module or none, and there is nothing else to choose."""
        return bool((self.choices == 2).all())

    def layout(self, choices: Sequence[int] | IntArray) -> Layout:
        """Return the layout of a vector of choices, legal or not; `check` of the problem says.

        Args:
            choices: A choice a place (places,).

        Raises:
            BlastEnvError: If there are more or fewer, or one that a place has not.
        """
        if len(choices) != len(self.options):
            raise BlastEnvError(f"choices: has {len(choices)}, must have {len(self.options)}")
        layout: list[Element] = []
        for index, (choice, options) in enumerate(zip(choices, self.options, strict=True)):
            if not 0 <= choice <= len(options):
                raise BlastEnvError(f"choices[{index}] is {choice}, must be 0 to {len(options)}")
            layout += options[int(choice) - 1 : int(choice)] if choice else ()
        return tuple(layout)

    def choices_of(self, layout: Sequence[Element]) -> IntArray:
        """Return the vector of choices of a legal layout (places,).

        Raises:
            LayoutError: If it is not legal.
        """
        choices = np.zeros(len(self.options), dtype=np.int64)
        for element in Placement.of(self.scenario, layout).layout:
            place, choice = self._place_of[element]
            choices[place] = choice
        return choices

    @cached_property
    def key_sizes(self) -> tuple[int, int, int]:
        """How many values each of a piece's keys tells apart: things, rows and columns.

        Things that fit nowhere on the site, such as a wall across a narrow strip, are none of them.
        """
        return 1 + len(self._fitting), *self._empty.catalogue.shape

    @property
    def keys(self) -> int:
        """How long a vector of random keys is."""
        return KEYS_PER_PIECE * self.most_pieces

    @cached_property
    def most_pieces(self) -> int:
        """How many pieces a layout can have: by the stock, and by what the cheapest ones cost."""
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
            keys: Numbers (keys,); those below 0 or above 1 count as these.

        Raises:
            BlastEnvError: If there are more or fewer, or one is no number.
        """
        given = np.asarray(keys, dtype=np.float64)
        if given.shape != (self.keys,):
            raise BlastEnvError(f"keys: has the shape {given.shape}, must have ({self.keys},)")
        if np.isnan(given).any():
            raise BlastEnvError(f"keys[{int(np.isnan(given).argmax())}] is NaN, must be a number")
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
        """Return why a layout is not legal, a sentence for each element that is in the way.

        Elements are set down in their order; one that cannot stand is left out.

        Raises:
            LayoutError: If it is no list of cells or pieces at all.
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
        """Place and choice of each thing that may stand alone."""
        return {
            element: (place, choice)
            for place, options in enumerate(self.options)
            for choice, element in enumerate(options, start=1)
        }
