"""What a league asks: nobody has met the blasts that layouts are judged on."""

from pathlib import Path

import pytest
from blast_agents.league import (
    Track,
    find_tracks,
    hidden_track,
    known_track,
    sites_track,
    vehicle_track,
)
from blast_agents.league.tracks import MOST_CASES, MOST_LEAGUE_SEED, MOST_SEEDS, practice_of
from hypothesis import given, settings
from hypothesis import strategies as st

from blast_env.errors import BlastEnvError
from blast_env.evaluation import SeedRange
from blast_env.site import PointSource, VehicleCharge, save_scenario
from blast_env.site.scene import Charge
from blast_env.sites import FAMILIES, HELD_OUT_SITES, SiteSource
from tests.agents.league_cases import ROAD, road_scenario
from tests.vehicle_sites import gate_site

SCENARIO = road_scenario()


def seeds_of(track: Track) -> list[int]:
    return [threat.seed for case in track.cases for threat in case.threats]


@settings(max_examples=20, deadline=None)
@given(cases=st.integers(1, 6), seeds=st.integers(1, 6), seed=st.integers(0, MOST_LEAGUE_SEED))
def test_held_out_blasts_are_met_once_and_never_before(cases: int, seeds: int, seed: int) -> None:
    """No blast is met twice, and each kind has its own range of seeds."""
    for track in (known_track(SCENARIO, cases, seeds, seed), hidden_track(SCENARIO, seeds, seed)):
        held_out = seeds_of(track)
        assert all(seed in SeedRange.JUDGEMENT.value for seed in held_out)
        assert len(set(held_out)) == len(held_out)
        practised = [t.seed for case in track.cases for t in practice_of(case).threats]
        assert all(seed in SeedRange.SEARCH.value for seed in practised)


def test_seeds_of_different_leagues_and_cases_cannot_meet() -> None:
    """The stride from case to case, and from league to league, holds the most there may be."""
    last = known_track(SCENARIO, MOST_CASES, 1, 0).cases[-1].threats[0].seed
    assert hidden_track(SCENARIO, 1, 1).cases[0].threats[0].seed - last >= 4 * MOST_SEEDS


def test_a_known_threat_is_the_same_charge_in_search_and_judgement() -> None:
    track = known_track(SCENARIO, 5, 3)
    told = [case.charge for case in track.cases if isinstance(case.charge, Charge)]
    places = {charge.position_m for charge in told}
    assert len(places) == 5
    (x_m, low_m), (_, high_m) = ROAD.start_m, ROAD.end_m
    assert all(x == x_m and low_m <= y <= high_m for x, y in places)
    for case in track.cases:
        threats = (*practice_of(case).threats, *case.threats)
        assert {threat.charge for threat in threats} == {case.charge}


def test_a_hidden_threat_is_judged_at_places_of_its_own() -> None:
    (case,) = hidden_track(SCENARIO, 3).cases
    assert case.charge is None
    assert len(case.threats) == 12
    searched = {threat.charge for threat in practice_of(case).threats}
    judged = {threat.charge for threat in case.threats}
    assert len(searched) == 16
    assert len(judged) == 12
    assert not searched & judged


def test_sites_are_those_that_training_never_sees() -> None:
    (track,) = find_tracks("sites", 3, 2)
    held_out = [site.content_hash for site in SiteSource(0, 3)]
    assert [case.scenario.content_hash for case in track.cases] == held_out
    assert HELD_OUT_SITES > 3
    assert all(case.charge is None for case in track.cases)
    assert track.site == "sites"


def test_more_cases_and_seeds_keep_the_first_ones() -> None:
    """So that a larger league goes on from a smaller one."""
    few, many = known_track(SCENARIO, 2, 3), known_track(SCENARIO, 4, 5)
    for one, other in zip(few.cases, many.cases, strict=False):
        assert one.charge == other.charge
        assert practice_of(one).threats == practice_of(other).threats
        assert one.threats == other.threats[:3]


def test_another_seed_asks_something_else() -> None:
    one, other = (known_track(SCENARIO, 2, 2, seed).cases for seed in (0, 1))
    assert not {case.charge for case in one} & {case.charge for case in other}


def test_all_tracks_and_the_reference_of_each(tmp_path: Path) -> None:
    path = tmp_path / "road.toml"
    save_scenario(SCENARIO, path)
    tracks = find_tracks("all", 1, 1, scenarios=[str(path)])
    found = [(track.name, track.threat, track.reference_budget) for track in tracks]
    assert found == [
        ("known_road", "visible", 200),
        ("hidden_road", "hidden", 200),
        ("sites", "hidden", 50),
    ]
    assert [track.name for track in find_tracks("known", 1, 1)] == [
        "known_courtyard",
        "known_perimeter_gate",
    ]


def test_bundled_vehicles_are_for_engines_that_can_judge_them() -> None:
    """Their scenarios name no calibration, so particles have no loads in Pa s to compare."""
    particles = [track.name for track in find_tracks("all", 1, 1)]
    gas = [track.name for track in find_tracks("all", 1, 1, noisy=False)]
    vehicles = ("hotel_forecourt", "ministry_kerb", "shopping_street")
    of_gas = [*(f"vehicle_{name}" for name in vehicles), "item_sites"]
    assert [name for name in gas if name not in particles] == of_gas
    assert "sites" in particles
    with pytest.raises(BlastEnvError, match="--engine gas"):
        find_tracks("vehicle", 1, 1)


def test_each_family_of_sites_is_a_track_of_its_own() -> None:
    (plain,), (items,), (large,) = (find_tracks(family, 2, 1) for family in FAMILIES)
    assert (plain.site, items.site) == (plain.name, items.name) == ("sites", "item_sites")
    assert large.site == large.name == "large_sites"
    assert all(not case.scenario.zone.items for case in plain.cases)
    assert all(case.scenario.zone.items for case in items.cases)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("knwon", 1, 1), "did you mean 'known'"),
        (("known", 0, 1), "cases is 0, must be an integer from 1 to 1000"),
        (("sites", 1001, 1), "cases is 1001"),
        (("hidden", 1, 0), "seeds is 0, must be an integer from 1 to 1000"),
        (("hidden", 1, 1, 1001), "seed is 1001"),
        (("sites", 1, 1, 0, ["courtyard"]), "generates its own"),
        (("item_sites", 1, 1, 0, ["courtyard"]), "'item_sites' generates its own"),
        (("known", 1, 1, 0, ["courtyard", "courtyard"]), "'known_courtyard' appears twice"),
        (("known", 1, 1, 0, ["free_field"]), "no build zone"),
    ],
)
def test_bad_input_is_refused(arguments: tuple, words: str) -> None:
    with pytest.raises(BlastEnvError, match=words):
        find_tracks(*arguments)


def test_no_sites_are_refused() -> None:
    with pytest.raises(BlastEnvError, match="cases is 0"):
        sites_track([], 1)


def test_without_noise_a_known_charge_is_one_blast() -> None:
    for case in known_track(SCENARIO, 3, 16, noisy=False).cases:
        assert (len(case.threats), len(practice_of(case).threats)) == (1, 1)
        assert practice_of(case).threats[0].charge == case.threats[0].charge == case.charge


def test_without_noise_a_charge_that_is_drawn_again_is_no_other_case() -> None:
    places = [PointSource(kind="point", position_m=(2.0, y), tnt_kg=5.0) for y in (4.0, 8.0)]
    scenario = SCENARIO.model_copy(update={"charge": tuple(places)})
    track = known_track(scenario, 16, 1, noisy=False)
    assert track.title == "Known threat at one of 2 fixed places: road"
    assert track.has_all_charges
    assert not known_track(scenario, 1, 1).has_all_charges
    cases = track.cases
    met = [case.charge.position_m for case in cases if isinstance(case.charge, Charge)]
    assert sorted(met) == [(2.0, 4.0), (2.0, 8.0)]
    assert len(cases) == 2
    assert len(known_track(scenario, 16, 1).cases) == 16


def test_a_vehicle_is_a_hidden_threat_of_a_site_that_has_one(tmp_path: Path) -> None:
    track = vehicle_track(gate_site(), 2)
    assert (track.name, track.threat) == ("vehicle_gate", "hidden")
    (case,) = track.cases
    assert all(isinstance(charge, VehicleCharge) for charge in case.charges)
    assert len(case.threats) == 8
    (alone,) = vehicle_track(gate_site(), 2, noisy=False).cases
    for threats in (alone.threats, practice_of(alone).threats):
        places = {each.charge_against(alone.scenario, ()).position_m for each in threats}
        assert len(places) == len(threats) == 4
    with pytest.raises(BlastEnvError, match="has no vehicle"):
        vehicle_track(SCENARIO, 2)
    path = tmp_path / "gate.toml"
    save_scenario(gate_site(), path)
    (found,) = find_tracks("vehicle", 1, 2, scenarios=[str(path)])
    assert found.name == track.name
