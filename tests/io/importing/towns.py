"""Random towns of which each object has a known fate, as GeoJSON and as an extract."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import shapely
from hypothesis import strategies as st
from shapely.affinity import translate
from shapely.geometry.base import BaseGeometry

from blast_env.io.importing import Fate
from tests.io.importing.maps import Extract

LOT_M: Final = 40.0
"""Distance of the lots of a town; what stands on one does not reach the next."""

COLUMNS: Final = 4

Tags = dict[str, Any]


@dataclass(frozen=True)
class Item:
    """An object of a town with what an import must make of it.

    Attributes:
        shape: Its geometry, m; empty if it has none.
        tags: Its tags.
        fate: Its only fate on the ledger; `None` if it must not be there.
        solid: Ground area, underside and top of the building that it must become, m2 and m.
        cut: Whether the extract lacks one of its nodes.
        marks: Attributes of its XML element.
    """

    shape: BaseGeometry
    tags: Tags
    fate: Fate | None
    solid: tuple[float, float, float] | None = None
    cut: bool = False
    marks: str = ""


@dataclass(frozen=True)
class Town:
    """A town: the lots with their items, and how many columns of them the site has."""

    lots: Sequence[Sequence[Item]]
    columns_on_site: int
    items: list[tuple[Item, bool]] = field(init=False)

    def __post_init__(self) -> None:
        """Place the lots: each item with whether it is on the site."""
        placed = []
        for number, lot in enumerate(self.lots):
            row, column = divmod(number, COLUMNS)
            for item in lot:
                moved = translate(item.shape, LOT_M * column, LOT_M * row)
                placed.append((replace(item, shape=moved), column < self.columns_on_site))
        object.__setattr__(self, "items", placed)

    @property
    def size_m(self) -> tuple[float, float]:
        rows = -(-len(self.lots) // COLUMNS)
        return LOT_M * self.columns_on_site, LOT_M * rows


def box(left: float, bottom: float, width: float, height: float) -> BaseGeometry:
    return shapely.box(left, bottom, left + width, bottom + height)


SIDES = st.integers(6, 20).map(float)
HEIGHTS = st.integers(1, 12).map(lambda storeys: 3.0 * storeys)


def forms_of(height_m: float) -> list[Tags]:
    """Return the ways to write a height of whole storeys of 3 m."""
    storeys = int(height_m / 3.0)
    forms: list[Tags] = [
        {"height": f"{height_m:g}"},
        {"height": f"{height_m:g} m"},
        {"height": f"{height_m:g},0"},
        {"height": f"{100 * height_m:g} cm"},
        {"height": f"{height_m / 0.3048:.3f}'"},
        {"building:levels": str(storeys)},
        {"height": "tall", "building:levels": str(storeys)},
        {"building:levels": f"1;{storeys}"},
    ]
    if storeys > 1:
        forms.append({"building:levels": str(storeys - 1), "roof:levels": "1"})
    return forms


@st.composite
def houses(draw: st.DrawFn) -> list[Item]:
    shape, height_m = box(2, 2, draw(SIDES), draw(SIDES)), draw(HEIGHTS)
    tags = draw(st.sampled_from(forms_of(height_m)))
    kind = draw(st.sampled_from(["yes", "office", "industrial"]))
    base_m = draw(st.sampled_from([0.0, 0.5, 2.0]))
    base = {"min_height": f"{base_m:g}"} if base_m else {}
    layer = draw(st.sampled_from([{}, {"layer": "1"}, {"facade:material": "brick"}]))
    tags = {"building": kind, **tags, **base, **layer}
    return [Item(shape, tags, Fate.READ, (shape.area, base_m, height_m))]


@st.composite
def courts(draw: st.DrawFn) -> list[Item]:
    """A building with a yard, as one object or two."""
    side, height_m = draw(SIDES), draw(HEIGHTS)
    border, yard = box(2, 2, side + 8.0, side + 8.0), box(6, 6, side, side)
    shape = border - yard
    tags = {"building": "yes", "height": f"{height_m:g}"}
    own = Item(shape, tags, Fate.READ, (shape.area, 0.0, height_m))
    known = draw(st.sampled_from([None, tags, {"building": "yes"}]))
    if known is None:
        return [own]
    twice = [own, Item(border, known, Fate.MERGED)]
    return twice[:: draw(st.sampled_from([1, -1]))]


@st.composite
def towers(draw: st.DrawFn) -> list[Item]:
    """A building over a lower one, which it covers or not."""
    low = box(2, 2, 24, 24)
    high = draw(st.sampled_from([box(4, 4, 6, 6), box(10, 10, 16, 16), box(1, 1, 26, 26)]))
    covers = bool(high.covers(low))
    rest_m2 = low.area - low.intersection(high).area
    base = Item(
        low,
        {"building": "yes", "height": 6.0},
        Fate.MERGED if covers else Fate.READ,
        None if covers else (rest_m2, 0.0, 6.0),
    )
    top = Item(high, {"building": "yes", "height": 15.0}, Fate.READ, (high.area, 0.0, 15.0))
    return [base, top][:: draw(st.sampled_from([1, -1]))]


@st.composite
def wholes(draw: st.DrawFn) -> list[Item]:
    """A building with a part of another height, or of none."""
    whole, part = box(2, 2, 20, 12), box(4, 4, 6, 6)
    height = draw(st.sampled_from([18.0, 3.0, None]))
    tags: Tags = {"building:part": "yes"}
    own: Tags = {"building": "yes", "height": 9.0}
    if height is None:
        solid = whole.area, 0.0, 9.0
        return [Item(whole, own, Fate.READ, solid), Item(part, tags, Fate.MERGED)]
    tags["height"] = height
    return [
        Item(whole, own, Fate.READ, (whole.area - part.area, 0.0, 9.0)),
        Item(part, tags, Fate.READ, (part.area, 0.0, height)),
    ]


@st.composite
def lost_buildings(draw: st.DrawFn) -> list[Item]:
    tags = draw(
        st.sampled_from(
            [
                {"building": "yes", "location": "underground"},
                {"building": "yes", "layer": "-1"},
                {"building": "construction"},
                {"building": "yes", "razed": "yes"},
                {"building": "yes", "location": "roof"},
            ]
        )
    )
    small = draw(st.booleans())
    if small:
        tags = {"building": "yes"}
    shape = box(2, 2, 1, 2) if small else box(2, 2, draw(SIDES), 8)
    return [Item(shape, {**tags, "height": 9.0}, Fate.LEFT_OUT)]


@st.composite
def roofs(draw: st.DrawFn) -> list[Item]:
    shape, height_m = box(2, 2, draw(SIDES), draw(SIDES)), draw(HEIGHTS)
    kind = draw(
        st.sampled_from([{"building": "roof", "layer": "1"}, {"building": "yes", "wall": "no"}])
    )
    tags = {**kind, "height": height_m}
    return [Item(shape, tags, Fate.READ, (shape.area, height_m - 0.5, height_m))]


@st.composite
def ground(draw: st.DrawFn) -> list[Item]:
    """Objects that are no buildings."""
    area, line = box(2, 2, 12, 8), shapely.LineString([(2, 20), (34, 20)])
    point = shapely.Point(5, 30)
    kinds: list[tuple[BaseGeometry, Tags, Fate]] = [
        (area, {"landuse": "grass"}, Fate.PASSED),
        (area, {"demolished:building": "yes", "height": 9.0}, Fate.PASSED),
        (area, {"building": "no", "natural": "water"}, Fate.PASSED),
        (area, {"amenity": "parking"}, Fate.READ),
        (area, {"amenity": "parking", "parking": "underground"}, Fate.LEFT_OUT),
        (area, {"kind": "keep_out"}, Fate.READ),
        (point, {"kind": "keep_out"}, Fate.LEFT_OUT),
        (point, {"natural": "tree"}, Fate.PASSED),
        (point, {"building": "yes", "height": 9.0}, Fate.LEFT_OUT),
        (point, {"kind": "charge_place"}, Fate.READ),
        (line, {"highway": "residential"}, Fate.READ),
        (line, {"highway": "service", "width": "8"}, Fate.READ),
        (line, {"highway": "steps"}, Fate.PASSED),
        (line, {"highway": "service", "tunnel": "yes"}, Fate.PASSED),
        (line, {"highway": "service", "layer": "-1"}, Fate.LEFT_OUT),
        (line, {"barrier": "wall", "height": "3"}, Fate.LEFT_OUT),
        (line, {"building": "yes", "height": 9.0}, Fate.LEFT_OUT),
    ]
    return [Item(*draw(st.sampled_from(kinds)))]


@st.composite
def tanks(draw: st.DrawFn) -> list[Item]:
    side_m = draw(st.integers(6, 20))
    circle = shapely.Point(20, 20).buffer(0.5 * side_m, quad_segs=4)
    tags = {"man_made": "storage_tank", "diameter": str(side_m), "height": "9"}
    return [Item(shapely.Point(20, 20), tags, Fate.READ, (circle.area, 0.0, 9.0))]


@st.composite
def sides(draw: st.DrawFn) -> list[Item]:
    """A building drawn as the lines of its sides."""
    shape = box(2, 2, draw(SIDES), draw(SIDES))
    corners = shapely.get_coordinates(shape)
    tags = {"building": "yes", "height": 9.0}
    lines = [shapely.LineString(ends) for ends in pairwise(corners)]
    chief = Item(lines[0], tags, Fate.READ, (shape.area, 0.0, 9.0))
    return [chief, *(Item(line, tags, Fate.MERGED) for line in lines[1:])]


def passage() -> list[Item]:
    """A street through a building, from side to side."""
    house = box(4, 10, 20, 10)
    way = shapely.LineString([(14, 10), (14, 20)])
    tags = {"highway": "service", "width": "2", "tunnel": "building_passage"}
    solid = {"building": "yes", "height": 9.0}
    return [Item(house, solid, Fate.READ, (200.0, 0.0, 9.0)), Item(way, tags, Fate.READ)]


@st.composite
def without_shape(draw: st.DrawFn) -> list[Item]:
    """Features without a geometry, which GeoJSON allows."""
    tags = draw(st.sampled_from([{"building": "yes"}, {"natural": "tree"}]))
    fate = Fate.LEFT_OUT if "building" in tags else Fate.PASSED
    return [Item(shapely.Point(), tags, fate)]


@st.composite
def incomplete(draw: st.DrawFn) -> list[Item]:
    """Objects of an extract of which a node is missing, or that are deleted."""
    shape = box(2, 2, 12, 8)
    if draw(st.booleans()):
        return [Item(shape, {"building": "yes"}, Fate.LEFT_OUT, cut=True)]
    marks = draw(st.sampled_from(['action="delete"', 'visible="false"']))
    return [Item(shape, {"building": "yes"}, None, marks=marks)]


LOTS: Final = (
    *(houses(), courts(), towers(), wholes(), lost_buildings()),
    *(roofs(), ground(), tanks(), sides(), st.builds(passage)),
)

HOUSE: Final = [
    Item(
        box(4, 4, 12, 10),
        {"building": "yes", "height": "9", "name": "House"},
        Fate.READ,
        (120.0, 0.0, 9.0),
    ),
    Item(shapely.Point(2, 30), {"kind": "charge_place"}, Fate.READ),
]


@st.composite
def towns(draw: st.DrawFn, *more: st.SearchStrategy[list[Item]]) -> Town:
    lots = draw(st.lists(st.one_of(*LOTS, *more), max_size=7))
    return Town([HOUSE, *lots], draw(st.integers(1, COLUMNS)))


def as_geojson(town: Town, folder: Path) -> tuple[Path, dict[str, tuple[Item, bool]]]:
    """Write a town in local metres; return the file and its items by their places."""
    features = [
        {
            "type": "Feature",
            "properties": item.tags,
            "geometry": None if item.shape.is_empty else json.loads(shapely.to_geojson(item.shape)),
        }
        for item, _ in town.items
    ]
    document = {
        "type": "FeatureCollection",
        "coordinate_system": "local site metres",
        "features": features,
    }
    path = folder / "town.geojson"
    path.write_text(json.dumps(document))
    return path, {f"features[{k}]": item for k, item in enumerate(town.items)}


def as_osm(town: Town, folder: Path) -> tuple[Path, dict[str, tuple[Item, bool]]]:
    """Write a town around (0, 0) on the equator; return the file and its items by their places."""
    extract, found = Extract(), dict[str, tuple[Item, bool]]()
    for number, (item, on_site) in enumerate(town.items, start=1):
        tags = {key: str(value) for key, value in item.tags.items()}
        write: Callable[[Extract, int, Item, Mapping[str, str]], str] = {
            "Point": _node,
            "LineString": _way,
            "Polygon": _relation if shapely.get_num_interior_rings(item.shape) else _way,
        }[item.shape.geom_type]
        found[write(extract, number, item, tags)] = item, on_site
    return extract.write(folder), found


def _node(extract: Extract, number: int, item: Item, tags: Mapping[str, str]) -> str:
    node = extract.node(*shapely.get_coordinates(item.shape)[0])
    words = "".join(f'<tag k="{key}" v="{value}"/>' for key, value in tags.items())
    extract.nodes[-1] = extract.nodes[-1].replace("/>", f">{words}</node>")
    return f"node {node}"


def _way(extract: Extract, number: int, item: Item, tags: Mapping[str, str]) -> str:
    is_ring = item.shape.geom_type == "Polygon"
    coordinates = list(shapely.get_coordinates(item.shape))
    nodes = [extract.node(x, y) for x, y in coordinates[: -1 if is_ring else None]]
    nodes = [*nodes, nodes[0]] if is_ring else nodes
    if item.cut:
        extract.nodes[nodes[1] - 1] = ""
    extract.way_of(number, nodes, item.marks, **tags)
    return f"way {number}"


def _relation(extract: Extract, number: int, item: Item, tags: Mapping[str, str]) -> str:
    members = []
    for part, ring in enumerate(shapely.get_rings(item.shape)):
        way = 1000 * number + part
        extract.way(way, [(x, y) for x, y in ring.coords[:-1]])
        members.append((way, "inner" if part else "outer"))
    extract.relation(number, members, **tags)
    return f"relation {number}"
