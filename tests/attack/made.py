"""Files made on purpose: small ones that ask for much, large ones of nothing, packed ones."""

import gzip
import json
import math
import resource
import sys
from bz2 import compress as bzip2
from collections.abc import Callable, Iterable, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from blast_env.errors import BlastEnvError
from blast_env.geometry import Piece
from blast_env.io.importing import ImportOptions, import_site
from blast_env.layout import LayoutFile, LayoutState
from blast_env.site import load_scenario

_REPAIR: Final = ImportOptions(repair=True)
_DRAWING: Final = ImportOptions(units="m", buildings_from=("B",), charges_from=("S",))
_HEADER: Final = """schema_version = 2
name = "made"
[site]
width_m = {size}
height_m = {size}
[[charge]]
kind = "point"
position_m = [1.0, 1.0]
tnt_kg = 1.0
"""
_HOUSE: Final = """[[structures]]
kind = "ModularObstacle"
name = "h{number}"
corner_m = [{x}, {y}]
rows = {rows}
columns = {rows}
protected = true
"""

Maker = Callable[[], bytes]


def _toml(parts: Iterable[str], size: float = 100.0) -> bytes:
    return (_HEADER.format(size=size) + "\n".join(parts)).encode()


def _house(number: int = 0, x: float = 50.0, rows: int = 4, y: float = 50.0) -> str:
    return _HOUSE.format(number=number, x=x, y=y, rows=rows)


def _repeated(text: str, most_bytes: int = 900_000) -> str:
    return text * (most_bytes // len(text))


def _numbered(form: str, count: int) -> str:
    return "".join(form.format(number) for number in range(count))


def _vehicles(size: float, count: int = 1) -> bytes:
    entry = "[[charge.entries]]\nstart_m = [0.0, 10.0]\nend_m = [0.0, 90.0]\n"
    ground = "".join(
        f"[[charge.drivable]]\ncorner_m = [{n}.0, {n}.0]\nsize_m = [{size - 2 * n}, 0.1]\n"
        for n in range(99)
    )
    ground += f"[[charge.drivable]]\ncorner_m = [0.0, 0.0]\nsize_m = [{size}, {size}]\n"
    vehicle = f'[[charge]]\nkind = "vehicle"\ntnt_kg = 1.0\nwidth_m = 2.0\n{entry}{ground}'
    zone = "[build_zone]\ncorner_m = [10.0, 0.0]\nrows = 1000\ncolumns = 1000\nstock = 9\n"
    houses = [_house(n, 600.0 + 10 * n, 4, 900.0) for n in range(100)]
    text = _HEADER.format(size=size).partition("[[charge]]")[0]
    return (text + vehicle * count + zone + "\n".join(houses)).encode()


def _zone_items() -> bytes:
    item = (
        '[[build_zone.items]]\nname = "i{}"\ncost = 1.0\nlength_modules = {}\nheight_m = 2.0\n'
        "stock = 5\nstops_vehicles = true\n"
    )
    items = "".join(item.format(number, number + 1) for number in range(20))
    way = '[build_zone.access_way]\nwidth_m = 3.5\nbetween = "left_right"\n'
    zone = "[build_zone]\ncorner_m = [10.0, 0.0]\nrows = 1000\ncolumns = 1000\nstock = 9\n"
    return _toml((zone, way, items, _house(0, 900.0)), 1000.0)


def _facades(count: int) -> bytes:
    facade = "height_m = 2000.0\n[structures.facade]\nstorey_m = 2.0\nbay_m = 0.5\n"
    houses = (
        f"{_house(n, 1000.0, 1, 10.0 + 15 * n)}columns = 1000\n{facade}wall = 'brick_215'\n"
        for n in range(count)
    )
    return _toml((each.replace("columns = 1\n", "") for each in houses), 2000.0)


def _large_items() -> bytes:
    item = (
        '[[build_zone.items]]\nname = "i{}"\ncost = 1.0\nlength_modules = 500\n'
        "thickness_modules = 250\nheight_m = 2.0\nstock = 5\n"
    )
    zone = "[build_zone]\ncorner_m = [10.0, 0.0]\nrows = 1000\ncolumns = 1000\n"
    items = "".join(item.format(number) for number in range(5))
    return _toml((zone, items, _house(0, 900.0)), 1000.0)


def _driven(size: float, items: int = 0) -> bytes:
    """Return a site with a vehicle that a rated gate or up to 20 rated items may stop."""
    rating = "crash_rating = {{mass_kg = 7200.0, speed_km_h = {}.0, penetration_m = 1.0}}\n"
    grounds = ((0.0, 40.0, 100.0), (40.0, size - 40.0, size))
    ground = "".join(
        f"[[charge.drivable]]\ncorner_m = [{x}, 0.0]\nsize_m = [{width}, {height}]\n"
        for x, width, height in grounds
    )
    vehicle = (
        '[[charge]]\nkind = "vehicle"\ntnt_kg = 1.0\nwidth_m = 2.0\n[[charge.entries]]\n'
        f"start_m = [0.0, 10.0]\nend_m = [0.0, 90.0]\n{ground}[charge.motion]\n"
        "mass_kg = 7000.0\nmax_speed_km_h = 80.0\nacceleration_m_s2 = 2.0\n"
    )
    zone = "[build_zone]\ncorner_m = [10.0, 0.0]\nrows = 200\ncolumns = 60\nstock = 20\n"
    way = '[build_zone.access_way]\nwidth_m = 3.5\nbetween = "left_right"\n'
    way += "[build_zone.access_way.gate]\ncorner_m = [10.0, 40.0]\nsize_m = [1.0, 5.0]\n"
    catalogue = "".join(
        f'[[build_zone.items]]\nname = "i{n}"\ncost = 1.0\nlength_modules = {4 + n}\n'
        f"height_m = 2.0\nstock = 1\n{rating.format(30 + 2 * n)}"
        for n in range(items)
    )
    head = _HEADER.format(size=size).partition("[[charge]]")[0]
    end = catalogue or way + rating.format(48)
    return f"{head}{vehicle}{zone}{end}{_house(0, size / 2, 4, size / 2)}".encode()


def _parquet(columns: Mapping[str, Any]) -> bytes:
    """Return a table with a run record; equal values take next to no room in it."""
    import pyarrow as pa  # here and below, because it would count for all others
    import pyarrow.parquet as pq

    from blast_env.particles.parquet import METADATA_KEY

    table = pa.table(columns).replace_schema_metadata({METADATA_KEY: "{}"})
    with BytesIO() as file:
        pq.write_table(table, file, compression="zstd", store_schema=False)
        return file.getvalue()


def _one_text() -> Any:
    import pyarrow as pa

    return pa.DictionaryArray.from_arrays(np.zeros(1600, dtype=np.int32), ["x" * 1_000_000])


def _geojson(*features: Mapping[str, Any]) -> bytes:
    members = {"type": "FeatureCollection", "coordinate_system": "local site metres"}
    charge = _feature("Point", [-5.0, -5.0], kind="charge_place")
    return json.dumps({**members, "features": [*features, charge]}).encode()


def _outline(rings: Sequence[Sequence[Sequence[float]]], **tags: Any) -> dict[str, Any]:
    geometry = {"type": "Polygon", "coordinates": [[*ring, ring[0]] for ring in rings]}
    properties = {"building": "yes", "protected": True, **tags}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def _square(x: float, y: float, side: float) -> list[tuple[float, float]]:
    return [(x, y), (x + side, y), (x + side, y + side), (x, y + side)]


def _star(points: int, radius: float = 40.0) -> list[tuple[float, float]]:
    turn = 2.0 * math.pi * (points // 2) / points
    return [(radius * math.cos(turn * i), radius * math.sin(turn * i)) for i in range(points)]


def _comb(teeth: int, width: float = 80.0, height: float = 40.0) -> list[tuple[float, float]]:
    step = width / teeth
    ends = [(i * step, height if i % 4 in (1, 2) else 1.0) for i in range(teeth)]
    return [(0.0, 0.0), *ends, (width, 0.0)]


def _spiral(points: int) -> list[tuple[float, float]]:
    def turn(i: int, more: float) -> tuple[float, float]:
        angle = 0.5 * i
        return ((i + more) * 0.01 * math.cos(angle), (i + more) * 0.01 * math.sin(angle))

    half = points // 2
    return [turn(i, 0.0) for i in range(half)] + [turn(i, 3.0) for i in reversed(range(half))]


def _holes(count: int) -> dict[str, Any]:
    side = int(math.sqrt(count))
    holes = [_square(1.0 + 0.4 * (i % side), 1.0 + 0.4 * (i // side), 0.2) for i in range(count)]
    return _outline([_square(0.0, 0.0, 2.0 + 0.4 * side), *[ring[::-1] for ring in holes]])


def _many_houses(count: int, step: float) -> bytes:
    side = int(math.sqrt(count)) + 1
    return _geojson(
        *(_outline([_square(step * (i % side), step * (i // side), 3.0)]) for i in range(count))
    )


def _feature(shape: str, coordinates: Any, **tags: Any) -> dict[str, Any]:
    geometry = {"type": shape, "coordinates": coordinates}
    return {"type": "Feature", "properties": tags, "geometry": geometry}


def _with_house(*features: dict[str, Any], x: float = 20.0) -> bytes:
    return _geojson(_outline([_square(x, 20.0, 8.0)]), *features)


def _zigzag(points: int) -> list[tuple[float, float]]:
    return [(100.0 * (i % 2), 100.0 * i / points) for i in range(points)]


def _modern(kind: str, marker: str) -> str:
    return f"0\n{kind}\n100\nAcDbEntity\n8\nB\n100\n{marker}\n"


def _dxf(entities: str, blocks: str = "") -> bytes:
    header = "0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1015\n0\nENDSEC\n"
    section = f"0\nSECTION\n2\nBLOCKS\n{blocks}0\nENDSEC\n" if blocks else ""
    house = "".join(f"10\n{x}\n20\n{y}\n" for x, y in _square(20.0, 20.0, 8.0))
    drawn = f"{_modern('LWPOLYLINE', 'AcDbPolyline')}90\n4\n70\n1\n{house}{entities}"
    return f"{header}{section}0\nSECTION\n2\nENTITIES\n{drawn}0\nENDSEC\n0\nEOF\n".encode()


def _block(name: str, content: str) -> str:
    return f"0\nBLOCK\n8\n0\n2\n{name}\n70\n0\n10\n0.0\n20\n0.0\n{content}0\nENDBLK\n8\n0\n"


def _insert(name: str, more: str = "") -> str:
    return f"0\nINSERT\n8\nB\n2\n{name}\n10\n1.0\n20\n1.0\n{more}"


_LINE: Final = "0\nLINE\n8\nB\n10\n0.0\n20\n0.0\n11\n1.0\n21\n1.0\n"


def _nested_blocks() -> bytes:
    inner = [_block("L0", _LINE)]
    inner += [_block(f"L{n}", _insert(f"L{n - 1}") * 10) for n in range(1, 10)]
    return _dxf(_insert("L9"), "".join(inner))


def _empty_blocks() -> bytes:
    inner = [_block("L0", "")]
    inner += [_block(f"L{n}", _insert(f"L{n - 1}") * 10) for n in range(1, 10)]
    return _dxf(_insert("L9"), "".join(inner))


def _minsert() -> bytes:
    rows = "70\n32000\n71\n32000\n44\n1.0\n45\n1.0\n"
    return _dxf(_insert("L0", rows), _block("L0", _LINE))


def _bulges(bulge: str) -> bytes:
    points = "".join(f"10\n{x}\n20\n{y}\n42\n{bulge}\n" for x, y in _square(0.0, 0.0, 9.0))
    return _dxf(f"{_modern('LWPOLYLINE', 'AcDbPolyline')}90\n4\n70\n1\n{points}")


def _arc(start: str, end: str, radius: str = "5.0") -> bytes:
    return _dxf(f"0\nARC\n8\nB\n10\n9.0\n20\n9.0\n40\n{radius}\n50\n{start}\n51\n{end}\n")


def _mtext(code: str, size: int = 5_000_000) -> bytes:
    piece = (code * (249 // len(code) + 1))[:249]
    lines = "".join(f"3\n{piece}\n" for _ in range(size // 252))
    return _dxf(f"{_modern('MTEXT', 'AcDbMText')}10\n22.0\n20\n22.0\n40\n1.0\n{lines}1\nend\n")


def _texts_in_outlines(count: int) -> bytes:
    def one(i: int) -> str:
        ring = "".join(f"10\n{x}\n20\n{y}\n" for x, y in _square(0.01 * i, 0.0, 50.0))
        text = f"0\nTEXT\n8\nB\n10\n{40 + 0.001 * i}\n20\n2.0\n40\n1.0\n1\nname {i}\n"
        return f"{_modern('LWPOLYLINE', 'AcDbPolyline')}90\n4\n70\n1\n{ring}{text}"

    return _dxf("".join(one(i) for i in range(count)))


def _spline(count: int) -> bytes:
    knots = "".join(f"40\n{i}.0\n" for i in range(count + 4))
    points = "".join(f"10\n{100 * (i % 2)}.0\n20\n{i}.0\n30\n0.0\n" for i in range(count))
    head = f"{_modern('SPLINE', 'AcDbSpline')}70\n8\n71\n3\n72\n{count + 4}\n73\n{count}\n"
    return _dxf(head + knots + points)


def _osm(body: str, header: str = "") -> str:
    return f'<?xml version="1.0"?>{header}<osm version="0.6">{body}</osm>'


def _packed_spaces(members: int) -> bytes:
    """Return a file of some megabytes that unfolds to 100 MB a member, of spaces."""
    first, spaces = gzip.compress(b'<osm version="0.6">'), gzip.compress(b" " * 100_000_000)
    return first + spaces * members + gzip.compress(b"</osm>")


def _packed_nodes(members: int) -> bytes:
    nodes = b'<node id="1" lat="1" lon="1"/>' * 1_000_000
    first = gzip.compress(b'<osm version="0.6">')
    return first + gzip.compress(nodes) * members + gzip.compress(b"</osm>")


def _laughs() -> bytes:
    entities = '<!ENTITY a "ha">' + "".join(
        f'<!ENTITY {chr(98 + n)} "{f"&{chr(97 + n)};" * 10}">' for n in range(10)
    )
    return _osm('<node id="1" lat="1" lon="&k;"/>', f"<!DOCTYPE osm [{entities}]>").encode()


def _osm_star(points: int) -> bytes:
    nodes = "".join(
        f'<node id="{i + 1}" lat="{1e-5 * y:.7f}" lon="{1e-5 * x:.7f}"/>'
        for i, (x, y) in enumerate(_star(points))
    )
    refs = "".join(f'<nd ref="{i + 1}"/>' for i in (*range(points), 0))
    way = f'<way id="1">{refs}</way>'
    tags = '<tag k="type" v="multipolygon"/><tag k="building" v="yes"/>'
    relation = f'<relation id="1"><member type="way" ref="1" role="outer"/>{tags}</relation>'
    return _osm(nodes + way + relation).encode()


def _scenario(path: Path) -> None:
    load_scenario(path)


def _layout(path: Path) -> None:
    LayoutFile.load(path).layout_for("courtyard")


def _map(path: Path) -> None:
    import_site(path, _REPAIR)


def _drawing(path: Path) -> None:
    import_site(path, _DRAWING)


def _drawn(path: Path) -> None:
    scenario = load_scenario(path)
    items = scenario.zone.catalogue.names
    layout = [Piece(3 + 9 * n, 30, name, False) for n, name in enumerate(items)]
    LayoutState.of(scenario, layout).explain_vehicles()


def _table(path: Path) -> None:
    from blast_env.particles.parquet import read_parquet

    read_parquet(path)


def _runs(path: Path) -> None:
    from blast_env.benchmark import Submission

    Submission.load(path)


def _record(path: Path) -> None:
    from blast_env.app.records import BlastRecord, read_kept

    if read_kept(BlastRecord, path) is None:
        raise BlastEnvError("is damaged")


READERS: Final[Mapping[str, Callable[[Path], None]]] = MappingProxyType(
    {
        ".toml": _scenario,
        ".json": _layout,
        ".dxf": _drawing,
        ".drawn.toml": _drawn,
        ".parquet": _table,
        ".runs": _runs,
        ".record": _record,
    }
)
"""What reads a file as the packages do, by its ending; the others are maps."""

_OPEN: Final = '"' + '\\"' * 40_000

FAMILIES: Final[Mapping[str, Maker]] = MappingProxyType(
    {
        "8,000 structures in one place.toml": lambda: _toml(_house(n) for n in range(8000)),
        "100 structures in one place.toml": lambda: _toml(_house(n) for n in range(100)),
        "8,000 broken structures.toml": lambda: _toml(["[[structures]]\nrow = 1"] * 8000),
        "40,000 escaped quotes.toml": lambda: b"a = " + _OPEN.encode(),
        "40,000 escaped quotes in a key.toml": lambda: _OPEN.encode() + b" = 1",
        "450,000 escaped quotes, closed.toml": lambda: (
            f'a = "{_repeated(chr(92) + chr(34))}"'.encode()
        ),
        "an endless multi-line text.toml": lambda: b'a = """' + b'\\"""x' * 150_000,
        "900,000 quotes.toml": lambda: b"a = " + b"'" * 900_000,
        "unknown keys.toml": lambda: _toml([_house(), _numbered("structure{} = 1\n", 40_000)]),
        "60,000 tables.toml": lambda: _numbered("[a{}]\n", 60_000).encode(),
        "9,000 deep tables.toml": lambda: _numbered("[a{}" + ".a" * 45 + "]\n", 9000).encode(),
        "9,000 dotted keys.toml": lambda: _numbered("a{}" + ".a" * 45 + " = 1\n", 9000).encode(),
        "200,000 tables in an array.toml": lambda: _repeated("[[a]]\n").encode(),
        "400,000 empty arrays.toml": lambda: f"a = [{_repeated('[],')}]".encode(),
        "a number of 900,000 digits.toml": lambda: b"a = " + b"1" * 900_000,
        "a number of 900,000 digits and lines.toml": lambda: b"a = 0." + b"1_" * 450_000,
        "a vehicle among 100 houses on 2 km.toml": lambda: _vehicles(2000.0),
        "30 vehicles on 2 km.toml": lambda: _vehicles(2000.0, 30),
        "20 items on 500 m.toml": _zone_items,
        "a facade of 2,002,000 bays.toml": lambda: _facades(1),
        "100 facades of 2,002,000 bays.toml": lambda: _facades(100),
        "items of 500 x 250 modules.toml": _large_items,
        "a vehicle with a motion on 2 km.toml": lambda: _driven(2000.0),
        "a vehicle with a motion on 300 m.toml": lambda: _driven(300.0),
        "a vehicle through a rated gate on 300 m.drawn.toml": lambda: _driven(300.0),
        "20 rated items on 300 m.drawn.toml": lambda: _driven(300.0, 20),
        "20 rated items on 400 m.drawn.toml": lambda: _driven(400.0, 20),
        "a text of 1 MB, 1,600 times.parquet": lambda: _parquet({"structure": _one_text()}),
        "30,000,000 equal numbers.parquet": lambda: _parquet({"time_s": np.zeros(30_000_000)}),
        "numbers for texts.parquet": lambda: _parquet({"structure": [1.0]}),
        "texts for numbers.parquet": lambda: _parquet({"time_s": ["a"]}),
        "bytes for numbers.parquet": lambda: _parquet({"time_s": [b"a"]}),
        "missing texts.parquet": lambda: _parquet({"structure": ["a", None]}),
        "lists for numbers.parquet": lambda: _parquet({"time_s": [[1.0]]}),
        "13 MB of empty runs.runs": lambda: b'{"runs": [' + b"{}," * 4_400_000 + b"{}]}",
        "19 MB of empty arrays.runs": lambda: b"[" + b"[]," * 6_400_000 + b"[]]",
        "1 MB of empty runs.runs": lambda: b'{"runs": [' + b"{}," * 320_000 + b"{}]}",
        "48 MB of empty arrays.record": lambda: b"[" + b"[]," * 16_000_000 + b"[]]",
        "40,000 escaped quotes.json": lambda: _OPEN.encode(),
        "300,000 empty arrays.json": lambda: f"[{_repeated('[],')}[]]".encode(),
        "150,000 cells in one place.json": lambda: f"[{_repeated('[0,0],')}[0,0]]".encode(),
        "100,000 unknown keys.json": lambda: json.dumps(
            {f"cell{n}": n for n in range(60_000)}
        ).encode(),
        "brackets that close nothing.json": lambda: b"[" + b"]" * 900_000,
        "a star of 301.geojson": lambda: _geojson(_outline([_star(301)])),
        "a star of 3,001.geojson": lambda: _geojson(_outline([_star(3001)])),
        "a star of 10,001.geojson": lambda: _geojson(_outline([_star(10_001)])),
        "a comb of 2,000.geojson": lambda: _geojson(_outline([_comb(2000)])),
        "a comb of 40,000.geojson": lambda: _geojson(_outline([_comb(40_000)])),
        "a spiral of 40,000.geojson": lambda: _geojson(_outline([_spiral(40_000)])),
        "90,000 buildings.geojson": lambda: _many_houses(90_000, 4.0),
        "90,000 buildings in one place.geojson": lambda: _many_houses(90_000, 0.001),
        "600 buildings in one place.geojson": lambda: _many_houses(600, 0.001),
        "600 buildings of 1 km in one place.geojson": lambda: _geojson(
            *(_outline([_square(0.01 * i, 0.0, 1000.0)]) for i in range(600))
        ),
        "39,000 holes.geojson": lambda: _geojson(_holes(39_000)),
        "1,000 holes.geojson": lambda: _geojson(_holes(1000)),
        "one building of 1 km.geojson": lambda: _geojson(_outline([_square(0.0, 0.0, 1000.0)])),
        "one building of 2 km.geojson": lambda: _geojson(_outline([_square(0.0, 0.0, 1960.0)])),
        "one triangle of 2 km.geojson": lambda: _geojson(
            _outline([[(0.0, 0.0), (1900.0, 3.0), (1000.0, 1900.0)]])
        ),
        "48 MB of empty arrays.geojson": lambda: b"[" + b"[]," * 16_000_000 + b"[]]",
        "48 MB of empty tables.geojson": lambda: b"[" + b"{}," * 16_000_000 + b"{}]",
        "48 MB of numbers.geojson": lambda: b"[" + b"1," * 24_000_000 + b"1]",
        "48 MB of keys.geojson": lambda: b"{" + b'"":{},' * 8_000_000 + b'"":0}',
        "a street of 40,000 turns.geojson": lambda: _with_house(
            _feature("LineString", _zigzag(40_000), highway="service")
        ),
        "9,000 streets.geojson": lambda: _with_house(
            *(_feature("LineString", _zigzag(4), highway="service") for _ in range(9000))
        ),
        "parking as a star.geojson": lambda: _with_house(
            _feature("Polygon", [[*_star(3001), _star(3001)[0]]], kind="charge_place")
        ),
        "a no-build area as a star.geojson": lambda: _with_house(
            _feature("Polygon", [[*_star(3001), _star(3001)[0]]], kind="keep_out"),
            _feature("Polygon", [[*_star(3001), _star(3001)[0]]], kind="build_zone"),
        ),
        "3,000 lines that cross.geojson": lambda: _with_house(
            *(
                _feature("LineString", [a, b], kind="structure")
                for a, b in zip(_star(3001), _star(3001)[1:], strict=False)
            )
        ),
        "collections in collections.geojson": lambda: (
            b'{"type":"GeometryCollection","geometries":[' * 900 + b"]}" * 900
        ),
        "a name of 1 MB.geojson": lambda: _geojson(
            _outline([_square(0.0, 0.0, 9.0)], name="a-" * 500_000)
        ),
        "blocks in blocks.dxf": _nested_blocks,
        "empty blocks in blocks.dxf": _empty_blocks,
        "a block in itself.dxf": lambda: _dxf(_insert("A"), _block("A", _insert("A") + _LINE)),
        "MINSERT 32,000 x 32,000.dxf": _minsert,
        "300 circles of radius 1e11.dxf": lambda: _dxf(
            "0\nCIRCLE\n8\nB\n10\n0.0\n20\n0.0\n40\n1e11\n" * 300
        ),
        "100,000 circles of radius 1,000.dxf": lambda: _dxf(
            "0\nCIRCLE\n8\nB\n10\n0.0\n20\n0.0\n40\n1000\n" * 100_000
        ),
        "MTEXT of codes.dxf": lambda: _mtext("\\P"),
        "MTEXT of groups.dxf": lambda: _mtext("{"),
        "MTEXT of fonts.dxf": lambda: _mtext("\\fArial|b0;"),
        "MTEXT of stacks.dxf": lambda: _mtext("\\S1/"),
        "MTEXT of carets.dxf": lambda: _mtext("^"),
        "1 MB of TEXT codes.dxf": lambda: _dxf(
            f"0\nTEXT\n8\nB\n10\n22.0\n20\n22.0\n40\n1.0\n1\n{'%%u' * 300_000}\n"
        ),
        "an arc of 1e300 degrees.dxf": lambda: _arc("0.0", "1e300"),
        "an arc from 1e300 degrees.dxf": lambda: _arc("1e300", "0.0"),
        "an arc of NaN degrees.dxf": lambda: _arc("0.0", "nan"),
        "an arc of 1e9 turns.dxf": lambda: _arc("0.0", "3.6e11"),
        "bulges of 1e300.dxf": lambda: _bulges("1e300"),
        "bulges of NaN.dxf": lambda: _bulges("nan"),
        "bulges of 1e-300.dxf": lambda: _bulges("1e-300"),
        "an ellipse of 1e300.dxf": lambda: _dxf(
            _modern("ELLIPSE", "AcDbEllipse")
            + "10\n0.0\n20\n0.0\n11\n5.0\n21\n0.0\n40\n0.5\n41\n0.0\n42\n1e300\n"
        ),
        "a spline of 20,000.dxf": lambda: _spline(20_000),
        "1,000 texts in 1,000 outlines.dxf": lambda: _texts_in_outlines(1000),
        "9,000 texts in 9,000 outlines.dxf": lambda: _texts_in_outlines(9000),
        "an insert of scale 1e300.dxf": lambda: _dxf(
            _insert("L0", "41\n1e300\n42\n1e300\n"), _block("L0", _LINE)
        ),
        "40 MB of nothing.dxf": lambda: _dxf("0\nPOINT\n8\nX\n10\n0.0\n20\n0.0\n" * 1_500_000),
        "200,000 points.dxf": lambda: _dxf("0\nPOINT\n8\nX\n10\n0.0\n20\n0.0\n" * 200_000),
        "45,000 lines in blocks.dxf": lambda: _dxf(
            _insert("L0", "70\n100\n71\n4\n44\n1.0\n45\n1.0\n"), _block("L0", _LINE * 110)
        ),
        "a line of 600,000 points.dxf": lambda: _dxf(
            _modern("LWPOLYLINE", "AcDbPolyline") + "90\n4\n" + "10\n1\n20\n1\n" * 490_000
        ),
        "a chain of 900 blocks.dxf": lambda: _dxf(
            _insert("L899"),
            _block("L0", _LINE)
            + "".join(_block(f"L{n}", _insert(f"L{n - 1}")) for n in range(1, 900)),
        ),
        "19 MB that unfold to 20 GB.osm.gz": lambda: _packed_spaces(200),
        "nodes that unfold to 9 GB.osm.gz": lambda: _packed_nodes(300),
        "spaces that unfold to 1 GB.osm.bz2": lambda: bzip2(
            b'<osm version="0.6">' + b" " * 1_000_000_000 + b"</osm>"
        ),
        "entities in entities.osm": _laughs,
        "elements in elements.osm": lambda: _osm("<node>" * 100_000).encode(),
        "a star of 3,001.osm": lambda: _osm_star(3001),
        "a way of 1,000,000 nodes.osm": lambda: _osm(
            '<node id="1" lat="1" lon="1"/><way id="1">'
            + '<nd ref="1"/>' * 1_000_000
            + '<tag k="building" v="yes"/></way>'
        ).encode(),
        "1,000,000 tags.osm": lambda: _osm(
            '<node id="1" lat="1" lon="1">'
            + _numbered('<tag k="k{}" v="v"/>', 1_000_000)
            + "</node>"
        ).encode(),
    }
)
"""By names that end as the files do."""


def suffix_of(name: str) -> str:
    """Return the ending of a family's files."""
    return name[name.index(".") :]


def read(path: Path) -> str:
    """Read a file as the packages do; return what became of it, a word and the message."""
    reader = READERS.get("".join(path.suffixes), _map)
    try:
        reader(path)
    except BlastEnvError as error:
        return f"refused: {error}"
    return "read"


def taken() -> tuple[float, int]:
    """Return the processor time in s of this process and of its finished ones, and most memory."""
    usages = [resource.getrusage(each) for each in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    time_s = sum(each.ru_utime + each.ru_stime for each in usages)
    # Of this process not ru_maxrss, which counts what began it, too.
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    own_kb = next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:"))
    return time_s, 1024 * max(own_kb, usages[1].ru_maxrss)


if __name__ == "__main__":
    what, name, place = sys.argv[1:]
    if what == "make":
        Path(place).write_bytes(FAMILIES[name]())
    else:
        outcome = read(Path(place)).partition(":")[0]
        print(json.dumps([outcome, *taken()]))
