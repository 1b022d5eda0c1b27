"""Which buildings have an oblique wall, as modules show it: those of the study, and plain ones."""

from collections.abc import Sequence
from typing import Any

import pytest

from blast_env.engines.gas import GasBlast, GasEngine
from blast_env.evaluation import draw_threats
from blast_env.evaluation.consequences import consequences
from blast_env.scenario import Scenario, bundled_scenarios, load_scenario
from blast_env.scenario.staircase import STEPPED, stepped_buildings
from studies.gas.oblique import turned_block
from tests.gas_sites import site_document
from tests.office_park import office_park


@pytest.mark.parametrize("angle_deg", [20.0, 30.0, 45.0, -20.0, 110.0])
def test_a_turned_block_is_stepped(angle_deg: float) -> None:
    assert stepped_buildings(turned_block(angle_deg).structures) == {"block"}


def test_plain_buildings_are_not() -> None:
    sites = [turned_block(0.0), office_park(), *map(load_scenario, bundled_scenarios())]
    assert [stepped_buildings(each.structures) for each in sites] == [frozenset()] * len(sites)


def parts_of(*rectangles: Sequence[int]) -> Scenario:
    """Return one building of rectangles (column, row, columns, rows) on the ground of the hut."""
    document = site_document()
    keys: dict[str, Any] = {"kind": "ModularObstacle", "height_m": 2.0, "protected": True}
    document["structures"] = [
        {
            **keys,
            "name": f"part_{number}",
            "building": "hall",
            "corner_m": [6.0 + 0.5 * column, 1.0 + 0.5 * row],
            "columns": columns,
            "rows": rows,
        }
        for number, (column, row, columns, rows) in enumerate(rectangles)
    ]
    return Scenario.from_document(document, "hall")


STAIRS = [(0, 0, 5, 2), (1, 2, 4, 2), (2, 4, 3, 2), (3, 6, 2, 2)]


def test_steps_to_and_fro_are_bays_and_not_a_staircase() -> None:
    to_and_fro = [(0, 0, 5, 2), (1, 2, 4, 2), (0, 4, 5, 2), (1, 6, 4, 2), (0, 8, 5, 2)]
    two = STAIRS[:3]
    assert stepped_buildings(parts_of(*to_and_fro).structures) == frozenset()
    assert stepped_buildings(parts_of(*two).structures) == frozenset()
    assert stepped_buildings(parts_of(*STAIRS).structures) == {"hall"}


def test_tables_and_notes_say_it() -> None:
    engine = GasEngine(border_m=0.0, until=0.01)
    found = [
        GasBlast(each, engine=engine).run() for each in (parts_of(*STAIRS), parts_of(*STAIRS[:1]))
    ]
    assert [each.buildings["stepped"].tolist() for each in found] == [[True], [False]]
    assert [each.stepped_notes for each in found] == [(f"hall: {STEPPED}",), ()]


def test_an_assessment_says_it_of_a_building_with_a_facade() -> None:
    """A step is a bay of its own there; an oblique wall has no other."""
    stairs = parts_of(*STAIRS).model_dump(mode="json")
    for each in stairs["structures"]:
        each["facade"] = {"wall": "concrete_200"}
    scenario = Scenario.from_document(stairs, "stairs")
    engine = GasEngine(border_m=0.0, until=0.01)
    found = consequences(scenario, (), [draw_threats(scenario, [0])[0].charge], engine)
    assert found.notes[0].startswith(f"hall: {STEPPED}")
