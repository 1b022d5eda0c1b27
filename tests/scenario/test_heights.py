"""Version 2 of the file format: heights, faces and gauges."""

from pathlib import Path

import numpy as np
import pytest

from blast_env.physics.scene import WALLS, Charge, Gauge
from blast_env.scenario import (
    Scenario,
    load_scenario,
    save_scenario,
    usable_cells,
)
from blast_env.scenario.build_scene import build_scene, build_site, draw_charge
from blast_env.scenario.versions import NEW_KEYS
from blast_env.units import UNITS_PER_M
from tests.scenario.documents import (
    Document,
    KeyPath,
    all_documents,
    changed,
    full_document,
    lines_for,
    tall_document,
    without,
    written,
)


def scenario_from(document: Document) -> Scenario:
    return Scenario.from_document(document, "f.toml")


def test_scenario_with_heights_survives_saving(tmp_path: Path) -> None:
    scenario = scenario_from(tall_document())
    save_scenario(scenario, tmp_path / "copy.toml")
    copy = load_scenario(tmp_path / "copy.toml")
    assert copy == scenario
    assert copy.content_hash == scenario.content_hash
    assert copy.schema_version == 2
    assert tmp_path.joinpath("copy.toml").read_text().startswith("schema_version = 2")


@pytest.mark.parametrize("document", all_documents(), ids=lambda document: document["name"])
def test_version_is_the_lowest_that_holds_the_content(tmp_path: Path, document: Document) -> None:
    """A file that uses nothing of version 2 is one of version 1, which older releases read."""
    newer = scenario_from({**document, "schema_version": 2})
    assert newer.schema_version == (2 if document["name"] == "tall" else 1)
    assert newer == scenario_from(document)
    assert newer.content_hash == scenario_from(document).content_hash
    save_scenario(newer, tmp_path / "copy.toml")
    assert load_scenario(tmp_path / "copy.toml") == newer
    assert f"schema_version = {newer.schema_version}\n" in (tmp_path / "copy.toml").read_text()


@pytest.mark.parametrize("document", all_documents(), ids=lambda document: document["name"])
def test_document_of_a_scenario_makes_the_same_scenario(document: Document) -> None:
    scenario = scenario_from(document)
    for mode in ("python", "json"):
        assert scenario_from(scenario.model_dump(mode=mode)) == scenario
    left_out = scenario.model_dump(exclude={"charge", "site", "schema_version"})
    assert set(left_out).isdisjoint({"charge", "site", "schema_version"})


def defaults_written_out() -> Document:
    """Return the full document with the defaults of version 2 written out."""
    document = {**full_document(), "schema_version": 2, "gauges": []}
    document["site"]["air_height_m"] = 12.0
    for source in document["charge"]:
        source["height_m"] = 0
    document["structures"][0]["faces"] = ["north", "south", "east", "west"]
    return document


def test_defaults_written_out_leave_the_hash_as_it_is() -> None:
    assert scenario_from(defaults_written_out()).content_hash == (
        scenario_from(full_document()).content_hash
    )


NEW_PATHS: list[KeyPath] = [
    ("gauges",),
    ("site", "air_height_m"),
    ("charge", 0, "height_m"),
    ("structures", 0, "height_m"),
    ("structures", 0, "faces"),
    ("build_zone", "height_m"),
]


def test_new_keys_are_all_tried() -> None:
    listed = {(section, key) for section, keys in NEW_KEYS.items() for key in keys}
    assert listed == {(str(path[0]) if path[1:] else "", str(path[-1])) for path in NEW_PATHS}


@pytest.mark.parametrize("path", NEW_PATHS, ids=written)
def test_each_new_key_counts_in_the_hash(path: KeyPath) -> None:
    fewer = without(tall_document(), path)
    assert scenario_from(fewer).content_hash != scenario_from(tall_document()).content_hash


@pytest.mark.parametrize("path", NEW_PATHS, ids=written)
@pytest.mark.parametrize("section", [None, "site", "structures"])
def test_new_key_in_a_file_of_version_1_is_named(path: KeyPath, section: str | None) -> None:
    document = {**tall_document(), "schema_version": 1}
    if section is not None and path[0] != section:
        document[section] = 3  # another problem, which must not hide this one
    lines = lines_for(document)
    message = "schema_version 2 has this key, the file has schema_version 1"
    assert f"f.toml: {written(path)}: {message}" in lines
    assert len(lines) >= 6 if section is None else True


def test_default_of_version_2_is_a_new_key_too() -> None:
    lines = lines_for(changed(full_document(), ("charge", 1, "height_m"), 0.0))
    assert lines == [
        "f.toml: charge[1].height_m: schema_version 2 has this key, the file has schema_version 1"
    ]


def test_every_wall_of_version_1_is_as_high_as_the_air() -> None:
    site = build_site(load_scenario("courtyard"), [(4, 0)])
    assert [outline.height_m for outline in site.structures] == [None] * len(site.structures)
    assert {outline.faces for outline in site.structures} == {WALLS}
    assert (site.air_height_m, site.gauges, site.charge.height_m) == (12.0, (), 0.0)


def test_site_of_a_blast_has_heights_faces_and_gauges_in_metres() -> None:
    scenario = scenario_from(tall_document())
    site = build_site(scenario, [(0, 0), (1, 0)], charge=Charge((2.0, 10.0), 50.0, 1.0))
    house, bunker, barrier = site.structures
    assert (house.height_m, house.faces) == (6.0, ("west", "south"))
    assert (bunker.height_m, bunker.faces) == (None, WALLS)
    assert (barrier.height_m, barrier.faces) == (3.0, WALLS)
    assert site.air_height_m == 14.0
    assert site.gauges == (Gauge("door", (19.75, 10.0, 1.5)), Gauge("roof", (21.0, 10.0, 6.5)))
    assert site.charge == Charge((2.0, 10.0), 50.0, 1.0)
    assert site.charge_centre == (2.0 * UNITS_PER_M, 10.0 * UNITS_PER_M)


@pytest.mark.parametrize("name", ["courtyard", "street_junction"])
@pytest.mark.parametrize("seed", [0, 7])
def test_site_of_a_blast_is_that_of_its_particles(name: str, seed: int) -> None:
    """The same seed draws the same charge for every engine."""
    scenario = load_scenario(name)
    cell = next(zip(*np.nonzero(usable_cells(scenario)), strict=True))
    scene, site = (build(scenario, [cell], seed) for build in (build_scene, build_site))
    for field in ("site", "charge_centre", "charge", "structures", "gauges", "air_height_m"):
        assert getattr(site, field) == getattr(scene, field)
    assert site.charge == draw_charge(scenario, seed)


def test_charges_carry_their_height() -> None:
    scenario = scenario_from(tall_document())
    heights = {scenario.sample_charge(np.random.default_rng(seed)).height_m for seed in range(20)}
    assert heights == {0.0, 1.0}
    raised = scenario_from(full_document()).with_charge(Charge((8.0, 15.0), 50.0, 2.0))
    assert raised.sample_charge(np.random.default_rng(0)) == Charge((8.0, 15.0), 50.0, 2.0)
    assert raised.schema_version == 2
    assert scenario_from(raised.model_dump()) == raised
    lowered = raised.with_charge(Charge((8.0, 15.0), 50.0))
    assert lowered.schema_version == 1
    assert lowered.content_hash != raised.content_hash
