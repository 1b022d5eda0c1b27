"""A site of 100 m whose charges, gauges and small structures stand close together."""

from blast_env.site import Scenario
from tests.builders import block, point, site, zone


def office_park() -> Scenario:
    """Return the site; its office is one building in two parts."""
    part = {"building": "office", "protected": True}
    gauges = {
        "door": (59.5, 40.0, 1.5),
        "door_upper_floor": (59.5, 40.0, 8.5),
        "gate_post": (25.0, 40.5, 1.5),
        "kerb": (25.0, 41.5, 0.5),
    }
    return site(
        "office_park",
        (100.0, 80.0, 20.0),
        [
            point(22.0, 40.0),
            point(22.0, 40.0, 500.0),
            point(24.0, 42.0, 50.0, height_m=1.0),
            {"kind": "segment", "start_m": (18.0, 4.0), "end_m": (18.0, 76.0), "tnt_kg": 250.0},
            {"kind": "rectangle", "corner_m": (30.0, 4.0), "size_m": (15.0, 6.0), "tnt_kg": 20.0},
        ],
        block("office_west", 60.0, 30.0, 40, 24, height_m=13.0, **part),
        block("office_east", 72.0, 30.0, 20, 30, height_m=9.0, **part),
        block("guard_house", 26.0, 38.0, 6, 6, height_m=3.0),
        block("bicycle_shed", 26.0, 43.0, 4, 8, height_m=2.5),
        block("transformer", 31.5, 38.5, 4, 4, height_m=2.5),
        gauges=[{"name": name, "position_m": place} for name, place in gauges.items()],
        build_zone=zone(40.0, 20.0, 80, 24, stock=30),
    )
