"""City models in CityJSON for tests, of which areas and heights are known."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

Corner = tuple[float, float, float]
Face = tuple[str, list[Corner]]
"""What a surface is, and its corners as they are seen from outside."""

RD = "https://www.opengis.net/def/crs/EPSG/0/7415"
ORIGIN = (85_000.0, 447_000.0)
"""A place in Delft in the coordinates of the Netherlands."""


def box(
    left: float, bottom: float, width: float, depth: float, low: float, high: float
) -> list[Face]:
    """Return the surfaces of a block."""
    plan = [(0.0, 0.0), (width, 0.0), (width, depth), (0.0, depth)]
    return block([(left + x, bottom + y) for x, y in plan], low, high)


def block(plan: Sequence[tuple[float, float]], low: float, high: float) -> list[Face]:
    """Return the surfaces of a block over a plan whose corners run counterclockwise."""
    walls: list[Face] = [
        ("WallSurface", [(*start, low), (*end, low), (*end, high), (*start, high)])
        for start, end in zip(plan, [*plan[1:], plan[0]], strict=True)
    ]
    return [
        ("GroundSurface", [(x, y, low) for x, y in reversed(plan)]),
        ("RoofSurface", [(x, y, high) for x, y in plan]),
        *walls,
    ]


def gable(
    left: float, bottom: float, width: float, depth: float, low: float, eaves: float, ridge: float
) -> list[Face]:
    """Return the surfaces of a house with a gable roof, whose ridge runs along x."""
    right, top, middle = left + width, bottom + depth, bottom + 0.5 * depth
    south = [(left, bottom, eaves), (right, bottom, eaves), (right, middle, ridge)]
    north = [(right, top, eaves), (left, top, eaves), (left, middle, ridge)]
    walls = [face for face in box(left, bottom, width, depth, low, eaves) if "Roof" not in face[0]]
    return [
        *walls,
        ("RoofSurface", [*south, (left, middle, ridge)]),
        ("RoofSurface", [*north, (right, middle, ridge)]),
        ("WallSurface", [(left, top, eaves), (left, bottom, eaves), (left, middle, ridge)]),
        ("WallSurface", [(right, bottom, eaves), (right, top, eaves), (right, middle, ridge)]),
    ]


class City:
    """A city model, in metres from an origin, with vertices of whole millimetres.

    Args:
        version: Version of the format.
        origin: Place of the origin in its reference system.
        system: The reference system.
    """

    def __init__(
        self,
        version: str = "2.0",
        origin: tuple[float, float] = ORIGIN,
        system: str | None = RD,
        unit: float = 1e-3,
    ) -> None:
        self.document: dict[str, Any] = {
            "type": "CityJSON",
            "version": version,
            "transform": {"scale": [unit, unit, 1e-3], "translate": [*origin, 0.0]},
            "CityObjects": {},
            "vertices": [],
        }
        if system is not None:
            self.document["metadata"] = {"referenceSystem": system}
        self.steps = (1.0 / unit, 1.0 / unit, 1000.0)

    def add(
        self, key: str, kind: str, *geometries: dict[str, Any], **members: Any
    ) -> dict[str, Any]:
        """Add an object; return it."""
        item: dict[str, Any] = {"type": kind, **members}
        if geometries:
            item["geometry"] = [*geometries]
        self.document["CityObjects"][key] = item
        return item

    def geometry(
        self, kind: str, faces: Sequence[Face], lod: str = "2", is_known: bool = True
    ) -> dict[str, Any]:
        """Return a geometry of a type, with semantics if it is known what its surfaces are."""
        surfaces = [[self.ring(corners)] for _, corners in faces]
        kinds = sorted({name for name, _ in faces})
        numbers = [kinds.index(name) for name, _ in faces]
        nested = {"Solid": 1, "MultiSolid": 2, "CompositeSolid": 2}.get(kind, 0)
        boundaries: Any = surfaces
        values: Any = numbers
        for _ in range(nested):
            boundaries, values = [boundaries], [values]
        geometry = {"type": kind, "lod": lod, "boundaries": boundaries}
        if is_known:
            geometry["semantics"] = {
                "surfaces": [{"type": name} for name in kinds],
                "values": values,
            }
        return geometry

    def ring(self, corners: Sequence[Corner]) -> list[int]:
        """Return the numbers of new vertices at some corners."""
        vertices = self.document["vertices"]
        start = len(vertices)
        for corner in corners:
            vertices.append([round(x * n) for x, n in zip(corner, self.steps, strict=True)])
        return list(range(start, len(vertices)))

    def write(self, folder: Path, name: str = "town.city.json") -> Path:
        """Write the model, and return the file."""
        path = folder / name
        path.write_text(json.dumps(self.document), encoding="utf-8")
        return path
