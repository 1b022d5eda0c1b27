"""Maps that cannot be used, and choices that do not fit them: each a clear error."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import ezdxf
import pytest
from ezdxf import units

from blast_env.errors import BlastEnvError
from blast_env.io.importing import Fate, ImportOptions, import_site, osm, site_map
from tests.io.importing.maps import BLOCK, LAYERS, Places, charge, line, outline, rectangle, written

HALL = ImportOptions(protect=("Town Hall",))
HOUSE = outline(rectangle(0, 0, 6, 4), name="House", protected=True)
PLACE = charge(12.0, 2.0)
BOW: Places = [(0, 0), (6, 4), (6, 0), (0, 4)]


def square(low_m: float, high_m: float) -> list[list[float]]:
    corners = ((low_m, low_m), (high_m, low_m), (high_m, high_m), (low_m, high_m))
    return [[*corner] for corner in (*corners, corners[0])]


def error_of(path: Path, options: ImportOptions | None = None, **others: Any) -> str:
    """Return the message of the error, which names the file."""
    with pytest.raises(BlastEnvError) as caught:
        import_site(path, options or ImportOptions(**others))
    return str(caught.value)


def error_of_options(**options: Any) -> str:
    with pytest.raises(BlastEnvError) as caught:
        ImportOptions(**options)
    return str(caught.value)


def drawing(folder: Path, unit: int = units.M) -> tuple[Path, Any]:
    document = ezdxf.filemanagement.new("R2010", units=unit)
    return folder / "plan.dxf", document


# Files.


def test_missing_file_is_named(tmp_path: Path) -> None:
    assert error_of(tmp_path / "no.dxf") == f"{tmp_path / 'no.dxf'}: there is no such file"


def test_folder_and_unknown_suffix_are_named(tmp_path: Path) -> None:
    (tmp_path / "a.geojson").mkdir()
    assert error_of(tmp_path / "a.geojson").endswith("is a folder, must be a file")
    assert "suffix is '.gml', must be one of .geojson, .json, .cityjson" in error_of(
        tmp_path / "a.gml"
    )


def test_large_files_are_refused_before_they_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "large.geojson"
    with path.open("wb") as file:
        file.truncate(site_map.MOST_BYTES + 1)  # takes no room on the disk
    assert "has 50000001 bytes, must have at most 50000000" in error_of(path)
    monkeypatch.setattr(site_map, "MOST_FEATURES", 3)
    for suffix, options in ((".geojson", HALL), (".osm", HALL), (".dxf", replace(HALL, **LAYERS))):
        assert "outlines and lines, must have at most" in error_of(
            BLOCK.with_suffix(suffix), options
        )
    monkeypatch.setattr(site_map, "MOST_FEATURES", 1000)
    monkeypatch.setattr(site_map, "MOST_POINTS", 10)
    assert "than 10 points, must have at most that many" in error_of(BLOCK)


@pytest.mark.parametrize(
    ("document", "words"),
    [
        ([], "is list, must be a GeoJSON object"),
        ({"type": "Topology"}, "type is 'Topology', must be 'FeatureCollection'"),
        ({"type": "FeatureCollection"}, "features is missing or no array"),
        ({"type": "FeatureCollection", "features": [3]}, "features[0]: is not a Feature"),
    ],
)
def test_json_that_is_no_geojson(document: object, words: str, tmp_path: Path) -> None:
    path = tmp_path / "a.geojson"
    path.write_text(json.dumps(document))
    assert words in error_of(path)


@pytest.mark.parametrize(
    ("geometry", "words"),
    [
        ({"type": "Circle"}, "features[0].geometry: type is 'Circle', must be one of Point"),
        ({"type": "Polygon"}, "features[0].geometry: cannot be read as a geometry"),
        ({"type": "Polygon", "coordinates": [[[0, 0], [1, 1]]]}, "cannot be read as a geometry"),
        (
            {"type": "Polygon", "coordinates": [[["a", 0], [1, 1], [1, 0], ["a", 0]]]},
            "as a geometry",
        ),
        (
            {"type": "Point", "coordinates": [float("nan"), 1.0]},
            "features[0]: has the coordinate nan, must be within 1e+12",
        ),
        (
            {"type": "Point", "coordinates": [10**400, 1.0]},
            "features[0].geometry: cannot be read as a geometry: int too large",
        ),
        (
            {
                "type": "GeometryCollection",
                "geometries": [{"type": "Point", "coordinates": [0.0, -1e300]}],
            },
            "coordinate -1e+300, must be within",
        ),
        (
            {"type": "LineString", "coordinates": [[0, 0], [float("inf"), 1.0]]},
            "coordinate inf, must be within",
        ),
        ({"type": "Point", "coordinates": [1.0, -1e308]}, "coordinate -1e+308, must be within"),
        (7, "type is 7, must be one of Point"),
    ],
)
def test_geometry_that_is_none(geometry: Any, words: str, tmp_path: Path) -> None:
    feature = {"type": "Feature", "properties": {"building": "yes"}, "geometry": geometry}
    assert words in error_of(written(tmp_path, feature))


# Coordinates.


def test_wrong_reference_systems_are_named(tmp_path: Path) -> None:
    assert "pyproj does not know" in error_of(BLOCK, replace(HALL, crs="EPSG:1"))
    assert "crs: has no properties.name" in error_of(written(tmp_path, HOUSE, crs=4))
    assert "--crs is not for OpenStreetMap" in error_of(
        BLOCK.with_suffix(".osm"), replace(HALL, crs="EPSG:4326")
    )
    assert "--units is not for GeoJSON" in error_of(BLOCK, replace(HALL, units="m"))


def test_units_of_a_drawing_are_needed(tmp_path: Path) -> None:
    path, document = drawing(tmp_path, unit=0)
    document.modelspace().add_lwpolyline(rectangle(0, 0, 6, 4), close=True)
    document.saveas(path)
    assert "does not say its unit ($INSUNITS is 0); say it with --units" in error_of(path)
    assert "units is 'mmm', did you mean 'mm'?" in error_of(path, units="mmm")
    document.units = 12  # astronomical units and the like
    document.saveas(path)
    assert "$INSUNITS is 12, which is none of m, mm" in error_of(path)


# Sites.


def test_map_without_buildings(tmp_path: Path) -> None:
    assert "is empty: it has no outline" in error_of(written(tmp_path))
    assert "has no building" in error_of(written(tmp_path, PLACE))
    path, document = drawing(tmp_path)
    document.modelspace().add_lwpolyline(
        rectangle(0, 0, 6, 4), close=True, dxfattribs={"layer": "WALLS"}
    )
    document.saveas(path)
    assert "define them with --buildings-from" in error_of(path)
    assert "there is no building on the site: the file has none" in error_of(
        written(tmp_path, PLACE), origin=(0.0, 0.0), size_m=(20.0, 20.0)
    )
    assert "lie elsewhere, or are smaller" in error_of(
        written(tmp_path, PLACE, HOUSE), origin=(11.0, 0.0), size_m=(20.0, 20.0)
    )


def test_outlines_that_cross_themselves(tmp_path: Path) -> None:
    path = written(tmp_path, outline(BOW, name="bow", protected=True), PLACE)
    message = "features[0] (bow): the outline is not sound: self-intersection; --repair"
    assert message in error_of(path)
    site = import_site(path, ImportOptions(repair=True))
    assert "corrected: 1" in site.notes[0]
    assert site.buildings[0].outline.area == pytest.approx(12.0)


@pytest.mark.parametrize(
    ("rings", "area_m2"),
    [
        ([[square(0, 20)], [square(10, 30)]], 700.0),  # two houses that overlap
        ([[square(0, 20), square(10, 24)]], 300.0),  # a courtyard that sticks out
        ([[square(0, 20), square(30, 34)]], 400.0),  # a courtyard outside
        ([[square(0, 20), square(4, 12), square(8, 16)]], 288.0),  # courtyards that overlap
    ],
)
def test_a_repair_covers_what_lies_in_an_outline_and_in_no_courtyard(
    rings: Any, area_m2: float, tmp_path: Path
) -> None:
    geometry = {"type": "MultiPolygon", "coordinates": rings}
    tags = {"building": "yes", "protected": True}
    feature = {"type": "Feature", "properties": tags, "geometry": geometry}
    options = ImportOptions(repair=True, crs="local", charge_at=((-8.0, -8.0),))
    site = import_site(written(tmp_path, feature), options)
    assert sum(part.polygon.area for part in site.buildings[0].polygons) == pytest.approx(area_m2)


def test_site_that_is_too_large(tmp_path: Path) -> None:
    far = outline(rectangle(2500, 0, 6, 4))
    message = error_of(written(tmp_path, HOUSE, far, PLACE))
    assert "the site would be 2,526 x 24 m, must be at most 2000 m long and wide" in message
    assert "--centre or --origin, and --size" in message
    lon_lat = [
        outline([(x + 0.1, y) for x, y in rectangle(lon, 54.8, 0.0001, 0.0001)]) for lon in (7, 100)
    ]
    assert "--centre or --origin, and --size" in error_of(
        written(tmp_path, *lon_lat, coordinate_system="")
    )


def test_a_building_that_modules_cannot_show_is_named(tmp_path: Path) -> None:
    tower = outline([*rectangle(0, 0, 6, 4)[:3], (3.2, 4), (3.2, 7), (2.9, 7), (2.9, 4), (0, 4)])
    thin = outline(rectangle(10, 0, 20, 0.4), name="wall")
    house = HOUSE | {"geometry": outline(rectangle(20, 8, 6, 4))["geometry"]}
    site = import_site(written(tmp_path, tower, house, thin, PLACE), ImportOptions())
    off = [entry.name for entry in site.ledger.of(Fate.GUESSED) if "modules miss" in entry.kind]
    assert "building_1" in off
    assert "wall" in (*off, *(entry.name for entry in site.ledger.of(Fate.LEFT_OUT)))


def test_a_site_of_too_many_buildings(tmp_path: Path) -> None:
    houses = [outline(rectangle(8.0 * k, 0, 3, 3)) for k in range(101)]
    path = written(tmp_path, *houses, PLACE)
    message = error_of(path, protect_near=(0.0, 0.0))
    assert "there are 101 buildings on the site, must be at most 100" in message


def test_choices_that_name_nothing(tmp_path: Path) -> None:
    path = written(tmp_path, outline(rectangle(0, 0, 6, 4), name="House"), PLACE)
    assert "--protect is 'Hous', but there are House" in error_of(path, protect=("Hous",))
    assert (
        "no building is protected: say --protect NAME or --protect-near X,Y; there are House"
        in (error_of(path))
    )
    assert "nothing on the site is chosen by --zone-from" in error_of(
        path, protect=("House",), zone_from=("zone",)
    )
    assert "'=x' chooses nothing, must be KEY or KEY=VALUE" in error_of(path, zone_from=("=x",))
    lonely = written(tmp_path, HOUSE)
    assert "no place for a charge on the site clear of buildings: say --charge-at" in error_of(
        lonely
    )
    assert "--charge-at is 3,2, which is at (13.00, 12.00) m of the site" in error_of(
        lonely, charge_at=((3.0, 2.0),)
    )
    assert "the build zone is not on the site" in error_of(
        written(tmp_path, HOUSE, PLACE, outline(rectangle(35, 0, 4, 4), kind="build_zone")),
        origin=(-5.0, -5.0),
        size_m=(30.0, 20.0),
    )
    assert "--zone is x 0 to 90 m, y 0 to 9 m, must lie on the site" in error_of(
        path, protect=("House",), zone_m=(0.0, 0.0, 90.0, 9.0)
    )


def test_options_out_of_bounds_are_named() -> None:
    assert error_of_options(margin_m=-1.0) == "--margin is -1, must be 0 to 2000"
    assert error_of_options(tnt_kg=-5.0) == "--tnt-kg is -5, must be 0.01 to 100000"
    assert error_of_options(size_m=(1.0, 50.0), centre=(0, 0)) == "--size is 1, must be 2 to 2000 m"
    assert "--origin needs --size" in error_of_options(origin=(0.0, 0.0))
    assert "--size needs --origin or --centre" in error_of_options(size_m=(20.0, 20.0))
    both = {"origin": (0.0, 0.0), "centre": (0.0, 0.0), "size_m": (9.0, 9.0)}
    assert "--origin and --centre exclude each other" in error_of_options(**both)
    assert "exclude each other" in error_of_options(zone_m=(0, 0, 1, 1), zone_around_m=3.0)
    assert "exclude each other" in error_of_options(zone_from=("a",), zone_around_m=3.0)
    assert "nan" in error_of_options(default_height_m=float("nan"))


def test_streets_of_too_many_bends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bends are made straighter until a scenario takes them, as far as that goes."""
    curve = [[x, 14.0 + 3.0 * (-1) ** (x // 4) + 0.2 * (-1) ** x] for x in range(-8, 15)]
    path = written(tmp_path, HOUSE, line(curve, highway="service"))
    options = ImportOptions(margin_m=20.0)
    assert len(import_site(path, options).scenario.charge) > 12
    monkeypatch.setattr("blast_env.io.importing.ground.MOST_SOURCES", 12)
    assert len(import_site(path, options).scenario.charge) <= 12
    monkeypatch.setattr("blast_env.io.importing.ground.MOST_SOURCES", 2)
    assert "places, must be at most 2: make the site smaller" in error_of(path, options)


def test_extract_that_cuts_a_building_says_so(tmp_path: Path) -> None:
    text = BLOCK.with_suffix(".osm").read_text()
    line = next(line for line in text.splitlines() if '<node id="7"' in line)
    path = tmp_path / "cut.osm"
    path.write_text(text.replace(f"{line}\n", ""))
    site = import_site(path, HALL)
    (cut,) = (entry for entry in site.ledger.of(Fate.LEFT_OUT) if entry.kind == osm.CUT)
    assert (cut.place, cut.name) == ("way 2", "Baker")
    assert "Baker" not in [building.name for building in site.buildings]
    assert "--protect is 'baker', which is left out: way 2" in error_of(
        path, replace(HALL, protect=("baker",))
    )
