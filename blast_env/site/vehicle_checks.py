"""Checks of vehicles with a charge: they fit on the site, can enter, and can be stopped."""

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from blast_env.arrays import BoolArray
from blast_env.geometry import TOLERANCE_M, stacked_runs
from blast_env.problems import Problem, extent
from blast_env.sections import Ground, PointM, Site
from blast_env.site.content import Content, outside_site
from blast_env.site.sources import VehicleSource
from blast_env.site.zone import BuildZone, EmptyZone, empty_zone
from blast_env.vehicles.drive import VehicleGround
from blast_env.vehicles.driving import places_shape
from blast_env.vehicles.reach import places_on
from blast_env.vehicles.vehicle import Obstacles, Vehicle

MOST_PLACES: Final = 3_000_000
"""Most places of the charges of all vehicles: three vehicles on the largest site."""

MOST_SPEED_PLACES: Final = 400_000
"""Most places of the speeds of all vehicles: a site of 300 m x 300 m takes 2 s a search."""


def vehicle_count_problems(site: Site, vehicles: Sequence[VehicleSource]) -> Iterator[Problem]:
    """Yield the problems of too many places of vehicles, with and without a motion."""
    places = len(vehicles) * places_on(site)
    if places > MOST_PLACES:
        yield Problem(
            "charge",
            f"has {len(vehicles)} vehicles, whose charges may go off at {places:,} places of the"
            f" site, must have at most {MOST_PLACES:,}",
        )
    moved = sum(vehicle.motion is not None for vehicle in vehicles)
    rows, columns = places_shape(site.width_m, site.height_m)
    if moved * rows * columns > MOST_SPEED_PLACES:
        yield Problem(
            "charge",
            f"has {moved} vehicle{'s' * (moved > 1)} with a motion, whose speed is needed at"
            f" {moved * rows * columns:,} places of the site, must have at most"
            f" {MOST_SPEED_PLACES:,}: make the site smaller, or leave the motion out",
        )


def vehicle_problems(scenario: Content, key: str, source: VehicleSource) -> Iterator[Problem]:
    """Check that a vehicle fits on the site and can enter, and that barriers can stop it."""
    problems = [
        *_vehicle_size_problems(scenario, key, source),
        *_entry_problems(scenario, key, source),
    ]
    listed: dict[str, Sequence[Ground]] = {
        "drivable": source.drivable,
        "keep_outs": source.keep_outs,
    }
    for name, areas in listed.items():
        for index, area in enumerate(areas):
            where = f"the ground ({extent(area.rectangle_m)})"
            problems += outside_site(scenario, f"{key}.{name}[{index}]", where, area.rectangle_m)
    yield from problems
    if not problems:
        yield from _way_problems(scenario, key, scenario.vehicle_ground(source))


def _vehicle_size_problems(scenario: Content, key: str, source: VehicleSource) -> Iterator[Problem]:
    """Check that the vehicle is at least as wide as its charge and no larger than the site."""
    least_m = 2.0 * scenario.charge_radius_m
    if source.width_m < least_m - TOLERANCE_M:
        message = f"is {source.width_m:g}, must be at least {least_m:g}, the charge's diameter"
        yield Problem(f"{key}.width_m", message)
    most_m = min(scenario.site.width_m, scenario.site.height_m)
    if source.width_m > most_m + TOLERANCE_M:
        message = f"is {source.width_m:g}, must be at most {most_m:g}, the site's shorter side"
        yield Problem(f"{key}.width_m", message)


def _entry_problems(scenario: Content, key: str, source: VehicleSource) -> Iterator[Problem]:
    """Check that entries lie on the border and are wide enough."""
    for index, entry in enumerate(source.entries):
        if entry.side(scenario.site) is None:
            message = (
                f"runs from {_place(entry.start_m)} to {_place(entry.end_m)}, must lie on one side"
                f" of the site's border ({extent(scenario.site.rectangle_m)})"
            )
            yield Problem(f"{key}.entries[{index}]", message)
        elif entry.length_m < source.width_m - TOLERANCE_M:
            message = (
                f"is {entry.length_m:g} m long, must be at least {source.width_m:g} m, the"
                " vehicle's width"
            )
            yield Problem(f"{key}.entries[{index}]", message)


def _way_problems(scenario: Content, key: str, ground: VehicleGround) -> Iterator[Problem]:
    """Check that a vehicle can enter, approach a protected structure, and be stopped."""
    width = f"{ground.source.width_m:g} m, its width"
    # (1) It can enter; (2) it comes nearer than where it enters, else barriers change nothing; (3)
    # some barrier can hold it farther off.
    reach = ground.reach()
    if not reach.enters:
        message = (
            "the vehicle cannot enter: structures, gates and ground that is closed to it leave no"
            f" entry a gap of {width}"
        )
        yield Problem(f"{key}.entries", message)
    elif ground.walls:
        stand_off_m = ground.worst_places().stand_off_m
        if stand_off_m >= ground.entry_stand_off_m - TOLERANCE_M:
            message = (
                f"the vehicle comes no nearer to a protected structure than {stand_off_m:g} m, as"
                " near as where it enters: structures, gates and ground that is closed to it leave"
                f" no gap of {width}"
            )
            yield Problem(key, message)
        elif scenario.build_zone is not None:
            yield from _stopping_problems(scenario, key, ground, scenario.build_zone)


def _stopping_problems(
    scenario: Content, key: str, ground: VehicleGround, zone: BuildZone
) -> Iterator[Problem]:
    """Check that a barrier can increase the stand-off of a vehicle over the empty site's."""
    cells = _stopping_cells(empty_zone(scenario.surroundings(zone)), ground.source)
    if not cells.any():
        message = "nothing can stop the vehicle: no item in stock stops vehicles"
        if ground.source.motion is not None:
            message += f", or is rated for {ground.source.motion.mass_kg:g} kg"
        yield Problem(key, message)
        return
    # Adjoining cells leave no gap: their rectangle stops a vehicle as they do.
    full = Obstacles(
        stops=tuple(zone.cells_rectangle_m(*stacked_run) for stacked_run in stacked_runs(cells))
    )
    stand_off_m = ground.worst_places().stand_off_m
    if ground.worst_places(full).stand_off_m <= stand_off_m + TOLERANCE_M:
        message = (
            "nothing can stop the vehicle: even with a vehicle barrier on each of the"
            f" {cells.sum()} cells where one can stand, it comes as near as {stand_off_m:g} m to a"
            " protected structure"
        )
        yield Problem(key, message)


def _stopping_cells(empty: EmptyZone, source: Vehicle) -> BoolArray:
    """Return the cells that an item which stops the vehicle can cover (rows, columns)."""
    # All cells that some item in stock which stops it can cover, wherever that item stands.
    cells = np.zeros_like(empty.usable)
    rows, columns = cells.shape
    for variant, fits in zip(empty.catalogue.variants, empty.fits, strict=True):
        rating, motion = variant.crash_rating, source.motion
        heavy = rating is not None and motion is not None and motion.mass_kg > rating.mass_kg
        stops = variant.stops_vehicles and not heavy
        if stops and empty.catalogue.stocks[variant.item] > 0:
            for up, right in variant.cells_at(0, 0):
                cells[up:, right:] |= fits[: max(rows - up, 0), : max(columns - right, 0)]
    return cells


def _place(point_m: PointM) -> str:
    """Return the text of a point."""
    return f"({point_m[0]:g}, {point_m[1]:g}) m"
