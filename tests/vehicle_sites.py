"""Small sites on which a vehicle drives towards a building."""

from typing import Any

from blast_env.site import Scenario, VehicleSource
from tests import builders
from tests.builders import block, zone

POSTS = tuple((row, 0) for row in (0, 3, 6, 9, 12, 15))
"""Posts across the whole site, a metre apart: too narrow for the vehicle of 2 m."""


def vehicle_document(**changes: Any) -> dict[str, Any]:
    """A vehicle of 2 m with 5 kg that enters in the west."""
    return {
        "kind": "vehicle",
        "entries": [{"start_m": [0.0, 2.0], "end_m": [0.0, 6.0]}],
        "width_m": 2.0,
        "tnt_kg": 5.0,
    } | changes


def site_document(vehicle: dict[str, Any] | None = None, **changes: Any) -> dict[str, Any]:
    """A site of 14 m x 8 m, a strip of 4 x 16 cells across it, a hut in the east."""
    charge = vehicle_document() if vehicle is None else vehicle
    hut = block("hut", 10.0, 2.0, 8, 4, height_m=2.0, protected=True)
    strip = zone(4.0, 0.0, 16, 4, stock=16, height_m=1.0)
    document = builders.site_document("gate", (14.0, 8.0, 5.0), charge, hut, build_zone=strip)
    return document | changes


def gate_site(vehicle: dict[str, Any] | None = None, **changes: Any) -> Scenario:
    """Return the site, with another vehicle or other sections where some are given."""
    return Scenario.from_document(site_document(vehicle, **changes), "gate")


def vehicle_of(scenario: Scenario) -> VehicleSource:
    """Return its only vehicle."""
    (vehicle,) = scenario.vehicles
    return vehicle
