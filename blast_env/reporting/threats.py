"""The charges that a report looks at: the worst places, other places, other masses."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import cbrt, hypot
from typing import Final

import numpy as np

from blast_env.errors import BlastEnvError
from blast_env.geometry import Rectangle
from blast_env.physics.scene import Charge
from blast_env.scenario import (
    AnySource,
    PointSource,
    RectangleSource,
    Scenario,
    ScenarioError,
    SegmentSource,
    VehicleSource,
)

_STEPS: Final = 400
"""Into how many parts a segment is cut to find its place nearest to a building."""


@dataclass(frozen=True)
class NamedCharge:
    """A charge with what a report calls it.

    Attributes:
        name: `T1`, or what it stands for.
        charge: The charge.
        why: Why it is there.
    """

    name: str
    charge: Charge
    why: str


def chief_threats(scenario: Scenario, most: int) -> tuple[NamedCharge, ...]:
    """Return the charges that can do most: of each source the place nearest to what is protected.

    Args:
        scenario: The scenario.
        most: How many at most; those of the smallest scaled distance are taken.
    """
    found: dict[Charge, tuple[float, int]] = {}
    for index, source in enumerate(scenario.charge):
        place = min(_candidates(scenario, source), key=lambda each: _distance_m(scenario, each))
        charge = Charge(place, source.tnt_kg, source.height_m)
        scaled = hypot(_distance_m(scenario, place), charge.height_m) / cbrt(charge.tnt_kg)
        found.setdefault(charge, (scaled, index))
    ranked = sorted(found.items(), key=lambda item: item[1])[:most]
    return tuple(
        NamedCharge(
            f"T{number}",
            charge,
            f"the place of charge source {index + 1} nearest to what is protected, "
            f"{scaled:.2f} m/kg^(1/3) away",
        )
        for number, (charge, (scaled, index)) in enumerate(ranked, start=1)
    )


def asked_threats(scenario: Scenario, charges: tuple[Charge, ...]) -> tuple[NamedCharge, ...]:
    """Return the charges that the user named.

    Raises:
        ScenarioError: If one is out of bounds, or not clear of structures and the border.
    """
    for charge in charges:
        scenario.with_charge(charge)
    return tuple(
        NamedCharge(f"T{number}", charge, "as asked for")
        for number, charge in enumerate(charges, start=1)
    )


def other_places(scenario: Scenario, count: int) -> tuple[NamedCharge, ...]:
    """Return charges at even steps along segments, over areas, and at points; each only once.

    Args:
        scenario: The scenario.
        count: How many of each segment, and along each side of an area.
    """
    found: dict[Charge, NamedCharge] = {}
    for index, source in enumerate(scenario.charge):
        for place in _spread(source, count):
            charge = Charge(place, source.tnt_kg, source.height_m)
            why = f"charge source {index + 1}"
            found.setdefault(
                charge, NamedCharge(f"({place[0]:.1f}, {place[1]:.1f}) m", charge, why)
            )
    return tuple(found.values())


def other_masses(
    scenario: Scenario, charge: Charge, factors: tuple[float, ...]
) -> tuple[tuple[NamedCharge, ...], tuple[str, ...]]:
    """Return the same charge with other masses, and why some are not possible."""
    possible, notes = [], []
    for factor in factors:
        other = charge._replace(tnt_kg=factor * charge.tnt_kg)
        name = f"{other.tnt_kg:g} kg"
        try:
            scenario.with_charge(other)
        except (ScenarioError, BlastEnvError) as error:
            notes.append(f"{name} was left out: {error}")
        else:
            possible.append(NamedCharge(name, other, f"{factor:g} times the mass"))
    return tuple(possible), tuple(notes)


def _candidates(scenario: Scenario, source: AnySource) -> Iterator[tuple[float, float]]:
    """Yield places of a source of which one is the nearest, or nearly."""
    if isinstance(source, RectangleSource):
        left, bottom, right, top = source.rectangle_m
        for target in _protected(scenario):
            # The point of the area nearest to the building.
            x_m = min(max(left, min(max(target.left, left), right)), right)
            y_m = min(max(bottom, min(max(target.bottom, bottom), top)), top)
            for x in {x_m, min(max(target.right, left), right)}:
                for y in {y_m, min(max(target.top, bottom), top)}:
                    yield x, y
        return
    yield from _spread(source, _STEPS + 1)


def _spread(source: AnySource, count: int) -> Iterator[tuple[float, float]]:
    shares = np.linspace(0.0, 1.0, count).tolist() if count > 1 else [0.5]
    if isinstance(source, PointSource):
        yield source.position_m
    elif isinstance(source, SegmentSource):
        (x0, y0), (x1, y1) = source.segment_m
        for share in shares:
            yield x0 + share * (x1 - x0), y0 + share * (y1 - y0)
    elif isinstance(source, VehicleSource):
        raise BlastEnvError(
            "a charge is brought by a vehicle, whose place depends on the layout: the report "
            "takes charges at places only; name one (--charge)"
        )
    else:
        left, bottom, right, top = source.rectangle_m
        for across in shares:
            for along in shares:
                yield left + across * (right - left), bottom + along * (top - bottom)


def _distance_m(scenario: Scenario, place: tuple[float, float]) -> float:
    """Return the distance of a place from the nearest protected structure."""
    x_m, y_m = place
    return min(
        hypot(
            max(each.left - x_m, x_m - each.right, 0.0), max(each.bottom - y_m, y_m - each.top, 0.0)
        )
        for each in _protected(scenario)
    )


def _protected(scenario: Scenario) -> list[Rectangle]:
    return [each.rectangle_m for each in scenario.structures if each.protected]
