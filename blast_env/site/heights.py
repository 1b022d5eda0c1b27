"""Heights of the air, of barriers and of structures."""

from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Final

import numpy as np

from blast_env.arrays import any_in_windows, counts_before
from blast_env.sections import GaugeSection
from blast_env.site.blast_site import WALLS
from blast_env.site.sources import AnySource
from blast_env.site.structures import AnyStructure
from blast_env.site.terraces import ground_m
from blast_env.site.zone import BuildZone, Surroundings, usable_cells

LEAST_AIR_HEIGHT_M: Final = 12.0
"""Least default height of the air."""

AIR_ABOVE_M: Final = 6.0
"""Air above the highest structure or barrier, so that the blast can pass over it."""


def default_air_height_m(structures: Iterable[AnyStructure], zone: BuildZone | None) -> float:
    """Return the default height of the air, m.

    It is 12 m, or 6 m more than the highest structure or barrier if that is more.
    """
    structures = tuple(structures)
    tops_m = [structure.height_m or 0.0 for structure in structures]
    barrier_m = None if zone is None else highest_top_m(zone, structures)
    return max(LEAST_AIR_HEIGHT_M, max(*tops_m, barrier_m or 0.0) + AIR_ABOVE_M)


def highest_top_m(zone: BuildZone, structures: Iterable[AnyStructure]) -> float | None:
    """Return the largest height of a barrier's top, m; `None` is the height of the air.

    It is the largest sum of an item's height and the highest ground on which it can stand.
    """
    grounds_m = highest_grounds_m(zone, structures)
    if not zone.items:
        return None if zone.height_m is None else zone.height_m + grounds_m[0]
    return max(item.height_m + ground for item, ground in zip(zone.items, grounds_m, strict=True))


def highest_grounds_m(zone: BuildZone, structures: Iterable[AnyStructure]) -> tuple[float, ...]:
    """Return the highest ground on which each item, or a single module, can stand, m.

    Charges and vehicles are ignored. An item that fits nowhere has 0.
    """
    structures = tuple(structures)
    zone_m = zone.rectangle_m
    has_terrace = any(
        box.overlaps(zone_m)
        for structure in structures
        if structure.carries
        for box in structure.boxes_m
    )
    return _grounds_m(zone, structures) if has_terrace else (0.0,) * max(len(zone.items), 1)


@lru_cache(maxsize=16)
def _grounds_m(zone: BuildZone, structures: tuple[AnyStructure, ...]) -> tuple[float, ...]:
    free = usable_cells(Surroundings(zone, structures, (), 0.0, None))
    ground = ground_m(structures, zone.boxes)
    variants = [variant for variant in zone.catalogue.variants if not variant.is_measure]
    found = [0.0] * max(len(zone.items), 1)
    for height_m in np.unique(ground[free]).tolist():  # the lowest first
        taken = counts_before(~free | (ground != height_m))
        for variant in variants:
            if not any_in_windows(taken, variant.rows, variant.columns).all():
                found[variant.item] = height_m
    return tuple(found)


def is_over_or_below(height_m: float, structure: AnyStructure) -> bool:
    """Return whether a height is above a structure's roof, if it has one, or below its base."""
    is_over = structure.height_m is not None and height_m > structure.height_m
    return is_over or height_m < structure.base_m


def depth_inside_m(position_m: tuple[float, float, float], structure: AnyStructure) -> float:
    """Return the depth of a point inside a structure, m: its distance to the nearest surface.

    It is negative or 0 outside. The ground is no surface.
    """
    x_m, y_m, z_m = position_m
    depth_m = max(
        min(x_m - left, right - x_m, y_m - bottom, top - y_m)
        for left, bottom, right, top in structure.boxes_m
    )
    if structure.footprint is not None and depth_m > 0.0:  # boxes of a polygon share sides
        place_m = np.array([(x_m, y_m)])
        depth_m = min(float(wall.distances_m(place_m)[0]) for wall in structure.footprint.walls)
    if structure.base_m > 0.0:
        depth_m = min(depth_m, z_m - structure.base_m)
    return depth_m if structure.height_m is None else min(depth_m, structure.height_m - z_m)


def height_notes(
    structures: Iterable[AnyStructure],
    sources: Iterable[AnySource],
    zone: BuildZone | None,
    gauges: Sequence[GaugeSection],
) -> tuple[str, ...]:
    """Return the features of a scenario that an engine without heights ignores, in sentences."""
    structures = tuple(structures)
    walls = any(structure.height_m is not None for structure in structures)
    walls |= zone is not None and bool(zone.items or zone.height_m)
    raised = any(source.height_m > 0.0 for source in sources)
    notes = []
    if walls:
        notes.append(
            "The model has no heights: every structure and module counts as endlessly high, so"
            " that nothing goes over it and barriers seem to protect more than they do."
        )
    if raised:
        notes.append("The model has no heights: the charge counts as if it lay on the ground.")
    if any(structure.faces != WALLS for structure in structures):
        notes.append("The load on all walls counts, not only on those that the scenario names.")
    if gauges:
        notes.append("The model has no air pressure: the scenario's gauges record nothing.")
    return tuple(notes)
