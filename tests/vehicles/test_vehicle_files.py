"""Vehicles in scenario files: what is wrong with one, versions, hashes."""

from pathlib import Path
from typing import Any

import pytest

from blast_env.site import ChargeSource, ScenarioError, VehicleSource
from tests.builders import block
from tests.vehicle_sites import gate_site, site_document, vehicle_document


def problems(vehicle: dict[str, Any] | None = None, **changes: Any) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        gate_site(vehicle, **changes)
    return [str(problem) for problem in caught.value.problems]


def entry(start_m: list[float], end_m: list[float]) -> dict[str, Any]:
    return {"entries": [{"start_m": start_m, "end_m": end_m}]}


HUT = site_document()["structures"][0]


def ground(x_m: float, y_m: float, width_m: float, depth_m: float) -> dict[str, Any]:
    return {"corner_m": [x_m, y_m], "size_m": [width_m, depth_m]}


def pond(*places_m: float) -> dict[str, Any]:
    return ground(*places_m) | {"reason": "pond"}


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        (entry([1.0, 2.0], [1.0, 6.0]), ".entries[0]: runs from (1, 2) m to (1, 6) m, must lie on"),
        (entry([0.0, 2.0], [0.0, 3.5]), ".entries[0]: is 1.5 m long, must be at least 2 m, the v"),
        ({"width_m": 0.5}, ".width_m: is 0.5, must be at least 1, the charge's diameter"),
        ({"drivable": [ground(0.0, 0.0, 15.0, 8.0)]}, ".drivable[0]: the ground (x 0 to 15 m, y"),
        ({"keep_outs": [pond(0.0, 5.0, 3.0, 4.0)]}, ".keep_outs[0]: the ground (x 0 to 3 m, y 5"),
        (
            {"keep_outs": [pond(0.0, 0.0, 1.0, 8.0)]},
            ".entries: the vehicle cannot enter: structures, gates and ground that is closed to it"
            " leave no entry a gap of 2 m, its width",
        ),
        (
            {"keep_outs": [pond(2.0, 0.0, 1.0, 8.0)]},
            ": the vehicle comes no nearer to a protected structure than 9 m, as near as where it"
            " enters: structures, gates and ground that is closed to it leave no gap of 2 m, its",
        ),
    ],
)
def test_a_vehicle_that_gets_nowhere_is_refused(changes: dict[str, Any], expected: str) -> None:
    (line,) = problems(vehicle_document(**changes))
    assert line.startswith(f"charge[0]{expected}")


def test_walls_with_gaps_narrower_than_the_vehicle_let_it_no_further_than_its_entry() -> None:
    walls = [block("low", 2.0, 0.0, 7, 1), block("high", 2.0, 4.5, 7, 1)]
    assert problems(structures=[HUT, *walls])[0].startswith(
        "charge[0]: the vehicle comes no nearer to a protected structure than 9 m"
    )
    walls[1] = block("high", 2.0, 5.5, 5, 1)
    assert gate_site(structures=[HUT, *walls])


def test_a_vehicle_that_nothing_could_stop_is_refused() -> None:
    zone = site_document()["build_zone"] | {"rows": 4, "stock": 4}
    assert problems(build_zone=zone) == [
        "charge[0]: nothing can stop the vehicle: even with a vehicle barrier on each of the"
        " 16 cells where one can stand, it comes as near as 1 m to a protected structure"
    ]


@pytest.mark.parametrize(("stops", "stock"), [(False, 3), (True, 0)])
def test_a_catalogue_in_which_nothing_stops_vehicles_is_refused(stops: bool, stock: int) -> None:
    hedge = {"name": "hedge", "length_modules": 3, "height_m": 1.5, "cost": 1.0, "stock": 9}
    post = {"name": "post", "length_modules": 1, "height_m": 1.0, "cost": 1.0}
    items = [hedge | {"stops_vehicles": False}, post | {"stops_vehicles": stops, "stock": stock}]
    zone = {"corner_m": [4.0, 0.0], "rows": 16, "columns": 4, "items": items}
    assert problems(build_zone=zone) == [
        "charge[0]: nothing can stop the vehicle: no item in stock stops vehicles"
    ]
    items[1] |= {"stops_vehicles": True, "stock": 1}
    assert gate_site(build_zone=zone)


def test_all_is_said_at_once() -> None:
    vehicle = vehicle_document(
        width_m=9.0,
        entries=[
            {"start_m": [1.0, 2.0], "end_m": [0.0, 6.0]},
            {"start_m": [0.0, 2.0], "end_m": [0.0, 6.0]},
        ],
        drivable=[{"corner_m": [0.0, 7.0], "size_m": [3.0, 2.0]}],
    )
    keys = [text.partition(":")[0] for text in problems(vehicle)]
    assert keys == [
        "charge[0].width_m",
        "charge[0].entries[0]",
        "charge[0].entries[1]",
        "charge[0].drivable[0]",
    ]


@pytest.mark.parametrize(
    ("gate", "message"),
    [
        (
            {"corner_m": [3.5, 3.0], "size_m": [1.0, 2.0]},
            "the gate (x 3.5 to 4.5 m, y 3 to 5 m) must lie inside the build zone"
            " (x 4 to 6 m, y 0 to 8 m)",
        ),
        (
            {"corner_m": [4.0, 3.0], "size_m": [2.0, 1.0]},
            "the gate (x 4 to 6 m, y 3 to 4 m) is 1 m wide across the way, must be at least 2 m,"
            " the way's width",
        ),
    ],
)
def test_a_gate_that_does_not_fit_its_way_is_refused(gate: dict[str, Any], message: str) -> None:
    way = {"width_m": 2.0, "between": "left_right", "gate": gate}
    zone = site_document()["build_zone"] | {"access_way": way}
    assert problems(build_zone=zone) == [f"build_zone.access_way.gate: {message}"]


def test_the_page_on_vehicles_names_every_key() -> None:
    page = Path(__file__).parents[2] / "docs" / "reference" / "vehicles.md"
    text = page.read_text(encoding="utf-8")
    keys = {*VehicleSource.model_fields} - {*ChargeSource.model_fields, "kind"}
    assert "entries" in keys
    assert [key for key in keys if f"`{key}`" not in text] == []
