"""Choice of the protected buildings of an imported site, and their names."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from blast_env.errors import BlastEnvError, import_extra, shortened
from blast_env.io.importing.fitting import FittedBuilding
from blast_env.io.importing.ledger import Deed, Ledger
from blast_env.io.importing.options import ImportOptions, plain
from blast_env.io.importing.placing import PlacedSite
from blast_env.io.importing.things import Role, Thing

with import_extra("maps", "maps and drawings"):
    import shapely

_MOST_LISTED: Final = 20


def protected_as_asked(
    buildings: Sequence[FittedBuilding],
    left_out: Sequence[Thing],
    site: PlacedSite,
    options: ImportOptions,
    ledger: Ledger,
) -> tuple[FittedBuilding, ...]:
    """Return the buildings, with those protected that the user named, or else the file marks.

    All parts of a building are protected with it.

    Args:
        buildings: The buildings on the site.
        left_out: Buildings that are not, with their faults.
        site: The site.
        options: The user's choices.
        ledger: The ledger of the import.

    Raises:
        BlastEnvError: If there is no building of a name, the place is outside the site, the
            building asked for is left out, or no building is protected.
    """
    chosen = {index for name in options.protect for index in _named(buildings, name, ledger)}
    if options.protect_near is not None:
        chosen.add(_nearest(buildings, left_out, site, options.protect_near))
    if not chosen:
        chosen = {index for index, each in enumerate(buildings) if each.protected}
    if not chosen:
        raise BlastEnvError(
            "no building is protected: say --protect NAME or --protect-near X,Y; there are "
            f"{_listed(buildings)}"
        )
    groups = {buildings[index].group for index in chosen}
    return tuple(replace(each, protected=each.group in groups) for each in buildings)


def _named(buildings: Sequence[FittedBuilding], name: str, ledger: Ledger) -> list[int]:
    """Return the indices of the buildings of a name, the scenario's or the map's."""
    asked = name.casefold()
    found = [index for index, each in enumerate(buildings) if each.name.casefold() == asked]
    found = found or [
        index for index, each in enumerate(buildings) if each.title.casefold() == asked
    ]
    if found:
        return found[:1]
    lost = [each for each in ledger.of(Deed.LEFT_OUT) if each.name.casefold() == asked]
    if lost:
        raise BlastEnvError(
            f"--protect is {name!r}, which is left out: {lost[0].place}: {lost[0].kind}"
        )
    raise BlastEnvError(f"--protect is {name!r}, but there are {_listed(buildings)}")


def _nearest(
    buildings: Sequence[FittedBuilding],
    left_out: Sequence[Thing],
    site: PlacedSite,
    place: tuple[float, float],
) -> int:
    """Return the index of the building nearest to a place of the map."""
    x_m, y_m = site.to_site(np.array([place]))[0]
    point = shapely.Point(x_m, y_m)
    distances_m = [each.outline.distance(point) for each in buildings]
    best = int(np.argmin(distances_m))
    for each in left_out:
        if each.role is not Role.BUILDING or each.geometry.is_empty:
            continue
        if each.geometry.convex_hull.distance(point) < distances_m[best]:
            words = f" ({shortened(each.name)})" if each.name else ""
            raise BlastEnvError(
                f"--protect-near is {place[0]:.10g},{place[1]:.10g}: the building nearest to it "
                f"is {each.place}{words}, which is left out: {each.fault}"
            )
    if not shapely.intersects(point, site.box):
        raise BlastEnvError(
            f"--protect-near is {place[0]:.10g},{place[1]:.10g}, which is at ({x_m:,.1f}, "
            f"{y_m:,.1f}) m of the site, outside of it{site.hint_of_exchange(place)}"
        )
    return best


def _listed(buildings: Sequence[FittedBuilding]) -> str:
    """Return the names of some buildings, those with names on the map first."""
    titled = sorted(buildings, key=lambda each: not each.title)
    shown = [
        each.name if plain(each.title) in ("", each.name) else f"{each.name} ({each.title})"
        for each in titled[:_MOST_LISTED]
    ]
    more = len(buildings) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more else "")
