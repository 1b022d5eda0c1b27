"""Small sites on which a vehicle drives towards a building."""

from typing import Any

from blast_env.site import Scenario, VehicleSource

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
    return {
        "schema_version": 2,
        "name": "gate",
        "site": {"width_m": 14.0, "height_m": 8.0, "air_height_m": 5.0},
        "charge": [vehicle_document() if vehicle is None else vehicle],
        "build_zone": {
            "corner_m": [4.0, 0.0],
            "rows": 16,
            "columns": 4,
            "stock": 16,
            "height_m": 1.0,
        },
        "structures": [
            {
                "kind": "ModularObstacle",
                "name": "hut",
                "corner_m": [10.0, 2.0],
                "rows": 8,
                "columns": 4,
                "height_m": 2.0,
                "protected": True,
            }
        ],
    } | changes


def gate_site(vehicle: dict[str, Any] | None = None, **changes: Any) -> Scenario:
    """Return the site, with another vehicle or other sections where some are given."""
    return Scenario.from_document(site_document(vehicle, **changes), "gate")


def vehicle_of(scenario: Scenario) -> VehicleSource:
    """Return its only vehicle."""
    (vehicle,) = scenario.vehicles
    return vehicle
