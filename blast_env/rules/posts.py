"""Rules of thumb against vehicles: a line of posts, and a wall behind it."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import product
from math import ceil, floor
from typing import Final, NamedTuple

import numpy as np

from blast_env.arrays import BoolArray
from blast_env.errors import BlastEnvError
from blast_env.geometry import Cell, Layout, Rectangle
from blast_env.layout import LayoutState
from blast_env.layout.build_site import worst_places
from blast_env.rules.walls import NEAR_CHARGE, ById, wall_added_to
from blast_env.site import AnyCharge, AnyScenario, Scenario, VehicleSource, find_scenario
from blast_env.units import MODULE_SIDE_M

_TOLERANCE: Final = 1e-6
"""Tolerance of lengths in modules, and of scaled distances in m / kg^(1/3)."""


def line_of_posts(
    scenario: AnyScenario,
    charge: AnyCharge | None = None,  # noqa: ARG001
) -> Layout:
    """Return the line of posts with the largest stand-off distance of vehicles within the stock.

    Candidates are straight lines along every row and column of the build zone, between obstacles
    to vehicles, and rings around the protected structures at every distance; each has the fewest
    posts that leave no gap for the narrowest vehicle. A post is a module or, with a catalogue, an
    item that stops vehicles, the same one along a line and with its length along it. The line with
    the largest scaled distance of the nearest vehicle is chosen, and of several the cheapest. Posts
    that do not increase this distance are removed.

    `LayoutState` checks every post: budget, access way and all other conditions hold.

    Args:
        scenario: The scenario, or its bundled name or path; it has a build zone and a vehicle.
        charge: Ignored: the line is against all vehicles of the scenario.

    Returns:
        The posts; none if no line increases the distance.

    Raises:
        BlastEnvError: If the scenario has no build zone or no vehicle.
    """
    return _line_on(ById(find_scenario(scenario))).layout


def posts_and_wall(
    scenario: AnyScenario,
    charge: AnyCharge | None = None,  # noqa: ARG001
) -> Layout:
    """Return the line of posts, with a wall of the remaining stock behind it.

    The wall crosses the line of sight from the worst place within a vehicle's reach to the
    protected structures, as near to that place as possible; see `line_of_sight_wall`.

    Args:
        scenario: As for `line_of_posts`.
        charge: As for `line_of_posts`.

    Raises:
        BlastEnvError: As for `line_of_posts`.
    """
    found = find_scenario(scenario)
    posts = _line_on(ById(found))
    source = min(
        found.vehicles, key=lambda vehicle: _Vehicles.scaled_m(found, vehicle, posts.layout)
    )
    place_m = worst_places(found, source, posts.layout).place_m(0)
    return wall_added_to(posts, place_m, NEAR_CHARGE).layout


@lru_cache(maxsize=4)
def _line_on(very: ById) -> LayoutState:
    """Return the line of posts of a scenario, cached for the two rules that need it."""
    scenario = very.scenario
    scenario.zone  # noqa: B018  # refuses a scenario without one
    if not scenario.vehicles:
        raise BlastEnvError(
            f"{scenario.name} has no vehicle (a source of kind 'vehicle'): no line of posts to set"
        )
    # Branch and bound over lines and items: (1) close the line with the fewest posts; (2) bound its
    # distance from above, as if ratings held at any speed, which takes no search for speeds; (3)
    # only if that beats the best so far, the true distance; (4) drop posts without effect.
    vehicles = _Vehicles(scenario)
    best = LayoutState.empty(scenario)
    farthest = vehicles.farthest(best)
    for item, line in product(vehicles.items(), vehicles.lines()):
        placement = vehicles.with_posts(line, item)
        if placement is None:
            continue
        cheaper = placement.cost < best.cost - _TOLERANCE
        at_most = vehicles.farthest(placement, without_speed=True)
        if at_most <= farthest + (-_TOLERANCE if cheaper else _TOLERANCE):
            continue
        distance = vehicles.farthest(placement)
        if distance > farthest + _TOLERANCE or (cheaper and distance > farthest - _TOLERANCE):
            best, farthest = placement, distance
    return vehicles.without_idle_posts(best)


Line = tuple[tuple[Cell, ...], ...]
"""Straight runs of squares in the build zone's grid, continued beyond the zone."""


class _Post(NamedTuple):
    """A post along a run: the number of its variant, and its length in modules."""

    variant: int
    length: int


@dataclass(frozen=True)
class _Vehicles:
    """All vehicles of a scenario together, and the squares of its build zone's grid."""

    scenario: Scenario

    @staticmethod
    def scaled_m(scenario: Scenario, source: VehicleSource, layout: Layout) -> float:
        """Return the scaled distance of a vehicle at its worst place, m / kg^(1/3)."""
        distance_m = worst_places(scenario, source, layout).stand_off_m
        return float(distance_m / np.cbrt(source.tnt_kg))

    def farthest(self, placement: LayoutState, without_speed: bool = False) -> float:
        """Return the least scaled distance of all vehicles, m / kg^(1/3).

        Args:
            without_speed: Whether all crash-rated pieces count as holding, which is a fast upper
                bound.
        """
        sources = self.scenario.vehicles
        if without_speed:
            sources = self._without_speed
        return min(self.scaled_m(self.scenario, source, placement.layout) for source in sources)

    @cached_property
    def _empty(self) -> LayoutState:
        """The empty placement."""
        return LayoutState.empty(self.scenario)

    @cached_property
    def _without_speed(self) -> tuple[VehicleSource, ...]:
        return tuple(
            source if source.motion is None else source.model_copy(update={"motion": None})
            for source in self.scenario.vehicles
        )

    @cached_property
    def span(self) -> tuple[range, range]:
        """Rows and columns of the grid, continued to the border of the site."""
        zone, site = self.scenario.zone, self.scenario.site
        (left, bottom), side = zone.corner_m, MODULE_SIDE_M
        rows = range(-floor(bottom / side), ceil((site.height_m - bottom) / side - _TOLERANCE))
        columns = range(-floor(left / side), ceil((site.width_m - left) / side - _TOLERANCE))
        return rows, columns

    @cached_property
    def closed(self) -> BoolArray:
        """Mask of the squares of the span that are closed to every vehicle (rows, columns)."""
        rows, columns = self.span
        closed = np.ones((len(rows), len(columns)), dtype=bool)
        for source in self.scenario.vehicles:
            own = np.zeros_like(closed)
            for rectangle in self.scenario.vehicle_ground(source).closed_m:
                own[self._squares(rectangle)] = True
            # Closed to every vehicle: a line must stop the one that it stops least.
            closed &= own
        return closed

    def lines(self) -> Iterator[Line]:
        """Yield straight lines, then rings from the innermost outwards."""
        rows, columns = self.span
        zone = self.scenario.zone
        for row in range(zone.rows):
            yield (tuple((row, column) for column in columns),)
        for column in range(zone.columns):
            yield (tuple((row, column) for row in rows),)
        protected = [
            structure.rectangle_m for structure in self.scenario.structures if structure.protected
        ]
        around = Rectangle.around(protected)
        for steps in range(max(len(rows), len(columns))):
            yield self._ring(around.grown(steps * MODULE_SIDE_M))

    def items(self) -> list[int]:
        """Return the indices of the items that stop vehicles, or that of the single module."""
        variants = self._empty.catalogue.variants
        return sorted({variant.item for variant in variants if variant.stops_vehicles})

    def with_posts(self, line: Line, item: int) -> LayoutState | None:
        """Return the placement of the fewest posts that close a line, or `None` if none do."""
        placement = self._empty
        for run in line:
            post = self._along(item, run)
            end = 0  # of the closed part of the run
            for index in self._closed_along(run, placement):
                # Greedy from one end, as far apart as the narrowest vehicle allows, which needs the
                # fewest posts; where the farthest place is not legal, the next nearer one.
                while index - end >= self.width - _TOLERANCE:
                    latest = min(ceil(end + self.width - _TOLERANCE) - 1, index - post.length)
                    tried = range(latest, end - 1, -1)
                    may = (at for at in tried if self._is_legal(post, placement, run[at]))
                    at = next(may, None)
                    if at is None:
                        return None
                    element = placement.catalogue.element_at(post.variant, *run[at])
                    placement = placement.place(element)
                    end = at + post.length
                end = index + 1
        return placement

    def without_idle_posts(self, placement: LayoutState) -> LayoutState:
        """Return the placement without posts that do not increase the least scaled distance."""
        farthest = self.farthest(placement)
        for post in placement.layout:
            fewer = tuple(element for element in placement.layout if element != post)
            without = LayoutState.of(self.scenario, fewer)
            if self.farthest(without) > farthest - _TOLERANCE:
                placement = without
        return placement

    @cached_property
    def width(self) -> float:
        """Width of the narrowest vehicle in modules."""
        return min(vehicle.width_m for vehicle in self.scenario.vehicles) / MODULE_SIDE_M

    def _along(self, item: int, run: tuple[Cell, ...]) -> "_Post":
        """Return the variant of an item with the largest length along a run."""
        is_row = run[0][0] == run[-1][0]
        variants = self._empty.catalogue.variants
        posts = [
            _Post(number, variant.columns if is_row else variant.rows)
            for number, variant in enumerate(variants)
            if variant.item == item
        ]
        return max(posts, key=lambda post: post.length)

    def _is_legal(self, post: _Post, placement: LayoutState, cell: Cell) -> bool:
        """Return whether a post may be placed with its first module on a cell."""
        on_empty = self.scenario.zone.has(cell) and self._empty.legal[post.variant, *cell]
        if not on_empty:  # then neither on any other placement
            return False
        # A single check, which on a large zone is a thousand times faster than the whole mask.
        return placement.explain(placement.catalogue.element_at(post.variant, *cell)) is None

    def _closed_along(self, run: tuple[Cell, ...], placement: LayoutState) -> list[int]:
        """Return the indices of a run's squares closed to every vehicle, and the run's length."""
        rows, columns = self.span
        row, column = np.transpose(run)
        closed = self.closed[row - rows.start, column - columns.start]
        if placement.layout:  # posts of another run, which may cross this one
            closed |= [cell in placement.cells for cell in run]
        return [*np.flatnonzero(closed).tolist(), len(run)]

    def _ring(self, inner_m: Rectangle) -> Line:
        """Return the runs of squares directly outside a rectangle, within the span."""
        rows, columns = self.span
        vertical, horizontal = self._squares(inner_m)
        low, high = vertical.start + rows.start - 1, vertical.stop + rows.start
        left, right = horizontal.start + columns.start - 1, horizontal.stop + columns.start
        up = [row for row in range(low, high + 1) if row in rows]
        across = [column for column in range(left, right + 1) if column in columns]
        runs = [tuple((row, column) for row in up) for column in (left, right) if column in columns]
        runs += [tuple((row, column) for column in across) for row in (low, high) if row in rows]
        return tuple(runs)

    def _squares(self, rectangle_m: Rectangle) -> tuple[slice, slice]:
        """Return the squares of the span that a rectangle overlaps."""
        (left, bottom), side = self.scenario.zone.corner_m, MODULE_SIDE_M
        rows, columns = self.span
        low = floor((rectangle_m.bottom - bottom) / side + _TOLERANCE) - rows.start
        high = ceil((rectangle_m.top - bottom) / side - _TOLERANCE) - rows.start
        first = floor((rectangle_m.left - left) / side + _TOLERANCE) - columns.start
        last = ceil((rectangle_m.right - left) / side - _TOLERANCE) - columns.start
        return slice(max(low, 0), max(high, 0)), slice(max(first, 0), max(last, 0))
