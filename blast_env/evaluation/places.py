"""Places of charges: the worst ones as threats, and others."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from blast_env.evaluation.blasts import Severity
from blast_env.evaluation.cases import LoadCase
from blast_env.geometry import Layout, Wall, WallLine
from blast_env.sections import PointM
from blast_env.site import (
    AnyCharge,
    PointSource,
    Scenario,
    SegmentSource,
    VehicleCharge,
    VehicleSource,
)
from blast_env.site.blast_site import Charge
from blast_env.site.sources import PlaceSource
from blast_env.vehicles.worst_places import least_distances_m

_MILLIMETRES: Final = 3  # digits


def place_text(threat: LoadCase, scenario: Scenario, layout: Layout) -> str:
    """Return the place of a charge in words, with a layout, and without if that differs."""
    unprotected, protected = (
        _place_text(threat.charge_against(scenario, own)) for own in ((), layout)
    )
    return (
        protected
        if unprotected == protected
        else f"{unprotected} without the layout, {protected} with it"
    )


def chief_threats(
    places: Sequence[LoadCase], severity: Callable[[LoadCase], Severity], most: int
) -> tuple[LoadCase, ...]:
    """Return the most severe charges: of each source, the place that governs; at most `most`."""
    sources: dict[int, list[LoadCase]] = {}
    for place in places:
        sources.setdefault(place.source, []).append(place)
    worst = [max(own, key=severity) for own in sources.values()]
    ranked = sorted(worst, key=severity, reverse=True)[:most]
    return tuple(
        replace(part, name=f"T{number}", why=_why(part, len(sources[part.source])))
        for number, part in enumerate(ranked, start=1)
    )


def requested_threats(scenario: Scenario, charges: tuple[AnyCharge, ...]) -> tuple[LoadCase, ...]:
    """Return the charges given by the user; refuse one that is out of bounds or not clear."""
    scenario.with_possible_charges(charges)
    return tuple(
        LoadCase(charge, name=f"T{number}", why="given by the user")
        for number, charge in enumerate(charges, start=1)
    )


def other_places(scenario: Scenario, count: int) -> tuple[LoadCase, ...]:
    """Return charges at even steps along segments, over areas, and at points; each only once.

    There are `count` places of each segment and vehicle, and along each side of an area. The place
    of each source nearest to an assessed wall is added. Those of a vehicle are at its worst
    place, its second worst, and so on.
    """
    found: dict[AnyCharge, LoadCase] = {}
    for index, source in enumerate(scenario.charge):
        why = f"charge source {index + 1}"
        if isinstance(source, VehicleSource):
            for rank in range(min(count, source.places)):
                vehicle = VehicleCharge(source, rank)
                name = f"vehicle, place {rank + 1} by distance"
                found.setdefault(vehicle, LoadCase(vehicle, 0, name, why, index))
            continue
        for place in (*_spread(source, count), nearest_place(scenario, source)):
            charge = Charge(place, source.tnt_kg, source.height_m)
            found.setdefault(charge, LoadCase(charge, 0, _place_text(charge), why, index))
    return tuple(found.values())


def _why(place: LoadCase, count: int) -> str:
    if count == 1:
        return place.why
    words = "the worst with the layout"
    return f"{place.why}, {words} of {count} places examined"


def _place_text(charge: Charge) -> str:
    x_m, y_m = charge.position_m
    return f"({x_m:.1f}, {y_m:.1f}) m"


def nearest_place(
    scenario: Scenario, source: PlaceSource, walls: Sequence[Wall] | None = None
) -> PointM:
    """Return the place of a source nearest to an assessed wall; of several, to a wall's middle.

    Args:
        walls: The walls that count; all assessed ones unless given.
    """
    walls = scenario.loaded_walls if walls is None else walls
    boxes_m = [
        (*wall.start_m, *wall.end_m) if isinstance(wall, WallLine) else wall for wall in walls
    ]
    # The nearest pair of two lines, or of a line and an area, has an end or corner of one of them.
    ends_m = np.array(boxes_m, dtype=np.float64).reshape(-1, 2, 2)
    middles_m = ends_m.mean(axis=1)
    points_m = np.concatenate((middles_m, ends_m.reshape(-1, 2)))
    places_m = np.concatenate((source.nearest_m(points_m), [*_spread(source, 2)]))
    away_m = least_distances_m(walls, places_m).round(_MILLIMETRES)
    off_m = np.linalg.norm(places_m[:, np.newaxis] - middles_m, axis=2).min(axis=1, initial=np.inf)
    x_m, y_m = places_m[np.lexsort((off_m, away_m))[0]].tolist()
    return x_m, y_m


def _spread(source: PlaceSource, count: int) -> Iterator[tuple[float, float]]:
    shares = np.linspace(0.0, 1.0, count).tolist() if count > 1 else [0.5]
    if isinstance(source, PointSource):
        yield source.position_m
    elif isinstance(source, SegmentSource):
        (x0, y0), (x1, y1) = source.segment_m
        for share in shares:
            yield x0 + share * (x1 - x0), y0 + share * (y1 - y0)
    else:
        left, bottom, right, top = source.rectangle_m
        for across in shares:
            for along in shares:
                yield left + across * (right - left), bottom + along * (top - bottom)
