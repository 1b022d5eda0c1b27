"""The build zone of an imported site."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from blast_env.arrays import BoolArray
from blast_env.errors import BlastEnvError, import_extra
from blast_env.geometry import Rectangle, fewest_runs
from blast_env.io.importing.cells import (
    COARSER,
    LEAST_SHARE,
    check_outlines,
    covered_shares,
    in_blocks,
    mended,
)
from blast_env.io.importing.fitting import FittedBuilding
from blast_env.io.importing.options import ImportOptions
from blast_env.io.importing.placing import PlacedSite
from blast_env.io.importing.things import Role, Thing
from blast_env.units import MODULE_SIDE_M

with import_extra("maps", "maps and drawings"):
    import shapely
    from shapely.geometry.base import BaseGeometry

MOST_KEEP_OUTS: Final = 100
"""Most no-build areas of a scenario."""

MOST_AREAS: Final = 1000
"""Most outlines of a zone, or of no-build areas."""

_MOST_REASON: Final = 200
_ANY: Final = 1e-3  # of a block: a single cell suffices
_TOUCHED: Final = 0.05  # of a cell: a smaller share is rounding of the map
_OUTSIDE: Final = "outside the build zone of the map"


def build_zone(
    site: PlacedSite, buildings: Sequence[FittedBuilding], options: ImportOptions
) -> dict[str, Any] | None:
    """Return the build zone in the form of a scenario; `None` if neither map nor options have one.

    A zone that is not a rectangle becomes its bounding box, with no-build areas for the rest.

    Raises:
        BlastEnvError: If it is not on the site, or takes too many no-build areas.
    """
    inside = np.zeros(site.shape, dtype=bool)
    if options.zone_m is not None:
        left, bottom, width, height = options.zone_m
        inside[_window(site, Rectangle(left, bottom, left + width, bottom + height), "--zone")] = (
            True
        )
    elif options.zone_around_m is not None:
        inside[_window_around(site, buildings, options.zone_around_m)] = True
    elif not site.of_role(Role.ZONE):
        if options.zone_from:
            raise BlastEnvError(
                f"{site.path}: nothing on the site is chosen by --zone-from {options.zone_from}"
            )
        return None
    else:
        for _, outline in _on_site(site, Role.ZONE):
            touched, shares = covered_shares(outline, site.shape)
            inside[touched] |= shares >= LEAST_SHARE
    if not inside.any():
        raise BlastEnvError(f"{site.path}: the build zone is not on the site")
    rows, columns = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
    low, left = int(rows[0]), int(columns[0])
    window = (slice(low, int(rows[-1]) + 1), slice(left, int(columns[-1]) + 1))
    return {
        "corner_m": [left * MODULE_SIDE_M, low * MODULE_SIDE_M],
        "rows": window[0].stop - low,
        "columns": window[1].stop - left,
        "stock": options.stock,
        "height_m": options.wall_height_m,
        "clearance_m": options.clearance_m,
        "keep_outs": _keep_outs(site, inside, window),
    }


def _keep_outs(
    site: PlacedSite, inside: BoolArray, window: tuple[slice, slice]
) -> list[dict[str, Any]]:
    """Return the no-build areas, in the finest blocks within the limit of a scenario."""
    empty = [(_OUTSIDE, window, ~inside[window])]
    for thing, outline in _on_site(site, Role.KEEP_OUT):
        touched, shares = covered_shares(outline, site.shape)
        reason = (thing.name or "no-build area of the map")[:_MOST_REASON]
        empty.append((reason, touched, shares > _TOUCHED))
    low, left = (each.start for each in window)
    for side in COARSER:
        found = []
        for reason, touched, cells in empty:
            whole = np.zeros(site.shape, dtype=bool)
            whole[touched] = cells
            runs = fewest_runs(in_blocks(whole[window], side, _ANY))
            found += [
                {
                    "corner_m": [(left + column) * MODULE_SIDE_M, (low + row) * MODULE_SIDE_M],
                    "size_m": [columns * MODULE_SIDE_M, rows * MODULE_SIDE_M],
                    "reason": reason,
                }
                for row, column, rows, columns in runs.tolist()
            ]
        if len(found) <= MOST_KEEP_OUTS:
            return found
    raise BlastEnvError(
        f"{site.path}: areas that must stay empty take {len(found)} rectangles even in blocks of "
        f"{COARSER[-1] * MODULE_SIDE_M:g} m, must take at most {MOST_KEEP_OUTS}: make the zone "
        "smaller or simpler"
    )


def _on_site(site: PlacedSite, role: Role) -> list[tuple[Thing, BaseGeometry]]:
    """Return the areas of a role, each with the part of its outline on the site.

    Raises:
        BlastEnvError: If they are too many or too long, or one crosses itself too often.
    """
    found = []
    for thing in site.of_role(role):
        what = f"{site.path}: {thing.place}: the outline"
        inside = shapely.intersection(mended(thing.geometry, what), site.box)
        if inside.area > 0.0:
            found.append((thing, inside))
    if len(found) > MOST_AREAS:
        raise BlastEnvError(
            f"{site.path}: there are {len(found)} outlines of a {role} on the site, must be at "
            f"most {MOST_AREAS}"
        )
    check_outlines([outline for _, outline in found], f"{site.path}: outlines of a {role}")
    return found


def _window(site: PlacedSite, area_m: Rectangle, option: str) -> tuple[slice, slice]:
    """Return the rows and columns of a rectangle, which must lie on the site.

    Raises:
        BlastEnvError: If it does not.
    """
    width_m, height_m = site.size_m
    if not Rectangle(0.0, 0.0, width_m, height_m).contains(area_m) or not (
        area_m.left < area_m.right and area_m.bottom < area_m.top
    ):
        left, bottom, right, top = area_m
        raise BlastEnvError(
            f"{option} is x {left:g} to {right:g} m, y {bottom:g} to {top:g} m, must lie on the "
            f"site (x 0 to {width_m:g} m, y 0 to {height_m:g} m)"
        )
    left, bottom, right, top = (round(each / MODULE_SIDE_M) for each in area_m)
    return slice(bottom, max(top, bottom + 1)), slice(left, max(right, left + 1))


def _window_around(
    site: PlacedSite, buildings: Sequence[FittedBuilding], reach_m: float
) -> tuple[slice, slice]:
    """Return the rows and columns around the protected buildings, within the site."""
    chosen = [each for own in buildings if own.protected for each in own.boxes_m]
    left, bottom, right, top = Rectangle.around(chosen).grown(reach_m)
    width_m, height_m = site.size_m
    cut = Rectangle(max(left, 0.0), max(bottom, 0.0), min(right, width_m), min(top, height_m))
    return _window(site, cut, "--zone-around")
