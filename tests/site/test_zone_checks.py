"""Build zones in which nothing could be built, or not as it is written, are refused at loading."""

from typing import Any

import pytest

from tests.site.documents import Document, lines_for
from tests.site.zones import area, structure, zone_document


def way(width_m: float, between: str = "left_right") -> Document:
    return {"width_m": width_m, "between": between}


FAR = area(0.0, 4.0, 1.0, 1.0, module_cost=2.0, reason="duct")


def only_line(*structures: Document, **zone: Any) -> str:
    (line,) = lines_for(zone_document(*structures, **zone))
    return line.removeprefix("f.toml: build_zone.")


@pytest.mark.parametrize(
    ("zone", "line"),
    [
        ({"cost_areas": [FAR]}, "cost_areas[0]: covers x 10 to 11 m, y 14 to 15 m, must overlap t"),
        ({"access_way": way(1.3)}, "access_way.width_m: is 1.3, must be a multiple of 0.5, the si"),
        (
            {"access_way": way(3.5), "rows": 10, "columns": 6, "stock": 1},
            "access_way.width_m: is 3.5, must be at most 3, the zone's shorter side",
        ),
        (
            {"access_way": way(3.0, "bottom_top"), "columns": 6},
            "access_way: a module on any usable cell would close the access way of 3 m from bottom"
            " to top",
        ),
        ({"budget": 0.9}, "budget: is 0.9, must be at least 1, the cost of a module on the cheape"),
        ({"stock": 65}, "stock: is 65, must be at most 64, the number of usable cells"),
    ],
)
def test_zone_that_cannot_be_used_is_named_with_its_bound(zone: Document, line: str) -> None:
    assert only_line(**zone).startswith(line)


def test_clearance_that_leaves_no_cell_is_refused() -> None:
    tower = structure("tower", 1.5, 1.5, 2, 2)
    for zone in ({}, {"access_way": way(0.5)}, {"budget": 0.5}):
        line = only_line(tower, clearance_m=5.0, **zone)
        assert line == "stock: is 10, must be at most 0, the number of usable cells"


@pytest.mark.parametrize(("rows", "is_sound"), [(4, True), (5, False)])
def test_structures_must_leave_the_access_way(rows: int, is_sound: bool) -> None:
    """Eight rows less the tower's: a vehicle four cells wide just passes it, or just does not."""
    document = zone_document(structure("tower", 1.5, 0.0, rows, 1), access_way=way(2.0))
    expected = "the structures leave no access way of 2 m from left to right through the empty zone"
    assert lines_for(document) == (
        [] if is_sound else [f"f.toml: build_zone.access_way: {expected}"]
    )


def test_only_structures_inside_the_zone_are_in_the_way() -> None:
    beside = structure("beside", 4.0, 0.0, 8, 1)
    assert lines_for(zone_document(beside, access_way=way(4.0 - 0.5))) == []


def test_cheapest_cell_counts_only_if_a_module_may_stand_there() -> None:
    """The middle row is cheap, but a module there would close the way."""
    cheap = area(0.0, 0.5, 4.0, 0.5, module_cost=1.0, reason="slab")
    zone = {"rows": 3, "cost_areas": [cheap], "module_cost": 2.0, "access_way": way(1.0)}
    assert only_line(**zone, budget=1.5).startswith("budget: is 1.5, must be at least 2, the cost")
    assert lines_for(zone_document(**zone, budget=2.0)) == []
    del zone["access_way"]
    assert lines_for(zone_document(**zone, budget=1.0)) == []
