"""Action spaces: an action is a placement, a part of it, or whose next piece to take."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, Protocol

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.site import (
    AnyCharge,
    AnySource,
    Catalogue,
    Charge,
    PointSource,
    Scenario,
    VehicleCharge,
    VehicleSource,
)
from blast_env.site.zone import source_bounds_m
from blast_env.units import MODULE_SIDE_M
from blast_env.values import whole_number

if TYPE_CHECKING:
    from blast_env.rules import Proposals, RuleRow


class ActionCode(Protocol):
    """How agents write the numbered actions: as a number, or as a vector of numbers."""

    @property
    def space(self) -> spaces.Space[Any]:
        """The space of one action."""

    @property
    def finish(self) -> Any:
        """The action that finishes."""

    def numbers(self, actions: NDArray[np.int64]) -> IntArray:
        """Return the numbers of actions of the space (actions,)."""

    def masks(self, legal: NDArray[np.int8]) -> NDArray[np.int8]:
        """Return the masks of the space, one per row of the mask of numbered actions."""


@dataclass(frozen=True)
class Numbers:
    """An action is its number.

    Attributes:
        count: Number of actions.
    """

    count: int

    @property
    def space(self) -> spaces.Space[Any]:
        """`Discrete`."""
        return spaces.Discrete(self.count)

    @property
    def finish(self) -> Any:
        """The last number."""
        return self.count - 1

    def numbers(self, actions: NDArray[np.int64]) -> IntArray:
        """Return the actions."""
        return actions

    def masks(self, legal: NDArray[np.int8]) -> NDArray[np.int8]:
        """Return the masks."""
        return legal


@dataclass(frozen=True)
class Dimensions:
    """An action is a variant with a row, or the end, and a column, each chosen by itself.

    The end is among the rows, of which there are many: a policy that has learnt nothing yet then
    places most of the stock. Among few variants it would finish after one or two.

    A mask says of each dimension which values some legal action has, one after the other, as
    MaskablePPO takes it. Values that are legal one by one may be illegal together.

    Attributes:
        variants: Number of variants.
        rows: Number of rows of the build zone; this number itself finishes.
        columns: Number of its columns.
    """

    variants: int
    rows: int
    columns: int

    @property
    def space(self) -> spaces.Space[Any]:
        """`MultiDiscrete`."""
        return spaces.MultiDiscrete([self.variants, self.rows + 1, self.columns])

    @property
    def finish(self) -> Any:
        """The last row, with the first variant and column."""
        return np.array([0, self.rows, 0])

    def numbers(self, actions: NDArray[np.int64]) -> IntArray:
        """Return the numbers of actions (actions, 3) among placements row by row; the last ends."""
        variant, row, column = actions.T
        placed = (variant * self.rows + row) * self.columns + column
        end = self.variants * self.rows * self.columns
        numbers: IntArray = np.where(row == self.rows, end, placed)
        return numbers

    def masks(self, legal: NDArray[np.int8]) -> NDArray[np.int8]:
        """Return the masks (actions, variants + rows + 1 + columns).

        Where nothing can be placed, any variant and column go with the end.
        """
        places = legal[:, :-1].reshape(-1, self.variants, self.rows, self.columns)
        nothing = ~places.any(axis=(1, 2, 3)).reshape(-1, 1)
        of_variants, of_columns = places.any(axis=(2, 3)), places.any(axis=(1, 2))
        of_rows = np.hstack((places.any(axis=(1, 3)), legal[:, -1:]))
        return np.hstack((of_variants | nothing, of_rows, of_columns | nothing)).astype(np.int8)


class NumberedActions(Protocol):
    """The numbered actions on a site; without a known charge, against all of its sources."""

    @property
    def finish(self) -> int:
        """The action that finishes; the others are below it."""

    @property
    def are_plain(self) -> bool:
        """Whether each action is a placement, so that the legal places are the mask."""

    def mask(self, chosen: "ActionChoice") -> BoolArray:
        """Return the mask of legal actions after the choices so far (actions,)."""

    def narrowed(self, chosen: "ActionChoice", action: int) -> "ActionChoice | int | None":
        """Return the choices after an action, the element to place, or `None` if it is illegal."""

    def nearest(self, chosen: "ActionChoice", action: int) -> int | None:
        """Return the action to take in the place of an illegal one; `None` for none."""

    def with_sources(self, sources: tuple[AnySource, ...]) -> "NumberedActions":
        """Return the actions for other places of the charge, as shown to the agent."""


class Actions(Protocol):
    """A kind of action space: the sequence of choices that makes up a placement."""

    def choices(self, scenario: Scenario) -> tuple[IntArray, ...]:
        """Return the choices that lead to a variant and its lower left cell.

        The number of options depends on the catalogue alone.

        Returns:
            For each choice, the index from 0 of the option that contains each variant and cell
            (variants, rows, columns). Of several placements that all choices leave, the one nearest
            to the line of sight is taken.
        """

    def numbered(self, scenario: Scenario, representative: Scenario) -> NumberedActions:  # noqa: ARG002
        """Return the numbered actions on a site.

        Args:
            scenario: The scenario.
            representative: The scenario that the spaces of the environment are those of.
        """
        return ActionNumbers.of(self, scenario)

    def code(self, catalogue: Catalogue, count: int) -> ActionCode:  # noqa: ARG002
        """Return how agents write the actions, of which there are `count`: as numbers."""
        return Numbers(count)

    def rules(self, representative: Scenario) -> tuple[str, ...]:  # noqa: ARG002
        """Return the rules that suggest the actions, by title, in their order: none."""
        return ()


@dataclass(frozen=True)
class PlaceAtOnce(Actions):
    """One action per placement: a variant and its lower left cell, as `Catalogue` numbers them."""

    def choices(self, scenario: Scenario) -> tuple[IntArray, ...]:
        """Return the only choice."""
        catalogue = scenario.zone.catalogue
        return (np.arange(catalogue.finish).reshape(-1, *catalogue.shape),)


@dataclass(frozen=True)
class PlaceByDimensions(PlaceAtOnce):
    """The same placements as a vector: the variant, the row or the end, and the column.

    Policies of libraries draw each number by itself: some dozens of outputs take the place of
    thousands, and what is learnt of a row holds for all columns.
    """

    def code(self, catalogue: Catalogue, count: int) -> ActionCode:  # noqa: ARG002
        """Return the three numbers of a placement."""
        return Dimensions(len(catalogue.variants), *catalogue.shape)


@dataclass(frozen=True)
class ItemThenPlace(Actions):
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

    def choices(self, scenario: Scenario) -> tuple[IntArray, ...]:
        """Return two choices, or three with blocks, without those that have a single option."""
        catalogue = scenario.zone.catalogue
        variant, row, column = np.indices((len(catalogue.variants), *catalogue.shape))
        rows, columns = catalogue.shape
        # Without blocks the zone is one block, whose number is 0 everywhere: that choice has a
        # single option, and goes.
        side = self.block_cells or max(rows, columns, 1)
        block = (row // side) * -(-columns // side) + column // side
        cell = (row % side) * min(side, columns) + column % side
        return tuple(item for item in (variant, block, cell) if item.any()) or (cell,)


@dataclass(frozen=True)
class RowAcrossSight(Actions):
    """The variant and a row of cells across the line of sight, without the place in it.

    A row is a column or a row of the build zone: whichever lies more across the line from the mean
    place of the charge to the protected structures. There are as many rows as the shorter side of
    the zone has cells. The same action again and again thus builds a straight wall, from the line
    of sight outwards. Little has to be learnt, but not every layout can be built.
    """

    def choices(self, scenario: Scenario) -> tuple[IntArray, ...]:
        """Return the only choice."""
        catalogue = scenario.zone.catalogue
        variant, *cells = np.indices((len(catalogue.variants), *catalogue.shape))
        axis = int(_sight(scenario, scenario.charge).is_along_x)
        count = min(catalogue.shape)
        return (variant * count + cells[axis] * count // max(catalogue.shape[axis], 1),)


@dataclass(frozen=True)
class PlaceBySuggestion(PlaceAtOnce):
    """The next piece of what one of the rules of thumb proposes, all its rest, or to finish.

    There are two actions for each rule that suits the representative scenario: its next piece, and
    behind those of all rules, all the rest of its layout. By turns, pieces of several layouts make
    a new one.
    """

    def numbered(self, scenario: Scenario, representative: Scenario) -> NumberedActions:
        """Return the suggestions on a site."""
        return Suggestions.of(scenario, representative)

    def rules(self, representative: Scenario) -> tuple[str, ...]:
        """Return the rules that suit the representative scenario, by title."""
        return tuple(row.title for row in Suggestions.of(representative, representative).rules)


@dataclass(frozen=True)
class _Sight:
    """The line from the mean place of a charge to the mean of the protected structures' centres.

    Attributes:
        start_m: The place.
        along: The vector to the structures, m.
    """

    start_m: FloatArray
    along: FloatArray

    @property
    def is_along_x(self) -> bool:
        return bool(abs(self.along[0]) >= abs(self.along[1]))

    def beside_m(self, scenario: Scenario) -> FloatArray:
        """Return the distance of each placement's centre from the line, along a row of cells."""
        variants = scenario.zone.catalogue.variants
        # 1. The centre of a piece: half of its further cells beside its lower left one.
        half_m = (
            MODULE_SIDE_M
            / 2.0
            * np.array([(variant.columns - 1, variant.rows - 1) for variant in variants])
        )
        centres_m = np.stack(scenario.zone.centres_m)
        from_start_m = centres_m[:, np.newaxis] + half_m.T[..., np.newaxis, np.newaxis]
        from_start_m = from_start_m - self.start_m[:, np.newaxis, np.newaxis, np.newaxis]
        # 2. Its distance from the line, along the row of cells that lies across it.
        ahead, aside = (0, 1) if self.is_along_x else (1, 0)
        slope = self.along[aside] / self.along[ahead] if self.along[ahead] else 0.0
        beside_m: FloatArray = np.abs(from_start_m[aside] - slope * from_start_m[ahead])
        return beside_m.round(9)  # equal on both sides, whatever the rounding


def _sight(scenario: Scenario, sources: Sequence[AnySource]) -> _Sight:
    protected = [structure for structure in scenario.structures if structure.protected]
    places = _mean(
        [source_bounds_m(source).centre for source in sources],
        [source.weight for source in sources],
    )
    target = _mean(
        [structure.rectangle_m.centre for structure in protected],
        [structure.weight for structure in protected],
    )
    return _Sight(places, target - places)


def _mean(places_m: Sequence[tuple[float, float]], weights: Sequence[float]) -> FloatArray:
    return np.average(np.array(places_m), axis=0, weights=weights)


ACTIONS: Final[Mapping[str, Actions]] = MappingProxyType(
    {
        "place": PlaceAtOnce(),
        "dimensions": PlaceByDimensions(),
        "item_then_place": ItemThenPlace(),
        "item_then_block": ItemThenPlace(block_cells=8),
        "row": RowAcrossSight(),
        "suggestion": PlaceBySuggestion(),
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
class ActionNumbers:
    """The numbered actions for a catalogue: the options of each choice in turn, then to finish.

    Attributes:
        scenario: The scenario.
        sources: The place of the charge, or its possible places.
        choices: See `Actions.choices`.
        first: The first action of each choice (choices,).
        finish: The action that finishes; the others are below it.
    """

    scenario: Scenario
    sources: tuple[AnySource, ...]
    choices: tuple[IntArray, ...]
    first: tuple[int, ...]
    finish: int

    @classmethod
    def of(
        cls, actions: Actions, scenario: Scenario, sources: tuple[AnySource, ...] = ()
    ) -> "ActionNumbers":
        """Return the actions for a scenario.

        Args:
            actions: The kind of action space.
            scenario: The scenario.
            sources: The place of the charge as shown to the agent; by default all of the scenario.
        """
        choices = actions.choices(scenario)
        counts = [int(choice.max(initial=-1)) + 1 for choice in choices]
        *first, finish = np.cumsum([0, *counts]).tolist()
        return cls(scenario, sources or scenario.charge, choices, tuple(first), finish)

    def with_sources(self, sources: tuple[AnySource, ...]) -> "ActionNumbers":
        """Return the actions for other places of the charge, as shown to the agent."""
        other = ActionNumbers(self.scenario, sources, self.choices, self.first, self.finish)
        vars(other)["are_plain"] = self.are_plain
        if not self.are_plain:
            vars(other)["_places"] = self._places
        return other

    @property
    def catalogue(self) -> Catalogue:
        """The catalogue of modules or pieces."""
        return self.scenario.zone.catalogue

    @cached_property
    def are_plain(self) -> bool:
        """Whether each action is a placement, so that the legal places are the mask."""
        first = self.choices[0].ravel()
        return len(self.choices) == 1 and np.array_equal(first, np.arange(self.finish))

    @cached_property
    def _places(self) -> tuple[tuple[IntArray, IntArray], ...]:
        """For each choice, the placements sorted by its option, and the first of each option."""
        found = []
        for options in self.choices:
            flat = options.ravel()
            places = np.argsort(flat, kind="stable")
            firsts = np.searchsorted(flat[places], np.arange(int(flat.max(initial=-1)) + 2))
            found.append((places, firsts))
        return tuple(found)

    @cached_property
    def _beside_m(self) -> FloatArray:
        return _sight(self.scenario, self.sources).beside_m(self.scenario)

    @cached_property
    def _is_sight_along_x(self) -> bool:
        return _sight(self.scenario, self.scenario.charge).is_along_x

    def mask(self, chosen: ActionChoice) -> NDArray[np.bool_]:
        """Return the mask of legal actions (actions,); finishing is legal before the first choice.

        Args:
            chosen: The choices so far.
        """
        mask = np.zeros(self.finish + 1, dtype=np.bool_)
        if self.are_plain:
            mask[:-1], mask[-1] = chosen.possible.ravel(), True
            return mask
        options = self.choices[chosen.choices]
        mask[self.first[chosen.choices] + options[chosen.possible]] = True
        mask[-1] = chosen.choices == 0
        return mask

    def narrowed(self, chosen: ActionChoice, action: int) -> ActionChoice | int | None:
        """Return the state of choice after an action.

        Choices with a single remaining option are skipped.

        Args:
            chosen: The choices before the action.
            action: An action other than the one that finishes.

        Returns:
            The choices after it; the number in the catalogue of the element to place, if all
            choices are made; or `None` if the action is illegal.
        """
        if self.are_plain:
            return action if chosen.possible.item(action) else None
        option, (sorted_places, firsts) = (
            action - self.first[chosen.choices],
            self._places[chosen.choices],
        )
        if not 0 <= option < len(firsts) - 1:
            return None
        # 1. The legal placements with this option.
        own = sorted_places[firsts[option] : firsts[option + 1]]
        places = own[chosen.possible.ravel()[own]]
        if not len(places):
            return None
        # 2. Choices that they all share are made already.
        made = chosen.choices + 1
        while made < len(self.choices) and np.ptp(self.choices[made].flat[places]) == 0:
            made += 1
        # 3. Of what no choice tells apart, the placement nearest to the line of sight.
        if made == len(self.choices):
            nearest = self._beside_m.flat[places].argmin() if len(places) > 1 else 0
            return int(places[nearest])
        possible = np.zeros_like(chosen.possible)
        possible.flat[places] = True
        possible.flags.writeable = False
        # 4. Else the mask of what is left.
        options = tuple(int(choice.flat[places[0]]) for choice in self.choices[:made])
        return ActionChoice(possible, made, options)

    def nearest(self, chosen: ActionChoice, action: int) -> int | None:
        """Return the legal action nearest to an illegal one.

        It leads to the legal placement of the same item whose lower left cell is nearest to the
        wanted one, or to the middle of several: in the same rotation, if it has a legal placement.
        Distances along the line of sight count first, then those across it. So what an agent
        repeats becomes a wall, not a heap. Of several at one distance the first one counts.

        Args:
            chosen: The choices so far.
            action: An illegal action other than the one that finishes.

        Returns:
            The action; `None` if the item has no legal placement, or the action belongs to another
            choice than the present one.
        """
        options = self.choices[chosen.choices]
        wanted = options == action - self.first[chosen.choices]
        # 1. The placements that the action meant, legal or not, after the choices so far.
        for choice, option in zip(self.choices, chosen.options, strict=False):
            wanted = wanted & (choice == option)
        numbers, rows, columns = wanted.nonzero()
        if not len(numbers):
            return None
        # 2. Distances from their middle: along the line of sight before across it.
        up, right = np.indices(self.catalogue.shape)
        beside = np.abs(up - rows.mean()), np.abs(right - columns.mean())
        across, along = beside if self._is_sight_along_x else beside[::-1]
        distances = along * max(self.catalogue.shape) + across
        # 3. The nearest legal one, turned as wanted, or else turned the other way.
        items = np.array([variant.item for variant in self.catalogue.variants])
        same_rotation = np.isin(np.arange(len(items)), numbers)
        for suits in (same_rotation, np.isin(items, items[numbers])):
            candidates = chosen.possible & suits[:, np.newaxis, np.newaxis]
            if candidates.any():
                place = np.where(candidates, distances, np.inf).argmin()
                return int(self.first[chosen.choices] + options.flat[place])
        return None


# ---- Suggestions.


SUGGESTION: Final = (
    "has a next piece",
    "pieces placed / pieces of its layout",
    "lines of sight that its layout cuts / all",
    "next piece: cost / budget",
    "next piece: height / 12 m",
    "next piece: distance along the line of sight / its length",
    "next piece: distance to the left of that line / 20 m + 0.5",
)
"""The values of a rule's suggestions, from 0 to 1; those of the next piece are 0 without one."""


@dataclass(frozen=True, eq=False)
class Suggestions:
    """The suggestions on a site: the next piece of each rule, the rest of each, then to finish.

    Attributes:
        scenario: The scenario.
        rules: The rules.
        charge: The charge as the rules know it; `None` for all of the scenario.
    """

    scenario: Scenario
    rules: "tuple[RuleRow, ...]"
    charge: AnyCharge | None = None

    @classmethod
    def of(cls, scenario: Scenario, representative: Scenario) -> "Suggestions":
        """Return the suggestions against all charges of a scenario.

        Args:
            scenario: The scenario.
            representative: The scenario whose rules they are; of those without a layout for
                `scenario`, none is legal.
        """
        from blast_env.rules import RULES  # only where they are asked for

        return cls(scenario, tuple(row for row in RULES.values() if row.suits(representative)))

    def with_sources(self, sources: tuple[AnySource, ...]) -> "Suggestions":
        """Return the suggestions where an agent is shown a single charge, or all of them."""
        charge = _shown_charge(self.scenario, sources)
        return self if charge is None else Suggestions(self.scenario, self.rules, charge)

    @cached_property
    def proposals(self) -> "Proposals":
        """What the rules propose."""
        from blast_env.layout import ById
        from blast_env.rules import proposals_for  # as in `of`

        return proposals_for(ById(self.scenario), self.rules, self.charge)

    @property
    def finish(self) -> int:
        """The action that finishes."""
        return 2 * len(self.rules)

    @property
    def are_plain(self) -> bool:
        """Whether each action is a placement: none is."""
        return False

    def mask(self, chosen: ActionChoice) -> BoolArray:
        """Return the mask of the rules with a piece that is legal now, twice, and of finishing."""
        mask = np.ones(self.finish + 1, dtype=np.bool_)
        mask[:-1] = np.tile(self._legal(chosen).any(axis=1), 2)
        return mask

    def narrowed(self, chosen: ActionChoice, action: int) -> int | None:
        """Return the number of the next legal piece of a rule's layout; `None` without one.

        A piece that is placed is not legal again. An action for the rest goes on with what this
        returns after each piece; see `is_rest`.
        """
        rule = action % len(self.rules)
        numbers, are_there = self.proposals.numbers[rule], self.proposals.are_there[rule]
        legal = chosen.possible.ravel()[numbers] & are_there
        return int(numbers[legal.argmax()]) if legal.any() else None

    def is_rest(self, action: int) -> bool:
        """Whether an action places all the rest of a layout at once, not its next piece alone."""
        return len(self.rules) <= action < self.finish

    def nearest(self, chosen: ActionChoice, action: int) -> int:  # noqa: ARG002
        """Return to finish: a rule whose layout is complete has had its say."""
        return self.finish

    def values(self, chosen: ActionChoice, table: NDArray[np.int8]) -> FloatArray:
        """Return the values `SUGGESTION` of each rule, from 0 to 1 (rules, values).

        Args:
            chosen: The choices so far.
            table: 1 where a variant has its lower left cell (variants, rows, columns).
        """
        proposals, legal = self.proposals, self._legal(chosen)
        has_next: BoolArray = np.any(legal, axis=1)
        placed = (table.ravel()[proposals.numbers] > 0) & proposals.are_there
        shares = placed.sum(axis=1) / np.maximum(proposals.are_there.sum(axis=1), 1)
        following = proposals.pieces[np.arange(len(self.rules)), legal.argmax(axis=1)]
        following = following * has_next[:, np.newaxis]
        of_rules = np.stack((has_next, shares, proposals.cut_shares), axis=1)
        return np.concatenate((of_rules, following), axis=1)

    def _legal(self, chosen: ActionChoice) -> BoolArray:
        """Return which elements of each layout are legal now (rules, most)."""
        possible = chosen.possible.ravel()[self.proposals.numbers]
        legal: BoolArray = possible & self.proposals.are_there
        return legal


def _shown_charge(scenario: Scenario, sources: tuple[AnySource, ...]) -> AnyCharge | None:
    """Return the charge that an agent is shown as rules know it; `None` if it is hidden."""
    if len(sources) != 1 or sources == scenario.charge:
        return None
    (source,) = sources
    if isinstance(source, VehicleSource):
        return VehicleCharge(source)
    if isinstance(source, PointSource):
        return Charge(source.position_m, source.tnt_kg, source.height_m)
    return None
