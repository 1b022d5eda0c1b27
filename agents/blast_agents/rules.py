"""Layouts by hand: rules of thumb, and random layouts."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import hypot
from types import MappingProxyType
from typing import Final

import numpy as np

from blast_env.arrays import BoolArray, FloatArray
from blast_env.errors import BlastEnvError
from blast_env.geometry import Cell, Layout
from blast_env.physics.scene import Charge
from blast_env.scenario import (
    AnyCharge,
    AnyScenario,
    AnySource,
    Placement,
    Scenario,
    VehicleSource,
)
from blast_env.scenario.sections import PointM
from blast_env.scenario.vehicles import source_of
from blast_env.scenario.zone import source_bounds_m
from blast_env.units import MODULE_SIDE_M

NEAR_CHARGE: Final = 0.0
"""Share of the way through the build zone at which `wall_near_charge` stands."""


NEAR_BUILDING: Final = 1.0
"""Share of the way through the build zone at which `wall_near_building` stands."""


_LEAST_GAIN_M: Final = MODULE_SIDE_M / 2.0
"""A module that makes the wall wider by less than this would rather thicken it."""


_TOLERANCE_M: Final = 1e-9


def line_of_sight_wall(scenario: AnyScenario, charge: AnyCharge, share: float = 0.5) -> Layout:
    """Return a wall across the line of sight from a charge to the protected structures.

    The wall stands at right angles to the line from the charge to the middle of the protected
    structures (the mean of their centres by weight). It begins on that line and grows to both
    sides alike for as long as the stock lasts. Where the cells on its own line are not available,
    it bends, by up to some 60 degrees, or has a gap and goes on behind it. Modules that could only
    thicken the wall stay in stock.

    Every module goes through `Placement`: budget, access way and all other conditions hold.

    Args:
        scenario: The scenario, or its bundled name or path; it has a build zone.
        charge: Where the charge is; its mass plays no part. See `expected_charge` for one whose
            place is not known, as that of a vehicle: the middle of its first entry stands for it.
        share: How far through the build zone: 0 as near to the charge as a module can stand on
            the line of sight (or, where none can, beside it), 1 as near to the structures.

    Returns:
        (row, column) of the modules, from the line of sight outwards; none if no cell between
        charge and structures is available.

    Raises:
        BlastEnvError: If the scenario has no build zone, `share` is not from 0 to 1, or the charge
            is in the middle of the protected structures.
    """
    charge_m = expected_charge([source_of(charge)]).position_m
    return wall_added_to(Placement.empty(scenario), charge_m, share).layout


def wall_added_to(placement: Placement, charge_m: PointM, share: float) -> Placement:
    """Return a placement with a wall beside what stands already; see `line_of_sight_wall`.

    Args:
        placement: What stands already.
        charge_m: Where the charge is.
        share: As for `line_of_sight_wall`.

    Raises:
        BlastEnvError: As for `line_of_sight_wall`.
    """
    if not 0.0 <= share <= 1.0:
        raise BlastEnvError(f"share is {share:g}, must be from 0 to 1")
    view = _View.of(placement.scenario, charge_m, placement.free)
    if not view.between.any():
        return placement
    wall_m = view.wall_depth_m(share)
    ends = [_End(side=1.0), _End(side=-1.0)]
    while ends and not placement.is_full:
        end = min(ends, key=lambda each: each.reach_m)
        cell = view.next_cell(placement.free, wall_m, end)
        if cell is None:
            ends.remove(end)
            continue
        placement = placement.place(cell)
        ends = [view.end_with(cell, wall_m, each) for each in ends]
    return placement


def wall_near_charge(scenario: AnyScenario, charge: AnyCharge) -> Layout:
    """Return the line-of-sight wall as near to the charge as a module can stand."""
    return line_of_sight_wall(scenario, charge, NEAR_CHARGE)


def wall_near_building(scenario: AnyScenario, charge: AnyCharge) -> Layout:
    """Return the line-of-sight wall as near to the protected structures as a module can stand."""
    return line_of_sight_wall(scenario, charge, NEAR_BUILDING)


RULES: Final[Mapping[str, Callable[[AnyScenario, AnyCharge], Layout]]] = MappingProxyType(
    {"wall near the charge": wall_near_charge, "wall near the building": wall_near_building}
)
"""The two rules that an engineer would try first, by name."""


def expected_charge(sources: Sequence[AnySource]) -> Charge:
    """Return the charge in the middle of where one may be: for one layout against all of them.

    Args:
        sources: At least one; of a scenario, or what is known of a hidden charge.

    Returns:
        The means, by weight, of the places, of the masses and of the heights. The place of a
        vehicle is the middle of its first entry.
    """
    weights = np.array([source.weight for source in sources])
    middles_m = np.array([_middle_m(source) for source in sources])
    x_m, y_m = weights @ middles_m / weights.sum()
    tnt_kg = weights @ [source.tnt_kg for source in sources] / weights.sum()
    height_m = weights @ [source.height_m for source in sources] / weights.sum()
    return Charge((float(x_m), float(y_m)), float(tnt_kg), float(height_m))


@dataclass(frozen=True)
class _End:
    """One end of a wall that grows.

    Attributes:
        side: 1 to the left of the line of sight, -1 to the right.
        reach_m: How far it is from the line of sight.
        off_m: How far its module is before or behind the wall's own line.
    """

    side: float
    reach_m: float = 0.0
    off_m: float = 0.0


@dataclass(frozen=True, eq=False)
class _View:
    """The cells of a build zone as seen from a charge along its line of sight.

    Attributes:
        depth_m: Distance of each cell's centre from the charge along the line (rows, columns).
        aside_m: Its distance from the line, positive to the left (rows, columns).
        half_width_m: Half the width that a module covers across the line.
        between: Which cells are available and lie between charge and structures (rows, columns).
    """

    depth_m: FloatArray
    aside_m: FloatArray
    half_width_m: float
    between: BoolArray

    @classmethod
    def of(cls, scenario: Scenario, charge_m: PointM, free: BoolArray) -> "_View":
        x_m, y_m = scenario.zone.centres_m
        target_x_m, target_y_m = _protected_middle_m(scenario)
        along_x, along_y = target_x_m - charge_m[0], target_y_m - charge_m[1]
        distance_m = hypot(along_x, along_y)
        if distance_m < _TOLERANCE_M:
            raise BlastEnvError(
                f"charge is at {charge_m}, the middle of the protected structures of "
                f"{scenario.name}: there is no line of sight"
            )
        along_x, along_y = along_x / distance_m, along_y / distance_m
        depth_m = (x_m - charge_m[0]) * along_x + (y_m - charge_m[1]) * along_y
        between = free & (depth_m > 0.0) & (depth_m < distance_m)
        protected = [each.rectangle_m for each in scenario.structures if each.protected]
        for row, column in np.argwhere(between):
            cell_m = (float(x_m[row, column]), float(y_m[row, column]))
            between[row, column] = not any(
                rectangle.meets_segment(charge_m, cell_m) for rectangle in protected
            )
        return cls(
            depth_m=depth_m,
            aside_m=(y_m - charge_m[1]) * along_x - (x_m - charge_m[0]) * along_y,
            half_width_m=MODULE_SIDE_M / 2.0 * (abs(along_x) + abs(along_y)),
            between=between,
        )

    def wall_depth_m(self, share: float) -> float:
        """Return where the wall stands, at a share of the way along the line of sight."""
        from_line_m = np.where(self.between, np.abs(self.aside_m), np.inf)
        on_line = from_line_m <= from_line_m.min() + MODULE_SIDE_M / 2.0
        depths_m = self.depth_m[on_line]
        near_m, far_m = float(depths_m.min()), float(depths_m.max())
        return near_m + share * (far_m - near_m)

    def next_cell(self, free: BoolArray, wall_m: float, end: _End) -> Cell | None:
        """Return the cell with which a wall at a depth goes on, or `None` if it cannot.

        Args:
            free: Which cells are available (rows, columns).
            wall_m: Depth of the wall.
            end: The end of the wall.
        """
        start_m = end.side * self.aside_m - self.half_width_m
        gain_m = end.side * self.aside_m + self.half_width_m - end.reach_m
        # Rounded, so that what is equal but for rounding counts as equal.
        off_m = np.abs(self.depth_m - wall_m).round(9)
        gap_m = np.abs(start_m - end.reach_m).round(9)
        wider = gain_m >= _LEAST_GAIN_M
        steep = off_m > end.off_m + gain_m + _LEAST_GAIN_M
        possible = free & self.between & wider & ~steep
        if not possible.any():
            return None
        # Without a gap if possible; else a little wider a gap, if that is nearer to the line.
        latest_m = end.reach_m + _TOLERANCE_M
        if not (possible & (start_m <= latest_m)).any():
            latest_m = float(start_m[possible].min()) + MODULE_SIDE_M
        near = np.argwhere(possible & (start_m <= latest_m))
        cells = ((int(row), int(column)) for row, column in near)
        return min(cells, key=lambda cell: (off_m[cell], gap_m[cell], cell))

    def end_with(self, cell: Cell, wall_m: float, end: _End) -> _End:
        """Return an end of a wall at a depth after a module has been added to it."""
        reach_m = end.side * float(self.aside_m[cell]) + self.half_width_m
        if reach_m <= end.reach_m:  # the module is at the other end
            return end
        return _End(end.side, reach_m, abs(float(self.depth_m[cell]) - wall_m))


def _middle_m(source: AnySource) -> PointM:
    """Return the middle of where a charge may be, of a vehicle that of its first entry."""
    if isinstance(source, VehicleSource):
        return source.entries[0].bounds_m.centre
    return source_bounds_m(source).centre


def _protected_middle_m(scenario: Scenario) -> tuple[float, float]:
    """Return the mean of the protected structures' centres by weight."""
    protected = [each for each in scenario.structures if each.protected]
    weights = np.array([each.weight for each in protected])
    x_m, y_m = weights @ [each.rectangle_m.centre for each in protected] / weights.sum()
    return float(x_m), float(y_m)


def random_layout(scenario: AnyScenario, rng: np.random.Generator) -> Layout:
    """Return a layout with every module on a random cell, as many as can be placed.

    One module after the other goes on a cell that is available then, all of them as likely. It
    ends when none is left: as a rule with the whole stock, earlier where the budget is used up or
    another module would close the access way.

    Args:
        scenario: The scenario, or its bundled name or path.
        rng: Decides everything.

    Returns:
        (row, column) of the modules in the order of their placing; none without a build zone.
    """
    placement = Placement.empty(scenario)
    while not placement.is_full:
        cells = np.argwhere(placement.free)
        row, column = cells[rng.integers(len(cells))].tolist()
        placement = placement.place((row, column))
    return placement.layout
