"""Heights, faces, gauges, buildings and georeferences."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env.layout import build_site, draw_charge, usable_cells
from blast_env.particles import build_scene
from blast_env.site import (
    WALLS,
    Charge,
    Gauge,
    Scenario,
    ScenarioError,
    bundled_scenarios,
    load_scenario,
)
from tests.site.documents import (
    Document,
    KeyPath,
    all_documents,
    changed,
    full_document,
    lines_for,
    minimal_document,
    tall_document,
    value_at,
    without,
)


def scenario_from(document: Document) -> Scenario:
    return Scenario.from_document(document, "f.toml")


@pytest.mark.parametrize("document", all_documents(), ids=lambda document: document["name"])
def test_document_of_a_scenario_makes_the_same_scenario(document: Document) -> None:
    scenario = scenario_from(document)
    for mode in ("python", "json"):
        assert scenario_from(scenario.model_dump(mode=mode)) == scenario
    left_out = scenario.model_dump(exclude={"charge", "site", "schema_version"})
    assert set(left_out).isdisjoint({"charge", "site", "schema_version"})


@pytest.mark.parametrize(
    ("georeference", "lines"),
    [
        ({"kind": "mp"}, ["georeference.kind: Input tag 'mp' found"]),
        ({"x_m": 1.0}, ["georeference.kind: missing, must be 'map' or 'drawing'"]),
        (
            {"kind": "map", "longitude_deg": 181.0, "latitude_deg": 91.0, "z_m": 1.0},
            [
                "georeference.longitude_deg: is 181.0: Input should be less than",
                "georeference.latitude_deg: is 91.0: Input should be less than",
                "georeference.z_m: unknown key; known: ",
            ],
        ),
        (
            {"kind": "drawing", "x_m": 0.0, "y_m": 0.0, "metres_per_unit": 0.0},
            ["georeference.metres_per_unit: is 0.0: Input should be greater than"],
        ),
        (4, ["georeference: is 4: Input should be a valid dictionary"]),
    ],
)
def test_georeference_out_of_bounds_is_named(georeference: object, lines: list[str]) -> None:
    found = lines_for(changed(tall_document(), ("georeference",), georeference))
    for line in lines:
        assert any(text.startswith(f"f.toml: {line}") for text in found), (line, found)


def test_every_wall_without_a_height_is_as_high_as_the_air() -> None:
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
    assert site.gauges == (Gauge("door", (19.75, 10.0, 1.5)), Gauge("roof", (20.25, 10.0, 6.5)))
    assert site.charge == Charge((2.0, 10.0), 50.0, 1.0)


@pytest.mark.parametrize("name", ["courtyard", "street_junction"])
@pytest.mark.parametrize("seed", [0, 7])
def test_site_of_a_blast_is_that_of_its_particles(name: str, seed: int) -> None:
    """The same seed draws the same charge for every engine."""
    scenario = load_scenario(name)
    cell = next(zip(*np.nonzero(usable_cells(scenario)), strict=True))
    scene, site = (build(scenario, [cell], seed) for build in (build_scene, build_site))
    for field in ("site_m", "charge", "structures", "gauges", "air_height_m"):
        assert getattr(site, field) == getattr(scene, field)
    assert site.charge == draw_charge(scenario, seed)


def test_charges_carry_their_height() -> None:
    scenario = scenario_from(tall_document())
    heights = {scenario.sample_charge(np.random.default_rng(seed)).height_m for seed in range(20)}
    assert heights == {0.0, 1.0}
    raised = scenario_from(full_document()).with_charge(Charge((8.0, 15.0), 50.0, 2.0))
    assert raised.sample_charge(np.random.default_rng(0)) == Charge((8.0, 15.0), 50.0, 2.0)
    assert scenario_from(raised.model_dump()) == raised
    lowered = raised.with_charge(Charge((8.0, 15.0), 50.0))
    assert lowered.content_hash != raised.content_hash


HOUSE_HIGH, GAUGE = ("structures", 0, "height_m"), ("gauges", 0, "position_m")
FACES = ("structures", 0, "faces")
AIR = "the height of the air (which site.air_height_m can raise)"


@pytest.mark.parametrize(
    ("path", "value", "line"),
    [
        (HOUSE_HIGH, 14.5, f"structures[0].height_m: is 14.5, must be at most 14, {AIR}"),
        (
            ("charge", 1, "height_m"),
            14.1,
            f"charge[1].height_m: is 14.1, must be at most 14, {AIR}",
        ),
        (
            ("charge", 0, "position_m"),
            [21.0, 10.0],
            "charge[0]: its centre comes as near as 0 m to structures[0], 'house' (x 20 to 22 m, y"
            " 8 to 12 m), must keep clear of it by 0.5 m, the charge's radius, or be higher than"
            " its 6 m",
        ),
        (
            FACES,
            ["west", "top"],
            "structures[0].faces[1]: is 'top': Input should be 'west', 'east'",
        ),
        (FACES, 2 * ["west"], "structures[0].faces: is an array, must name each wall at most once"),
        (("gauges", 1, "name"), "door", "gauges[1].name: is 'door', already the name of gauges[0]"),
        (GAUGE, [30.5, 10, 1], "gauges[0].position_m: (30.5, 10) must lie inside the site (x 0 to"),
        (GAUGE, [3, 10, 14.5], f"gauges[0].position_m[2]: is 14.5, must be at most 14, {AIR}"),
        (
            GAUGE,
            [20.75, 10.0, 1.5],
            "gauges[0].position_m: (20.75, 10), 1.5 m high, is 0.75 m deep inside structures[0],"
            " 'house' (x 20 to 22 m, y 8 to 12 m), 6 m high, must be at most 0.5 m deep",
        ),
    ],
)
def test_what_cannot_stand_is_named(path: KeyPath, value: object, line: str) -> None:
    lines = lines_for(changed(tall_document(), path, value))
    assert len(lines) == 1 or path == ("site", "air_height_m"), lines
    assert lines[0].startswith(f"f.toml: {line}")


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("structures", 0, "height_m"), 0.5),
        (("structures", 0, "height_m"), 14.0),  # up to the top of the air
        (("build_zone", "height_m"), 0.7),  # the cells are the engine's matter
        (("charge", 1, "height_m"), 14.0),
        (("gauges", 0, "position_m"), [0.0, 20.0, 0.0]),  # in a corner of the site, on the ground
        (("gauges", 0, "position_m"), [20.5, 10.0, 1.5]),  # in the wall, a module deep
        (("gauges", 0, "position_m"), [21.0, 10.0, 5.5]),  # the same in the roof
        (("gauges", 0, "position_m"), [3.0, 3.0, 14.0]),
    ],
)
def test_what_only_just_stands_is_allowed(path: KeyPath, value: object) -> None:
    assert lines_for(changed(tall_document(), path, value)) == []


def row_of_houses(gauge_m: tuple[float, float, float], gap_m: float = 0.0) -> Document:
    """Return a document with two houses of 4 x 3 m side by side, and a gauge."""
    document = minimal_document()
    sizes = {"kind": "ModularObstacle", "rows": 6, "columns": 8, "protected": True, "height_m": 4.0}
    document["structures"] = [
        sizes | {"name": "left", "corner_m": [10.0, 4.0]},
        sizes | {"name": "right", "corner_m": [14.0 + gap_m, 4.0]},
    ]
    document["gauges"] = [{"name": "seam", "position_m": gauge_m}]
    return document


@pytest.mark.parametrize("x_m", [13.75, 14.0, 14.25])
def test_a_gauge_on_the_seam_of_two_structures_is_refused(x_m: float) -> None:
    """It is on the surface of each, or near it, and far from the air; the blast had refused it."""
    line, *others = lines_for(row_of_houses((x_m, 5.5, 2.0)))
    assert others == []
    assert line == (
        f"f.toml: gauges[0].position_m: ({x_m:g}, 5.5), 2 m high, is where structures[0], 'left'"
        " (x 10 to 14 m, y 4 to 7 m) and structures[1], 'right' (x 14 to 18 m, y 4 to 7 m) meet,"
        " must be at most 0.5 m from the air"
    )


@pytest.mark.parametrize(
    ("gauge_m", "gap_m"),
    [
        ((14.0, 4.0, 2.0), 0.0),  # where the seam meets the air, at the front
        ((14.0, 4.5, 2.0), 0.0),  # a module behind it
        ((14.0, 5.5, 3.5), 0.0),  # a module below the roofs
        ((14.0, 5.5, 2.0), 0.5),  # a gap between them
    ],
)
def test_a_gauge_on_a_seam_near_the_air_is_allowed(
    gauge_m: tuple[float, float, float], gap_m: float
) -> None:
    assert lines_for(row_of_houses(gauge_m, gap_m)) == []


def test_unsound_structure_does_not_make_the_air_too_low() -> None:
    """It might be the highest, and then the air would be high enough."""
    document = without(tall_document(), ("site", "air_height_m"))
    document["structures"][0] |= {"height_m": 20.0, "rows": 0}
    document["gauges"][1]["position_m"] = [21.0, 10.0, 25.0]
    (line,) = lines_for(document)
    assert "structures[0].rows: is 0" in line


HEIGHT = st.none() | st.floats(0.5, 60.0)


@given(HEIGHT, HEIGHT, HEIGHT)
def test_air_is_6_m_higher_than_anything_and_at_least_12_m(
    house: float | None, bunker: float | None, modules: float | None
) -> None:
    document = without(tall_document(), ("gauges",))
    del document["site"]["air_height_m"]
    tables = (*document["structures"], document["build_zone"])
    for table, height_m in zip(tables, (house, bunker, modules), strict=True):
        table["height_m"] = height_m
    scenario = scenario_from(document)
    heights = [height_m for height_m in (house, bunker, modules) if height_m is not None]
    assert scenario.air_height_m == max([12.0, *(height_m + 6.0 for height_m in heights)])
    assert build_site(scenario).air_height_m == scenario.air_height_m
    document["site"]["air_height_m"] = scenario.air_height_m
    assert scenario_from(document).content_hash == scenario.content_hash


@given(st.tuples(st.floats(0.0, 30.0), st.floats(0.0, 20.0), st.floats(0.0, 14.0)))
def test_gauge_is_refused_just_where_there_is_no_air_within_half_a_metre(
    position_m: tuple[float, float, float],
) -> None:
    document = tall_document()
    document["gauges"] = [{"name": "probe", "position_m": list(position_m)}]
    x, y, z = position_m
    in_house = 20.5 < x < 21.5 and 8.5 < y < 11.5 and z < 5.5
    in_bunker = 15.5 < x < 16.5 and 15.5 < y < 16.5
    edges = (*(x - k for k in (15.5, 16.5, 20.5, 21.5)), *(y - k for k in (8.5, 11.5, 15.5, 16.5)))
    if min(map(abs, (*edges, z - 5.5))) > 1e-6:
        assert bool(lines_for(document)) == (in_house or in_bunker)


def over_the_roof() -> Document:
    document = changed(tall_document(), ("charge", 0, "position_m"), [21.0, 10.0])
    return changed(document, ("charge", 0, "height_m"), 7.0)


def test_charge_over_a_roof_is_for_engines_with_heights() -> None:
    scenario = scenario_from(over_the_roof())
    charge = Charge((21.0, 10.0), 50.0, 7.0)
    assert build_site(scenario, charge=charge).charge == charge
    with pytest.raises(ScenarioError) as caught:
        build_scene(scenario, charge=charge)
    assert str(caught.value) == (
        "tall: charge: is at (21, 10) m, 7 m high, over 'house' of 6 m: the particle engines know"
        " no heights and would put it inside, must be clear of it in plan, or the engine one with"
        " heights"
    )
    beside = charge._replace(position_m=(18.0, 10.0))
    assert build_scene(scenario, charge=beside).charge == beside


@pytest.mark.parametrize("height_m", [0.0, 5.9, 6.0])
def test_charge_inside_a_building_is_refused(height_m: float) -> None:
    scenario = scenario_from(tall_document())
    with pytest.raises(ScenarioError, match="or be higher than its 6 m"):
        scenario.with_charge(Charge((21.0, 10.0), 50.0, height_m))
    with pytest.raises(ScenarioError, match="must keep clear of it"):
        scenario.with_charge(Charge((16.0, 16.0), 50.0, 13.0))  # as high as the air
    with pytest.raises(ScenarioError, match=r"height_m: is 15, must be at most 14"):
        scenario.with_charge(Charge((2.0, 10.0), 50.0, 15.0))
    with pytest.raises(ScenarioError, match=r"height_m: is -1.0: Input should be greater"):
        scenario.with_charge(Charge((2.0, 10.0), 50.0, -1.0))


def test_engines_without_heights_can_say_what_they_leave_aside() -> None:
    assert scenario_from(full_document()).height_notes == ()
    bundled = [load_scenario(name) for name in bundled_scenarios()]
    without_heights = {name.name for name in bundled if not name.height_notes}
    assert without_heights == {"courtyard", "free_field", "perimeter_gate", "street_junction"}
    notes = scenario_from(tall_document()).height_notes
    words = ("endlessly high", "on the ground", "all walls", "gauges record nothing")
    assert len(notes) == len(words)
    assert all(word in note for word, note in zip(words, notes, strict=True))


@pytest.mark.parametrize(
    "path",
    [
        ("gauges",),
        ("charge", 0, "height_m"),
        ("structures", 0, "height_m"),
        ("structures", 0, "faces"),
        ("build_zone", "height_m"),
    ],
)
def test_each_note_has_its_cause(path: KeyPath) -> None:
    document = minimal_document()
    zone = {"corner_m": [5.0, 0.0], "rows": 20, "columns": 4, "stock": 12}
    document["build_zone"] = zone
    assert scenario_from(document).height_notes == ()
    value = value_at(tall_document(), path)
    if path == ("gauges",):
        value = [{"name": "door", "position_m": [1.0, 1.0, 1.0]}]
    assert len(scenario_from(changed(document, path, value)).height_notes) == 1
