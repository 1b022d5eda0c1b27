"""Every element of a random building model has the fate that it must have, once, and its solid.

`pytest tests/io/importing/test_random_models.py --hypothesis-profile many` imports 2,000 models.
"""

from collections import Counter
from collections.abc import Callable
from typing import Any

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from blast_env.io.importing import FATES, Fate
from tests.io.importing.models import LOT_M, TURNS_DEG, UNITS, WALL_M, WAYS, Model

TURNS = st.sampled_from(TURNS_DEG)

Maker = Callable[[Model, Any], None]
MAKERS: list[Maker] = []


def maker(function: Maker) -> Maker:
    MAKERS.append(function)
    return function


def house(model: Model, draw: Any, name: str = "") -> None:
    """Add a house of storeys with windows, outer and inner ones, and levels between them."""
    count, rise = draw(st.integers(1, 5)), draw(st.sampled_from((3.0, 3.5, 4.0)))
    x, y = draw(st.integers(12, 30)), draw(st.integers(8, 20))
    between = [rise * (k + 0.5) for k in range(count)] if draw(st.booleans()) else []
    floors = [rise * k for k in range(count)]
    levels = model.building([*floors, *between], name, draw(TURNS))[:count]
    has_roof, is_whole = draw(st.booleans()) or count == 1, draw(st.booleans())
    if is_whole:
        model.walls(levels[0], 0.0, (x, y, rise * count))
    large, small = draw(st.booleans()), draw(st.booleans())
    for number, level in enumerate(levels):
        if not is_whole:
            model.walls(level, 0.0, (x, y, rise))
        if number:
            model.slab(level, 0.0, (x, y), 0.0)
        depth = draw(st.sampled_from((0.0, 0.1, 0.3)))
        if large:
            model.box("IfcWindow", level, (2.0, 0.0, 0.8), (2.4, depth, 1.8), Fate.MERGED)
        if small:
            model.box("IfcWindow", level, (6.0, 0.0, 1.0), (0.8, depth, 0.8), Fate.MERGED)
        if draw(st.booleans()):
            place = (3.0, 0.5 * y, 0.5)
            model.box("IfcWindow", level, place, (5.0, 0.1, 2.0), Fate.MERGED)
    if has_roof:
        model.slab(levels[-1], 0.0, (x, y), rise)
    model.boxes.append((x * y, 0.0, rise * count))
    if large or small:
        model.panes.append((count, 2.4, 1.8) if large else (count, 0.8, 0.8))


MAKERS.append(house)


@maker
def tower(model: Model, draw: Any) -> None:
    """A tower on a podium, in one building."""
    (level,) = model.building([0.0], turn_deg=draw(TURNS))
    low, high = draw(st.integers(6, 16)) / 2.0, draw(st.integers(24, 90)) / 2.0
    model.walls(level, 0.0, (16.0, 12.0, high))
    model.slab(level, 0.0, (16.0, 12.0), high)
    model.walls(level, 16.0, (20.0, 12.0, low))
    model.slab(level, 16.0, (20.0, 12.0), low)
    model.boxes += [(192.0, 0.0, high), (240.0, 0.0, low)]
    if draw(st.booleans()):
        model.box("IfcWindow", level, (36.0 - WALL_M, 3.0, 1.0), (0.1, 1.5, 1.2), Fate.MERGED)
        model.panes.append((1, 1.5, 1.2))


@maker
def passage(model: Model, draw: Any) -> None:
    """Two blocks with storeys over a passage between them."""
    (level,) = model.building([0.0], turn_deg=draw(TURNS))
    base, top = draw(st.integers(7, 10)) / 2.0, draw(st.integers(16, 30)) / 2.0
    for left in (0.0, 18.0):
        model.walls(level, left, (10.0, 12.0, top))
    model.box("IfcSlab", level, (10.0, 0.0, base), (8.0, 12.0, 0.2), Fate.MERGED)
    model.slab(level, 0.0, (28.0, 12.0), top)
    model.boxes += [(120.0, 0.0, top), (120.0, 0.0, top), (96.0, base, top)]


@maker
def eaves(model: Model, draw: Any) -> None:
    """A house whose roof reaches beyond its walls, with a chimney and a slab in front of it."""
    (level,) = model.building([0.0], turn_deg=draw(TURNS))
    top = draw(st.integers(6, 16)) / 2.0
    model.walls(level, 0.0, (20.0, 10.0, top))
    low = (-0.6, -0.6, top - 0.2)
    model.box("IfcSlab", level, low, (21.2, 11.2, 0.2), Fate.MERGED)
    model.box("IfcWall", level, (5.0, 5.0, top), (1.0, 1.0, 3.0), Fate.MERGED)
    model.box("IfcSlab", level, (-5.0, -15.0, -0.2), (30.0, 13.0, 0.25), Fate.LEFT_OUT)
    model.boxes.append((200.0, 0.0, top))


@maker
def lived_in(model: Model, draw: Any) -> None:
    """A house with what is no part of it, a basement, and a curtain wall before it."""
    _, level = model.building([-3.0, 0.0], turn_deg=draw(TURNS))
    model.walls(level, 0.0, (20.0, 10.0, 12.0), low=-3.0)
    model.slab(level, 0.0, (20.0, 10.0), 9.0)
    model.box("IfcColumn", level, (5.0, 5.0, 0.0), (0.4, 0.4, 9.0), Fate.LEFT_OUT)
    model.box("IfcFurnishingElement", level, (5.0, 3.0, 0.0), (0.4, 0.4, 0.9), Fate.LEFT_OUT)
    model.box("IfcSpace", level, (1.0, 1.0, 0.0), (18.0, 8.0, 3.0), Fate.PASSED)
    model.box("IfcDoor", level, (5.0, 0.0, 0.0), (1.0, 0.2, 2.0), Fate.LEFT_OUT)
    model.box("IfcCurtainWall", level, (2.0, -0.1, 0.5), (16.0, 0.1, 8.0), Fate.MERGED)
    hole = model.box("IfcOpeningElement", level, (7.0, 0.0, 1.0), (1.0, 0.3, 1.0), Fate.PASSED)
    wall = model.file.by_type("IfcWall")[-4]
    link = model._rooted("IfcRelVoidsElement", "")
    link.RelatingBuildingElement, link.RelatedOpeningElement = wall, hole
    model.boxes.append((201.6, 0.0, 9.0))  # with the curtain wall


@maker
def window_of_parts(model: Model, draw: Any) -> None:
    """A window without a shape of its own, as of a frame and a pane."""
    (level,) = model.building([0.0], turn_deg=draw(TURNS))
    model.walls(level, 0.0, (20.0, 10.0, 6.0))
    model.slab(level, 0.0, (20.0, 10.0), 6.0)
    window = model.box("IfcWindow", level, (0.0, 0.0, 0.0), (1.0, 0.1, 1.0), Fate.MERGED)
    window.Representation = None
    parts = [
        model.box("IfcMember", level, (3.0, 0.0, 1.0), (0.1, 0.1, 2.0), Fate.MERGED),
        model.box("IfcPlate", level, (3.1, 0.0, 1.0), (1.4, 0.1, 2.0), Fate.MERGED),
    ]
    for part in parts:
        model.file.remove(part.ContainedInStructure[0])
    model._whole(window, parts)
    model.boxes.append((200.0, 0.0, 6.0))
    model.panes.append((1, 1.5, 2.0))


@maker
def walls_of_the_site(model: Model, draw: Any) -> None:
    height = draw(st.integers(2, 12)) / 2.0
    left = LOT_M * model.lots
    model.lots += 1
    zero = (left, 0.0, model.storeys_m)
    model.box("IfcWall", model.site, zero, (20.0, 1.0, height), Fate.READ)
    model.boxes.append((20.0, 0.0, height))


@st.composite
def models(draw: Any) -> Model:
    """Return a model of a house and some of the makers."""
    site_m, storeys_m = draw(
        st.sampled_from(((0.0, 0.0), (431.0, 0.0), (0.0, 431.0), (0.0, -80.0)))
    )
    schema = draw(st.sampled_from(("IFC2X3", "IFC4", "IFC4X3")))
    ways = draw(st.lists(st.sampled_from(WAYS), min_size=1, max_size=5))
    found = Model(draw(st.sampled_from(sorted(UNITS))), site_m, storeys_m, schema, ways)
    house(found, draw, "Town Hall")
    for make in draw(st.lists(st.sampled_from(MAKERS), max_size=3)):
        if make is lived_in and storeys_m:
            continue  # with a basement, the lowest storey is not the ground
        make(found, draw)
    return found


@given(models())
def test_every_element_has_its_fate_and_every_building_its_solid(
    tmp_path_factory: pytest.TempPathFactory, model: Model
) -> None:
    site = model.imported(tmp_path_factory.mktemp("models"))
    entries = site.ledger.of(*FATES)
    assert Counter(entry.place for entry in entries).most_common(1)[0][1] == 1
    assert {entry.place: entry.fate for entry in entries} == model.fates
    solids = sorted(
        (round(part.area, 1), building.base_m, building.height_m)
        for building in site.buildings
        for part in shapely.get_parts(building.outline)
    )
    expected = sorted(model.boxes)
    assert [box[1:] for box in solids] == [box[1:] for box in expected]
    assert [box[0] for box in solids] == pytest.approx([box[0] for box in expected], rel=0.01)
    panes = sorted(
        (int(building.facade["storeys"]), building.facade["width"], building.facade["height"])
        for building in site.buildings
        if building.facade
    )
    assert panes == sorted(model.panes)
