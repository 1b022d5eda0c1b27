"""Edits of a site: on the grid, sound, or refused in the library's own words."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env.app import edits
from blast_env.app.edits import SiteThing, ThingKind
from blast_env.errors import BlastEnvError
from blast_env.site import Scenario, ScenarioError, load_scenario
from tests import builders
from tests.gas_sites import hut
from tests.test_terraces import HALL, TERRACE, terraced
from tests.vehicle_sites import gate_site, vehicle_document, vehicle_of

COURTYARD = load_scenario("courtyard")
BUILDING = SiteThing(ThingKind.STRUCTURE)
OFFSETS = st.floats(-60.0, 60.0, allow_nan=False)


def on_grid(*values: float) -> bool:
    return all(abs(2.0 * value - round(2.0 * value)) < 1e-9 for value in values)


@given(OFFSETS, OFFSETS)
def test_a_structure_lands_on_the_grid_or_is_refused(x_m: float, y_m: float) -> None:
    left, bottom = 27.0 + edits.snapped(x_m), 10.0 + edits.snapped(y_m)
    try:
        moved = edits.moved(COURTYARD, BUILDING, (x_m, y_m))
    except ScenarioError:
        # Off the site, over the charge or over all of the zone.
        assert not (22.0 <= left <= 36.0 and 0.0 <= bottom <= 20.0)
        return
    assert moved.structures[0].corner_m == (left, bottom)
    corner = moved.structures[0].corner_m
    assert on_grid(*corner)
    assert abs(corner[0] - 27.0 - x_m) <= 0.25 + 1e-9
    assert moved.site.rectangle_m.contains(moved.structures[0].rectangle_m)
    assert moved.structures[0].rows == COURTYARD.structures[0].rows


def test_a_move_and_its_reverse_give_the_same_site() -> None:
    there = edits.moved(COURTYARD, BUILDING, (1.5, -2.0))
    assert there != COURTYARD
    assert edits.moved(there, BUILDING, (-1.5, 2.0)) == COURTYARD


def test_a_gauge_is_put_into_the_middle_of_a_cell_of_half_a_metre() -> None:
    moved = edits.moved(hut(), SiteThing(ThingKind.GAUGE, 1), (-0.1, 1.1))
    assert moved.gauges[1].position_m == (9.0 - 0.25, 5.25, 0.25)


def test_a_line_of_charges_moves_as_a_whole_and_ends_where_it_is_drawn_to() -> None:
    moved = edits.moved(COURTYARD, SiteThing(ThingKind.CHARGE), (0.6, 0.0))
    assert moved.charge[0].segment_m == ((5.5, 6.0), (5.5, 24.0))  # type: ignore[union-attr]
    longer = edits.resized(COURTYARD, SiteThing(ThingKind.CHARGE), (6.1, 20.2))
    assert longer.charge[0].segment_m == ((5.0, 6.0), (6.0, 20.0))  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("kind", "start", "end"),
    [
        (ThingKind.STRUCTURE, (30.2, 2.1), (34.4, 4.9)),
        (ThingKind.CHARGE, (2.0, 3.0), (2.0, 3.0)),
        (ThingKind.CHARGE, (2.0, 3.0), (8.0, 3.0)),
        (ThingKind.KEEP_OUT, (14.0, 20.0), (15.9, 21.1)),
        (ThingKind.COST_AREA, (14.0, 20.0), (15.9, 21.1)),
        (ThingKind.GAUGE, (24.1, 15.2), (24.1, 15.2)),
    ],
)
def test_what_is_drawn_can_be_taken_away_again(kind: ThingKind, start: Any, end: Any) -> None:
    after, thing = edits.added(COURTYARD, kind, start, end)
    assert thing in {case for case, _ in edits.things(after)}
    assert after != COURTYARD
    assert edits.removed(after, thing) == COURTYARD


def test_a_drawn_zone_keeps_what_holds_in_the_old_one() -> None:
    after, _ = edits.added(COURTYARD, ThingKind.ZONE, (12.6, 4.0), (22.0, 26.4))
    assert after.zone.corner_m == (12.5, 4.0)
    assert after.zone.shape == (45, 19)
    assert after.zone.keep_outs == COURTYARD.zone.keep_outs
    unprotected = edits.removed(COURTYARD, SiteThing(ThingKind.ZONE))
    assert unprotected.build_zone is None
    assert edits.added(unprotected, ThingKind.ZONE, (13.0, 5.0), (15.0, 7.0))[0].zone.stock == 4


def test_the_reason_is_that_of_the_library() -> None:
    with pytest.raises(ScenarioError, match="must lie inside the site"):
        edits.moved(COURTYARD, BUILDING, (30.0, 0.0))
    with pytest.raises(ScenarioError, match="none is protected"):
        edits.with_values(COURTYARD, BUILDING, {"protected": False})
    with pytest.raises(BlastEnvError, match="no build zone"):
        edits.added(
            edits.removed(COURTYARD, SiteThing(ThingKind.ZONE)),
            ThingKind.KEEP_OUT,
            (1.0, 1.0),
            (2.0, 2.0),
        )
    with pytest.raises(BlastEnvError, match="site itself"):
        edits.removed(COURTYARD, SiteThing(ThingKind.SITE))


def test_heights_come_and_go() -> None:
    high = edits.with_values(COURTYARD, BUILDING, {"height_m": 6.0})
    assert high.structures[0].height_m == 6.0
    assert edits.with_values(high, BUILDING, {"height_m": None}) == COURTYARD


@pytest.mark.parametrize(
    ("place", "expected"),
    [
        ((28.0, 15.0), BUILDING),
        ((5.2, 10.0), SiteThing(ThingKind.CHARGE)),
        ((14.0, 15.0), SiteThing(ThingKind.KEEP_OUT)),
        ((14.0, 20.0), SiteThing(ThingKind.ZONE)),
        ((38.0, 2.0), None),
    ],
)
def test_what_is_on_top_is_what_one_points_at(place: Any, expected: SiteThing | None) -> None:
    assert edits.thing_at(COURTYARD, place[0], place[1], 0.5) == expected


def test_a_house_in_the_courtyard_of_another_is_found() -> None:
    """The rectangle around a polygon has other houses in it."""
    kiosk = builders.block("kiosk", 18.0, 12.0, 4, 4, height_m=3.0, protected=True)
    ring = {
        "kind": "polygon",
        "name": "ring",
        "outline_m": [[10.0, 5.0], [30.0, 5.0], [30.0, 25.0], [10.0, 25.0]],
        "courtyards_m": [[[14.0, 9.0], [26.0, 9.0], [26.0, 21.0], [14.0, 21.0]]],
        "height_m": 6.0,
    }
    site = builders.site("s", (40.0, 30.0), builders.point(3.0, 3.0), kiosk, ring)
    found = [edits.thing_at(site, x, 13.0, 0.5) for x in (12.0, 16.0, 19.0)]
    assert found == [SiteThing(ThingKind.STRUCTURE, 1), None, SiteThing(ThingKind.STRUCTURE, 0)]


def test_a_square_stays_a_square() -> None:
    field = load_scenario("free_field")
    thing = SiteThing(ThingKind.STRUCTURE)
    left, bottom = field.structures[0].corner_m
    larger = edits.resized(field, thing, (left + 6.0, bottom + 5.0))
    assert larger.structures[0].rows == larger.structures[0].columns == 12


def test_every_thing_has_a_rectangle() -> None:
    scenario: Scenario = hut()
    for thing, words in edits.things(scenario):
        assert words
        assert scenario.site.rectangle_m.contains(edits.rectangle_of(scenario, thing))
    with pytest.raises(BlastEnvError, match="has no gauge 7"):
        edits.rectangle_of(scenario, SiteThing(ThingKind.GAUGE, 7))


def test_a_terrace_is_below_all_that_stands_on_it() -> None:
    site = terraced(structures=[HALL, TERRACE])
    places = {(9.0, 5.0): (ThingKind.STRUCTURE, 0), (6.5, 5.0): (ThingKind.ZONE, 0)}
    places[12.75, 9.5] = (ThingKind.STRUCTURE, 1)
    for place, thing in places.items():
        assert edits.thing_at(site, *place, 0.5) == thing
    assert dict(edits.things(site))[SiteThing(ThingKind.STRUCTURE, 1)] == "podium, terrace"


def test_what_is_drawn_on_a_terrace_stands_on_it() -> None:
    site = terraced()
    after, thing = edits.added(site, ThingKind.STRUCTURE, (8.5, 8.5), (10.5, 9.5), 2.5)
    hut_there = after.structures[thing.number]
    assert (hut_there.base_m, hut_there.height_m) == (1.0, 3.5)
    beside, thing = edits.added(site, ThingKind.STRUCTURE, (8.5, 10.5), (10.5, 11.5), 2.5)
    assert (beside.structures[-1].base_m, beside.structures[-1].height_m) == (0.0, 2.5)


def test_what_stood_on_a_terrace_stands_on_the_ground_after_an_edit() -> None:
    site, hall, podium = (
        terraced(),
        SiteThing(ThingKind.STRUCTURE),
        SiteThing(ThingKind.STRUCTURE, 1),
    )
    bare = edits.removed(site, podium)
    assert (bare.structures[0].base_m, bare.structures[0].height_m) == (0.0, 3.0)
    for height_m in (0.5, 2.0):
        other = edits.with_values(site, podium, {"height_m": height_m}).structures[0]
        assert (other.base_m, other.height_m) == (height_m, height_m + 3.0)
    wide = terraced(TERRACE | {"columns": 8})  # the hall hangs over its eastern edge
    beside = edits.moved(wide, hall, (1.5, 0.0))
    assert (beside.structures[0].base_m, beside.structures[0].height_m) == (0.0, 3.0)
    (words,) = edits.settled_names(wide, beside)
    assert words == "hall stands on the ground below it, from 0 m (before: 1 m)"
    assert edits.moved(beside, hall, (-1.5, 0.0)) == wide
    plain = edits.with_values(site, podium, {"carries": False})
    assert plain.structures[0].base_m == 1.0  # it stands on the podium still
    assert edits.with_values(plain, podium, {"carries": True}) == site
    raised = edits.with_values(site, hall, {"base_m": 2.0})
    assert edits.removed(raised, podium).structures[0].base_m == 2.0  # it hung there


def test_an_entry_of_a_vehicle_moves_along_its_side_of_the_border() -> None:
    sides = [([0.0, 2.0], [0.0, 6.0]), ([0.5, 8.0], [3.0, 8.0])]
    entries = [{"start_m": start, "end_m": end} for start, end in sides]
    site, vehicle = gate_site(vehicle_document(entries=entries)), SiteThing(ThingKind.CHARGE)
    west, north = vehicle_of(edits.moved(site, vehicle, (0.4, 1.1), (0.1, 3.0))).entries
    assert (west.start_m, west.end_m, north) == (
        (0.0, 3.0),
        (0.0, 7.0),
        vehicle_of(site).entries[1],
    )
    west, north = vehicle_of(edits.moved(site, vehicle, (1.0, -1.0))).entries
    assert (west.start_m, north.end_m) == ((0.0, 1.0), (4.0, 8.0))
    with pytest.raises(BlastEnvError, match="moves along its side of the border"):
        edits.moved(site, vehicle, (2.0, 0.0), (0.0, 4.0))
    with pytest.raises(ScenarioError):
        edits.moved(site, vehicle, (0.0, 4.0), (0.0, 4.0))  # beyond the corner of the site


def test_the_name_of_a_preset_sets_the_mass_of_a_charge() -> None:
    charge = SiteThing(ThingKind.CHARGE, 0)
    named = edits.with_values(COURTYARD, charge, {"threat": "van"})
    assert named.charge[0].tnt_kg == 454.0
    other = edits.with_values(named, charge, {"threat": "parcel"})
    assert other.charge[0].tnt_kg == 454.0
    assert "parcel, 454 kg" in [words for _, words in edits.things(other)]
