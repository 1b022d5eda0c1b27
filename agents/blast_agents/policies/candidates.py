"""Features of candidate places: what the packaged agent sees of a site of any size.

A candidate is a variant of the catalogue (an item in one direction, or a measure) with its lower
left cell. Its features are relations to the charge, to the protected walls and to the pieces that
stand, in the frame of the line from the charge to the walls. So a turned or mirrored site has the
same features, and their number does not depend on the site.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, Final, NamedTuple

import numpy as np

from blast_env.arrays import BoolArray, FloatArray, IntArray
from blast_env.design.search.learnt import case_for
from blast_env.errors import BlastEnvError
from blast_env.geometry import Layout, Rectangle
from blast_env.layout import LayoutState, kept_clear
from blast_env.layout.batch import PlacementRules
from blast_env.layout.build_site import vehicle_reach
from blast_env.rules import RULES, line_of_posts, posts_and_wall
from blast_env.site import AnyCharge, Scenario
from blast_env.site.blast_site import Charge
from blast_env.site.catalogue import Catalogue
from blast_env.surrogate.points import WallPoints
from blast_env.units import MODULE_SIDE_M

BEARINGS: Final = 32
"""Bearings from a charge on which the protected walls are counted."""

_LENGTH_M: Final = 10.0
"""Unit of lengths, so that features are of the order of 1."""

_MOST: Final = 4.0
"""Bound on the magnitude of features."""

_LEAST_M: Final = 0.25
_LEAST_SCALED: Final = 0.05
"""Offset of scaled distances before their logarithm, m/kg^(1/3)."""

STATIC: Final = (
    *("along", "remaining", "along_share", "aside", "offset", "cut", "hidden_cut", "hidden_height"),
    *("detour_over", "before", "log_from_charge", "log_from_walls", "half_along", "half_aside"),
    *("along_spread", "aside_spread", "most_hidden_cut", "height", "scaled_height", "length"),
    *("thickness", "is_single", "stops_vehicles", "is_measure", "is_module", "cost_share"),
    *("height_rank", "cut_for_cost", "in_reach", "has_vehicle", "of_posts", "of_posts_and_wall"),
)
"""Features of a candidate that do not depend on the pieces that stand."""

CHANGING: Final = (
    *("open_cut", "covered", "is_first", "gap", "touches", "along_from_nearest"),
    *("aside_from_nearest", "same_item", "same_variant", "cost_of_rest"),
)
"""Features of a candidate among the pieces that stand."""

WHOLE: Final = (
    *("distance", "half_angle", "wall_height", "scale", "hidden_charge", "spread", "vehicle"),
    *("has_budget", "budget_left", "pieces_for_budget", "stock_left", "placed", "open_walls"),
    *("legal", "most_open_cut", "cheapest", "posts_left"),
)
"""Features of the site and the layout as a whole."""


class _WallsInSight(NamedTuple):
    """The walls as one place of the charge sees them.

    Attributes:
        ahead: Unit vector from the charge to their middle.
        distance_m: Distance to that middle.
        half_angle: Half of their angle, rad.
        height_m: Height of the highest one.
        shares: Share of the load by bearing (BEARINGS,).
    """

    ahead: FloatArray
    distance_m: float
    half_angle: float
    height_m: float
    shares: FloatArray

    @classmethod
    def from_charge(cls, from_m: FloatArray, walls: WallPoints) -> "_WallsInSight":
        """Return the walls that a charge faces, weighted by area, slant and distance."""
        way_m = walls.points_m[:, :2] - from_m
        far_m = np.maximum(np.hypot(way_m[:, 0], way_m[:, 1]), _LEAST_M)
        facing = -(way_m * walls.outward).sum(axis=1) / far_m
        weight = walls.area_m2 * np.maximum(facing, 0.02) / far_m
        weight = weight / weight.sum()
        towards_m = weight @ way_m
        distance_m = max(float(np.hypot(*towards_m)), _LEAST_M)
        ahead = towards_m / distance_m
        faced = facing > 0.0 if bool(np.any(facing > 0.0)) else np.ones(len(facing), dtype=bool)
        height_m = float((walls.points_m[:, 2] + walls.to_roof_m)[faced].max())
        angle = np.arctan2(way_m[:, 1] * ahead[0] - way_m[:, 0] * ahead[1], way_m @ ahead)
        half_angle = max(float(np.abs(angle[faced]).max()), 0.05)
        place = np.clip((angle / half_angle + 1.0) / 2.0 * BEARINGS, 0, BEARINGS - 1)
        counted = np.bincount(place.astype(np.int64), weight * faced, BEARINGS)
        return cls(ahead, distance_m, half_angle, height_m, counted / counted.sum())


class _View(NamedTuple):
    """The candidates as seen from one place of the charge, (candidates,) unless stated otherwise.

    Attributes:
        along_m: Distance of the centre along the line from the charge to the walls.
        aside_m: Distance aside of it.
        columns: Static features that depend on the place (candidates, 14).
        first: First bearing that the candidate hides.
        last: Bearing after the last one.
        hidden: Share of the height of the walls that it hides from the charge, 0 to 1.
        faced: The walls.
        scale_m: Cube root of the charge's mass in kg.
    """

    along_m: FloatArray
    aside_m: FloatArray
    columns: FloatArray
    first: IntArray
    last: IntArray
    hidden: FloatArray
    faced: _WallsInSight
    scale_m: float


@dataclass(frozen=True, eq=False)
class Candidates:
    """The candidates of a site for a charge, or for some of the possible ones.

    Attributes:
        empty: The site without a piece.
        numbers: Action of each candidate in the catalogue (candidates,).
        static: Features of each (candidates, STATIC).
        first: First bearing that each hides, by place of the charge (places, candidates).
        last: Bearing after the last one (places, candidates).
        hidden: Share of the walls' height that each hides (places, candidates).
        shares: Share of the load by bearing (places, BEARINGS).
        edges_m: Left, bottom, right and top of each (4, candidates).
        frame_m: Position of each along and aside of the mean line, m (2, candidates).
        item: Number of the item of each (candidates,).
        variant: Number of the variant of each (candidates,).
        cost: Cost of each (candidates,).
        site: Features of the site that do not change, the first seven of `WHOLE`.
        is_measure: Whether each covers no cell (candidates,).
        is_post: Whether each is of the line of posts that keeps vehicles away (candidates,).
    """

    empty: LayoutState
    numbers: IntArray
    static: FloatArray
    first: IntArray
    last: IntArray
    hidden: FloatArray
    shares: FloatArray
    edges_m: FloatArray
    frame_m: FloatArray
    item: IntArray
    variant: IntArray
    cost: FloatArray
    site: FloatArray
    is_measure: BoolArray
    is_post: BoolArray

    @classmethod
    def of(
        cls,
        scenario: Scenario,
        charge: AnyCharge | None,
        rules: Mapping[str, Layout] | None = None,
    ) -> "Candidates":
        """Return the candidates of a site.

        Args:
            scenario: The scenario; it has a build zone and a protected structure.
            charge: The charge, or `None` for some of the possible ones. A vehicle is at the worst
                place behind the line of posts of the rule, if there is one.
            rules: The layouts of all rules by title, if they are at hand.

        Raises:
            BlastEnvError: If the scenario has no build zone, or no structure is protected.
        """
        scenario = kept_clear(scenario, charge)
        zone, empty = scenario.zone, LayoutState.empty(scenario)
        walls = _protected_walls(scenario)
        threats = case_for(scenario, charge).threats
        posts, walled = _against_vehicles(scenario, charge, rules)
        charges = list(dict.fromkeys(threat.charge_against(scenario, posts) for threat in threats))
        # 1. Where the candidates are, and what they are.
        catalogue = empty.catalogue
        number, row, column = np.nonzero(empty.legal)
        variants = catalogue.variants
        rows, columns = (np.array(size)[number] for size in zip(*catalogue.sizes, strict=True))
        boxes_m = _boxes_m(zone.rectangle_m, row, column, rows, columns)
        height_m = _heights_m(catalogue, scenario.air_height_m)[number]
        is_measure = rows == 0
        cost = empty.costs[number, row, column]
        numbers = np.flatnonzero(empty.legal.ravel())
        is_post, is_wall = (_is_in(numbers, layout, catalogue) for layout in (posts, walled))
        # 2. What each hides, from each place of the charge.
        views = [_view(one, walls, boxes_m, height_m, is_measure) for one in charges]
        # 3. The features: as seen on average, its own, and those of the site.
        seen = _seen(views)
        share = cost / zone.budget if zone.budget else np.zeros(len(cost))
        static = np.column_stack(
            (
                seen,
                _sizes(rows, columns, height_m, views),
                np.array([variant.stops_vehicles for variant in variants])[number],
                is_measure,
                np.full(len(cost), not catalogue.has_items),
                3.0 * share,
                height_m / float(height_m.max(initial=_LEAST_M)),
                seen[:, _HIDDEN_CUT] / (share + 0.02) / 5.0,
                _in_reach(scenario, boxes_m) if scenario.vehicles else np.zeros(len(cost)),
                np.full(len(cost), bool(scenario.vehicles)),
                is_post,
                is_wall,
            )
        )
        return cls(
            empty=empty,
            numbers=numbers,
            static=np.clip(static, -_MOST, _MOST).astype(np.float32),
            first=np.stack([view.first for view in views]),
            last=np.stack([view.last for view in views]),
            hidden=np.stack([view.hidden for view in views]).astype(np.float32),
            shares=np.stack([view.faced.shares for view in views]),
            edges_m=np.ascontiguousarray(boxes_m.T, np.float32),
            frame_m=_frame_m(views),
            item=np.array([variant.item for variant in variants])[number],
            variant=number,
            cost=cost,
            site=_site_features(scenario, charge, charges, views),
            is_measure=is_measure,
            is_post=is_post,
        )

    @cached_property
    def posts(self) -> int:
        """Number of candidates of the line of posts."""
        return int(self.is_post.sum())

    @cached_property
    def rules(self) -> PlacementRules:
        """The rules of placing on the site."""
        return PlacementRules.of(self.empty)


_HIDDEN_CUT: Final = STATIC.index("hidden_cut")


def _protected_walls(scenario: Scenario) -> WallPoints:
    """Return points on the walls whose load counts; refuse a site without one."""
    protected = [structure for structure in scenario.structures if structure.protected]
    if not protected:
        raise BlastEnvError(f"{scenario.name}: no structure is protected")
    return WallPoints.on(protected, scenario.air_height_m)


def _is_in(numbers: IntArray, layout: Layout, catalogue: Catalogue) -> BoolArray:
    """Return whether candidates are elements of a layout (candidates,)."""
    return np.isin(numbers, [catalogue.action(element) for element in layout])


def _heights_m(catalogue: Catalogue, air_m: float) -> FloatArray:
    """Return the height of each variant, that of the air where it is unlimited (variants,)."""
    own = [variant.height_m for variant in catalogue.variants]
    return np.array([air_m if height_m is None else height_m for height_m in own])


def _boxes_m(
    zone_m: Rectangle, row: IntArray, column: IntArray, rows: IntArray, columns: IntArray
) -> FloatArray:
    """Return left, bottom, right and top of candidates on the cells of a zone (candidates, 4)."""
    x_m, y_m = zone_m.left + MODULE_SIDE_M * column, zone_m.bottom + MODULE_SIDE_M * row
    return np.stack((x_m, y_m, x_m + MODULE_SIDE_M * columns, y_m + MODULE_SIDE_M * rows), axis=1)


def _seen(views: Sequence[_View]) -> FloatArray:
    """Return the features as seen from all places: means, spreads, and the most that is cut."""
    columns = np.stack([view.columns for view in views])
    return np.column_stack(
        (
            columns.mean(axis=0),
            np.stack([view.along_m for view in views]).std(axis=0) / _LENGTH_M,
            np.stack([view.aside_m for view in views]).std(axis=0) / _LENGTH_M,
            columns[:, :, _HIDDEN_CUT].max(axis=0),
        )
    )


def _frame_m(views: Sequence[_View]) -> FloatArray:
    """Return the position of each along and aside of the mean line, m (2, candidates)."""
    along_m = np.mean([view.along_m for view in views], axis=0)
    aside_m = np.mean([view.aside_m for view in views], axis=0)
    return np.stack((along_m, aside_m)).astype(np.float32)


def _sizes(
    rows: IntArray, columns: IntArray, height_m: FloatArray, views: Sequence[_View]
) -> FloatArray:
    """Return the features of the size of the candidates (candidates, 5)."""
    scale_m = float(np.mean([view.scale_m for view in views]))
    return np.column_stack(
        (
            height_m / 3.0,
            height_m / scale_m,
            MODULE_SIDE_M * np.maximum(rows, columns) / 3.0,
            MODULE_SIDE_M * np.minimum(rows, columns),
            rows * columns == 1,
        )
    )


def _site_features(
    scenario: Scenario, charge: AnyCharge | None, charges: Sequence[Charge], views: Sequence[_View]
) -> FloatArray:
    """Return the features of the site for a charge at some places, the first seven of `WHOLE`."""
    apart_m = [np.hypot(*np.subtract(one.position_m, charges[0].position_m)) for one in charges]
    features = (
        np.mean([view.faced.distance_m for view in views]) / (2.0 * _LENGTH_M),
        np.mean([view.faced.half_angle for view in views]),
        np.mean([view.faced.height_m for view in views]) / _LENGTH_M,
        float(np.mean([view.scale_m for view in views])) / 5.0,
        float(charge is None),
        max(apart_m) / _LENGTH_M,
        float(bool(scenario.vehicles)),
    )
    return np.array(features).astype(np.float32)


def _view(
    charge: Charge, walls: WallPoints, boxes_m: FloatArray, height_m: FloatArray, flat: BoolArray
) -> _View:
    """Return the candidates as seen from a place of the charge."""
    # 1. The walls that the charge faces.
    from_m = np.array(charge.position_m)
    faced = _WallsInSight.from_charge(from_m, walls)
    ahead, distance_m, half_angle = faced.ahead, faced.distance_m, faced.half_angle
    # 2. The candidates along and aside of the line, and the bearings that they hide.
    half_m = (boxes_m[:, 2:] - boxes_m[:, :2]) / 2.0
    centre_m = boxes_m[:, :2] + half_m - from_m
    along_m = centre_m @ ahead
    aside_m = centre_m[:, 1] * ahead[0] - centre_m[:, 0] * ahead[1]
    half_along_m = half_m @ np.abs(ahead)
    half_aside_m = half_m @ np.abs(ahead[::-1])
    near_m = np.maximum(np.hypot(along_m, aside_m), _LEAST_M)
    offset = np.arctan2(aside_m, along_m) / half_angle
    half_offset = np.arctan2(half_aside_m, near_m) / half_angle
    first, last = (
        np.clip(np.rint((edge + 1.0) / 2.0 * BEARINGS), 0, BEARINGS).astype(np.int64)
        for edge in (offset - half_offset, offset + half_offset)
    )
    before = (along_m > 0.0) & (along_m < distance_m) & ~flat
    first, last = np.where(before, first, 0), np.where(before, last, 0)
    up_to = np.append(0.0, np.cumsum(faced.shares))
    cut = up_to[last] - up_to[first]
    # 3. How high the shadow is on the walls, and the way over the top.
    start_m, wall_m = charge.height_m, faced.height_m
    shadow_m = start_m + (height_m - start_m) * distance_m / np.maximum(along_m, _LEAST_M)
    hidden = np.where(before, np.clip(shadow_m / wall_m, 0.0, 1.0), 0.0)
    scale_m = float(np.cbrt(charge.tnt_kg))
    over_m = _way_over_m(height_m, along_m, distance_m, start_m, wall_m / 2.0)
    to_walls_m = np.maximum(distance_m - along_m, _LEAST_M)
    columns = np.column_stack(
        (
            along_m / _LENGTH_M,
            (distance_m - along_m) / _LENGTH_M,
            along_m / distance_m,
            np.abs(aside_m) / _LENGTH_M,
            np.abs(offset),
            3.0 * cut,
            3.0 * cut * hidden,
            hidden,
            over_m / scale_m,
            before,
            np.log(near_m / scale_m + _LEAST_SCALED),
            np.log(to_walls_m / scale_m + _LEAST_SCALED),
            half_along_m,
            half_aside_m,
        )
    )
    return _View(
        along_m=along_m,
        aside_m=aside_m,
        columns=np.clip(columns, -_MOST, _MOST),
        first=first,
        last=last,
        hidden=hidden,
        faced=faced,
        scale_m=scale_m,
    )


def _way_over_m(
    height_m: FloatArray, along_m: FloatArray, distance_m: float, start_m: float, end_m: float
) -> FloatArray:
    """Return by how much the way over the top is longer than the straight one, between heights."""
    there_m = np.clip(along_m, 0.0, distance_m)
    rise_m = np.maximum(height_m - (start_m + there_m / distance_m * (end_m - start_m)), 0.0)
    return np.hypot(there_m, rise_m) + np.hypot(distance_m - there_m, rise_m) - distance_m


def _against_vehicles(
    scenario: Scenario, charge: AnyCharge | None, rules: Mapping[str, Layout] | None
) -> tuple[Layout, Layout]:
    """Return the layouts of the rules against vehicles, empty where they have none.

    How posts close a way depends on all of them together, which relations of pairs do not show.
    """
    found: list[Layout] = []
    for title, rule in _AGAINST_VEHICLES:
        layout: Layout = ()
        if rules is not None:
            layout = rules.get(title, ())
        elif scenario.vehicles:
            with suppress(BlastEnvError):  # no posts in stock, or no way for a vehicle
                layout = rule(scenario, charge)
        found.append(layout)
    return found[0], found[1]


_AGAINST_VEHICLES: Final = tuple(
    (RULES[rule.__name__].title, rule) for rule in (line_of_posts, posts_and_wall)
)


def _in_reach(scenario: Scenario, boxes_m: FloatArray) -> FloatArray:
    """Return the share of each box that a vehicle can reach on the empty site (boxes,)."""
    rows, columns = scenario.site.squares
    ground = np.zeros((rows, columns), dtype=bool)
    for source in scenario.vehicles:
        ground |= vehicle_reach(scenario, source).ground(rows, columns)
    counted = np.zeros((rows + 1, columns + 1))
    counted[1:, 1:] = ground.cumsum(axis=0).cumsum(axis=1)
    left, bottom, right, top = np.rint(boxes_m / MODULE_SIDE_M).astype(np.int64).T
    left, right = np.clip(left, 0, columns), np.clip(right, 0, columns)
    bottom, top = np.clip(bottom, 0, rows), np.clip(top, 0, rows)
    inside = counted[top, right] - counted[bottom, right] - counted[top, left]
    inside += counted[bottom, left]
    found: FloatArray = inside / np.maximum((right - left) * (top - bottom), 1)
    return found


def _sums_up_to(values: FloatArray) -> FloatArray:
    """Return the sum up to before each bearing (BEARINGS + 1,)."""
    return np.append(0.0, np.cumsum(values))


@cache
def _kernels() -> Any:
    from blast_agents.policies import candidate_kernels  # Numba takes long to import

    return candidate_kernels


class CandidateState:
    """What the pieces of a layout that grows mean for the candidates.

    Args:
        candidates: The candidates.

    Attributes:
        placed: Number of pieces.
        posts: Number of those of the line of posts.
        spent: Their cost.
    """

    def __init__(self, candidates: Candidates) -> None:
        count = len(candidates.numbers)
        self._of = candidates
        self._covered = np.zeros_like(candidates.shares)
        # Gap to the nearest piece, and its candidate.
        self._gap_m = np.full(count, np.inf, dtype=np.float32)
        self._nearest = np.zeros(count, dtype=np.int64)
        self.placed = 0
        self.posts = 0
        self.spent = 0.0

    def grown(self, index: int) -> "CandidateState":
        """Return the state with one more piece, by its candidate."""
        other = CandidateState.__new__(CandidateState)
        other._of = self._of
        other._covered, other._gap_m = self._covered.copy(), self._gap_m.copy()
        other._nearest = self._nearest.copy()
        other.placed, other.posts, other.spent = self.placed, self.posts, self.spent
        other.add(index)
        return other

    def add(self, index: int) -> None:
        """Add the piece of a candidate, by its index."""
        of = self._of
        self.placed += 1
        self.posts += int(of.is_post[index])
        self.spent += float(of.cost[index])
        if of.is_measure[index]:
            return
        for place in range(len(of.shares)):
            part = slice(of.first[place, index], of.last[place, index])
            np.maximum(
                self._covered[place, part], of.hidden[place, index], out=self._covered[place, part]
            )
        _kernels().stand(index, of.edges_m, self._gap_m, self._nearest)

    def features(self, chosen: IntArray) -> FloatArray:
        """Return the changing features of some candidates (chosen, CHANGING)."""
        of = self._of
        found = np.zeros((len(CHANGING), len(chosen)), dtype=np.float32)
        places = len(of.shares)
        for place in range(places):
            shares, cover = of.shares[place], self._covered[place]
            up_to = _sums_up_to(shares * (1.0 - cover)), _sums_up_to(cover)
            bearings = of.first[place], of.last[place], of.hidden[place]
            _kernels().put_covers(chosen, *bearings, *up_to, places, found[:2])
        budget = of.empty.scenario.zone.budget
        if budget:
            found[9] = of.cost[chosen] / max(budget - self.spent, 1e-9)
        if bool(np.isinf(self._gap_m[0])):
            found[2] = 1.0
        else:
            nearest = self._gap_m, self._nearest
            _kernels().put_relations(chosen, *nearest, of.frame_m, of.item, of.variant, found[3:9])
        clipped: Any = np.clip(found, -_MOST, _MOST, out=found)
        changing: FloatArray = clipped.T
        return changing

    def whole(self, chosen: IntArray, changing: FloatArray, stock_left: int) -> FloatArray:
        """Return the features of site and layout (WHOLE,).

        Args:
            chosen: The candidates that are legal.
            changing: Their changing features.
            stock_left: Pieces left in all.
        """
        of, budget = self._of, self._of.empty.scenario.zone.budget
        left = max(budget - self.spent, 0.0) if budget else 0.0
        cheapest = float(of.cost[chosen].min(initial=np.inf))
        open_walls = float((of.shares * (1.0 - self._covered)).sum(axis=1).mean())
        changes = np.array(
            [
                float(budget is not None),
                left / budget if budget else 0.0,
                left / cheapest / 10.0 if budget and len(chosen) else 0.0,
                stock_left / 20.0,
                self.placed / 10.0,
                open_walls,
                len(chosen) / max(len(of.numbers), 1),
                float(changing[:, 0].max(initial=0.0)),
                cheapest / left if budget and left > 0.0 and len(chosen) else 0.0,
                (of.posts - self.posts) / 10.0,
            ],
            dtype=np.float32,
        )
        return np.concatenate((of.site, np.clip(changes, -_MOST, _MOST)))
