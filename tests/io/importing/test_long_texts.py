"""However long a text of a map or drawing is, messages about it stay short."""

import logging
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from blast_env.errors import BlastEnvError
from blast_env.io.importing import MOST_LETTERS, Fate, ImportOptions, import_site
from tests.io.importing.maps import BLOCK, LAYERS

LONG = "W" * 20_000
MOST_MESSAGE = 3_000
"""Most characters of a message: some of them list a dozen objects."""

TEXTS: Mapping[str, re.Pattern[str]] = MappingProxyType(
    {
        ".geojson": re.compile(r'"([^"]*)"'),
        ".osm": re.compile(r"[vk]='([^']*)'|[vk]=\"([^\"]*)\""),
        ".dxf": re.compile(r"^ *(?:0|1|2|5|6|8|100)\n(.*)$", re.MULTILINE),
    }
)
"""The texts of a file: keys and values of tags; names, layers, handles and types of entities."""

ASKED: tuple[dict[str, Any], ...] = (
    {},
    {"protect": ("Town Hall",)},
    {"protect": ("Nowhere",)},
    {"protect": (LONG,)},
    {"protect_near": (0.0, 0.0)},
    {"protect": ("Town Hall",), "strict": True},
    {"buildings_from": ("nothing",)},
    {"buildings_from": (LONG,)},
    {"crs": LONG},
)


def places_of(suffix: str) -> list[tuple[int, int]]:
    """Return start and end of every text of the sample."""
    text = BLOCK.with_suffix(suffix).read_text()
    return [match.span(match.lastindex or 0) for match in TEXTS[suffix].finditer(text)]


def messages_of(suffix: str, number: int, asked: Mapping[str, Any]) -> Iterator[str]:
    """Yield all that an import says of the sample, one of whose texts is long."""
    text = BLOCK.with_suffix(suffix).read_text()
    places = places_of(suffix)
    start, end = places[number % len(places)]
    options = ImportOptions(**{**(LAYERS if suffix == ".dxf" else {}), **asked})
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"map{suffix}"
        path.write_text(text[:start] + LONG + text[end:])
        try:
            site = import_site(path, options)
        except BlastEnvError as error:
            yield str(error)
            return
    yield from site.notes
    yield from site.ledger.lines(tuple(Fate), MOST_LETTERS)
    yield from (entry.words for entry in site.ledger.entries)
    yield from (f"{building.name} {building.title}" for building in site.buildings)
    yield from (site.scenario.description, *site.scenario.import_notes)


def is_short(message: str) -> bool:
    return len(message) <= MOST_MESSAGE and "W" * 101 not in message  # a title has 100


@example(".geojson", 0, {})
@given(st.sampled_from(sorted(TEXTS)), st.integers(0, 5_000), st.sampled_from(ASKED))
def test_messages_stay_short(suffix: str, number: int, asked: Mapping[str, Any]) -> None:
    assert all(map(is_short, messages_of(suffix, number, asked)))


def test_the_log_of_a_library_is_not_printed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(logging.getLogger(), "handlers", [])  # as outside of pytest
    text = BLOCK.with_suffix(".dxf").read_text()
    handles = [
        number
        for number, (start, _) in enumerate(places_of(".dxf"))
        if text[:start].endswith("LWPOLYLINE\n  5\n")
    ]
    assert any(messages_of(".dxf", handles[0], {}))
    assert capsys.readouterr().err == ""
