"""Action spaces: an action gives a complete placement, or the item first and then its place."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, IntArray
from blast_env.geometry import Element
from blast_env.site import Catalogue
from blast_env.values import whole_number


class Actions(Protocol):
    """A kind of action space: the sequence of choices that makes up a placement."""

    def choices(self, catalogue: Catalogue) -> tuple[IntArray, ...]:
        """Return the choices that lead to a variant and its lower left cell.

        Returns:
            For each choice, the index from 0 of the option that contains each variant and cell
            (variants, rows, columns). One option per choice determines a single placement.
        """


@dataclass(frozen=True)
class PlaceAtOnce:
    """One action per placement: a variant and its lower left cell, as `Catalogue` numbers them."""

    def choices(self, catalogue: Catalogue) -> tuple[IntArray, ...]:
        """Return the only choice."""
        return (np.arange(catalogue.finish).reshape(-1, *catalogue.shape),)


@dataclass(frozen=True)
class ItemThenPlace:
    """First the variant (an item in one orientation), then the place of its lower left cell.

    In a zone without a catalogue only the place is chosen.

    Attributes:
        block_cells: Side of square blocks, in cells: the block is chosen before the cell in it.
            Without it, the cell is chosen from the whole zone.

    Raises:
        BlastEnvError: If it is less than 1.
    """

    block_cells: int | None = None

    def __post_init__(self) -> None:
        if self.block_cells is not None:
            whole_number("block_cells", self.block_cells, 1, 1000)

    def choices(self, catalogue: Catalogue) -> tuple[IntArray, ...]:
        """Return two choices, or three with blocks, without those that have a single option."""
        variant, row, column = np.indices((len(catalogue.variants), *catalogue.shape))
        rows, columns = catalogue.shape
        side = self.block_cells or max(rows, columns, 1)
        block = (row // side) * -(-columns // side) + column // side
        cell = (row % side) * min(side, columns) + column % side
        return tuple(each for each in (variant, block, cell) if each.any()) or (cell,)


ACTIONS: Final[Mapping[str, Actions]] = MappingProxyType(
    {
        "place": PlaceAtOnce(),
        "item_then_place": ItemThenPlace(),
        "item_then_block": ItemThenPlace(block_cells=8),
    }
)
"""The action spaces, by their names."""


@dataclass(frozen=True, eq=False)
class ActionChoice:
    """The choices so far for the next placement.

    Attributes:
        possible: Mask of the legal placements that remain, by variant and lower left cell
            (variants, rows, columns), read-only.
        choices: Number of choices made.
        options: The options of these choices, skipped ones included.
    """

    possible: BoolArray
    choices: int = 0
    options: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class NumberedActions:
    """The numbered actions for a catalogue: the options of each choice in turn, then to finish.

    Attributes:
        catalogue: The catalogue of modules or pieces.
        choices: See `Actions.choices`.
        first: The first action of each choice (choices,).
        finish: The action that finishes; the others are below it.
    """

    catalogue: Catalogue
    choices: tuple[IntArray, ...]
    first: tuple[int, ...]
    finish: int

    @classmethod
    def of(cls, actions: Actions, catalogue: Catalogue) -> "NumberedActions":
        """Return the actions for a catalogue."""
        choices = actions.choices(catalogue)
        counts = [int(each.max(initial=-1)) + 1 for each in choices]
        *first, finish = np.cumsum([0, *counts]).tolist()
        return cls(catalogue, choices, tuple(first), finish)

    def mask(self, chosen: ActionChoice) -> NDArray[np.bool_]:
        """Return the mask of legal actions (actions,); finishing is legal before the first choice.

        Args:
            chosen: The choices so far.
        """
        mask = np.zeros(self.finish + 1, dtype=np.bool_)
        options = self.choices[chosen.choices]
        mask[self.first[chosen.choices] + options[chosen.possible]] = True
        mask[-1] = chosen.choices == 0
        return mask

    def narrowed(self, chosen: ActionChoice, action: int) -> ActionChoice | Element | None:
        """Return the state of choice after an action.

        Choices with a single remaining option are skipped.

        Args:
            chosen: The choices before the action.
            action: An action other than the one that finishes.

        Returns:
            The choices after it; the element to place, if all choices are made; or `None` if the
            action is illegal.
        """
        option = action - self.first[chosen.choices]
        possible = chosen.possible & (self.choices[chosen.choices] == option)
        if not possible.any():
            return None
        made = chosen.choices + 1
        while made < len(self.choices) and np.ptp(self.choices[made][possible]) == 0:
            made += 1
        first = int(possible.argmax())
        if made == len(self.choices):
            return self.catalogue.element(first)
        possible.flags.writeable = False
        options = tuple(int(each.flat[first]) for each in self.choices[:made])
        return ActionChoice(possible, made, options)

    def nearest(self, chosen: ActionChoice, action: int) -> int | None:
        """Return the legal action nearest to an illegal one.

        The nearest one leads to the legal placement of the same item whose lower left cell has the
        least distance from the wanted one, or from the middle of several: in the same rotation, if
        it has a legal placement. Of several at one distance the first one counts.

        Args:
            chosen: The choices so far.
            action: An illegal action other than the one that finishes.

        Returns:
            The action; `None` if the item has no legal placement, or the action belongs to another
            choice than the present one.
        """
        options = self.choices[chosen.choices]
        wanted = options == action - self.first[chosen.choices]
        for each, option in zip(self.choices, chosen.options, strict=False):
            wanted = wanted & (each == option)
        numbers, rows, columns = wanted.nonzero()
        if not len(numbers):
            return None
        up, right = np.indices(self.catalogue.shape)
        distances = (up - rows.mean()) ** 2 + (right - columns.mean()) ** 2
        items = np.array([each.item for each in self.catalogue.variants])
        same_rotation = np.isin(np.arange(len(items)), numbers)
        for suits in (same_rotation, np.isin(items, items[numbers])):
            candidates = chosen.possible & suits[:, np.newaxis, np.newaxis]
            if candidates.any():
                place = np.where(candidates, distances, np.inf).argmin()
                return int(self.first[chosen.choices] + options.flat[place])
        return None
