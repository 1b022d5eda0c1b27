"""The charges that a design is tested against, by name, at defined places."""

from collections.abc import Iterator
from math import cbrt
from typing import Final

from blast_env.evaluation import LoadCase
from blast_env.evaluation.places import nearest_place
from blast_env.sections import PointM
from blast_env.site import RectangleSource, Scenario, SegmentSource, VehicleCharge, VehicleSource
from blast_env.site.blast_site import Charge
from blast_env.units import MODULE_SIDE_M
from blast_env.vehicles.worst_places import stand_off_m

MOST_USUAL: Final = 4
"""Most sources of charges, without vehicles, that blasts are run with by default."""

_NEAREST: Final = ", as near as it comes"


def threats_of(scenario: Scenario) -> tuple[LoadCase, ...]:
    """Return the charges that layouts of a site are tested against.

    Of a line: the middle and the ends; of an area: the middle and the corners; of both the place
    nearest to an assessed wall, if it is nearer than these; of a vehicle: the nearest place that
    the layout leaves it, and the next ones by distance.
    """
    walls = scenario.loaded_walls
    named: list[LoadCase] = []
    for index, source in enumerate(scenario.charge):
        places: list[tuple[str, PointM]]
        if isinstance(source, SegmentSource):
            (x0, y0), (x1, y1) = source.segment_m
            middle = ((x0 + x1) / 2.0, (y0 + y1) / 2.0)
            places = [(", middle", middle), (", start", (x0, y0)), (", end", (x1, y1))]
        elif isinstance(source, RectangleSource):
            left, bottom, right, top = source.rectangle_m
            places = [
                (", middle", source.rectangle_m.centre),
                (", lower left", (left, bottom)),
                (", lower right", (right, bottom)),
                (", upper left", (left, top)),
                (", upper right", (right, top)),
            ]
        elif isinstance(source, VehicleSource):
            named += _of_vehicle(index, source)
            continue
        else:
            places = [("", source.position_m)]
        nearest_m = nearest_place(scenario, source)
        least_m = min(stand_off_m(walls, at_m) for _, at_m in places)
        if stand_off_m(walls, nearest_m) < least_m - MODULE_SIDE_M:
            places.append((_NEAREST, nearest_m))
        named += [
            LoadCase(
                name=f"charge {index + 1}{words}",
                charge=Charge(at_m, source.tnt_kg, source.height_m),
                source=index,
            )
            for words, at_m in places
        ]
    return tuple(named)


def _of_vehicle(index: int, source: VehicleSource) -> Iterator[LoadCase]:
    for rank in range(source.places):
        words = _NEAREST if rank == 0 else f", place {rank + 1} by distance"
        charge = VehicleCharge(source, rank)
        yield LoadCase(charge, name=f"charge {index + 1}{words}", source=index)


def usual_threats(scenario: Scenario) -> tuple[str, ...]:
    """Return the names of the threats that blasts are run with by default.

    Of each source, the place with the least scaled stand-off, the first of equals; of a vehicle,
    the nearest one. Of more than `MOST_USUAL` sources without a vehicle, those with the least.
    """
    sources: dict[int, list[LoadCase]] = {}
    for threat in threats_of(scenario):
        sources.setdefault(threat.source, []).append(threat)

    def severity(threat: LoadCase) -> float:
        charge = threat.charge
        if isinstance(charge, VehicleCharge):
            return -charge.rank
        return -stand_off_m(scenario.loaded_walls, charge.position_m) / cbrt(charge.tnt_kg)

    chosen = [max(own, key=severity) for own in sources.values()]
    fixed = [threat for threat in chosen if not isinstance(threat.charge, VehicleCharge)]
    worst = sorted(fixed, key=severity, reverse=True)[:MOST_USUAL]
    return tuple(threat.name for threat in chosen if threat in worst or threat not in fixed)
