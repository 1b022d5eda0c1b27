"""Rules of thumb for layouts, and random layouts.

A rule returns a layout for a scenario and a charge without a blast. For `None`, an unknown charge,
the layout is against all possible places, or against their mean. `blast_env.rules.table` lists the
rules.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import hypot
from typing import Final, Literal

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.errors import BlastEnvError
from blast_env.geometry import Element, Layout, Measure, Rectangle
from blast_env.layout import ById, LayoutState
from blast_env.sections import PointM
from blast_env.site import AnyCharge, AnyScenario, AnySource, Scenario, VehicleSource, find_scenario
from blast_env.site.blast_site import Charge
from blast_env.site.catalogue import Variant
from blast_env.site.sources import source_of
from blast_env.site.zone import source_bounds_m
from blast_env.sites import Visibility, visibility_layout
from blast_env.units import MODULE_SIDE_M

NEAR_CHARGE: Final = 0.0
"""Position of `wall_near_charge`, as a share of the depth of the build zone."""

IN_MIDDLE: Final = 0.5
"""Position of `wall_in_middle`, as a share of the depth of the build zone."""

NEAR_BUILDING: Final = 1.0
"""Position of `wall_near_building`, as a share of the depth of the build zone."""

_LEAST_GAIN_M: Final = MODULE_SIDE_M / 2.0
"""Least widening of a wall by a module; one that adds less mainly thickens the wall."""

_TOLERANCE_M: Final = 1e-9

WallKind = Literal["high", "long"]
"""Preferred items of a wall of pieces: the highest, or the longest for their cost."""


def line_of_sight_wall(
    scenario: AnyScenario,
    charge: AnyCharge | None,
    share: float = IN_MIDDLE,
    kind: WallKind = "high",
) -> Layout:
    """Return a wall across the line of sight from a charge to the protected structures.

    The wall is perpendicular to the line from the charge to the centre of the protected structures
    (the mean of their centres by weight). It begins on that line and grows evenly to both sides
    until the stock is used up. Where the cells on its axis are not available, it bends, by up to
    about 60 degrees, or continues after a gap. Modules that could only thicken the wall stay in
    stock. The two sides start independently, and may leave less than a module open at the line.

    With a catalogue the wall consists of pieces approximately along it: first of the highest item
    (`"high"`), or of the one with the largest length per cost, or per piece without a budget
    (`"long"`), until its stock or the budget is used up; then of the next one. Items of a single
    module, such as posts, stay in stock if there are others.

    `LayoutState` checks every module: budget, access way and all other conditions hold.

    Args:
        scenario: The scenario, or its bundled name or path; it has a build zone.
        charge: The charge; its mass is ignored. The mean place represents an unknown charge
            (`expected_charge`), and the centre of its first entry a vehicle.
        share: Position in the build zone: 0 as near to the charge as a module can stand on the
            line of sight (or, if none can, beside it), 1 as near to the structures.
        kind: Preferred items with a catalogue.

    Returns:
        The modules or pieces, item by item from the line of sight outwards; none if no cell
        between charge and structures is available.

    Raises:
        BlastEnvError: If the scenario has no build zone, `share` is not from 0 to 1, or the charge
            is at the centre of the protected structures.
    """
    placement = LayoutState.empty(scenario)
    return wall_added_to(placement, _place_m(placement, charge), share, kind).layout


def why_no_wall(scenario: AnyScenario, charge: AnyCharge | None) -> str:
    """Return the reason why `line_of_sight_wall` has no place; empty if it has one."""
    placement = LayoutState.empty(scenario)
    place_m = _place_m(placement, charge)
    if (placement.legal & _view_of(ById(placement.scenario), place_m).lies_between).any():
        return ""
    x_m, y_m = place_m
    several = charge is None and len(placement.scenario.charge) > 1
    way = (
        f"between {'the mean place of the charges' if several else 'the charge'}, "
        f"({x_m:.1f}, {y_m:.1f}) m, and the protected structures"
    )
    # 1. The lines of sight do not cross the build zone.
    cells = _between(placement.scenario, place_m)
    if not cells.any():
        around = (
            f"; that place lies within the bounds of {structure.name}"
            for structure in placement.scenario.structures
            if structure.protected and structure.rectangle_m.distance_to(place_m) <= 0.0
        )
        why = next(around, "")
        return f"the build zone has no cell {way}{why}{': choose one charge' if several else ''}"
    # 2. They do, but cells there are not usable.
    reasons = placement.reasons_against(cells)
    free = np.argwhere(cells & placement.usable)
    text = f"of {cells.sum()} cells {way}, {cells.sum() - len(free)} are not usable"
    if reasons:
        most = max(reasons, key=reasons.__getitem__)
        text += f" ({reasons[most]}: each {most})"
    if not len(free):
        return text
    # 3. Some are usable, but no item fits: the reason on the first one.
    row, column = free[0].tolist()
    against = placement.explain(placement.catalogue.element_at(0, row, column))
    why = against or "it would reach beyond them"
    return f"{text}; on {len(free)} no item can stand: e.g. {why}"


def _place_m(placement: LayoutState, charge: AnyCharge | None) -> PointM:
    """Return the place of a charge: the mean of its possible places."""
    sources = placement.scenario.charge if charge is None else (source_of(charge),)
    return expected_charge(sources).position_m


def wall_added_to(
    placement: LayoutState, charge_m: PointM, share: float, kind: WallKind = "high"
) -> LayoutState:
    """Return a placement with an additional wall; see `line_of_sight_wall`.

    Args:
        placement: The placement to extend.
        share: As for `line_of_sight_wall`.
        kind: As for `line_of_sight_wall`.
    """
    if not 0.0 <= share <= 1.0:
        raise BlastEnvError(f"share is {share:g}, must be from 0 to 1")
    # (1) The preferred variants with a place between charge and structures; (2) the depth of the
    # wall by the first of them; (3) both ends grow, the one nearer to the line of sight first; (4)
    # the next variant goes on where the stock of one is used up.
    view = _view_of(ById(placement.scenario), charge_m)
    between = placement.legal & view.lies_between
    variants = _preferred(placement, view.lies_along, kind)
    variants = [number for number in variants if between[number].any()]
    if not variants:
        return placement
    wall_m = view.wall_depth_m(variants[0], between[variants[0]], share)
    ends = {1.0: _End(side=1.0), -1.0: _End(side=-1.0)}
    for number in variants:
        growing = list(ends)
        while growing and not placement.is_full:
            end = ends[min(growing, key=lambda side: ends[side].reach_m)]
            possible = placement.legal[number] & view.lies_between[number]
            place = view.next_place(number, possible, wall_m, end)
            if place is None:
                growing.remove(end.side)
                continue
            placement = placement.place(placement.catalogue.element_at(*place))
            ends = {end.side: view.end_with(place, wall_m, end) for end in ends.values()}
    return placement


def _preferred(placement: LayoutState, lies_along: BoolArray, kind: WallKind) -> list[int]:
    """Return the indices of the variants for a wall, in order of preference.

    Args:
        placement: The placement to extend.
        lies_along: Mask of the variants that lie along the wall rather than across it (variants,).
        kind: Preferred items.
    """
    variants = placement.catalogue.variants
    of_item = Counter(variant.item for variant in variants)
    numbers = [
        i for i, variant in enumerate(variants) if lies_along[i] or of_item[variant.item] == 1
    ]
    longer = [i for i in numbers if max(variants[i].rows, variants[i].columns) > 1]
    has_budget = placement.scenario.zone.budget is not None

    def rank(number: int) -> tuple[float, ...]:
        variant = variants[number]
        height_m = float("inf") if variant.height_m is None else variant.height_m
        length = max(variant.rows, variant.columns)
        if kind == "high":
            return -height_m, -length / variant.cost, -length
        return -length / (variant.cost if has_budget else 1.0), -height_m, -length

    return sorted(longer or numbers, key=rank)


def wall_near_charge(scenario: AnyScenario, charge: AnyCharge | None) -> Layout:
    """Return the line-of-sight wall as near to the charge as a module can stand."""
    return line_of_sight_wall(scenario, charge, NEAR_CHARGE)


def wall_in_middle(scenario: AnyScenario, charge: AnyCharge | None) -> Layout:
    """Return the line-of-sight wall in the middle of the build zone."""
    return line_of_sight_wall(scenario, charge, IN_MIDDLE)


def wall_near_building(scenario: AnyScenario, charge: AnyCharge | None) -> Layout:
    """Return the line-of-sight wall as near to the protected structures as a module can stand."""
    return line_of_sight_wall(scenario, charge, NEAR_BUILDING)


def long_wall_near_charge(scenario: AnyScenario, charge: AnyCharge | None) -> Layout:
    """Return `wall_near_charge` of the items with the largest length per cost."""
    return line_of_sight_wall(scenario, charge, NEAR_CHARGE, "long")


def long_wall_in_middle(scenario: AnyScenario, charge: AnyCharge | None) -> Layout:
    """Return `wall_in_middle` of the items with the largest length per cost."""
    return line_of_sight_wall(scenario, charge, IN_MIDDLE, "long")


def long_wall_near_building(scenario: AnyScenario, charge: AnyCharge | None) -> Layout:
    """Return `wall_near_building` of the items with the largest length per cost."""
    return line_of_sight_wall(scenario, charge, NEAR_BUILDING, "long")


def ring_around_charge(scenario: AnyScenario, charge: AnyCharge | None) -> Layout:
    """Return a wall that bends around the charge, as near to it as the build zone allows.

    Raises:
        BlastEnvError: As for `line_of_sight_wall`.
    """
    placement = LayoutState.empty(scenario)
    (x_m, y_m), radius_m = _place_m(placement, charge), placement.scenario.charge_radius_m
    around = Rectangle(x_m, y_m, x_m, y_m).grown(radius_m)
    return _ring(placement, around, _protected_middle_m(placement.scenario))


def ring_around_building(scenario: AnyScenario, charge: AnyCharge | None) -> Layout:
    """Return a wall around the protected structure nearest to a charge, as near as possible.

    It begins on the side of the charge and extends in both directions.

    Raises:
        BlastEnvError: As for `line_of_sight_wall`.
    """
    placement = LayoutState.empty(scenario)
    protected = [
        structure.rectangle_m for structure in placement.scenario.structures if structure.protected
    ]
    place_m = _place_m(placement, charge)
    nearest = min(protected, key=lambda rectangle: rectangle.distance_to(place_m))
    return _ring(placement, nearest, place_m)


def sight_lines(scenario: AnyScenario, charge: AnyCharge | None) -> Layout:
    """Return a layout that greedily cuts lines of sight; see `visibility_layout`.

    Args:
        scenario: The scenario, or its bundled name or path; it has a build zone.
        charge: The charge; `None` for a layout against all charges of the scenario.
    """
    return _sight_lines_on(ById(find_scenario(scenario)), charge)


@lru_cache(maxsize=4)
def _sight_lines_on(very: ById, charge: AnyCharge | None) -> Layout:
    """Return the layout of `sight_lines`, cached for the two rules that need it."""
    # The lines are those of the known charge; the legal places keep off all possible ones.
    return visibility_layout(very.scenario, Visibility.of(seen_with(very.scenario, charge)))


def seen_with(scenario: Scenario, charge: AnyCharge | None) -> Scenario:
    """Return the scenario with a known charge as its only source; unchanged for `None`."""
    if charge is None:
        return scenario
    return scenario.model_copy(update={"charge": (source_of(charge),)})


def hardening_alone(scenario: AnyScenario, charge: AnyCharge | None = None) -> Layout:  # noqa: ARG001
    """Return the dearest affordable measures that harden facades, and no barrier.

    A measure that only changes components which a dearer one hardens is left out.

    Args:
        scenario: The scenario, or its bundled name or path; it has a build zone.
        charge: Ignored.

    Raises:
        BlastEnvError: If the scenario has no build zone.
    """
    found = find_scenario(scenario)
    placement, hardened = LayoutState.empty(found), set[tuple[str, str]]()
    for item in sorted(found.zone.hardening, key=lambda it: -it.cost):
        kinds = [kind for kind in ("glazing", "wall") if getattr(item, kind) is not None]
        bays = [bay.bay.name for bay in found.named_bays() if item.covers(bay.bay)]
        changed = {(name, kind) for name in bays for kind in kinds}
        measure = Measure.named(item.name)
        if changed - hardened and placement.explain(measure) is None:
            placement, hardened = placement.place(measure), hardened | changed
    return placement.layout


def hardening_and_sight_lines(scenario: AnyScenario, charge: AnyCharge | None = None) -> Layout:
    """Return `hardening_alone`, and the pieces of `sight_lines` that are affordable beside it.

    Args:
        scenario: As for `hardening_alone`.
        charge: As for `sight_lines`.

    Raises:
        BlastEnvError: As for `sight_lines`.
    """
    placement = LayoutState(find_scenario(scenario), hardening_alone(scenario))
    for piece in sight_lines(scenario, charge):
        if placement.explain(piece) is None:
            placement = placement.place(piece)
    return placement.layout


def expected_charge(sources: Sequence[AnySource]) -> Charge:
    """Return the mean charge of several sources, for one layout against all of them.

    Args:
        sources: At least one source, of a scenario or of a hidden charge.

    Returns:
        The means, by weight, of the places, of the masses and of the heights. The place of a
        vehicle is the centre of its first entry.
    """
    weights = np.array([source.weight for source in sources])
    x_m, y_m = weights @ [_middle_m(source) for source in sources] / weights.sum()
    tnt_kg = weights @ [source.tnt_kg for source in sources] / weights.sum()
    height_m = weights @ [source.height_m for source in sources] / weights.sum()
    return Charge((float(x_m), float(y_m)), float(tnt_kg), float(height_m))


@dataclass(frozen=True)
class _End:
    """One end of a growing wall.

    Attributes:
        side: 1 to the left of the line of sight, -1 to the right.
        reach_m: Distance of the end from the line of sight.
        off_m: Distance of its last module before or behind the wall's axis.
    """

    side: float
    reach_m: float = 0.0
    off_m: float = 0.0


Place = tuple[int, int, int]
"""Index of a variant, and row and column of its lower left cell."""


@dataclass(frozen=True, eq=False)
class _View:
    """Places of pieces in a build zone, in coordinates of the line of sight from a charge.

    A single module is a piece of one cell. Arrays are by variant and lower left cell.

    Attributes:
        depth_m: Distance of a piece's centre from the charge along the line (variants, rows,
            columns).
        aside_m: Distance of the centre from the line, positive to the left (variants, rows,
            columns).
        half_width_m: Half width of each variant across the line (variants,).
        lies_along: Mask of the variants at least as long across the line as along it (variants,).
        lies_between: Mask of the pieces on usable cells between charge and structures (variants,
            rows, columns).
    """

    depth_m: FloatArray
    aside_m: FloatArray
    half_width_m: FloatArray
    lies_along: BoolArray
    lies_between: BoolArray

    @classmethod
    def of(cls, scenario: Scenario, charge_m: PointM) -> "_View":
        """Return the view from a charge."""
        empty = LayoutState.empty(scenario)
        x_m, y_m = scenario.zone.centres_m
        # Coordinates along the line of sight (depth) and across it (aside), of the centres of
        # cells, then of pieces by the offset from their lower left cell.
        along_x, along_y, _ = line_of_sight(scenario, charge_m)
        depth_m = (x_m - charge_m[0]) * along_x + (y_m - charge_m[1]) * along_y
        between = empty.usable & _between(scenario, charge_m)
        aside_m = (y_m - charge_m[1]) * along_x - (x_m - charge_m[0]) * along_y
        variants = empty.catalogue.variants
        up_m, right_m = _centres_off_m(variants)
        across_x, across_y = abs(along_y), abs(along_x)
        columns_m = MODULE_SIDE_M / 2.0 * np.array([variant.columns for variant in variants])
        rows_m = MODULE_SIDE_M / 2.0 * np.array([variant.rows for variant in variants])
        # The shadow of a rectangle across a direction: the sum of its sides' shadows.
        half_width_m = columns_m * across_x + rows_m * across_y
        return cls(
            depth_m=depth_m + (right_m * along_x + up_m * along_y),
            aside_m=aside_m + (up_m * along_x - right_m * along_y),
            half_width_m=half_width_m,
            lies_along=half_width_m >= columns_m * across_y + rows_m * across_x - _TOLERANCE_M,
            lies_between=empty.places(between),
        )

    def wall_depth_m(self, number: int, possible: BoolArray, share: float) -> float:
        """Return the depth of a wall of a variant, at a share of the available depths.

        Args:
            number: Index of the variant.
            possible: Mask of its legal places between charge and structures (rows, columns).
            share: The share.
        """
        # Depths at which a piece can stand on the line of sight, or as near to it as possible.
        from_line_m = np.where(possible, np.abs(self.aside_m[number]), np.inf)
        on_line = from_line_m <= from_line_m.min() + MODULE_SIDE_M / 2.0
        depths_m = self.depth_m[number][on_line]
        near_m, far_m = float(depths_m.min()), float(depths_m.max())
        return near_m + share * (far_m - near_m)

    def next_place(
        self, number: int, possible: BoolArray, wall_m: float, end: _End
    ) -> Place | None:
        """Return the next place of a variant in a wall, or `None` if there is none.

        Args:
            number: Index of the variant.
            possible: Mask of its legal places between charge and structures (rows, columns).
            wall_m: Depth of the wall.
        """
        # 1. What each place adds to the wall. Rounded, so that values that differ only by rounding
        #    are equal.
        places, half_width_m = np.flatnonzero(possible), float(self.half_width_m[number])
        if not len(places):
            return None
        aside_m = end.side * self.aside_m[number].ravel()[places]
        start_m, gain_m = aside_m - half_width_m, aside_m + half_width_m - end.reach_m
        off_m = np.abs(self.depth_m[number].ravel()[places] - wall_m).round(9)
        # 2. A piece must lengthen the wall by half a module, and may step off the axis by as much
        #    as it lengthens it and half a module: a bend of about 60 degrees at most.
        steep = off_m > end.off_m + gain_m + _LEAST_GAIN_M
        wide = np.flatnonzero((gain_m >= _LEAST_GAIN_M) & ~steep)
        if not len(wide):
            return None
        # 3. Without a gap if possible; else a slightly wider gap, if that is nearer to the axis.
        latest_m, first_m = end.reach_m + _TOLERANCE_M, float(start_m[wide].min())
        if first_m > latest_m:
            latest_m = first_m + MODULE_SIDE_M
        near = wide[start_m[wide] <= latest_m]
        gap_m = np.abs(start_m[near] - end.reach_m).round(9)
        nearest = near[np.lexsort((gap_m, off_m[near]))[0]]  # of equal ones the first cell
        row, column = divmod(int(places[nearest]), possible.shape[1])
        return number, row, column

    def end_with(self, place: Place, wall_m: float, end: _End) -> _End:
        """Return an end of a wall at a depth after the addition of a piece."""
        reach_m = end.side * float(self.aside_m[place]) + float(self.half_width_m[place[0]])
        if reach_m <= end.reach_m:  # the piece is at the other end
            return end
        return _End(end.side, reach_m, abs(float(self.depth_m[place]) - wall_m))


@lru_cache(maxsize=4)
def _view_of(site: ById, charge_m: PointM) -> _View:
    """Return the view from a charge, cached for the rules that need it."""
    return _View.of(site.scenario, charge_m)


def line_of_sight(scenario: Scenario, charge_m: PointM) -> tuple[float, float, float]:
    """Return the direction from a charge to the middle of what is protected; its length, m."""
    target_x_m, target_y_m = _protected_middle_m(scenario)
    along_x, along_y = target_x_m - charge_m[0], target_y_m - charge_m[1]
    distance_m = hypot(along_x, along_y)
    if distance_m < _TOLERANCE_M:
        raise BlastEnvError(
            f"charge is at {charge_m}, the middle of the protected structures of "
            f"{scenario.name}: there is no line of sight"
        )
    return along_x / distance_m, along_y / distance_m, distance_m


def _between(scenario: Scenario, charge_m: PointM) -> BoolArray:
    """Return the cells, usable or not, between a charge and the protected structures."""
    x_m, y_m = scenario.zone.centres_m
    along_x, along_y, distance_m = line_of_sight(scenario, charge_m)
    depth_m = (x_m - charge_m[0]) * along_x + (y_m - charge_m[1]) * along_y
    between: BoolArray = (depth_m > 0.0) & (depth_m < distance_m)
    for structure in scenario.structures:
        if structure.protected:
            # Cells whose line to the charge meets a protected structure lie in it or behind it.
            between &= ~structure.rectangle_m.intersects_segments(charge_m, x_m, y_m)
    return between


def _centres_off_m(variants: Sequence[Variant]) -> tuple[FloatArray, FloatArray]:
    """Return the offsets up and right of variants' centres from their lower left cells' centres.

    Both have the shape (variants, 1, 1).
    """
    up = np.array([variant.rows - 1 for variant in variants])[:, np.newaxis, np.newaxis]
    right = np.array([variant.columns - 1 for variant in variants])[:, np.newaxis, np.newaxis]
    return MODULE_SIDE_M / 2.0 * up, MODULE_SIDE_M / 2.0 * right


_RING_START_RAD: Final = 0.2
"""Pieces within this angle beyond the first possible one determine the distance of a ring."""


def _ring(placement: LayoutState, around: Rectangle, start_m: PointM) -> Layout:
    """Return a wall around a rectangle, as near to it as pieces can stand.

    Pieces lie along the adjacent side of the rectangle. The first one stands on the line from the
    centre of the rectangle to `start_m`; each further one stands as near to that line as possible,
    by the angle at the centre. The highest items come first.

    Args:
        placement: The empty placement.
        start_m: A point outside the rectangle.
    """
    turn_rad, gap_m, lies_along = _around(placement, around, start_m)
    variants = placement.catalogue.variants
    order = _preferred(placement, np.ones(len(variants), dtype=bool), "high")
    ring_m = None
    for item in dict.fromkeys(variants[number].item for number in order):
        own = np.array([variant.item == item for variant in variants])
        stands = lies_along & own[:, np.newaxis, np.newaxis]
        possible = placement.legal & stands
        if ring_m is None and possible.any():
            ahead = turn_rad <= turn_rad[possible].min() + _RING_START_RAD
            ring_m = float(gap_m[possible & ahead].min())
        while ring_m is not None:
            possible = placement.legal & stands & (np.abs(gap_m - ring_m) < MODULE_SIDE_M)
            if not possible.any():
                break
            nearest = np.where(possible, turn_rad, np.inf).argmin()
            placement = placement.place(placement.catalogue.element(int(nearest)))
    return placement.layout


def _around(
    placement: LayoutState, around: Rectangle, start_m: PointM
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return the positions of pieces relative to a rectangle (variants, rows, columns).

    Returns:
        The angle at the rectangle's centre from the direction of `start_m` to each piece's centre;
        the gap between piece and rectangle; and whether the piece lies along the adjacent side,
        which is True for items that cannot be rotated.
    """
    x_m, y_m = placement.scenario.zone.centres_m
    variants = placement.catalogue.variants
    up_m, right_m = _centres_off_m(variants)
    half_up_m, half_right_m = up_m + MODULE_SIDE_M / 2.0, right_m + MODULE_SIDE_M / 2.0
    (middle_x_m, middle_y_m), (start_x_m, start_y_m) = around.centre, start_m
    towards = complex(start_x_m - middle_x_m, start_y_m - middle_y_m)
    if abs(towards) < _TOLERANCE_M:
        raise BlastEnvError(
            f"{placement.scenario.name}: a ring around {around.centre} cannot begin there"
        )
    from_x_m, from_y_m = x_m + right_m - middle_x_m, y_m + up_m - middle_y_m
    # The argument of z conj(w) is the angle from w to z, without a branch at 180 degrees.
    turn_rad = np.abs(np.angle((from_x_m + 1j * from_y_m) * towards.conjugate())).round(9)
    # Gaps along x and y between two rectangles; the larger one separates them.
    gap_x_m = np.abs(from_x_m) - half_right_m - (around.right - around.left) / 2.0
    gap_y_m = np.abs(from_y_m) - half_up_m - (around.top - around.bottom) / 2.0
    upright = gap_x_m >= gap_y_m  # at the west or east side, rather than the south or north one
    of_item = Counter(variant.item for variant in variants)
    fixed = np.array([of_item[variant.item] == 1 for variant in variants])[
        :, np.newaxis, np.newaxis
    ]
    lies_along = fixed | np.where(upright, up_m > right_m, right_m > up_m)
    return turn_rad, np.maximum(gap_x_m, gap_y_m).round(9), lies_along


def _middle_m(source: AnySource) -> PointM:
    """Return the centre of a source's bounds; for a vehicle, that of its first entry."""
    if isinstance(source, VehicleSource):
        return source.entries[0].bounds_m.centre
    return source_bounds_m(source).centre


def _protected_middle_m(scenario: Scenario) -> tuple[float, float]:
    """Return the mean of the protected structures' centres by weight."""
    protected = [structure for structure in scenario.structures if structure.protected]
    weights = np.array([structure.weight for structure in protected])
    x_m, y_m = weights @ [structure.rectangle_m.centre for structure in protected] / weights.sum()
    return float(x_m), float(y_m)


def random_layout(scenario: AnyScenario, rng: np.random.Generator) -> Layout:
    """Return a complete layout of modules or pieces in random places.

    Each module is placed on an available cell, drawn uniformly. With a catalogue an item is drawn
    first, among those that can be placed, and then one of its places and rotations. The layout is
    complete when nothing more can be placed: usually with the whole stock, or earlier if the budget
    is used up or any further element would close the access way.

    Args:
        scenario: The scenario, or its bundled name or path.
        rng: Draws items and places.

    Returns:
        The modules or pieces in the order of their placement; none without a build zone.
    """
    placement = LayoutState.empty(scenario)
    while not placement.is_full:
        placement = placement.place(random_element(placement, rng))
    return placement.layout


def random_element(placement: LayoutState, rng: np.random.Generator) -> Element:
    """Return a random legal module, or a piece of a random item.

    Args:
        placement: A placement that is not full.
        rng: Draws the item and the place.
    """
    legal, catalogue = placement.legal, placement.catalogue
    if catalogue.has_items:
        numbers = np.array([variant.item for variant in catalogue.variants])
        items = np.unique(numbers[legal.any(axis=(1, 2))])
        chosen = items[rng.integers(len(items))]
        legal = legal & (numbers == chosen)[:, np.newaxis, np.newaxis]
    actions = np.flatnonzero(legal)
    return catalogue.element(int(actions[rng.integers(len(actions))]))
