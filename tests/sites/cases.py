"""Small scenarios of which the lines of sight can be told by hand."""

from typing import Any

from blast_env.site import Scenario

ROWS, COLUMNS = 8, 6


def yard_document(*structures: dict[str, Any], **zone: Any) -> dict[str, Any]:
    """A charge on the left, a house on the right, a zone of 8 x 6 cells that lies between."""
    house = {
        "kind": "ModularObstacle",
        "name": "house",
        "corner_m": (16.0, 8.0),
        "rows": 8,
        "columns": 4,
        "protected": True,
    }
    return {
        "schema_version": 2,
        "name": "yard",
        "calibration": "ballistic_kb_100kg",
        "site": {"width_m": 20.0, "height_m": 20.0},
        "charge": [{"kind": "point", "position_m": (2.0, 10.0), "tnt_kg": 100.0}],
        "structures": [house, *structures],
        "build_zone": {
            "corner_m": (9.0, 8.0),
            "rows": ROWS,
            "columns": COLUMNS,
            "stock": 8,
            **zone,
        },
    }


def yard(*structures: dict[str, Any], **zone: Any) -> Scenario:
    """The scenario of `yard_document`."""
    return Scenario.model_validate(yard_document(*structures, **zone))


def block(name: str, x_m: float, y_m: float, rows: int, columns: int) -> dict[str, Any]:
    """An unprotected structure."""
    shape = {"corner_m": (x_m, y_m), "rows": rows, "columns": columns}
    return {"kind": "ModularObstacle", "name": name, **shape}
