"""Parts of scenario documents, and small sites made of them."""

from collections.abc import Sequence
from typing import Any

from blast_env.site import Scenario

Document = dict[str, Any]


def point(x_m: float, y_m: float, tnt_kg: float = 100.0, **keys: Any) -> Document:
    """Return a charge at a place."""
    return {"kind": "point", "position_m": [x_m, y_m], "tnt_kg": tnt_kg, **keys}


def block(name: str, x_m: float, y_m: float, rows: int, columns: int, **keys: Any) -> Document:
    """Return a structure of modules by its lower left corner."""
    size = {"corner_m": [x_m, y_m], "rows": rows, "columns": columns}
    return {"kind": "ModularObstacle", "name": name, **size, **keys}


def square(name: str, x_m: float, y_m: float, side_modules: int, **keys: Any) -> Document:
    """Return a square structure by its lower left corner."""
    size = {"corner_m": [x_m, y_m], "side_modules": side_modules}
    return {"kind": "ConcreteSquare", "name": name, **size, **keys}


def zone(x_m: float, y_m: float, rows: int, columns: int, **keys: Any) -> Document:
    """Return a build zone by its lower left corner."""
    return {"corner_m": [x_m, y_m], "rows": rows, "columns": columns, **keys}


def site_document(
    name: str,
    size_m: Sequence[float],
    charge: Document | Sequence[Document],
    *structures: Document,
    **sections: Any,
) -> Document:
    """Return a scenario; the size of its site is width, depth and, if given, height of the air."""
    keys = ("width_m", "height_m", "air_height_m")
    return {
        "schema_version": 2,
        "name": name,
        "site": dict(zip(keys, size_m, strict=False)),
        "charge": [charge] if isinstance(charge, dict) else list(charge),
        "structures": list(structures),
        **sections,
    }


def site(*parts: Any, **sections: Any) -> Scenario:
    """Return the scenario of `site_document`."""
    document = site_document(*parts, **sections)
    return Scenario.from_document(document, document["name"])
