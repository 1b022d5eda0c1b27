"""Where barriers may be built on an imported site."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from blast_env.arrays import BoolArray
from blast_env.errors import BlastEnvError, import_extra
from blast_env.geometry import Rectangle
from blast_env.importing.cells import (
    COARSER,
    LEAST_SHARE,
    CellRectangle,
    covered_shares,
    rectangles_of,
)
from blast_env.importing.fitting import FittedBuilding
from blast_env.importing.options import ImportOptions
from blast_env.importing.placing import PlacedSite
from blast_env.importing.roles import Role
from blast_env.units import MODULE_SIDE_M

with import_extra("maps", "maps and drawings"):
    import shapely

MOST_KEEP_OUTS: Final = 100
"""As many as a scenario may have."""

_MOST_REASON: Final = 200
_TOUCHED: Final = 0.05  # of a cell: less is a map's rounding
_OUTSIDE: Final = "outside the build zone of the map"


def build_zone(
    site: PlacedSite, buildings: Sequence[FittedBuilding], options: ImportOptions
) -> dict[str, Any] | None:
    """Return the build zone as a scenario has it, `None` if nobody said where it is.

    A zone that is no rectangle is the one around it, and what lies outside it must stay empty.

    Raises:
        BlastEnvError: If it is not on the site, or must stay empty in too many pieces.
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
        inside |= _covered(site, Role.ZONE, LEAST_SHARE)
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
    """Return what must stay empty, in as fine pieces as a scenario can have."""
    low, left = window[0].start, window[1].start
    areas = [(~inside, _OUTSIDE)]
    for thing in site.of_role(Role.KEEP_OUT):
        cells = np.zeros(site.shape, dtype=bool)
        touched, shares = covered_shares(thing.geometry, site.shape)
        cells[touched] = shares > _TOUCHED
        areas.append((cells, (thing.name or "keep-out of the map")[:_MOST_REASON]))
    for side in COARSER:
        found = [
            _area(each, low, left, reason)
            for cells, reason in areas
            for each in rectangles_of(_whole_blocks(cells[window], side))
        ]
        if len(found) <= MOST_KEEP_OUTS:
            return found
    raise BlastEnvError(
        f"{site.path}: what must stay empty takes {len(found)} rectangles even in blocks of "
        f"{COARSER[-1] * MODULE_SIDE_M:g} m, must take at most {MOST_KEEP_OUTS}: make the zone "
        "smaller or simpler"
    )


def _whole_blocks(cells: BoolArray, side: int) -> BoolArray:
    """Return cells in blocks, each whole where any of its cells is there."""
    rows, columns = (-(-count // side) * side for count in cells.shape)
    padded = np.zeros((rows, columns), dtype=bool)
    padded[: cells.shape[0], : cells.shape[1]] = cells
    blocks = padded.reshape(rows // side, side, columns // side, side).any(axis=(1, 3))
    whole = np.repeat(np.repeat(blocks, side, axis=0), side, axis=1)
    return whole[: cells.shape[0], : cells.shape[1]]


def _area(each: CellRectangle, low: int, left: int, reason: str) -> dict[str, Any]:
    return {
        "corner_m": [(left + each.column) * MODULE_SIDE_M, (low + each.row) * MODULE_SIDE_M],
        "size_m": [each.columns * MODULE_SIDE_M, each.rows * MODULE_SIDE_M],
        "reason": reason,
    }


def _covered(site: PlacedSite, role: Role, least: float) -> BoolArray:
    """Return the cells of which outlines of a role cover a share."""
    cells = np.zeros(site.shape, dtype=bool)
    for thing in site.of_role(role):
        window, shares = covered_shares(shapely.make_valid(thing.geometry), site.shape)
        cells[window] |= shares >= least
    return cells


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
    """Return the rows and columns around the protected buildings, as far as the site goes."""
    chosen = [each.rectangle_m for own in buildings if own.protected for each in own.rectangles]
    around = Rectangle(
        min(each.left for each in chosen),
        min(each.bottom for each in chosen),
        max(each.right for each in chosen),
        max(each.top for each in chosen),
    ).grown(reach_m)
    width_m, height_m = site.size_m
    cut = Rectangle(
        max(around.left, 0.0),
        max(around.bottom, 0.0),
        min(around.right, width_m),
        min(around.top, height_m),
    )
    return _window(site, cut, "--zone-around")
