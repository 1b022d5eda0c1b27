"""Rules of thumb against vehicles: a line of posts, and a wall behind it."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import product
from typing import Final

import numpy as np

from blast_env.errors import BlastEnvError
from blast_env.geometry import Layout
from blast_env.layout import ById, LayoutState
from blast_env.layout.build_site import worst_places
from blast_env.rules.lines import PostLines
from blast_env.rules.walls import NEAR_CHARGE, wall_added_to
from blast_env.site import AnyCharge, AnyScenario, Scenario, VehicleSource, find_scenario

_TOLERANCE: Final = 1e-6
"""Tolerance of costs, and of scaled distances in m / kg^(1/3)."""


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
    vehicles, lines = _Vehicles(scenario), PostLines(LayoutState.empty(scenario))
    best = lines.empty
    farthest = vehicles.farthest(best)
    for item, line in product(lines.items, lines.with_gaps):
        placement = lines.closed_by(item, line)
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


@dataclass(frozen=True)
class _Vehicles:
    """All vehicles of a scenario together."""

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
    def _without_speed(self) -> tuple[VehicleSource, ...]:
        return tuple(
            source if source.motion is None else source.model_copy(update={"motion": None})
            for source in self.scenario.vehicles
        )

    def without_idle_posts(self, placement: LayoutState) -> LayoutState:
        """Return the placement without posts that do not increase the least scaled distance."""
        farthest, empty = self.farthest(placement), LayoutState.empty(self.scenario)
        for post in placement.layout:
            without = empty.with_legal(other for other in placement.layout if other != post)
            if self.farthest(without) > farthest - _TOLERANCE:
                placement = without
        return placement
