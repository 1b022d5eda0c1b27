"""A site of 100 m whose charges, gauges and small structures stand close together."""

from typing import Any

from blast_env.site import Scenario


def office_park() -> Scenario:
    """Return the site; its office is one building in two parts."""
    document: dict[str, Any] = {
        "schema_version": 2,
        "name": "office_park",
        "site": {"width_m": 100.0, "height_m": 80.0, "air_height_m": 20.0},
        "charge": [
            {"kind": "point", "position_m": (22.0, 40.0), "tnt_kg": 100.0},
            {"kind": "point", "position_m": (22.0, 40.0), "tnt_kg": 500.0},
            {"kind": "point", "position_m": (24.0, 42.0), "tnt_kg": 50.0, "height_m": 1.0},
            {"kind": "segment", "start_m": (18.0, 4.0), "end_m": (18.0, 76.0), "tnt_kg": 250.0},
            {"kind": "rectangle", "corner_m": (30.0, 4.0), "size_m": (15.0, 6.0), "tnt_kg": 20.0},
        ],
        "structures": [
            _block("office_west", (60.0, 30.0), 40, 24, 13.0, building="office", protected=True),
            _block("office_east", (72.0, 30.0), 20, 30, 9.0, building="office", protected=True),
            _block("guard_house", (26.0, 38.0), 6, 6, 3.0),
            _block("bicycle_shed", (26.0, 43.0), 4, 8, 2.5),
            _block("transformer", (31.5, 38.5), 4, 4, 2.5),
        ],
        "gauges": [
            {"name": "door", "position_m": (59.5, 40.0, 1.5)},
            {"name": "door_upper_floor", "position_m": (59.5, 40.0, 8.5)},
            {"name": "gate_post", "position_m": (25.0, 40.5, 1.5)},
            {"name": "kerb", "position_m": (25.0, 41.5, 0.5)},
        ],
        "build_zone": {"corner_m": (40.0, 20.0), "rows": 80, "columns": 24, "stock": 30},
    }
    return Scenario.from_document(document, "office_park")


def _block(
    name: str, corner_m: tuple[float, float], rows: int, columns: int, height_m: float, **more: Any
) -> dict[str, Any]:
    size = {"rows": rows, "columns": columns, "height_m": height_m}
    return {"kind": "ModularObstacle", "name": name, "corner_m": corner_m, **size, **more}
