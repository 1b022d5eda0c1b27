"""Heights: of the air, of what stands in it, of the charge and of gauges; and who heeds them."""

from collections.abc import Iterable, Sequence
from typing import Final

from blast_env.physics.scene import WALLS
from blast_env.scenario.sections import AnySource, AnyStructure, GaugeSection, Site
from blast_env.scenario.zone import BuildZone

LEAST_AIR_HEIGHT_M: Final = 12.0
"""Height of the air over a site on which nothing is higher than half of it."""


AIR_ABOVE_M: Final = 6.0
"""Air above the highest thing on the site: what the blast needs to go over it."""


def default_air_height_m(structures: Iterable[AnyStructure], zone: BuildZone | None) -> float:
    """Return how high the air is where a scenario does not say it.

    12 m, or 6 m more than the highest structure or barrier if that is more.
    """
    heights = [each.height_m for each in structures]
    heights.append(None if zone is None else zone.highest_m)
    highest = max((height for height in heights if height is not None), default=0.0)
    return max(LEAST_AIR_HEIGHT_M, highest + AIR_ABOVE_M)


def air_height_m(site: Site, structures: Iterable[AnyStructure], zone: BuildZone | None) -> float:
    """Return how high the air is."""
    if site.air_height_m is not None:
        return site.air_height_m
    return default_air_height_m(structures, zone)


def is_over(height_m: float, structure: AnyStructure) -> bool:
    """Whether a height is above the roof of a structure; without a height it has none."""
    return structure.height_m is not None and height_m > structure.height_m


def depth_inside_m(position_m: tuple[float, float, float], structure: AnyStructure) -> float:
    """Return how far it is from a place to the nearest air beside or above a structure.

    Negative or 0 outside.
    """
    x_m, y_m, z_m = position_m
    left, bottom, right, top = structure.rectangle_m
    depth_m = min(x_m - left, right - x_m, y_m - bottom, top - y_m)
    return depth_m if structure.height_m is None else min(depth_m, structure.height_m - z_m)


def height_notes(
    structures: Iterable[AnyStructure],
    sources: Iterable[AnySource],
    zone: BuildZone | None,
    gauges: Sequence[GaugeSection],
) -> tuple[str, ...]:
    """Return what an engine without heights leaves aside, in sentences."""
    structures = tuple(structures)
    walls = any(each.height_m is not None for each in structures)
    walls |= zone is not None and zone.highest_m is not None
    raised = any(source.height_m > 0.0 for source in sources)
    notes = []
    if walls:
        notes.append(
            "The model has no heights: every structure and module counts as endlessly high, so"
            " that nothing goes over it and barriers seem to protect more than they do."
        )
    if raised:
        notes.append("The model has no heights: the charge counts as if it lay on the ground.")
    if any(each.faces != WALLS for each in structures):
        notes.append("The load on all walls counts, not only on those that the scenario names.")
    if gauges:
        notes.append("The model has no air pressure: the scenario's gauges record nothing.")
    return tuple(notes)
