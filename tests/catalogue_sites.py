"""A small yard with a catalogue of items, on which a gas blast takes a fraction of a second."""

from typing import Any

from blast_env.geometry import Layout, Piece
from blast_env.site import Scenario
from tests import builders
from tests.builders import block, point

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
    cells = builders.zone(3.5, 2.5, 14, 6, budget=20.0, items=ITEMS) | zone
    hut = block("hut", 7.5, 4.5, 6, 6, height_m=2.5, protected=True)
    charge = point(2.0, 6.0, 5.0)
    return builders.site_document("walled_yard", (12.0, 12.0, 5.0), charge, hut, build_zone=cells)


def yard(**zone: Any) -> Scenario:
    """Return the yard, with other keys of the build zone where some are given."""
    return Scenario.from_document(yard_document(**zone), "yard")


def wide_yard(tnt_kg: float = 5.0) -> Scenario:
    """Return the yard with a charge that may be anywhere in an area."""
    area = {"kind": "rectangle", "corner_m": [1.0, 3.0], "size_m": [1.5, 6.0], "tnt_kg": tnt_kg}
    return Scenario.from_document(yard_document() | {"charge": [area]}, "wide yard")
