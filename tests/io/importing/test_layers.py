"""GeoPackage, shapefile, FlatGeobuf, KML and GeoParquet: the site of the same map in GeoJSON."""

import json
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pyogrio
import pytest
import shapely
from shapely.geometry import shape

from blast_env.errors import BlastEnvError
from blast_env.io.importing import Fate, ImportOptions, SiteImport, import_site

MARKET = Path("docs/data/market_street.geojson")
OPTIONS = ImportOptions(protect=("Town Hall",))


@cache
def features() -> tuple[dict[str, Any], ...]:
    return tuple(json.loads(MARKET.read_text(encoding="utf-8"))["features"])


def is_outline(feature: dict[str, Any]) -> bool:
    return bool(feature["geometry"]["type"] == "Polygon")


def write(
    path: Path,
    chosen: Sequence[dict[str, Any]],
    layer: str = "map",
    crs: str | None = "EPSG:4326",
    append: bool = False,
) -> Path:
    """Write features of one kind of geometry by GDAL."""
    names = sorted({name for feature in chosen for name in feature["properties"]})
    columns = [
        np.array([feature["properties"].get(name) for feature in chosen], dtype=object)
        for name in names
    ]
    columns = [
        np.array([None if value is None else str(value) for value in column], dtype=object)
        for column in columns
    ]
    geometries = [shapely.to_wkb(shape(feature["geometry"])) for feature in chosen]
    pyogrio.raw.write(
        path,
        np.array(geometries, dtype=object),
        columns,
        names,
        layer=layer,
        driver="KML" if path.suffix == ".kml" else None,
        geometry_type=chosen[0]["geometry"]["type"] if chosen else "Polygon",
        crs=crs,
        append=append,
    )
    return path


def as_geojson(path: Path, chosen: Sequence[dict[str, Any]]) -> Path:
    document = {"type": "FeatureCollection", "features": [*chosen]}
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


def sizes(found: SiteImport) -> list[tuple[float, float]]:
    """Return area and height of each building."""
    return [
        (round(sum(part.polygon.area for part in building.polygons), 6), building.wall_height_m)
        for building in found.buildings
    ]


def test_a_geopackage_of_two_layers_is_the_map(tmp_path: Path) -> None:
    outlines = [feature for feature in features() if is_outline(feature)]
    others = [feature for feature in features() if not is_outline(feature)]
    path = write(tmp_path / "market_street.gpkg", outlines, "buildings")
    write(path, others, "roads", append=True)
    found = import_site(path, OPTIONS)
    assert found.scenario.content_hash == import_site(MARKET, OPTIONS).scenario.content_hash
    places = {building.place for building in found.buildings}
    assert all(place.startswith("buildings[") for place in places)


def test_a_layer_is_chosen_by_its_name(tmp_path: Path) -> None:
    """Plots and houses of equal tags: only the houses are built."""
    house = {"type": "Feature", "geometry": features()[0]["geometry"], "properties": {"id": 1}}
    path = write(tmp_path / "town.gpkg", [house], "plots")
    outlines = [feature for feature in features() if is_outline(feature)]
    others = [feature for feature in features() if not is_outline(feature)]
    write(path, outlines, "houses", append=True)
    write(path, others, "roads", append=True)
    found = import_site(path, replace(OPTIONS, buildings_from=("Layer=houses",)))
    assert {building.place.partition("[")[0] for building in found.buildings} == {"houses"}


@pytest.mark.filterwarnings("ignore:Normalized/laundered field name")  # of ten letters
@pytest.mark.parametrize("suffix", [".shp", ".fgb", ".kml"])
def test_outlines_of_other_formats_have_the_same_areas_and_heights(
    suffix: str, tmp_path: Path
) -> None:
    outlines = [feature for feature in features() if is_outline(feature)]
    x, y = np.mean([shape(feature["geometry"]).bounds[:2] for feature in outlines], axis=0)
    options = ImportOptions(protect=("Town Hall",), charge_at=((float(x), float(y)),))
    plain = import_site(as_geojson(tmp_path / "plain.geojson", outlines), options)
    found = import_site(write(tmp_path / f"map{suffix}", outlines), options)
    assert sizes(found) == sizes(plain)


@pytest.mark.parametrize("crs", ["unsaid", "EPSG:4326"])
def test_geoparquet_is_the_map(crs: str, tmp_path: Path) -> None:
    rows: list[dict[str, Any]] = [
        {
            "tags": {name: str(value) for name, value in feature["properties"].items()},
            "bbox": {"xmin": 0.0, "ymin": 0.0, "xmax": 1.0, "ymax": 1.0},
            "geometry": shapely.to_wkb(shape(feature["geometry"])),
        }
        for feature in features()
    ]
    column = {"encoding": "WKB", "geometry_types": []}
    if crs != "unsaid":
        column["crs"] = pyproj_json(crs)
    geo = {"version": "1.1.0", "primary_column": "geometry", "columns": {"geometry": column}}
    kinds = pa.schema(
        {
            "tags": pa.map_(pa.string(), pa.string()),
            "bbox": pa.struct({side: pa.float64() for side in ("xmin", "ymin", "xmax", "ymax")}),
            "geometry": pa.binary(),
        },
        metadata={"geo": json.dumps(geo)},
    )
    table = pa.Table.from_pylist(
        [{**row, "tags": [*row["tags"].items()]} for row in rows], schema=kinds
    )
    path = tmp_path / "market_street.parquet"
    pq.write_table(table, path)
    found = import_site(path, OPTIONS)
    assert found.scenario.content_hash == import_site(MARKET, OPTIONS).scenario.content_hash


def pyproj_json(crs: str) -> Any:
    from pyproj import CRS

    return CRS(crs).to_json_dict()


def test_layers_without_a_reference_system_are_refused(tmp_path: Path) -> None:
    outlines = [feature for feature in features() if is_outline(feature)]
    with pytest.warns(UserWarning, match="'crs' was not provided"):
        path = write(tmp_path / "plain.fgb", outlines, crs=None)
    with pytest.raises(BlastEnvError, match="no reference system: say --crs"):
        import_site(path, OPTIONS)


def test_layers_of_two_reference_systems_are_refused(tmp_path: Path) -> None:
    outlines = [feature for feature in features() if is_outline(feature)]
    path = write(tmp_path / "two.gpkg", outlines, "here")
    write(path, outlines, "there", crs="EPSG:25832", append=True)
    for options in (OPTIONS, replace(OPTIONS, crs="EPSG:25832")):
        with pytest.raises(BlastEnvError, match=r"2 reference systems.* here: EPSG:4326.*-t_srs"):
            import_site(path, options)


def test_an_empty_layer_has_no_say_and_an_empty_file_says_so(tmp_path: Path) -> None:
    outlines = [feature for feature in features() if is_outline(feature)]
    path = write(tmp_path / "empty.gpkg", [], "nothing", crs="EPSG:25832")
    with pytest.raises(BlastEnvError, match="is empty: it has no outline, line or point"):
        import_site(path, OPTIONS)
    write(path, outlines, "here", append=True)
    with pytest.raises(BlastEnvError, match="no place for a charge"):  # its buildings are read
        import_site(path, OPTIONS)


@pytest.mark.parametrize("suffix", [".dbf", ".shx"])
def test_a_shapefile_that_came_alone_is_refused(suffix: str, tmp_path: Path) -> None:
    """Without its table all heights would be guesses, as of a map that has none."""
    path = tmp_path / "town [1].shp"
    for suffix_of_file in {".shp", ".SHX", ".dbf", ".shx"} - {suffix, suffix.upper()}:
        path.with_suffix(suffix_of_file).touch()
    with pytest.raises(BlastEnvError, match=f"several files, of which {suffix} must lie beside it"):
        import_site(path, OPTIONS)


def test_parquet_without_geometries_says_so(tmp_path: Path) -> None:
    path = tmp_path / "table.parquet"
    pq.write_table(pa.table({"a": [1]}), path)
    with pytest.raises(BlastEnvError, match="Parquet without geometries: its metadata has no"):
        import_site(path)


@pytest.mark.parametrize("suffix", [".gpkg", ".shp", ".fgb", ".kml", ".parquet"])
def test_what_is_no_such_file_is_a_plain_error(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"broken{suffix}"
    path.write_bytes(b"this is no map")
    for beside in (".dbf", ".shx"):
        path.with_suffix(beside).touch()
    with pytest.raises(BlastEnvError, match="cannot be read as") as caught:
        import_site(path)
    assert "DRIVER" not in str(caught.value)


def shapefile(folder: Path, **fields: Any) -> Path:
    """Write two houses with these fields, whose names GDAL cuts after ten letters."""
    path = folder / "houses.shp"
    houses = [shapely.box(x, 5.5e6, x + 20.0, 5.5e6 + 20.0) for x in (500_000.0, 500_040.0)]
    columns = {"building": "yes", "name": "House", **fields}
    with pytest.warns(RuntimeWarning, match="Normalized"):
        pyogrio.raw.write(
            path,
            shapely.to_wkb(np.array(houses)),
            [np.array([value] * 2, dtype=object) for value in columns.values()],
            [*columns],
            geometry_type="Polygon",
            crs="EPSG:25832",
        )
    return path


@pytest.mark.parametrize(
    ("fields", "height_m"),
    [
        ({"measuredHeight": "15"}, 15.0),
        ({"building:height": "15"}, 15.0),
        ({"building_height": "15"}, 15.0),
        ({"building:levels": "5"}, 15.0),
    ],
)
def test_heights_whose_names_a_shapefile_has_cut_are_read(
    fields: dict[str, str], height_m: float, tmp_path: Path
) -> None:
    options = ImportOptions(protect=("House",), charge_at=((500_010.0, 5.5e6 - 5.0),))
    site = import_site(shapefile(tmp_path, **fields), options)
    assert {building.height_m for building in site.buildings} == {height_m}
    assert not site.ledger.of(Fate.GUESSED)


def test_storeys_that_may_be_cellars_are_a_guess(tmp_path: Path) -> None:
    """Both are `building_l` when cut, and the first in the file has that name."""
    fields = {"building:levels:underground": "2", "building:levels": "5"}
    options = ImportOptions(protect=("House",), charge_at=((500_010.0, 5.5e6 - 5.0),))
    site = import_site(shapefile(tmp_path, **fields), options)
    (guess,) = site.ledger.of(Fate.GUESSED)
    assert "below the ground" in guess.kind
    assert "building_1" in guess.detail
