"""What an action says: a place at once, or first the item, then where."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, IntArray
from blast_env.geometry import Element
from blast_env.scenario import Catalogue
from blast_env.values import whole_number


class Actions(Protocol):
    """A kind of action space: by which choices, one after the other, something is placed."""

    def choices(self, catalogue: Catalogue) -> tuple[IntArray, ...]:
        """Return the choices that lead to a variant and its lower left cell.

        Returns:
            For each choice, which of its options every variant and cell belongs to, counted from 0
            (variants, rows, columns). The options of all choices together leave one place.
        """


@dataclass(frozen=True)
class PlaceAtOnce:
    """One action a place: a variant and its lower left cell, as `Catalogue` numbers them."""

    def choices(self, catalogue: Catalogue) -> tuple[IntArray, ...]:
        """Return the only choice."""
        return (np.arange(catalogue.finish).reshape(-1, *catalogue.shape),)


@dataclass(frozen=True)
class ItemThenPlace:
    """First the variant (an item in one orientation), then the place of its lower left cell.

    In a zone without a catalogue there is nothing to choose but the place.

    Attributes:
        block_cells: Side of square blocks of cells: the block is chosen before the cell in it.
            Without it, the cell is chosen out of the whole zone.

    Raises:
        BlastEnvError: If it is less than 1.
    """

    block_cells: int | None = None

    def __post_init__(self) -> None:
        if self.block_cells is not None:
            whole_number("block_cells", self.block_cells, 1, 1000)

    def choices(self, catalogue: Catalogue) -> tuple[IntArray, ...]:
        """Return two choices, or three with blocks, without those that have one option alone."""
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
"""The kinds of actions that have names."""


@dataclass(frozen=True, eq=False)
class ActionChoice:
    """What has been chosen so far of the next thing to place.

    Attributes:
        possible: What may still come of it, by variant and lower left cell (variants, rows,
            columns), read-only.
        choices: How many choices were made.
    """

    possible: BoolArray
    choices: int = 0


@dataclass(frozen=True, eq=False)
class NumberedActions:
    """The actions for a catalogue: the options of the first choice, of the next ones, to finish.

    Attributes:
        catalogue: What can be placed.
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
        """Return which actions are legal (actions,); to finish is, where nothing is chosen yet."""
        mask = np.zeros(self.finish + 1, dtype=np.bool_)
        options = self.choices[chosen.choices]
        mask[self.first[chosen.choices] + options[chosen.possible]] = True
        mask[-1] = chosen.choices == 0
        return mask

    def narrowed(self, chosen: ActionChoice, action: int) -> ActionChoice | Element | None:
        """Return what is chosen after an action.

        Choices that leave no choice are passed over.

        Args:
            chosen: What was chosen before.
            action: One that does not finish.

        Returns:
            What is chosen then, what is to be placed, or `None` if the action is illegal.
        """
        option = action - self.first[chosen.choices]
        possible = chosen.possible & (self.choices[chosen.choices] == option)
        if not possible.any():
            return None
        made = chosen.choices + 1
        while made < len(self.choices) and np.ptp(self.choices[made][possible]) == 0:
            made += 1
        if made == len(self.choices):
            return self.catalogue.element(int(possible.argmax()))
        possible.flags.writeable = False
        return ActionChoice(possible, made)
