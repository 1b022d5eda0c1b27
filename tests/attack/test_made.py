"""Files made on purpose to take long or much are refused at once; all of them: `make attack`."""

from pathlib import Path
from time import process_time

import pytest

from tests.attack.made import FAMILIES, read, suffix_of
from tests.attack.run import MadeOutcome, read_made

REFUSALS = {
    "100 structures in one place.toml": "4931 more problems",
    "unknown keys.toml": "more problems",
    "40,000 escaped quotes.toml": "Unterminated string",
    "40,000 escaped quotes in a key.toml": "Unterminated string",
    "9,000 deep tables.toml": "396000 parts after their second ones, must have at most 10000",
    "30 vehicles on 2 km.toml": "30,000,000 places of the site, must have at most 3,000,000",
    "20 items on 500 m.toml": "places of pieces in the zone, must make at most 10,000,000",
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


def test_large_files_are_read_in_a_process_that_counts(tmp_path: Path) -> None:
    found = read_made("a star of 3,001.geojson", tmp_path)
    assert found.is_within
    assert found.outcome == "refused"


def test_what_takes_too_much_is_noticed() -> None:
    assert MadeOutcome(1, "refused", 9.0, 400_000_000).is_within
    assert not MadeOutcome(1, "refused", 11.0, 400_000_000).is_within
    assert not MadeOutcome(1, "refused", 9.0, 600_000_000).is_within
    assert not MadeOutcome(1, "failed", 1.0, 1).is_within
