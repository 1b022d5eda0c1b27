"""Files made on purpose to take long or much are refused at once; all of them: `make attack`."""

from pathlib import Path
from time import process_time

import pytest

from tests.attack.made import FAMILIES, read, suffix_of

REFUSALS = {
    "100 structures in one place.toml": "4931 more problems",
    "unknown keys.toml": "more problems",
    "40,000 escaped quotes.toml": "Unterminated string",
    "40,000 escaped quotes in a key.toml": "Unterminated string",
    "20 items on 500 m.toml": "places of pieces in the zone, must make at most 10,000,000",
    "a facade of 2,002,000 bays.toml": "have 2,002,000 bays in all, must be at most 5,000",
    "100 facades of 2,002,000 bays.toml": "have 200,200,000 bays in all, must be at most 5,000",
    "items of 500 x 250 modules.toml": "cells at all their places together, must cover at most",
    "a vehicle with a motion on 2 km.toml": "at 16,008,001 places of the site, must have at most",
    "1 MB of empty runs.runs": "has 320,001 runs, must have at most 10,000",
    "40,000 escaped quotes.json": "Unterminated string",
    "a star of 301.geojson": "crosses itself more than 1,000 times",
    "blocks in blocks.dxf": "3,222,222,223 entities once its blocks are taken apart, must have",
    "empty blocks in blocks.dxf": "entities once its blocks are taken apart, must have at most",
    "a block in itself.dxf": "lies in itself",
    "MINSERT 32,000 x 32,000.dxf": "2,048,000,002 entities once its blocks are taken apart",
    "300 circles of radius 1e11.dxf": "has more than 500,000 points",
    "an arc of 1e300 degrees.dxf": "has the number 1e+300, must be within 1e+12",
    "bulges of 1e300.dxf": "has the number 1e+300, must be within 1e+12",
    "bulges of NaN.dxf": "has the number nan, must be within 1e+12",
    "entities in entities.osm": "XML entities are not supported",
}
"""Of families that are small enough to be read here: what is said of them."""


@pytest.mark.parametrize("name", REFUSALS)
def test_what_asks_for_much_is_refused_at_once(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"made{suffix_of(name)}"
    path.write_bytes(FAMILIES[name]())
    began_s = process_time()
    said = read(path)
    assert said.startswith("refused: ")
    assert REFUSALS[name] in said
    assert len(said) < 10_000
    assert process_time() - began_s < 5.0
