"""Every entity of a random drawing has the fate that it must have, once, and its solid.

`pytest tests/io/importing/test_drawn_towns.py --hypothesis-profile many` imports 2,000 drawings.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from ezdxf.document import Drawing
from ezdxf.filemanagement import new
from ezdxf.layouts.blocklayout import BlockLayout
from ezdxf.layouts.layout import Modelspace
from ezdxf.render.forms import cube
from hypothesis import given
from hypothesis import strategies as st

from blast_env.io.importing import FATES, Fate, ImportOptions, SiteImport, import_site
from tests.io.importing.maps import rectangle

LOT_M = 60.0
UNITS = {6: 1.0, 4: 1000.0, 2: 1.0 / 0.3048}
"""Codes of units, and how many of them a metre has."""

Box = tuple[float, float, float]
"""Area in m2, underside and top in m above the ground."""


@dataclass
class Town:
    """A drawing with what is known of it, on lots in a row.

    Attributes:
        unit: Units of the drawing in a metre.
        zero_m: Height of the ground in the drawing.
    """

    unit: float
    zero_m: float
    document: Drawing = field(default_factory=new)
    fates: list[Fate] = field(default_factory=list)
    boxes: list[Box] = field(default_factory=list)
    lots: int = 0

    @property
    def space(self) -> Modelspace:
        return self.document.modelspace()

    def lot(self) -> float:
        """Return the left border of the next lot, m."""
        self.lots += 1
        return LOT_M * self.lots

    def expect(self, *boxes: Box, read: int = 1, **fates: int) -> None:
        """Expect buildings and fates: the names of fates with their numbers."""
        self.boxes += boxes
        self.fates += [Fate.READ] * read
        for name, count in fates.items():
            self.fates += [Fate[name.upper()]] * count

    def scaled(self, *values: float) -> tuple[float, ...]:
        return tuple(self.unit * value for value in values)

    def outline(
        self, space: Modelspace | BlockLayout, box: tuple[float, ...], base_m: float, **more: Any
    ) -> Any:
        ring = [self.scaled(*place) for place in rectangle(*box)]
        attributes = {"layer": "BLD", "elevation": self.unit * base_m, **more}
        return space.add_lwpolyline(ring, close=True, dxfattribs=attributes)


Maker = Callable[[Town, Any, float, float], None]
MAKERS: list[Maker] = []


def maker(function: Maker) -> Maker:
    MAKERS.append(function)
    return function


@maker
def extruded(town: Town, draw: Any, left: float, height: float) -> None:
    down, mirrored = draw(st.booleans()), draw(st.booleans())
    base = draw(st.sampled_from((0.0, -0.5, 0.5, 2.0)))
    low, high = town.zero_m + base, town.zero_m + base + height
    sign = -1.0 if mirrored else 1.0
    start, rise = (high, low - high) if down else (low, high - low)
    box = (-left - 20.0 if mirrored else left, 0.0, 20.0, 10.0)  # of the entity, whose x goes west
    more = {"thickness": sign * town.unit * rise, "extrusion": (0.0, 0.0, sign)}
    town.outline(town.space, box, sign * start, **more)
    if town.zero_m:
        town.expect((200.0, 0.0, height))
    else:
        town.expect((200.0, max(base, 0.0), base + height))


@maker
def in_blocks(town: Town, draw: Any, left: float, height: float) -> None:
    """An extrusion in a block in a block: mirrored, turned, scaled in height."""
    inner = town.document.blocks.new(f"INNER{town.lots}")
    outer = town.document.blocks.new(f"OUTER{town.lots}")
    rise = draw(st.sampled_from((1.0, 2.0)))
    town.outline(inner, (0, 0, 20, 10), 0.0, thickness=town.unit * height / rise, layer="0")
    flip_x, flip_y = draw(st.sampled_from((1.0, -1.0))), draw(st.sampled_from((1.0, -1.0)))
    turn = draw(st.sampled_from((0.0, 90.0, 180.0)))
    scales = {"xscale": flip_x, "yscale": flip_y, "zscale": rise}
    outer.add_blockref(inner.name, (0, 0), dxfattribs={**scales, "layer": "0"})
    place = town.scaled(left + 25.0, 0.0, town.zero_m)
    town.space.add_blockref(outer.name, place, dxfattribs={"layer": "BLD", "rotation": turn})
    town.expect((200.0, 0.0, height))


@maker
def in_rows(town: Town, draw: Any, left: float, height: float) -> None:
    block = town.document.blocks.new(f"ROW{town.lots}")
    town.outline(block, (0, 0, 6, 10), 0.0, thickness=town.unit * height)
    town.space.add_blockref(
        block.name,
        town.scaled(left, 0.0, town.zero_m),
        dxfattribs={"layer": "BLD", "column_count": 3, "column_spacing": town.unit * 15.0},
    )
    town.expect(*[(60.0, 0.0, height)] * 3, read=3)


@maker
def tower(town: Town, draw: Any, left: float, height: float) -> None:
    """A podium and a tower on it, as two extrusions."""
    up = town.unit * height
    town.outline(town.space, (left, 0, 40, 10), town.zero_m, thickness=up)
    town.outline(town.space, (left, 0, 15, 10), town.zero_m + height, thickness=up)
    town.expect((250.0, 0.0, height), (150.0, 0.0, 2.0 * height), read=2)


@maker
def meshes(town: Town, draw: Any, left: float, height: float) -> None:
    """A box as a mesh, a polyface mesh, or faces that meet."""
    size, place = town.scaled(20, 10, height), town.scaled(left, 0, town.zero_m)
    mesh = cube(center=False).scale(*size).translate(*place)
    way = draw(st.sampled_from(("mesh", "polyface", "3dface")))
    attributes = {"layer": "BLD"}
    if way == "mesh":
        mesh.render_mesh(town.space, dxfattribs=attributes)
    elif way == "polyface":
        mesh.render_polyface(town.space, dxfattribs=attributes)
    else:
        mesh.render_3dfaces(town.space, dxfattribs=attributes)
    faces = 6 if way == "3dface" else 1
    town.expect((200.0, 0.0, height), merged=faces - 1)


@maker
def stepped_mesh(town: Town, draw: Any, left: float, height: float) -> None:
    """A tower and a podium side by side as faces that meet."""
    low = cube(center=False).scale(*town.scaled(20, 10, height))
    low.translate(*town.scaled(left, 0, town.zero_m)).render_3dfaces(
        town.space, dxfattribs={"layer": "BLD"}
    )
    high = cube(center=False).scale(*town.scaled(10, 10, height + 4.0))
    high.translate(*town.scaled(left + 20, 0, town.zero_m)).render_3dfaces(
        town.space, dxfattribs={"layer": "BLD"}
    )
    town.expect((200.0, 0.0, height), (100.0, 0.0, height + 4.0), merged=11)


@maker
def round_one(town: Town, draw: Any, left: float, height: float) -> None:
    up = draw(st.sampled_from((1.0, -1.0)))  # the direction of extrusion
    centre = town.scaled(up * (left + 10.0), 5.0, up * town.zero_m)
    more = {"layer": "BLD", "thickness": up * town.unit * height, "extrusion": (0.0, 0.0, up)}
    town.space.add_circle(centre, town.unit * 5.0, dxfattribs=more)
    town.expect((78.54, 0.0, height))


@maker
def stretched(town: Town, draw: Any, left: float, height: float) -> None:
    """A round tower in a block that is stretched along one axis."""
    block = town.document.blocks.new(f"OVAL{town.lots}")
    rise = town.unit * height
    block.add_circle(town.scaled(5.0, 5.0), town.unit * 5.0, {"layer": "0", "thickness": rise})
    turn = draw(st.sampled_from((0.0, 90.0)))
    place = town.scaled(left + 10.0, 0.0, town.zero_m)
    scales = {"xscale": 2.0, "rotation": turn, "layer": "BLD"}
    town.space.add_blockref(block.name, place, dxfattribs=scales)
    town.expect((157.08, 0.0, height))


@maker
def joined(town: Town, draw: Any, left: float, height: float) -> None:
    corners = [(*town.scaled(*place), 0.0) for place in rectangle(left, 0, 20, 10)]
    for one, other in zip(corners, corners[1:] + corners[:1], strict=True):
        town.space.add_line(one, other, dxfattribs={"layer": "BLD"})
    town.expect((200.0, 0.0, 6.0), merged=3)


@maker
def named(town: Town, draw: Any, left: float, height: float) -> None:
    extruded(town, draw, left, height)
    up = draw(st.sampled_from((1.0, -1.0)))
    more = {"layer": "TXT", "extrusion": (0.0, 0.0, up)}
    text = town.space.add_text("A", height=town.unit, dxfattribs=more)
    text.set_placement(town.scaled(up * (left + 10.0), 5.0))
    town.expect(read=1)


@maker
def beside(town: Town, draw: Any, left: float, height: float) -> None:
    """What is of no use, with the reason."""
    town.space.add_text("A", dxfattribs={"layer": "TXT"}).set_placement(town.scaled(left, 30))
    town.space.add_line(town.scaled(left, 30), town.scaled(left + 5, 30), {"layer": "BLD"})
    town.space.add_arc(town.scaled(left, 30), town.unit * 4, 0, 90, dxfattribs={"layer": "BLD"})
    town.space.add_point(town.scaled(left, 30), dxfattribs={"layer": "BLD"})
    town.space.add_ray(town.scaled(left, 30), (0.0, 1.0), dxfattribs={"layer": "BLD"})
    town.outline(town.space, (left, 20, 9, 9), 0.0, layer="TREES")
    town.outline(town.space, (left, 20, 9, 9), 0.0, invisible=1)
    town.expect(read=0, passed=2, left_out=5)


@maker
def hidden_block(town: Town, draw: Any, left: float, height: float) -> None:
    block = town.document.blocks.new(f"STATES{town.lots}")
    town.outline(block, (0, 0, 20, 10), 0.0, thickness=town.unit * height)
    town.outline(block, (0, 0, 40, 20), 0.0, thickness=town.unit * height, invisible=1)
    place = town.scaled(left, 0.0, town.zero_m)
    town.space.add_blockref(block.name, place, dxfattribs={"layer": "BLD"})
    town.expect((200.0, 0.0, height), left_out=1)


@st.composite
def towns(draw: Any) -> Town:
    """Return a town of some of the makers, with a house that says what the zero is."""
    code = draw(st.sampled_from(sorted(UNITS)))
    town = Town(UNITS[code], draw(st.sampled_from((0.0, 431.0, -430.0))))
    town.document.units = code
    town.outline(town.space, (0, 0, 20, 10), town.zero_m, thickness=town.unit * 6.0)
    town.expect((200.0, 0.0, 6.0))
    for make in draw(st.lists(st.sampled_from(MAKERS), max_size=4)):
        make(town, draw, town.lot(), draw(st.integers(8, 40)) / 2.0)
    return town


def imported(town: Town, folder: Path) -> SiteImport:
    path = folder / "town.dxf"
    town.document.saveas(path)
    place = town.scaled(-6.0, 5.0)
    options = ImportOptions(
        buildings_from=("BLD",),
        charge_at=((place[0], place[1]),),
        protect_near=(0.0, 0.0),
        default_height_m=6.0,
    )
    return import_site(path, options)


@given(towns())
def test_every_entity_has_its_fate_and_every_building_its_solid(
    tmp_path_factory: pytest.TempPathFactory, town: Town
) -> None:
    site = imported(town, tmp_path_factory.mktemp("drawn"))
    entries = site.ledger.of(*FATES)
    assert len({entry.place for entry in entries}) == len(entries)
    assert sorted(entry.fate for entry in entries) == sorted(town.fates)
    solids = [
        (building.outline.area, building.base_m, building.height_m) for building in site.buildings
    ]
    expected = sorted(town.boxes)
    rounded = sorted((round(area, 1), base, height) for area, base, height in solids)
    assert [box[1:] for box in rounded] == [box[1:] for box in expected]
    assert [box[0] for box in rounded] == pytest.approx([box[0] for box in expected], rel=0.02)
