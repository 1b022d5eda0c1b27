"""Write the fictitious town block that the docs and tests import, in three formats.

`python -m studies.market_street FOLDER` writes `market_street.geojson`, `.osm` and `.dxf`. The
coordinates lie in the North Sea.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import ezdxf
import numpy as np
import typer
from ezdxf import units
from ezdxf.enums import TextEntityAlignment

from blast_env.arrays import FloatArray
from blast_env.cli.output import print_line, user_errors
from blast_env.files import write_atomically
from blast_env.io.importing.plane import LocalPlane, rotated

PLANE: Final = LocalPlane("EPSG:4326", 7.5, 54.8)
ROTATION_DEG: Final = 23.0
"""From east to the streets of the block, counterclockwise."""

DRAWING_CORNER_M: Final = np.array([5000.0, 3000.0])
NAME: Final = "market_street"

Places = list[tuple[float, float]]


@dataclass(frozen=True)
class House:
    """A building: its outline in metres along and across the street, and its height."""

    name: str
    outline: Places
    height_m: float | None
    levels: int | None = None


def _rectangle(left: float, bottom: float, width: float, height: float) -> Places:
    right, top = left + width, bottom + height
    return [(left, bottom), (right, bottom), (right, top), (left, top)]


def _turned(outline: Places, angle_deg: float) -> Places:
    """Return an outline turned around its first corner."""
    points = rotated(np.array(outline) - outline[0], angle_deg) + outline[0]
    return [(float(x), float(y)) for x, y in points]


_TOWN_HALL: Final[Places] = [(40, 32), (64, 32), (64, 42.2), (52.1, 42.2), (52.1, 50), (40, 50)]
_CIRCLE: Final[Places] = [
    (22 + 4 * np.cos(angle), 40 + 4 * np.sin(angle))
    for angle in np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
]

HOUSES: Final = (
    House("Town Hall", _TOWN_HALL, 10.5),
    House("Baker", _rectangle(30.0, 8.0, 8.3, 9.0), 9.0),
    House("Bookshop", _rectangle(38.3, 8.0, 7.2, 9.0), None, 2),
    House("Pharmacy", _rectangle(45.5, 8.0, 9.0, 10.2), 9.0),
    House("Library", _turned(_rectangle(74.0, 34.0, 9.0, 13.0), 3.0), 7.4),
    House("Water Tower", _CIRCLE, 18.0),
    House("Chapel", _turned(_rectangle(72.0, 8.0, 12.0, 7.0), 18.0), None),
    House("", _rectangle(58.0, 10.0, 1.4, 2.0), 2.5),
)
STREET: Final[Places] = [(4, 24), (50, 24), (92, 25.5)]
PATH: Final[Places] = [(50, 24), (50, 32)]
ZONE: Final[Places] = _rectangle(36.0, 27.0, 32.0, 4.0)
MONUMENT: Final[Places] = _rectangle(56.0, 28.0, 1.5, 1.5)
CORNER: Final[Places] = [(4, 4), (92, 54)]
"""Outermost points of the block."""


def longitude_latitude(places: Places) -> FloatArray:
    """Return places of the block as longitude and latitude (n, 2)."""
    return PLANE.to_source(rotated(np.array(places, dtype=np.float64), ROTATION_DEG))


def geojson() -> dict[str, Any]:
    """Return the block as GeoJSON."""
    features = []
    for house in HOUSES:
        tags: dict[str, Any] = {"building": "yes"}
        tags |= {"name": house.name} if house.name else {}
        tags |= {} if house.height_m is None else {"height": house.height_m}
        tags |= {} if house.levels is None else {"building:levels": house.levels}
        features.append(_feature("Polygon", house.outline, tags))
    features += [
        _feature("LineString", STREET, {"highway": "residential", "name": "Market Street"}),
        _feature("LineString", PATH, {"highway": "footway"}),
        _feature("Polygon", ZONE, {"kind": "build_zone"}),
        _feature("Polygon", MONUMENT, {"kind": "keep_out", "name": "monument"}),
    ]
    return {
        "type": "FeatureCollection",
        "name": NAME,
        "description": "An invented block of a town that does not exist.",
        "features": features,
    }


def _feature(kind: str, places: Places, tags: dict[str, Any]) -> dict[str, Any]:
    points = longitude_latitude(places).round(8).tolist()
    ring: Any = [[*points, points[0]]] if kind == "Polygon" else points
    geometry = {"type": kind, "coordinates": ring}
    return {"type": "Feature", "properties": tags, "geometry": geometry}


def osm() -> str:
    """Return houses and streets of the block as OpenStreetMap XML."""
    ids: dict[tuple[float, float], int] = {}
    ways: list[tuple[list[int], dict[str, str]]] = []

    def nodes(places: Places) -> list[int]:
        rows = longitude_latitude(places).round(7).tolist()
        return [ids.setdefault((lon, lat), len(ids) + 1) for lon, lat in rows]

    for house in HOUSES:
        ring = nodes(house.outline)
        tags = {"building": "yes"}
        tags |= {"name": house.name} if house.name else {}
        tags |= {} if house.height_m is None else {"height": f"{house.height_m:g} m"}
        tags |= {} if house.levels is None else {"building:levels": f"{house.levels}"}
        ways.append(([*ring, ring[0]], tags))
    ways.append((nodes(STREET), {"highway": "residential", "name": "Market Street"}))
    ways.append((nodes(PATH), {"highway": "footway"}))
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        "<!-- An invented block of a town that does not exist. -->",
        '<osm version="0.6" generator="studies.market_street">',
        *(f'  <node id="{key}" lat="{lat}" lon="{lon}"/>' for (lon, lat), key in ids.items()),
    ]
    for number, (refs, tags) in enumerate(ways, start=1):
        lines.append(f'  <way id="{number}">')
        lines += [f'    <nd ref="{ref}"/>' for ref in refs]
        lines += [f'    <tag k="{key}" v="{value}"/>' for key, value in tags.items()]
        lines.append("  </way>")
    return "\n".join([*lines, "</osm>", ""])


def write_dxf(path: Path) -> None:
    """Write the block as a drawing in millimetres, heights as thicknesses."""
    document = ezdxf.filemanagement.new("R2010", units=units.MM)
    document.header.custom_vars.append("description", "An invented block of a town.")
    space = document.modelspace()

    def points(places: Places) -> list[tuple[float, float]]:
        metres = rotated(np.array(places, dtype=np.float64), ROTATION_DEG) + DRAWING_CORNER_M
        return [(round(1000.0 * x, 3), round(1000.0 * y, 3)) for x, y in metres.tolist()]

    for house in HOUSES:
        height_m = house.height_m or 3.0 * (house.levels or 0)
        style = {"layer": "BUILDINGS", "thickness": 1000.0 * height_m}
        space.add_lwpolyline(points(house.outline), close=True, dxfattribs=style)
        if house.name:
            text = space.add_text(house.name, height=600.0, dxfattribs={"layer": "TEXTS"})
            x, y = np.mean(points(house.outline), axis=0).tolist()
            text.set_placement((x, y), align=TextEntityAlignment.MIDDLE_CENTER)
    space.add_lwpolyline(points(STREET), dxfattribs={"layer": "STREETS"})
    corners = points(ZONE)  # drawn as single lines, as is common in drawings
    for start, end in zip(corners, [*corners[1:], corners[0]], strict=True):
        space.add_line(start, end, dxfattribs={"layer": "ZONE"})
    space.add_lwpolyline(points(MONUMENT), close=True, dxfattribs={"layer": "KEEP_CLEAR"})
    with write_atomically(path) as temporary:
        document.saveas(temporary)


def write_all(folder: Path) -> list[Path]:
    """Write the block in all formats; return the files."""
    files = [folder / f"{NAME}{suffix}" for suffix in (".geojson", ".osm", ".dxf")]
    collection = geojson()
    lines = ",\n".join(json.dumps(each) for each in collection.pop("features"))
    head = json.dumps(collection).removesuffix("}")
    for path, text in ((files[0], f'{head}, "features": [\n{lines}\n]}}\n'), (files[1], osm())):
        with write_atomically(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    write_dxf(files[2])
    return files


def main(
    folder: Annotated[Path, typer.Argument(help="Where the files go; must exist.")],
) -> None:
    """Write the block as GeoJSON, as an extract of OpenStreetMap and as a drawing."""
    with user_errors():
        for path in write_all(folder):
            print_line(f"wrote {path}")


if __name__ == "__main__":
    typer.run(main)
