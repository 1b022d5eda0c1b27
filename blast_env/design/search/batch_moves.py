"""Small changes of many layouts at once, for searches by guesses; every result is legal.

A search by guesses looks at hundreds of layouts, each in less time than a change by `Moves` takes.
So changes are drawn as numbers of elements first, and then placed together (`LayoutBatch`).
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from blast_env.arrays import BoolArray, IntArray
from blast_env.design.search.moves import drawn_by_rank
from blast_env.geometry import Layout
from blast_env.layout import LayoutState
from blast_env.layout.batch import LayoutBatch, PlacementRules
from blast_env.site import Scenario

_TRIES: Final = 12
"""Places that are tried for an element; the first legal one is taken."""

_NOWHERE: Final = -1
"""Number of an element off the grid."""

_FLUSH: Final = 1.0 / 3.0
"""Share of the places beside an element that are flush with one end of it; so many with the other,
and the rest anywhere along it."""


class _Draws(NamedTuple):
    """Random numbers for the places that are tried for the elements of a change.

    Attributes:
        away: Displacements in rows and columns (tries, 2).
        shares: Uniform from 0 to 1 (tries, 4).
    """

    away: Sequence[tuple[int, int]]
    shares: Sequence[tuple[float, float, float, float]]


Tries = Callable[[], Iterable[int]]
"""Returns the numbers of elements to try in turn; lazily, as an early one is mostly legal."""


class _Change(NamedTuple):
    """A change of a layout, before it is known what is legal.

    Attributes:
        stay: Numbers of the elements that stay.
        added: For each element to add, the numbers to try; `None` for any legal one.
    """

    stay: Sequence[int]
    added: Sequence[Tries | None]


@dataclass(frozen=True, eq=False)
class BatchMoves:
    """Draws neighbours of layouts.

    Attributes:
        scenario: The scenario.
        reach_cells: Standard deviation of the displacement of an element or a wall, in cells.
        count_share: Share of the changes that add or remove an element.
        wall_share: Share of those that displace a connected group of elements.
        far_share: Share of those that take an element to any other place.
        item_share: Share of those that replace one or two elements by up to three others. The rest
            moves one element, near its place or beside another one.
    """

    scenario: Scenario
    reach_cells: float = 2.0
    count_share: float = 0.1
    wall_share: float = 0.2
    far_share: float = 0.2
    item_share: float = 0.2
    _places: "_Places" = field(init=False, repr=False)
    _numbers: dict[Layout, list[int]] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_places", _Places(LayoutState.empty(self.scenario)))

    def near_best(
        self, best: Sequence[Layout], count: int, rng: np.random.Generator
    ) -> list[Layout]:
        """Return sorted neighbours of layouts drawn in favour of the first.

        Args:
            best: Legal layouts, the best first; the probability falls exponentially with the rank.
            count: Number of neighbours.
            rng: Draws the layouts and the changes.
        """
        drawn = [self._numbers_of(drawn_by_rank(best, rng)) for _ in range(count)]
        # All random numbers at once: one by one they take longer than the changes.
        away = np.rint(rng.normal(0.0, self.reach_cells, (count, _TRIES, 2))).astype(int).tolist()
        shares = rng.random((count, _TRIES, 4)).tolist()
        changes = [
            self._change(numbers, _Draws(*own), rng)
            for numbers, *own in zip(drawn, away, shares, strict=True)
        ]
        return self._places.placed(changes, rng)

    def _numbers_of(self, layout: Layout) -> list[int]:
        found = self._numbers.get(layout)
        if found is None:
            found = self._numbers[layout] = self._places.numbers(layout)
        return found

    def _change(self, numbers: list[int], draws: _Draws, rng: np.random.Generator) -> _Change:
        """Return a change of a layout."""
        if not numbers:
            return _Change((), (None,))
        # One draw decides the kind of change; the shares stack up on the interval from 0 to 1.
        kind = rng.random()
        own, stay = _taken(numbers, rng)
        if kind < self.count_share:
            return self._one_more_or_less(own, numbers, stay, draws, rng)
        kind -= self.count_share
        if kind < self.wall_share:
            return self._wall_moved(own, numbers, draws, rng)
        kind -= self.wall_share
        if kind < self.far_share:
            return _Change(stay, (None,))
        if kind < self.far_share + self.item_share:
            return self._exchanged(own, stay, draws, rng)
        if stay and rng.random() < 0.4:
            other = stay[int(rng.integers(len(stay)))]
            return _Change(stay, (partial(self._places.beside, other, draws, like=own),))
        return _Change(stay, (partial(self._places.near, own, draws, keeps_item=True),))

    def _one_more_or_less(
        self,
        own: int,
        numbers: list[int],
        stay: list[int],
        draws: _Draws,
        rng: np.random.Generator,
    ) -> _Change:
        """Add an element beside one, or take that away."""
        if rng.random() < 0.3:
            return _Change(stay, ())
        return _Change(numbers, (partial(self._places.beside, own, draws),))

    def _exchanged(
        self, own: int, stay: list[int], draws: _Draws, rng: np.random.Generator
    ) -> _Change:
        """Replace one or two elements by up to three others near the first.

        An expensive piece can become several cheap ones, and a long low wall a short high one.
        """
        if stay and rng.random() < 0.5:
            _, stay = _taken(stay, rng)
        wanted = 1 + int(rng.integers(3))
        return _Change(stay, [partial(self._places.near, own, draws, keeps_item=False)] * wanted)

    def _wall_moved(
        self, own: int, numbers: list[int], draws: _Draws, rng: np.random.Generator
    ) -> _Change:
        """Displace a connected group, or the whole layout, by one random vector."""
        # A wall protects as a whole: moved piece by piece it would have gaps on the way. An element
        # that cannot go along stays near its place.
        wall = numbers if rng.random() < 0.3 else self._places.connected(numbers, own)
        stay = [number for number in numbers if number not in set(wall)]
        return _Change(stay, [partial(self._places.along, number, draws) for number in wall])


def _taken(numbers: list[int], rng: np.random.Generator) -> tuple[int, list[int]]:
    """Return one of some numbers, at random, and the others."""
    at = int(rng.integers(len(numbers)))
    return numbers[at], numbers[:at] + numbers[at + 1 :]


class _Places:
    """The numbers of the elements of a build zone, and which may stand together.

    Args:
        empty: The empty placement.
    """

    def __init__(self, empty: LayoutState) -> None:
        self._empty, self._rules = empty, PlacementRules.of(empty)
        self._rows, self._columns = self._rules.catalogue.shape
        # Rows, columns and item of each variant.
        self._sizes: list[tuple[int, int, int]] = [*map(tuple, self._rules.variants.tolist())]
        items = {item for *_, item in self._sizes}
        self._of_item = {
            item: [number for number, own in enumerate(self._sizes) if own[2] == item]
            for item in items
        }

    def numbers(self, layout: Layout) -> list[int]:
        """Return the numbers of the elements of a legal layout."""
        return [*map(self._rules.catalogue.action, layout)]

    def placed(self, changes: Sequence[_Change], rng: np.random.Generator) -> list[Layout]:
        """Return the layouts of changes, as far as they are legal, each sorted."""
        # 1. What stays is legal together: one element of all layouts after the other.
        batch = LayoutBatch(self._empty, self._rules, len(changes))
        batch.begin(range(len(changes)), self._rules, self._empty)
        for place in range(max((len(change.stay) for change in changes), default=0)):
            own = [index for index, change in enumerate(changes) if len(change.stay) > place]
            batch.place(own, [changes[index].stay[place] for index in own])
        # 2. Elements that are added, each at the first legal place that is tried.
        legal = batch.legal.reshape(len(changes), -1)
        for place in range(max((len(change.added) for change in changes), default=0)):
            chosen: dict[int, int] = {}
            for index, change in enumerate(changes):
                if len(change.added) > place and not batch.is_full[index]:
                    chosen[index] = _first_legal(legal[index], change.added[place], rng)
            found = {index: number for index, number in chosen.items() if number != _NOWHERE}
            batch.place([*found], [*found.values()])
        return [tuple(sorted(batch.elements(index))) for index in range(len(changes))]

    def near(self, number: int, draws: _Draws, keeps_item: bool) -> Iterator[int]:
        """Yield other elements about the place of one, of its item or of any."""
        variant, row, column = self._place(number)
        others = self._of_item[self._sizes[variant][2]] if keeps_item else range(len(self._sizes))
        for (up, right), (which, turns, *_) in zip(draws.away, draws.shares, strict=True):
            # Two of three that keep their item keep their direction, too.
            keeps = keeps_item and turns < 2.0 / 3.0
            own = variant if keeps else others[int(which * len(others))]
            found = self._number(own, row + up, column + right)
            if found != number:
                yield found

    def along(self, number: int, draws: _Draws) -> Iterator[int]:
        """Yield an element where all of a wall go by the first draw, then others near its place."""
        variant, row, column = self._place(number)
        up, right = draws.away[0]
        yield self._number(variant, row + up, column + right)
        yield from self.near(number, draws, keeps_item=True)

    def beside(self, other: int, draws: _Draws, like: int | None = None) -> Iterator[int]:
        """Yield elements that touch another one or are a little away from it.

        Args:
            other: Its number.
            draws: The random numbers.
            like: Number of an element whose item they are of; any if `None`.
        """
        variant, row, column = self._place(other)
        high, wide, _ = self._sizes[variant]
        choices: Sequence[int] = range(len(self._sizes))
        if like is not None:
            choices = self._of_item[self._sizes[self._place(like)[0]][2]]
        for which, side, flush, gap in draws.shares:
            own = choices[int(which * len(choices))]
            own_high, own_wide, _ = self._sizes[own]
            off = int(2.0 * gap * gap)
            # Above, below, to the right or to the left.
            if side < 0.5:
                up = high + off if side < 0.25 else -own_high - off
                right = _beginning(flush, wide, own_wide)
            else:
                up = _beginning(flush, high, own_high)
                right = wide + off if side < 0.75 else -own_wide - off
            yield self._number(own, row + up, column + right)

    def connected(self, numbers: Sequence[int], start: int) -> list[int]:
        """Return those of some elements that are connected with one, by edges or corners."""
        boxes: dict[int, tuple[int, int, int, int]] = {}
        for number in numbers:
            variant, row, column = self._place(number)
            high, wide, _ = self._sizes[variant]
            boxes[number] = row, column, row + high, column + wide
        found, todo = {start}, [start]
        while todo:
            bottom, left, top, right = boxes[todo.pop()]
            for other, (low, begin, high, end) in boxes.items():
                is_near = low <= top and bottom <= high and begin <= right and left <= end
                if is_near and other not in found:
                    found.add(other)
                    todo.append(other)
        return [number for number in numbers if number in found]

    def _place(self, number: int) -> tuple[int, int, int]:
        """Return variant, row and column of an element."""
        place, column = divmod(number, self._columns)
        return (*divmod(place, self._rows), column)

    def _number(self, variant: int, row: int, column: int) -> int:
        """Return the number of an element, or `_NOWHERE`."""
        if 0 <= row < self._rows and 0 <= column < self._columns:
            return (variant * self._rows + row) * self._columns + column
        return _NOWHERE


def _beginning(share: float, length: int, own_length: int) -> int:
    """Return where an element beside another one begins, relative to that, in cells.

    Args:
        share: Uniform from 0 to 1.
        length: Length of the other one.
        own_length: Length of its own.
    """
    if share < _FLUSH:
        return 0
    if share < 2.0 * _FLUSH:
        return length - own_length
    anywhere = (share - 2.0 * _FLUSH) / _FLUSH
    return round((length + own_length) * anywhere) - own_length


def _first_legal(legal: BoolArray, tries: Tries | None, rng: np.random.Generator) -> int:
    """Return the first number that is legal, any legal one without tries, or `_NOWHERE`."""
    if tries is None:
        every: IntArray = np.flatnonzero(legal)
        return int(every[int(rng.integers(len(every)))]) if len(every) else _NOWHERE
    for number in tries():
        if number != _NOWHERE and legal[number]:
            return number
    return _NOWHERE
