"""Acceptance criterion of generated sites, by measures that need no blast.

The measures are shares of the lines of sight from charge to protected structures that barriers cut.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from math import cos, pi, sin
from typing import Final, NamedTuple, Protocol

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.geometry import Element, Layout, Rectangle
from blast_env.layout import LayoutState, usable_cells
from blast_env.sections import PointM
from blast_env.site import (
    AnyScenario,
    AnySource,
    BuildZone,
    Catalogue,
    PointSource,
    RectangleSource,
    Scenario,
    find_scenario,
)
from blast_env.site.structures import ground_m, is_open_below
from blast_env.sites.sight_bits import SightBits, Words, take_next
from blast_env.units import MODULE_SIDE_M

DIRECTIONS: Final = 360
"""Number of lines from each place of a charge."""

TARGETS: Final = 3
"""Number of target heights on a facade with a height: the middles of its thirds."""

MOST_CROSSINGS: Final = 40_000_000
"""Most lines times cells; of more lines, as many are kept, evenly spaced."""

PLACES: Final = 9
"""Number of places along a segment or an entry, or in a rectangle (3 x 3)."""


@dataclass(frozen=True, eq=False)
class Visibility:
    """The lines of sight from the places of charges to the protected structures.

    Lines leave evenly spaced places of every source in evenly spaced directions, like the balls of
    a charge. The lines that reach a protected structure count, each by the weights of its source
    and of the structure. If the structure has a height, each line becomes three, which rise from
    the ground at the charge to the middle of its lower, middle and upper third: a low wall cuts
    all three near the charge, but only the lower ones near the structure. A terrace stops the
    lines that arrive below its top.

    Attributes:
        weight: Weight of each line that no other structure stops (lines,).
        cut: Whether a module of unlimited height on each cell of the build zone would cut each
            line (lines, rows, columns).
        height_m: Height of each line over the ground of each cell (lines, rows, columns).
        open_share: Share, by weight, of the lines that no other structure stops.
    """

    weight: FloatArray
    cut: BoolArray
    height_m: FloatArray
    open_share: float

    @classmethod
    def of(cls, scenario: AnyScenario) -> "Visibility":
        """Return the lines of sight of a scenario.

        Args:
            scenario: The scenario, or its bundled name or path.

        Raises:
            BlastEnvError: If it has no build zone.
        """
        scenario = find_scenario(scenario)
        # (1) Lines from all places in all directions; (2) where each first meets a protected
        # structure, another structure, a terrace; (3) of those that no other structure stops, the
        # cells that cut them; (4) with heights, three lines each, less those that a terrace stops.
        origin, direction, source_weight = _all_lines(scenario)
        protected_m, other_m = np.full((2, len(origin)), np.inf)
        weight, base_m, target_m = np.zeros((3, len(origin)))
        terraces: list[tuple[FloatArray, float]] = []
        for structure in scenario.structures:
            entry_m = _entry_m(origin, direction, structure.rectangle_m)
            if structure.protected:
                nearer = entry_m < protected_m
                weight[nearer] = (structure.weight * source_weight)[nearer]
                target_m[nearer] = structure.height_m or 0.0
                base_m[nearer] = structure.base_m if structure.height_m else 0.0
                protected_m = np.minimum(protected_m, entry_m)
            elif structure.carries:
                terraces.append((entry_m, structure.height_m or 0.0))
            elif not is_open_below(structure, scenario.structures):  # else lines pass below it
                other_m = np.minimum(other_m, entry_m)
        free = (weight > 0.0) & (protected_m < other_m)
        open_share = float(weight[free].sum() / max(weight.sum(), 1e-300))
        free &= _kept(free, scenario.zone.rows * scenario.zone.columns)
        cut, along_share = _cut(scenario, origin[free], direction[free], protected_m[free])
        if not target_m.any():
            return cls(weight[free], cut, np.zeros(cut.shape), open_share)
        shares = (np.arange(TARGETS) + 0.5) / TARGETS
        rise_m = (target_m - base_m)[free]
        ends_m = (base_m[free] + shares[:, np.newaxis] * rise_m).ravel()  # third by third
        weight = np.tile(weight[free] / TARGETS, TARGETS)
        over = np.ones(len(weight), dtype=bool)
        for entry_m, high_m in terraces:
            share = np.tile(np.minimum(entry_m[free] / protected_m[free], 1.0), TARGETS)
            over &= (share == 1.0) | (ends_m == 0.0) | (share * ends_m >= high_m)
        open_share *= float(weight[over].sum() / max(weight.sum(), 1e-300))
        height_m = (ends_m.reshape(TARGETS, -1, 1, 1) * along_share).reshape(-1, *cut.shape[1:])
        ground = ground_m(scenario.structures, scenario.zone.boxes)
        if ground.any():
            height_m -= ground
        cut = np.tile(cut, (TARGETS, 1, 1))
        if over.all():  # the usual case, without copies
            return cls(weight, cut, height_m, open_share)
        return cls(weight[over], cut[over], height_m[over], open_share)

    def cut_by(self, height_m: float | None) -> BoolArray:
        """Return whether a module on each cell would cut each line (lines, rows, columns).

        Args:
            height_m: Height of the module; `None` is the height of the air.
        """
        return self.cut if height_m is None else self.cut & (self.height_m < height_m)

    def cut_share(
        self, cells: Sequence[Element], heights_m: Sequence[float | None] | None = None
    ) -> float:
        """Return the share of the lines, by weight, that modules cut.

        Args:
            cells: (row, column) of the cells that hold a module (`LayoutState.cells`).
            heights_m: Height of each module, `None` for the height of the air; all `None` unless
                given.
        """
        if not cells or not len(self.weight):
            return 0.0
        rows, columns = zip(*(cell[:2] for cell in cells), strict=True)
        cut = self.cut[:, rows, columns]
        if heights_m is not None:
            tall = np.array([np.inf if height_m is None else height_m for height_m in heights_m])
            cut = cut & (self.height_m[:, rows, columns] < tall)
        share = float(self.weight @ cut.any(axis=1) / self.weight.sum())
        return min(share, 1.0)  # rounding


def _all_lines(scenario: Scenario) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return origins (lines, 2), directions (lines, 2) and weights of sources (lines,)."""
    places = [(place, source.weight) for source in scenario.charge for place in places_of(source)]
    origin = np.repeat(np.array([place for place, _ in places]), DIRECTIONS, axis=0)
    weight = np.repeat(np.array([weight for _, weight in places]), DIRECTIONS)
    return origin, np.tile(np.array(_directions()), (len(places), 1)), weight


def _kept(free: BoolArray, cells: int) -> BoolArray:
    """Return which lines to keep, so that they take no more memory than `MOST_CROSSINGS`."""
    numbers, most = np.flatnonzero(free), max(MOST_CROSSINGS // cells, 1)
    kept = np.zeros(len(free), dtype=bool)
    kept[numbers[np.linspace(0, len(numbers) - 1, min(len(numbers), most)).astype(int)]] = True
    return kept


@cache
def _directions() -> tuple[tuple[float, float], ...]:
    """Return the directions, none along an axis.

    Rounding keeps the last bit of sines, which differs between machines, without effect.
    """
    angles = (2.0 * pi * (index + 0.5) / DIRECTIONS for index in range(DIRECTIONS))
    return tuple((round(cos(angle), 9), round(sin(angle), 9)) for angle in angles)


def places_of(source: AnySource) -> list[PointM]:
    """Return the places of a source: the centres of equal parts of it.

    Those of a vehicle lie along its entries, since its reach depends on the layout.
    """
    if isinstance(source, PointSource):
        return [source.position_m]
    if not isinstance(source, RectangleSource):
        return [place for ends_m in source.lines_m for place in _places_along(*ends_m)]
    # Centres of equal parts: none of them on the edge of the source.
    side = round(PLACES**0.5)
    shares = [(index + 0.5) / side for index in range(side)]
    (left, bottom), (width, height) = source.corner_m, source.size_m
    return [(left + across * width, bottom + up * height) for up in shares for across in shares]


def _places_along(start_m: PointM, end_m: PointM) -> list[PointM]:
    (x0, y0), (x1, y1) = start_m, end_m
    shares = [(index + 0.5) / PLACES for index in range(PLACES)]
    return [(x0 + share * (x1 - x0), y0 + share * (y1 - y0)) for share in shares]


def _entry_m(origin: FloatArray, direction: FloatArray, rectangle: Rectangle) -> FloatArray:
    """Return the distance along each line to a rectangle, m (lines,); infinite if it misses."""
    # Slab method: the line is within the rectangle from its last entry to its first exit. No
    # direction is along an axis, so nothing is divided by 0.
    low = (np.array([rectangle.left, rectangle.bottom]) - origin) / direction
    high = (np.array([rectangle.right, rectangle.top]) - origin) / direction
    enter = np.minimum(low, high).max(axis=1)
    leave = np.maximum(low, high).min(axis=1)
    return np.where((enter < leave) & (leave > 0.0), enter, np.inf)


def _cut(
    scenario: Scenario, origin: FloatArray, direction: FloatArray, length_m: FloatArray
) -> tuple[BoolArray, FloatArray]:
    """Return whether a module on each cell would cut each line, and the place along the line.

    Both are (lines, rows, columns); the place is a share of the line's length, 0 to 1.
    """
    x, y = scenario.zone.centres_m
    to_x = x[0] - origin[:, :1]  # (lines, columns)
    to_y = y[:, 0] - origin[:, 1:]  # (lines, rows)
    along_x, along_y = direction[:, :1], direction[:, 1:]
    along = (to_y * along_y)[:, :, np.newaxis] + (to_x * along_x)[:, np.newaxis, :]
    beside = (to_y * along_x)[:, :, np.newaxis] - (to_x * along_y)[:, np.newaxis, :]
    # The shadow of a square across a line is its side times |cos| + |sin|, half to either side.
    half_width = MODULE_SIDE_M / 2.0 * np.abs(direction).sum(axis=1)
    cut: BoolArray = np.abs(beside, out=beside) < half_width[:, np.newaxis, np.newaxis]
    cut &= along > 0.0
    cut &= along < length_m[:, np.newaxis, np.newaxis]
    along /= length_m[:, np.newaxis, np.newaxis]  # from here on a share of the length
    return cut, np.clip(along, 0.0, 1.0, out=along)


@dataclass(frozen=True)
class SiteMeasures:
    """Shares of the lines of sight; see `Visibility`.

    Attributes:
        open_share: Share that no other structure stops; the other shares are of these lines.
        layout_share: Share that `visibility_layout` cuts, up to the order of equal elements.
        wall_share: Share that the best straight wall cuts: the whole stock in one run along a row
            or column of the zone, without regard to budget and access way. With a catalogue: as
            many pieces of one item as stock and budget allow.
        random_share: Expected share that the affordable modules cut on random cells, without
            regard to the access way. With a catalogue: as many pieces as stock and budget allow,
            each of a random item in a random place.
    """

    open_share: float
    layout_share: float
    wall_share: float
    random_share: float

    @classmethod
    def of(cls, scenario: AnyScenario) -> "SiteMeasures":
        """Return the measures of a scenario.

        Args:
            scenario: The scenario, or its bundled name or path.

        Raises:
            BlastEnvError: If it has no build zone.
        """
        scenario = find_scenario(scenario)
        lines, placement = Visibility.of(scenario), LayoutState.empty(scenario)
        sight = _Sight.of(lines, placement.catalogue)
        if scenario.zone.items:
            random_share = _random_pieces_share(placement, sight)
        else:
            random_share = _random_share(scenario, lines)
        return cls(
            open_share=lines.open_share,
            layout_share=cut_share_of(lines, _greedy(placement, _CountedGains(placement, sight))),
            wall_share=_wall_share(scenario, sight),
            random_share=random_share,
        )


@dataclass(frozen=True, eq=False)
class _Sight:
    """The lines of sight as bits.

    Attributes:
        bits: Their order.
        by_height: Lines that a module of each height would cut (rows, columns, words).
        by_variants: Lines that each action would cut, of which a piece that reaches beyond the zone
            counts with its part inside (variants, rows, columns, words).
    """

    lines: Visibility
    bits: SightBits
    by_height: Mapping[float | None, Words]
    by_variants: Words

    @classmethod
    def of(cls, lines: Visibility, catalogue: Catalogue) -> "_Sight":
        """Return the lines of sight on a site with a catalogue."""
        variants = catalogue.variants
        heights_m = [*{item.height_m: None for item in variants if not item.is_measure}]
        bits = SightBits.of(lines.weight)
        by_height = dict(
            zip(heights_m, bits.cut_by(lines.cut, lines.height_m, heights_m), strict=True)
        )
        shape = len(variants), *catalogue.shape, bits.words
        by_variants = np.zeros(shape, dtype=np.uint64)
        for own, variant in zip(by_variants, variants, strict=True):
            if not variant.is_measure:
                own[...] = by_height[variant.height_m]
                take_next(own, 0, variant.rows)
                take_next(own, 1, variant.columns)
        return cls(lines, bits, by_height, by_variants)


def cut_share_of(lines: Visibility, placement: LayoutState) -> float:
    """Return the share of the lines that the placed modules cut, with their heights."""
    modules = placement.modules
    return lines.cut_share(
        [module.cell for module in modules], [module.height_m for module in modules]
    )


def visibility_layout(scenario: AnyScenario, lines: Visibility) -> Layout:
    """Return the greedy layout: each step adds the element that cuts most lines per cost.

    It is legal, and complete when no further module or piece would cut another line.

    Args:
        scenario: The scenario, or its bundled name or path.
        lines: Its lines of sight.
    """
    placement = LayoutState.empty(scenario)
    return _greedy(placement, _SummedGains(placement, lines)).layout


class _Gains(Protocol):
    """The weight of the lines that each element would cut, among those that are left."""

    nothing: float

    def of_all(self) -> FloatArray:
        """Return the weights (actions,), 0 of what is not legal at first."""

    def cut(self, action: int) -> None:
        """Take away the lines that an element cuts."""


def _greedy(placement: LayoutState, gains: _Gains) -> LayoutState:
    while not placement.is_full:
        gain = gains.of_all()
        worth = np.where(placement.legal, gain.reshape(placement.legal.shape), 0.0)
        worth /= placement.costs
        action = int(worth.argmax())
        if not gain[action] > gains.nothing or not worth.flat[action] > 0.0:
            break
        placement = placement.place(placement.catalogue.element(action))
        gains.cut(action)
    return placement


_ROUNDING: Final = 1e-9
"""Share of the lines that counts as 0, to absorb rounding of fractional weights."""


class _SummedGains:
    """Gains as sums of the weights, each less what is cut.

    The last bit of a sum decides between elements that cut equally much. Published layouts of the
    rule depend on that, so `visibility_layout` keeps it.
    """

    def __init__(self, placement: LayoutState, lines: Visibility) -> None:
        self._weight, self._left = lines.weight, np.ones(len(lines.weight), dtype=bool)
        self._possible = placement.legal.reshape(-1)  # what is not legal never becomes so
        self._cut = _cut_by_legal(lines, placement)  # line by line, as sums take it
        self._column = np.cumsum(self._possible) - 1
        self._gain = np.zeros(len(self._possible))
        self._gain[self._possible] = _gains(lines.weight, self._cut)
        self.nothing = _ROUNDING * float(lines.weight.sum())

    def of_all(self) -> FloatArray:
        return self._gain

    def cut(self, action: int) -> None:
        newly = self._left & self._cut[:, self._column[action]]
        self._left &= ~newly
        self._gain[self._possible] -= _gains(self._weight[newly], self._cut[newly])


class _CountedGains:
    """Gains as numbers of lines times their weights: of equal ones the first element is best."""

    def __init__(self, placement: LayoutState, sight: "_Sight") -> None:
        self._bits, self._possible = sight.bits, placement.legal.reshape(-1)
        self._left = sight.by_variants.reshape(len(self._possible), sight.bits.words)[
            self._possible
        ]
        self._column = np.cumsum(self._possible) - 1
        self.nothing = _ROUNDING * float(sight.lines.weight.sum())

    def of_all(self) -> FloatArray:
        gain = np.zeros(len(self._possible))
        gain[self._possible] = self._bits.weight_of(self._left)
        return gain

    def cut(self, action: int) -> None:
        self._left &= ~self._left[self._column[action]]


_NUMBERS_AT_ONCE: Final = 1_000_000
"""Truth values converted to numbers at a time, eight bytes each."""


def _gains(weight: FloatArray, cut: BoolArray) -> FloatArray:
    """Return the weight of the lines that each action would cut (actions,)."""
    gains = np.zeros(cut.shape[1])
    few = max(1, _NUMBERS_AT_ONCE // max(1, len(weight)))
    for first in range(0, len(gains), few):
        gains[first : first + few] = weight @ cut[:, first : first + few]
    return gains


def _cut_by_legal(lines: Visibility, placement: LayoutState) -> BoolArray:
    """Return whether each legal action would cut each line (lines, legal actions)."""
    catalogue, legal = placement.catalogue, placement.legal.reshape(len(placement.legal), -1)
    ends = np.cumsum(legal.sum(axis=1))
    found = np.zeros((len(lines.weight), ends[-1]), dtype=bool)
    by_height: dict[float | None, BoolArray] = {}
    cut = np.empty(lines.cut.shape, dtype=bool)  # one array for all: new memory takes time
    for variant, own, end in zip(catalogue.variants, legal, ends.tolist(), strict=True):
        if variant.is_measure or not own.any():
            continue
        if variant.height_m not in by_height:
            by_height[variant.height_m] = lines.cut_by(variant.height_m)
        cut[...] = by_height[variant.height_m]
        # As if the cells of all lines were in one row. What reaches beyond a side of the zone meets
        # other cells there, but no such piece is legal.
        take_next(cut.reshape(-1, catalogue.shape[1]), 0, variant.rows)
        take_next(cut.reshape(-1), 0, variant.columns)
        found[:, end - own.sum() : end] = cut.reshape(len(cut), own.size).compress(own, axis=1)
    return found


def _wall_share(scenario: Scenario, sight: _Sight) -> float:
    """Return the share of the lines that the best straight run of modules cuts."""
    weight = sight.lines.weight
    if not len(weight):
        return 0.0
    usable = usable_cells(scenario)
    best = 0.0
    for height_m, longest in _longest_runs(scenario.zone):
        cut = np.where(usable[..., np.newaxis], sight.by_height[height_m], np.uint64(0))
        for axis, cells in enumerate(usable.shape):
            by_run = cut.copy()
            take_next(by_run, axis, min(longest, cells))
            best = max(best, float(sight.bits.weight_of(by_run).max(initial=0.0)))
    return min(float(best / weight.sum()), 1.0)


def _longest_runs(zone: BuildZone) -> Iterator[tuple[float | None, int]]:
    """Yield the height of each kind of wall, and the number of modules of a straight one.

    It is the stock of modules or, with items, of one item's pieces as far as the budget allows.
    """
    if not zone.items:
        yield zone.height_m, zone.stock
    for item in zone.items:
        pieces = min(item.stock, zone.stock)
        if zone.budget is not None:
            pieces = min(pieces, int(zone.budget / item.cost))
        if pieces:
            yield item.height_m, pieces * item.length_modules


def _random_share(scenario: Scenario, lines: Visibility) -> float:
    """Return the expected share of the lines that modules on random usable cells cut."""
    zone, usable = scenario.zone, usable_cells(scenario)
    cells = int(usable.sum())
    modules = zone.stock
    if zone.budget is not None:
        mean_cost = LayoutState.empty(scenario).empty_zone.module_costs[usable].mean()
        modules = min(modules, int(zone.budget / mean_cost))
    # A line is missed if all modules stand on cells that do not cut it.
    harmless = cells - lines.cut[:, usable].sum(axis=1)
    missed: FloatArray = np.ones(len(harmless))
    for placed in range(modules):
        missed *= np.maximum(harmless - placed, 0) / (cells - placed)
    share = 1.0 - float(lines.weight @ missed) / max(float(lines.weight.sum()), 1e-300)
    return round(share, 9)  # the last bit differs between machines and must not decide


def _random_pieces_share(placement: LayoutState, sight: _Sight) -> float:
    """Return the approximate share of the lines that random pieces cut; overlaps are allowed."""
    zone, weight = placement.scenario.zone, sight.lines.weight
    legal = placement.legal
    numbers = np.array([variant.item for variant in placement.catalogue.variants])
    there = [number for number in range(len(zone.items)) if legal[numbers == number].any()]
    mean_cost = float(np.mean([zone.items[number].cost for number in there]))
    pieces = zone.stock if zone.budget is None else min(zone.stock, zone.budget / mean_cost)
    missed: FloatArray = np.ones(len(weight))
    for number in there:
        own = numbers == number
        places = sight.by_variants[own][legal[own]]
        cutting = sight.bits.counts(places) / len(places)
        missed *= (1.0 - cutting) ** min(zone.items[number].stock, pieces / len(there))
    share = 1.0 - float(weight @ missed) / max(float(weight.sum()), 1e-300)
    return round(share, 9)  # as `_random_share`


class Objection(NamedTuple):
    """The reason for rejecting a site.

    Attributes:
        rule: The violated rule, in the same words for all sites.
        found: The value found.
    """

    rule: str
    found: str


class SiteCriterion(Protocol):
    """Decides whether a site is used: a pure function of the scenario."""

    def objection(self, scenario: Scenario) -> Objection | None:
        """Return the reason for rejecting a site, or `None` if it is accepted."""


@dataclass(frozen=True)
class VisibilityCriterion:
    """Accepts sites where a good layout is effective but incomplete, and placement matters.

    Decided from the lines of sight (`SiteMeasures`) in a few milliseconds, without a blast.
    `studies/check_sites.py` compares it with blasts.

    Attributes:
        least_open_share: Least share of the lines of sight that other structures leave open.
        least_layout_share: Least share of these that the visibility layout cuts.
        most_layout_share: Largest share that it cuts, and that any straight wall cuts.
        least_advantage: Least difference between its share and the mean share of random layouts.
        most_open_share: Largest open share: 1 but for rounding. The families refuse a share that
            rounding puts above 1, since the sites of their seeds are those drawn that way.
    """

    least_open_share: float = 0.6
    least_layout_share: float = 0.5
    most_layout_share: float = 0.9
    least_advantage: float = 0.3
    most_open_share: float = 1.0 + 1e-9

    def objection(self, scenario: AnyScenario) -> Objection | None:
        """Return the reason for rejecting a site, or `None` if it is accepted.

        Args:
            scenario: The scenario, or its bundled name or path.

        Raises:
            BlastEnvError: If it has no build zone.
        """
        shares = SiteMeasures.of(scenario)
        advantage = shares.layout_share - shares.random_share
        least, most = self.least_layout_share, self.most_layout_share
        open_shares = self.least_open_share, self.most_open_share
        for what, value, low, high in (
            ("open share of the lines of sight", shares.open_share, *open_shares),
            ("share cut by the visibility layout", shares.layout_share, least, most),
            ("share cut by the best straight wall", shares.wall_share, 0.0, most),
            ("advantage over random layouts", advantage, self.least_advantage, 1.0),
        ):
            if not low <= value <= high:
                bound = f"at least {low:g}" if value < low else f"at most {high:g}"
                return Objection(f"{what}: must be {bound}", f"is {value:.3f}")
        return None
