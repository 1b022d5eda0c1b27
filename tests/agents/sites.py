"""Small sites with a building, a charge and a build zone wherever a test wants them."""

from typing import Any

from blast_env.site import Scenario

SIDE_M = 40.0


def site(
    charge_m: tuple[float, float] = (5.0, 20.0),
    building_m: tuple[float, float] = (30.0, 18.0),
    **zone: Any,
) -> Scenario:
    """Return a site of 40 m x 40 m with a building of 4 m x 4 m and a zone of 10 m x 10 m."""
    document = {
        "schema_version": 2,
        "name": "site",
        "site": {"width_m": SIDE_M, "height_m": SIDE_M},
        "charge": [{"kind": "point", "position_m": charge_m, "tnt_kg": 100.0}],
        "structures": [
            {
                "kind": "ConcreteSquare",
                "name": "building",
                "corner_m": building_m,
                "side_modules": 8,
                "protected": True,
            }
        ],
        "build_zone": {"corner_m": (15.0, 15.0), "rows": 20, "columns": 20, "stock": 12} | zone,
    }
    return Scenario.from_document(document, "site")
