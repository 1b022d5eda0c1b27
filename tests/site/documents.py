"""Valid scenario documents for the tests to damage."""

import tomllib
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

from blast_env.site import Scenario, ScenarioError, bundled_scenarios
from tests.vehicle_sites import site_document, vehicle_document

REPOSITORY = Path(__file__).parents[2]
Document = dict[str, Any]
KeyPath = tuple[str | int, ...]

_FULL: Document = {
    "schema_version": 2,
    "name": "full",
    "description": 'Every key of the format, with "quotes", \\ and\nümlauts.',
    "calibration": "some_calibration",
    "site": {"width_m": 30, "height_m": 20.0},
    "charge": [
        {"kind": "point", "position_m": [2.0, 10.0], "tnt_kg": 50.0, "weight": 2.0},
        {"kind": "segment", "start_m": [3.0, 2.0], "end_m": [5.0, 18.0], "tnt_kg": 100.0},
        {"kind": "rectangle", "corner_m": [2.0, 2.0], "size_m": [3.0, 4.0], "tnt_kg": 10.0},
    ],
    "structures": [
        {
            "kind": "ModularObstacle",
            "name": "house",
            "corner_m": [20.0, 8.0],
            "rows": 8,
            "columns": 4,
            "protected": True,
            "weight": 3.0,
        },
        {
            "kind": "ConcreteSquare",
            "name": "bunker",
            "corner_m": [15.0, 15.0],
            "side_modules": 4,
            "module_capacity": 500.0,
        },
    ],
    "build_zone": {
        "corner_m": [8.0, 5.0],
        "rows": 20,
        "columns": 10,
        "stock": 12,
        "module_capacity": 100.0,
        "keep_outs": [{"corner_m": [8.0, 9.0], "size_m": [5.0, 1.0], "reason": "path"}],
        "clearance_m": 0.5,
        "module_cost": 2.0,
        "cost_areas": [
            {"corner_m": [8.0, 5.0], "size_m": [1, 10], "module_cost": 5.0, "reason": "duct"}
        ],
        "budget": 40.0,
        "access_way": {"width_m": 1.5, "between": "left_right"},
    },
    "simulation": {
        "preset": "ballistic",
        "overrides": {
            "air": {"spacing_units": 6.0, "jitter": 0.25},
            "explosive": {"ball_count": 360, "collide_within_charge": False},
        },
    },
}


def full_document() -> Document:
    """Return a valid document in which every key of the format's first version occurs."""
    return deepcopy(_FULL)


def tall_document() -> Document:
    """Return the full document with heights, faces, gauges and what else gas dynamics knows."""
    document = full_document()
    document |= {
        "schema_version": 2,
        "name": "tall",
        "gauges": [
            {"name": "door", "position_m": [19.75, 10.0, 1.5]},
            {"name": "roof", "position_m": [20.25, 10.0, 6.5]},
        ],
        "georeference": {
            "kind": "map",
            "longitude_deg": 7.5,
            "latitude_deg": 54.2,
            "rotation_deg": 20.0,
            "crs": "EPSG:25832",
        },
    }
    document["site"]["air_height_m"] = 14.0
    document["charge"][0]["height_m"] = 1.0
    document["structures"][0] |= {"height_m": 6.0, "faces": ["west", "south"], "building": "farm"}
    document["structures"][0]["peak_weight"] = 2.0
    document["objective"] = {
        "quantity": "both",
        "reference_impulse_pa_s": 500.0,
        "reference_peak_pa": 5e4,
        "charges": "cvar",
        "cvar_level": 0.5,
    }
    document["build_zone"]["height_m"] = 3.0
    gate = {"corner_m": [12.0, 12.0], "size_m": [0.5, 2.0]}
    document["build_zone"]["access_way"]["gate"] = gate
    return document


def driven_document() -> Document:
    """Return a document with every key of a vehicle."""
    vehicle = vehicle_document(
        height_m=0.5,
        weight=2.0,
        drivable=[{"corner_m": [0.0, 0.0], "size_m": [14.0, 8.0]}],
        keep_outs=[{"corner_m": [7.0, 0.0], "size_m": [1.0, 2.0], "reason": "a pond"}],
        places=3,
        apart_m=2.5,
        motion={
            "mass_kg": 3500.0,
            "max_speed_km_h": 80.0,
            "acceleration_m_s2": 2.5,
            "entry_speed_km_h": 30.0,
            "grip": 0.8,
            "slow": [
                {
                    "corner_m": [1.0, 0.0],
                    "size_m": [2.0, 8.0],
                    "speed_km_h": 15.0,
                    "reason": "a speed table",
                }
            ],
        },
    )
    document = site_document(vehicle, name="driven")
    gate = {
        "corner_m": [4.0, 3.0],
        "size_m": [0.5, 2.0],
        "crash_rating": {
            "mass_kg": 7200.0,
            "speed_km_h": 48.0,
            "penetration_m": 0.4,
            "test": "IWA 14-1, N2A",
        },
    }
    way = {"width_m": 2.0, "between": "left_right", "gate": gate}
    document["build_zone"] |= {"access_way": way}
    return document


def minimal_document() -> Document:
    """Return a valid document with nothing but required keys."""
    return {
        "schema_version": 2,
        "name": "minimal",
        "site": {"width_m": 20.0, "height_m": 10.0},
        "charge": [{"kind": "point", "position_m": [3.0, 5.0], "tnt_kg": 100.0}],
        "structures": [
            {
                "kind": "ConcreteSquare",
                "name": "house",
                "corner_m": [10.0, 4.0],
                "side_modules": 4,
                "protected": True,
            }
        ],
    }


def all_documents() -> list[Document]:
    """Return the documents above and those of the bundled scenarios of single modules.

    Keys of items may be left out where `from_catalogue` stands, so that what is required there is
    no matter of the key alone; `test_catalogue` has them.
    """
    folder = REPOSITORY / "scenarios"
    bundled = [
        tomllib.loads((folder / f"{name}.toml").read_text(encoding="utf-8"))
        for name in bundled_scenarios()
    ]
    own = [full_document(), tall_document(), driven_document(), minimal_document()]
    return [*own, *(name for name in bundled if "items" not in name.get("build_zone", {}))]


def key_paths(value: object, path: KeyPath = ()) -> Iterator[KeyPath]:
    """Yield the path of everything inside a document."""
    if isinstance(value, dict):
        items: list[tuple[str | int, object]] = list(value.items())
    elif isinstance(value, list):
        items = list(enumerate(value))
    else:
        return
    for key, item in items:
        yield (*path, key)
        yield from key_paths(item, (*path, key))


def value_at(document: Document, path: KeyPath) -> Any:
    """Return what lies at a path."""
    value: Any = document
    for key in path:
        value = value[key]
    return value


def changed(document: Document, path: KeyPath, value: object) -> Document:
    """Return a copy with another value at a path; the last key may be new."""
    copy = deepcopy(document)
    value_at(copy, path[:-1])[path[-1]] = value
    return copy


def without(document: Document, path: KeyPath) -> Document:
    """Return a copy without the key at a path."""
    copy = deepcopy(document)
    del value_at(copy, path[:-1])[path[-1]]
    return copy


def written(path: KeyPath) -> str:
    """Return a path as messages write it."""
    text = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in path)
    return text.removeprefix(".")


def lines_for(document: Document) -> list[str]:
    """Return the lines of the error that a document raises; none if it is valid."""
    try:
        Scenario.from_document(document, "f.toml")
    except ScenarioError as error:
        return str(error).split("\n")
    return []
