"""The parts of a report that need no blast: threats, limits, durations."""

from math import hypot, inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env.answers.report import Limit, StudyOptions, StudyPlan
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.evaluation import LoadCase, ThreatOutcome
from blast_env.evaluation.blasts import Severity
from blast_env.evaluation.engines.gas import GasBlast
from blast_env.evaluation.engines.walls import PeakSource, first_phase_s
from blast_env.evaluation.places import chief_threats, other_places, place_text, requested_threats
from blast_env.evaluation.questions.limits import check_limits
from blast_env.evaluation.record import BuildingLoad
from blast_env.evaluation.validation import UNSTATED
from blast_env.site import Charge, Scenario, ScenarioError
from tests.gas_sites import site_document
from tests.report.sites import small_hut
from tests.vehicle_sites import POSTS, gate_site, vehicle_document


def site_with(*charges: dict[str, object]) -> Scenario:
    return Scenario.from_document(site_document(charge=list(charges)), "hut")


ROAD = {"kind": "segment", "start_m": [1.0, 1.0], "end_m": [1.0, 7.0], "tnt_kg": 8.0}
YARD = {"kind": "rectangle", "corner_m": [1.0, 1.0], "size_m": [2.0, 1.0], "tnt_kg": 1.0}


def test_threats_are_the_governing_places_of_their_sources_the_worst_first() -> None:
    scenario = site_with(ROAD, YARD)
    places = other_places(scenario, 3)
    loads = {place.charge: float(number) for number, place in enumerate(places)}
    loads[places[1].charge] = 1e3

    def severity(place: LoadCase) -> Severity:
        return Severity(load=loads[place.charge])

    first, second = chief_threats(places, severity, 6)
    assert (first.name, second.name) == ("T1", "T2")
    assert (first.charge, second.charge) == (places[1].charge, places[-1].charge)
    assert first.why == ("charge source 1, the worst with the layout of 3 places examined")
    assert [chief_threat.charge for chief_threat in chief_threats(places, severity, 1)] == [
        first.charge
    ]


@given(st.floats(1.0, 3.0), st.floats(1.0, 7.0), st.floats(1.0, 3.0), st.floats(1.0, 7.0))
def test_no_place_of_a_street_is_nearer_than_those_looked_at(
    x0: float, y0: float, x1: float, y1: float
) -> None:
    road = {**ROAD, "start_m": [x0, y0], "end_m": [x1, y1]}
    scenario = site_with(road)
    left, bottom, right, top = scenario.structures[0].rectangle_m

    def away_m(x_m: float, y_m: float) -> float:
        return hypot(max(left - x_m, x_m - right, 0.0), max(bottom - y_m, y_m - top, 0.0))

    places = other_places(scenario, 1)
    shares = np.linspace(0.0, 1.0, 1000)
    nearest = min(away_m(x0 + s * (x1 - x0), y0 + s * (y1 - y0)) for s in shares)
    looked_at_m = min(away_m(*place.charge_against(scenario).position_m) for place in places)
    assert looked_at_m == pytest.approx(nearest, abs=0.01)


def test_the_nearest_place_is_near_the_walls_of_a_polygon_not_its_notch() -> None:
    document = site_document(charge=[ROAD | {"start_m": [1.0, 5.5], "end_m": [7.0, 5.5]}])
    corners = [(5.0, 2.0), (9.0, 2.0), (9.0, 6.0), (8.0, 6.0), (8.0, 3.0), (5.0, 3.0)]
    keys = {"kind": "polygon", "name": "angle", "height_m": 2.0, "protected": True}
    document["structures"] = [keys | {"outline_m": corners}]
    del document["build_zone"]
    site = Scenario.from_document(document, "angle")
    places = [place.charge_against(site).position_m for place in other_places(site, 1)]
    assert places == [(4.0, 5.5), (7.0, 5.5)]


def test_other_places_are_spread_over_every_source() -> None:
    site = site_with(ROAD, YARD, ROAD)
    places = other_places(site, 3)
    along_m = [place.charge_against(site).position_m for place in places[:3]]
    assert along_m == [(1.0, 1.0), (1.0, 4.0), (1.0, 7.0)]
    # The middle is nearest to the hut, the second road has the same places, the yard its corner.
    assert len(places) == 3 + 9
    assert {place.charge.tnt_kg for place in places[3:]} == {1.0}


def test_the_nearest_place_of_a_street_along_a_wall_is_before_its_middle() -> None:
    site = site_with(ROAD | {"start_m": [1.0, 2.5], "end_m": [1.0, 7.0]})
    last = other_places(site, 3)[-1].charge_against(site)
    assert last.position_m == (1.0, 4.0)


def test_charge_of_a_vehicle_comes_as_near_as_the_layout_lets_it() -> None:
    site = gate_site(vehicle_document(places=3, apart_m=2.0))
    places = other_places(site, 5)
    threat = places[0]
    # Its square of 2 m touches the hut at x = 10 m, or the posts at x = 4 m.
    assert threat.charge_against(site) == Charge((9.0, 4.0), 5.0)
    assert threat.charge_against(site, POSTS) == Charge((3.0, 4.0), 5.0)
    assert place_text(threat, site, POSTS) == (
        "(9.0, 4.0) m without the layout, (3.0, 4.0) m with it"
    )
    assert len({place.charge_against(site, POSTS) for place in places}) == len(places) == 3


def test_vehicles_outcomes_are_those_of_the_places_that_it_reaches() -> None:
    site = gate_site()
    plan = StudyPlan(site, POSTS, StudyOptions())
    outcome = ThreatOutcome.of(plan.places.campaign.run(), 0)
    near, far = (
        GasBlast(site, layout, charge=Charge((x_m, 4.0), 5.0)).run().impulse("hut").pa_s
        for layout, x_m in (((), 9.0), (POSTS, 3.0))
    )
    assert outcome.unprotected_load == pytest.approx(near)
    assert outcome.load == pytest.approx(far)


def test_threats_that_are_asked_for_must_be_clear() -> None:
    assert requested_threats(small_hut(), (Charge((2.0, 3.0), 5.0),))[0].name == "T1"
    with pytest.raises(ScenarioError, match="hut"):
        requested_threats(small_hut(), (Charge((6.5, 4.0), 5.0),))


# Limits.


def load(impulse_pa_s: float, peak_pa: float) -> BuildingLoad:
    counted = peak_pa, PeakSource.CURVE.value
    return BuildingLoad(
        *(1.0, 0.5 * peak_pa, *counted, 0.1, "west", impulse_pa_s, 0.1, True, False, UNSTATED)
    )


def test_limit_is_kept_by_loads_up_to_it() -> None:
    limit = Limit.parsed("hut=200,40")
    assert limit == Limit("hut", 200.0, 40_000.0)
    assert limit.is_kept(load(200.0, 40_000.0))
    assert not limit.is_kept(load(200.1, 1.0))
    assert not limit.is_kept(load(1.0, 40_001.0))
    assert Limit.parsed("hut=,40") == Limit("hut", inf, 40_000.0)
    assert Limit.parsed("hut=200") == Limit("hut", 200.0, inf)


@pytest.mark.parametrize("text", ["hut", "=1,2", "hut=", "hut=a", "hut=1,2,3", "hut=-1", "hut=,"])
def test_limit_that_is_none_is_named(text: str) -> None:
    with pytest.raises(BlastEnvError) as caught:
        Limit.parsed(text)
    assert f"--limit is {text!r}" in str(caught.value)


def test_limits_are_of_buildings_that_exist() -> None:
    with pytest.raises(UnknownNameError, match="no building 'hat', did you mean 'hut'"):
        check_limits([Limit("hat", 1.0)], ["hut"])
    with pytest.raises(BlastEnvError, match="twice for 'hut'"):
        check_limits([Limit("hut", 1.0), Limit("hut", 2.0)], ["hut"])


# Options, durations.


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"most_threats": 7}, "threats is 7, must be 1 to 6"),
        ({"cells": (0.25, 0.5)}, "must be two sizes, the coarser one first"),
        ({"cells": (0.5, 0.3)}, "cell_m is 0.3"),
        ({"places": 0}, "places is 0"),
    ],
)
def test_options_out_of_bounds(options: dict, words: str) -> None:
    with pytest.raises(BlastEnvError) as caught:
        StudyOptions(**options)
    assert words in str(caught.value)


def test_duration_of_a_triangle() -> None:
    """It rises at once at 3 ms and falls to 0 at 13 ms, then below."""
    time_s = np.arange(0.0, 0.03, 0.0005)
    pressure = np.where(time_s < 0.003, 0.0, 20_000.0 * (0.013 - time_s) / 0.01)
    pressure[time_s >= 0.02] = 5000.0  # a second wave, which does not count
    assert first_phase_s(time_s, pressure) == pytest.approx(0.0105, abs=1e-6)


def test_duration_of_what_never_comes_or_never_ends() -> None:
    time_s = np.linspace(0.0, 0.01, 11)
    assert np.isnan(first_phase_s(time_s, np.full(11, 900.0)))  # below 1 kPa
    assert np.isnan(first_phase_s(time_s, np.full(11, 2000.0)))
