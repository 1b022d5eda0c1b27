"""A small yard with a catalogue of items, on which a gas blast takes a fraction of a second."""

from typing import Any

from blast_env.geometry import Layout, Piece
from blast_env.site import Scenario

WALL: Layout = (Piece(5, 1, "wall", True), Piece(8, 1, "wall", True), Piece(4, 1, "post"))
"""Two walls in line before the building, and a post beside them."""


def item(name: str, length: int, thickness: int, height_m: float, **keys: Any) -> dict[str, Any]:
    """Return an item of a catalogue: one piece that costs 1, unless said otherwise."""
    size = {"length_modules": length, "thickness_modules": thickness, "height_m": height_m}
    return {"name": name, **size, "cost": 1.0, "stock": 1, **keys}


ITEMS = [
    item("wall", 3, 1, 2.0, cost=6.0, stock=3, description="half of a T-wall"),
    item("basket", 2, 2, 1.5, cost=3.0, stock=2),
    item("post", 1, 1, 1.0, stock=4, rotatable=False),
]


def yard_document(**zone: Any) -> dict[str, Any]:
    """Return a charge of 5 kg in the west, a zone of 14 x 6 cells with items, a hut in the east.

    Args:
        zone: Other keys of the build zone.
    """
    return {
        "schema_version": 2,
        "name": "walled_yard",
        "site": {"width_m": 12.0, "height_m": 12.0, "air_height_m": 5.0},
        "charge": [{"kind": "point", "position_m": [2.0, 6.0], "tnt_kg": 5.0}],
        "build_zone": {
            "corner_m": [3.5, 2.5],
            "rows": 14,
            "columns": 6,
            "budget": 20.0,
            "items": ITEMS,
            **zone,
        },
        "structures": [
            {
                "kind": "ModularObstacle",
                "name": "hut",
                "corner_m": [7.5, 4.5],
                "rows": 6,
                "columns": 6,
                "height_m": 2.5,
                "protected": True,
            }
        ],
    }


def yard(**zone: Any) -> Scenario:
    """Return the yard, with other keys of the build zone where some are given."""
    return Scenario.from_document(yard_document(**zone), "yard")
