"""Documents with every key: saving, and the hash, which is that of all that loads depend on."""

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from blast_env.site import Scenario, ScenarioError, load_scenario, save_scenario
from tests.catalogue_sites import yard_document
from tests.site import test_hardening, test_polygons, test_removable
from tests.site.documents import (
    Document,
    KeyPath,
    changed,
    driven_document,
    full_document,
    key_paths,
    tall_document,
    value_at,
    without,
)
from tests.test_terraces import site_document

WORDS = {"description", "reason", "title", "source", "test"}
WORDS |= {"building", "georeference", "target_probability", "collide_within_charge"}
"""Keys that no load depends on; of the last one the documents have the value of the preset."""


def with_probability() -> Document:
    document = test_hardening.document(target="medium")
    document["objective"]["target_probability"] = 0.95
    return document


DOCUMENTS = {
    "full": full_document(),
    "tall": tall_document(),
    "driven": driven_document(),
    "catalogue": yard_document(),
    "hardening": test_hardening.document(charges="mean"),
    "target": with_probability(),
    "removable": test_removable.document(),
    "terrace": site_document(),
    "polygon": test_polygons.with_polygon(courtyards_m=[test_polygons.COURT]),
}


def others(document: Document) -> Iterator[tuple[KeyPath, Scenario]]:
    """Yield sound scenarios that differ in one place: without a key, or with another value.

    Of numbers that are a little larger or smaller, the first that is sound.
    """
    for path in key_paths(document):
        value = value_at(document, path)
        variants: list[Document] = []
        if isinstance(value, str):
            variants.append(changed(document, path, f"{value}x"))
        elif isinstance(value, bool):
            variants.append(changed(document, path, not value))
        elif isinstance(value, int | float):
            near = (changed(document, path, value + step) for step in (0.125, 1, -1))
            found = (own for own in map(scenario_or_none, near) if own is not None)
            yield from ((path, own) for own in islice(found, 1))
        if isinstance(path[-1], str):
            variants.append(without(document, path))
        for other in map(scenario_or_none, variants):
            if other is not None:
                yield path, other


def scenario_or_none(document: Document) -> Scenario | None:
    try:
        return Scenario.from_document(document, "other")
    except ScenarioError:
        return None


@pytest.mark.parametrize("name", DOCUMENTS)
def test_what_differs_has_another_hash_unless_it_is_a_word(name: str) -> None:
    scenario = Scenario.from_document(DOCUMENTS[name], "one")
    wrong: set[Any] = set()
    tried = 0
    for path, other in others(DOCUMENTS[name]):
        tried += 1
        same = other.content_hash == scenario.content_hash
        counts = other != scenario and path != ("name",) and not WORDS & set(path)
        if same == counts:
            wrong.add(path)
    assert wrong == set()
    assert tried > 10


@pytest.mark.parametrize("name", DOCUMENTS)
def test_a_saved_scenario_comes_back(name: str, tmp_path: Path) -> None:
    scenario = Scenario.from_document(DOCUMENTS[name], "one")
    save_scenario(scenario, tmp_path / "one.toml")
    again = load_scenario(tmp_path / "one.toml")
    assert again == scenario
    assert again.content_hash == scenario.content_hash
