"""Which charges of a site an answer leaves out, in words.

An answer is under charges that somebody chose or that were drawn. A building may have a worse one:
fixed ones that were not asked for, a source of which none was drawn, or a place that is nearer.
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np

from blast_env.evaluation.cases import fixed_charges
from blast_env.evaluation.places import nearest_place
from blast_env.geometry import Element
from blast_env.layout.build_site import vehicle_drive, worst_places
from blast_env.sections import PointM
from blast_env.site import (
    AnyCharge,
    AnySource,
    PointSource,
    Scenario,
    VehicleCharge,
    VehicleSource,
)
from blast_env.site.blast_site import Charge
from blast_env.site.structures import buildings_of, loaded_walls
from blast_env.vehicles.worst_places import least_distances_m

_MOST_NAMES: Final = 3  # of further buildings
_NEARER_M: Final = 1.0
_NEARER: Final = 1.1
"""How much farther than its nearest place a charge may be without a word, in m and as a ratio."""


def left_out_words(
    scenario: Scenario, charges: Iterable[AnyCharge], layout: Sequence[Element] = ()
) -> Iterator[str]:
    """Yield that some of the charges of a site are not among those of an answer.

    They are fixed charges, or those of a source of which no charge was drawn, and places of a
    vehicle that are nearer to one of several buildings. Nothing is said of charges at other places
    or of other masses, which the user gave.

    Args:
        layout: The layout in question, which vehicles have to pass.
    """
    own = [*charges]
    vehicles: dict[VehicleSource, list[int]] = {}
    for driven in own:
        if isinstance(driven, VehicleCharge):
            vehicles.setdefault(driven.source, []).append(driven.rank)
    for source, ranks in vehicles.items():
        yield from _nearer_vehicle_words(scenario, source, ranks, layout)
    fixed = fixed_charges(scenario)
    if fixed:
        counted = {charge for charge in own if isinstance(charge, Charge)}
        left_out = [*_fixed_left_out(fixed, counted)]
        if 0 < len(left_out) < len(fixed):
            yield f"not among these: {len(left_out)} of the {len(fixed)} fixed charges of the site"
        return
    sources = scenario.charge
    without = [source for source in sources if not any(_is_of(source, charge) for charge in own)]
    if 0 < len(without) < len(sources):
        masses = ", ".join(dict.fromkeys(f"{source.tnt_kg:g} kg" for source in without))
        count = f"{len(without)} of the {len(sources)} sources of charges"
        yield f"not among these: any charge of {count} of the site ({masses})"


def _fixed_left_out(fixed: Sequence[Charge], counted: Collection[Charge]) -> Iterator[Charge]:
    """Yield the fixed charges of a site that are not counted."""
    places = {charge._replace(tnt_kg=0.0) for charge in counted}
    with_own_mass = {charge._replace(tnt_kg=0.0) for charge in {*counted} & {*fixed}}
    for charge in fixed:
        place = charge._replace(tnt_kg=0.0)
        # Of several at one place, those that count have their own masses.
        if charge not in counted and (place not in places or place in with_own_mass):
            yield charge


def _is_of(source: AnySource, charge: AnyCharge) -> bool:
    """Return whether a charge may come from a source."""
    if isinstance(charge, VehicleCharge) or isinstance(source, VehicleSource):
        return isinstance(charge, VehicleCharge) and charge.source == source
    mass = charge.tnt_kg, charge.height_m
    return mass == (source.tnt_kg, source.height_m) and source.has_place(charge.position_m)


class _NearerPlace(NamedTuple):
    """A place of a charge that is nearer to a building than all those of an answer."""

    building: str
    away_m: float
    place_m: PointM
    least_m: float


def _nearest_words(found: Iterable[_NearerPlace], source: str, those_here: str) -> Iterator[str]:
    """Yield one sentence on the nearest of some places, with the buildings of the others."""
    by_distance = sorted(found, key=lambda place: place.away_m)
    if not by_distance:
        return
    nearest, *others = by_distance
    x_m, y_m = nearest.place_m
    names = [place.building for place in others[:_MOST_NAMES]]
    if len(others) > _MOST_NAMES:
        names.append(f"{len(others) - _MOST_NAMES} more")
    yield (
        f"not among these: the nearest place of {source} to {nearest.building},"
        f" {nearest.away_m:.1f} m away at ({round(x_m, 1):g}, {round(y_m, 1):g}) m; {those_here}"
        f" are {nearest.least_m:.1f} m away or more"
        f"{'; so it is with ' * bool(names)}{', '.join(names)}"
    )


def _nearer_vehicle_words(
    scenario: Scenario, source: VehicleSource, ranks: Iterable[int], layout: Sequence[Element]
) -> Iterator[str]:
    """Yield how near a vehicle comes to a building, if its places are farther from it.

    They are those nearest to any assessed wall, which may all be before one of several buildings.
    """
    reach_m = vehicle_drive(scenario, source, layout).places_m
    worst = worst_places(scenario, source, layout)
    here_m = np.array([worst.place_m(rank) for rank in ranks])
    found = []
    for name, parts in buildings_of(scenario.structures_with(layout)).items():
        walls = loaded_walls(parts)
        if not walls or not len(reach_m):
            continue
        away_m = least_distances_m(walls, reach_m)
        least_m = float(least_distances_m(walls, here_m).min())
        if least_m > away_m.min() + source.least_apart_m:
            x_m, y_m = reach_m[away_m.argmin()].tolist()
            found.append(_NearerPlace(name, float(away_m.min()), (x_m, y_m), least_m))
    vehicle = f"a vehicle with {source.tnt_kg:g} kg"
    yield from _nearest_words(found, vehicle, "its places here")


def nearer_words(scenario: Scenario, charges: Iterable[AnyCharge]) -> Iterator[str]:
    """Yield how near a street or area comes to a building, if all charges are farther from it.

    A verdict is under charges that are drawn, of which none need be at the nearest place. Nothing
    is said where a charge of at least its mass from elsewhere is as near.
    """
    own = [charge for charge in charges if isinstance(charge, Charge)]
    buildings = [
        (name, walls)
        for name, parts in buildings_of(scenario.structures).items()
        if (walls := loaded_walls(parts))
    ]
    for number, source in enumerate(scenario.charge, start=1):
        is_drawn = any(_is_of(source, charge) for charge in own)
        if isinstance(source, PointSource | VehicleSource) or not is_drawn:
            continue
        here_m = [
            charge.position_m
            for charge in own
            if charge.tnt_kg >= source.tnt_kg and charge.height_m <= source.height_m
        ]
        found = []
        for name, walls in buildings:
            place_m = nearest_place(scenario, source, walls)
            away_m, *here = least_distances_m(walls, np.array([place_m, *here_m])).tolist()
            if min(here) > max(away_m + _NEARER_M, _NEARER * away_m):
                found.append(_NearerPlace(name, away_m, place_m, min(here)))
        street = f"charge {number} ({source.tnt_kg:g} kg)"
        yield from _nearest_words(found, street, "those here")
