"""Files that are damaged, or made on purpose to take long: refused at once, or sound."""

import json
import math
import re
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from time import process_time
from typing import Any, Final

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from blast_env.benchmark import Submission
from blast_env.errors import BlastEnvError
from blast_env.io.importing import ImportOptions, import_site
from blast_env.layout import LayoutFile
from blast_env.site import load_scenario
from tests.attack.formats import FORMATS, Format

TOKEN = re.compile(rb'"[^"\n]*"|[-+0-9.][-+0-9.eE_]*|[A-Za-z_][A-Za-z0-9_.]*|[\[\]{}(),:=]')
VALUES = (
    *b"0 -1 1.5 -0.0 1e308 1e-320 1e999 9223372036854775808 nan inf -inf Infinity .inf".split(),
    *b"true null None ~ 2026-01-01 12:30:00 0x1f 1_000 [] {} !!python/x # // % \\ \" '".split(),
    *(b'""', b'"x"', b"[1, 2, 3]", b'{"a": 1}', b"&a *a", b"x" * 5000, b'"' + b"x" * 5000 + b'"'),
    *(b'"\x1b[31m"', b'"\\u0000"', b'"\\ud800"', b'"\\u202e"', b'"[/x]"', b"\xc3\xa9", b"\xff"),
    *(b"9" * 6000, b"0." + b"3" * 6000, b"[" * 1000, b'{"a":' * 1000, b"a." * 1000 + b"a"),
    *(b"\n", b"\r", b"\0", b"\xef\xbb\xbf", b"\xff\xfe"),
)
"""In the place of a token of a file."""


@st.composite
def damaged(draw: st.DrawFn, samples: tuple[bytes, ...]) -> bytes:
    """A sound file with tokens replaced, repeated or cut out, or without its end."""
    content = draw(st.sampled_from(samples))
    for _ in range(draw(st.integers(0, 3))):
        places = [match.span() for match in TOKEN.finditer(content)] or [(0, len(content))]
        first, last = draw(st.sampled_from(places))
        another = content[slice(*draw(st.sampled_from(places)))]
        old = content[first:last]
        part = st.sampled_from((*VALUES, b"", 2 * old, 1000 * old[:20], another, old + b"0"))
        content = content[:first] + draw(part | st.binary(max_size=64)) + content[last:]
    if draw(st.booleans()):
        return content
    place = draw(st.integers(0, max(len(content) - 1, 0)))
    flipped = content[place : place + 1].translate(bytes(index ^ 1 for index in range(256)))
    return content[:place] + draw(st.sampled_from((b"", flipped + content[place + 1 :])))


@pytest.fixture(scope="module", params=FORMATS)
def form(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Format:
    return FORMATS[request.param](tmp_path_factory.mktemp("format"))


@settings(suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_a_damaged_file_is_refused_or_read(form: Format, data: st.DataObject) -> None:
    content = data.draw(damaged(form.samples))
    with suppress(BlastEnvError):
        found = form.read(content)
        if form.has_checksum and found is not None:
            assert found in [form.read(sample) for sample in form.samples]


def test_a_sound_file_is_read(form: Format) -> None:
    for sample in form.samples:
        assert form.read(sample) is not None


# --- Files made on purpose to take long or much are refused at once.


HEADER: Final = """schema_version = 2
name = "made"
[site]
width_m = {size}
height_m = {size}
"""
CHARGE: Final = '[[charge]]\nkind = "point"\nposition_m = [1.0, 1.0]\ntnt_kg = 1.0\n'
QUOTES: Final = '"' + '\\"' * 40_000


def toml(parts: Iterable[str], size: float = 100.0, charge: str = CHARGE) -> bytes:
    return "\n".join((HEADER.format(size=size), charge, *parts)).encode()


def house(number: int = 0, x: float = 50.0, y: float = 50.0) -> str:
    return (
        f'[[structures]]\nkind = "ModularObstacle"\nname = "h{number}"\ncorner_m = [{x}, {y}]\n'
        "rows = 4\ncolumns = 4\nprotected = true\n"
    )


def zone(*items: str, rows: int = 1000, columns: int = 1000) -> str:
    head = f"[build_zone]\ncorner_m = [10.0, 0.0]\nrows = {rows}\ncolumns = {columns}\n"
    kinds = (
        f'[[build_zone.items]]\nname = "i{number}"\ncost = 1.0\nheight_m = 2.0\nstock = 5\n{item}'
        for number, item in enumerate(items)
    )
    return head + "".join(kinds)


def many_places() -> bytes:
    items = (f"length_modules = {n}\nstops_vehicles = true\n" for n in range(1, 21))
    return toml((zone(*items), house(0, 900.0)), 1000.0)


def large_items() -> bytes:
    items = ["length_modules = 500\nthickness_modules = 250\n"] * 5
    return toml((zone(*items), house(0, 900.0)), 1000.0)


def facades(count: int) -> bytes:
    facade = "height_m = 2000.0\n[structures.facade]\nstorey_m = 2.0\nbay_m = 0.5\n"
    wide = (house(n, 1000.0, 10.0 + 15 * n).replace("s = 4", "s = 1000") for n in range(count))
    return toml((f"{case}{facade}wall = 'brick_215'\n" for case in wide), 2000.0)


def driven(size: float) -> bytes:
    """Return a site with a vehicle that accelerates over all of it."""
    ground = f"[[charge.drivable]]\ncorner_m = [0.0, 0.0]\nsize_m = [{size}, {size}]\n"
    vehicle = (
        '[[charge]]\nkind = "vehicle"\ntnt_kg = 1.0\nwidth_m = 2.0\n[[charge.entries]]\n'
        f"start_m = [0.0, 10.0]\nend_m = [0.0, 90.0]\n{ground}[charge.motion]\n"
        "mass_kg = 7000.0\nmax_speed_km_h = 80.0\nacceleration_m_s2 = 2.0\n"
    )
    items = zone("length_modules = 4\n", rows=200, columns=60)
    return toml((items, house(0, size / 2, size / 2)), size, vehicle)


def star(points: int) -> bytes:
    turn = 2.0 * math.pi * (points // 2) / points
    ring = [(40.0 * math.cos(turn * i), 40.0 * math.sin(turn * i)) for i in range(points)]
    geometry = {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}
    feature = {"type": "Feature", "properties": {"building": "yes"}, "geometry": geometry}
    members = {"type": "FeatureCollection", "coordinate_system": "local site metres"}
    return json.dumps({**members, "features": [feature]}).encode()


LINE: Final = "0\nLINE\n8\nB\n10\n0.0\n20\n0.0\n11\n1.0\n21\n1.0\n"
POLYLINE: Final = "0\nLWPOLYLINE\n100\nAcDbEntity\n8\nB\n100\nAcDbPolyline\n90\n4\n70\n1\n"


def vertices(side: float, more: str = "") -> str:
    square = ((0.0, 0.0), (side, 0.0), (side, side), (0.0, side))
    return "".join(f"10\n{x}\n20\n{y}\n{more}" for x, y in square)


def dxf(entities: str, blocks: Sequence[str] = ()) -> bytes:
    header = "0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1015\n0\nENDSEC\n"
    named = "".join(
        f"0\nBLOCK\n8\n0\n2\nL{n}\n70\n0\n10\n0.0\n20\n0.0\n{content}0\nENDBLK\n8\n0\n"
        for n, content in enumerate(blocks)
    )
    section = f"0\nSECTION\n2\nBLOCKS\n{named}0\nENDSEC\n" if blocks else ""
    drawn = POLYLINE + vertices(8.0) + entities
    return f"{header}{section}0\nSECTION\n2\nENTITIES\n{drawn}0\nENDSEC\n0\nEOF\n".encode()


def insert(number: int, more: str = "") -> str:
    return f"0\nINSERT\n8\nB\n2\nL{number}\n10\n1.0\n20\n1.0\n{more}"


def nested(content: str) -> bytes:
    return dxf(insert(9), [content, *(insert(n) * 10 for n in range(9))])


def laughs() -> bytes:
    entities = '<!ENTITY a "ha">' + "".join(
        f'<!ENTITY {chr(98 + n)} "{f"&{chr(97 + n)};" * 10}">' for n in range(10)
    )
    node = '<osm version="0.6"><node id="1" lat="1" lon="&k;"/></osm>'
    return f'<?xml version="1.0"?><!DOCTYPE osm [{entities}]>{node}'.encode()


def layout(path: Path) -> Any:
    return LayoutFile.load(path).layout_for("courtyard")


READERS: dict[str, Callable[[Path], Any]] = {
    "toml": load_scenario,
    "json": layout,
    "runs": Submission.load,
    "dxf": lambda path: import_site(path, ImportOptions(units="m", buildings_from=("B",))),
    "geojson": lambda path: import_site(path, ImportOptions(repair=True)),
    "osm": import_site,
}
"""By the ending of the file."""

MADE: dict[str, tuple[str, Callable[[], bytes], str]] = {
    "structures in one place": (
        "toml",
        lambda: toml(house(n) for n in range(100)),
        "4930 more problems",
    ),
    "unknown keys": (
        "toml",
        lambda: toml((house(), *(f"structure{n} = 1" for n in range(10_000)))),
        "more problems",
    ),
    "escaped quotes": ("toml", lambda: f"a = {QUOTES}".encode(), "Unterminated string"),
    "escaped quotes in a key": ("toml", lambda: f"{QUOTES} = 1".encode(), "Unterminated string"),
    "escaped quotes in JSON": ("json", QUOTES.encode, "Unterminated string"),
    "places of pieces": ("toml", many_places, "in the zone, must make at most 10,000,000"),
    "large items": ("toml", large_items, "cells at all their places together, must cover at most"),
    "bays of a facade": ("toml", lambda: facades(1), "bays in all, must be at most 5,000"),
    "bays of facades": ("toml", lambda: facades(100), "bays in all, must be at most 5,000"),
    "a vehicle on 2 km": ("toml", lambda: driven(2000.0), "places of the site, must have at most"),
    "runs": (
        "runs",
        lambda: b'{"runs": [' + b"{}," * 320_000 + b"{}]}",
        "has 320,001 runs, must have at most 10,000",
    ),
    "a star": ("geojson", lambda: star(301), "crosses itself more than 1,000 times"),
    "blocks in blocks": (
        "dxf",
        lambda: nested(LINE),
        "entities once its blocks are taken apart, must have",
    ),
    "empty blocks in blocks": (
        "dxf",
        lambda: nested(""),
        "entities once its blocks are taken apart, must have at most",
    ),
    "a block in itself": ("dxf", lambda: dxf(insert(0), [insert(0) + LINE]), "lies in itself"),
    "rows of a block": (
        "dxf",
        lambda: dxf(insert(0, "70\n32000\n71\n32000\n44\n1.0\n45\n1.0\n"), [LINE]),
        "more than 50,000 entities once its blocks are taken apart",
    ),
    "large circles": (
        "dxf",
        lambda: dxf("0\nCIRCLE\n8\nB\n10\n0.0\n20\n0.0\n40\n1e11\n" * 300),
        "has more than 500,000 points",
    ),
    "an arc of 1e300 degrees": (
        "dxf",
        lambda: dxf("0\nARC\n8\nB\n10\n9.0\n20\n9.0\n40\n5.0\n50\n0.0\n51\n1e300\n"),
        "has the number 1e+300, must be within 1e+12",
    ),
    "bulges of NaN": (
        "dxf",
        lambda: dxf(POLYLINE + vertices(9.0, "42\nnan\n")),
        "has the number nan, must be within 1e+12",
    ),
    "entities in entities": ("osm", laughs, "XML entities are not supported"),
}
"""The ending of a file, its content, and the words that refuse it."""


@pytest.mark.parametrize("name", MADE)
def test_a_file_that_asks_for_much_is_refused_at_once(name: str, tmp_path: Path) -> None:
    ending, content, words = MADE[name]
    path = tmp_path / f"made.{ending}"
    path.write_bytes(content())
    began_s = process_time()
    with pytest.raises(BlastEnvError) as caught:
        READERS[ending](path)
    assert words in str(caught.value)
    assert len(str(caught.value)) < 10_000
    assert process_time() - began_s < 60.0  # with the imports of its reader
