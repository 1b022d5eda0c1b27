"""A charge under a roof within walls is flagged by mass over volume, one under a canopy is not."""

import re

import pytest

from blast_env.evaluation.engines.gas import GasBlast, GasEngine
from blast_env.site import Scenario
from tests.builders import Document, block, point, site

SLAB = {"base_m": 3.0, "height_m": 3.5}
WALLS = {
    "south": block("south", 6.0, 5.5, 1, 16, height_m=3.0),
    "north": block("north", 6.0, 12.0, 1, 16, height_m=3.0),
    "west": block("west", 6.0, 6.0, 12, 1, height_m=3.0),
    "east": block("east", 13.5, 6.0, 12, 1, height_m=3.0, protected=True),
}
"""Round a room of 7 x 6 x 3 m."""


def room(*walls: str, tnt_kg: float = 0.965, at_m: tuple[float, float] = (9.0, 9.0)) -> Scenario:
    """Return a site with a slab over some walls; the east wall always stands."""
    roof: Document = block("roof", 6.0, 5.5, 14, 16, **SLAB)
    parts = [WALLS[wall] for wall in dict.fromkeys([*walls, "east"])]
    charge = point(*at_m, tnt_kg, height_m=1.0)
    return site("room", (20.0, 18.0, 8.0), charge, roof, *parts)


def room_notes(scenario: Scenario) -> list[str]:
    notes = GasBlast(scenario, engine=GasEngine(until=0.001)).run().impulse("east").notes
    return [note for note in notes if "under a roof within walls" in note]


@pytest.mark.parametrize(
    ("tnt_kg", "burnt_kpa", "known_kpa"), [(0.965, 45.0, 17.0), (3.86, 179.0, 68.0)]
)
def test_a_closed_room_states_the_gas_pressure_that_the_source_lacks(
    tnt_kg: float, burnt_kpa: float, known_kpa: float
) -> None:
    """45 and 179 kPa by all of the heat of combustion, 17 and 68 kPa by that of the source."""
    (note,) = room_notes(room(*WALLS, tnt_kg=tnt_kg))
    assert "of 126 m3" in note
    found = re.search(r"gives (\d+) kPa, the source (\d+) kPa", note)
    assert found is not None
    assert [float(group) for group in found.groups()] == pytest.approx(
        [burnt_kpa, known_kpa], rel=0.03
    )


def test_three_walls_make_a_room_and_one_does_not() -> None:
    assert len(room_notes(room("south", "north"))) == 1
    assert room_notes(room("east")) == []
    assert room_notes(room(*WALLS, at_m=(3.0, 9.0))) == []  # outside
