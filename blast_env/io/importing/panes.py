"""Windows of a building model that fit into the walls and storeys of a site."""

from collections.abc import Mapping, Sequence
from math import floor
from typing import Final

from blast_env.io.importing.ledger import Fate, Ledger

_FEWER: Final = "windows higher than a storey, with fewer storeys"
_LOWER: Final = "windows higher than the building, cut to it"
_WIDE: Final = "windows wider than all walls, left out"
_CENTI: Final = 100.0
_ROUNDING: Final = 1e-9
_LEAST_M: Final = 0.05
_BAY_M: Final = (0.5, 50.0)


def fitted(
    facade: Mapping[str, float],
    walls_m: Sequence[float],
    rise_m: float,
    place: str,
    ledger: Ledger,
) -> dict[str, float]:
    """Return the facade of a model with windows on all walls that are wide enough for one.

    A facade has storeys of equal height, and bays of equal width on a wall. Storeys become fewer
    and sills lower until a window fits. The ledger gets what changed.

    Args:
        facade: Storeys and windows, see `MapFeature`; may be empty.
        walls_m: Lengths of the walls.
        place: The building's place in the file.
        ledger: The ledger of the import.
    """
    if not facade:
        return {}
    found = dict(facade)
    wide_m = [wall_m for wall_m in walls_m if wall_m >= found["width"]]
    if not wide_m:
        ledger.add(Fate.GUESSED, _WIDE, place, detail=f"{found['width']:g} m")
        return {}
    if found["height"] > rise_m:
        ledger.add(Fate.GUESSED, _LOWER, place, detail=f"{found['height']:g} m to {rise_m:g} m")
        found["height"] = max(rise_m, _LEAST_M)
    most = max(floor(rise_m / found["height"] + _ROUNDING), 1)
    if found["storeys"] > most:
        detail = f"{most} for {found['storeys']:g}, windows {found['height']:g} m high"
        ledger.add(Fate.GUESSED, _FEWER, place, detail=detail)
        found["storeys"] = float(most)
    room_m = rise_m / found["storeys"] - found["height"]
    found["sill"] = min(found["sill"], max(floor(_CENTI * room_m + _ROUNDING) / _CENTI, 0.0))
    # A wall of half a bay or more has windows: the shortest one that is wide enough must be.
    found["bay"] = min(found["bay"], 2.0 * min(wide_m))
    if not _all_fit(found["bay"], found["width"], wide_m):
        found["bay"] = 2.0 * found["width"]
    found["bay"] = min(max(found["bay"], _BAY_M[0]), _BAY_M[1])
    return found


def _all_fit(bay_m: float, width_m: float, walls_m: Sequence[float]) -> bool:
    """Return whether a window fits into the bays of all walls."""
    return all(wall_m / max(1, round(wall_m / bay_m)) >= width_m for wall_m in walls_m)
