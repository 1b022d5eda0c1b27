"""Uses and limits of a sound scenario, as `draw` prints them."""

import pytest

from blast_env import load_scenario
from blast_env.cli.suitability import suitability
from blast_env.evaluation import BlastEvaluator
from blast_env.site import Scenario
from tests.gas_sites import hut
from tests.vehicle_sites import gate_site

PLACING = "placing barriers"


def limits_of(scenario: Scenario | str) -> str:
    return "\n".join(suitability(scenario)[1])


@pytest.mark.parametrize("name", ["courtyard", "perimeter_gate", "street_junction"])
def test_bundled_scenarios_serve_for_placing_with_every_engine_said(name: str) -> None:
    (_, placing, report) = suitability(name)[0]
    assert report == "report (gas)"
    scenario = load_scenario(name)
    for engine in ("pymunk", "event", "gas"):
        assert engine in placing
        BlastEvaluator(scenario, engine)  # takes it


def test_free_field_serves_for_blasts_alone_and_says_all_reasons_at_once() -> None:
    uses, limits = suitability("free_field")
    assert uses == ["simulate with every engine"]
    said = "\n".join(limits)
    for words in (
        "no build zone: nothing can be placed",
        "preset 'ballistic' is not meant for design",
        "no height (building): as high as the air",
        "the charge is always at one place",
        "no gauges",
    ):
        assert words in said


def test_what_has_everything_is_limited_only_by_what_it_lacks() -> None:
    said = limits_of(hut())
    assert "no calibration: particles give simulation units alone" in said
    assert "no gauges" not in said
    assert "no height (" not in said
    assert "overrates walls" not in said
    assert PLACING in suitability(hut())[0][1]
    assert suitability(hut())[0][1].endswith("with gas")
    assert suitability(hut())[0][2] == "report (gas)"


def test_a_vehicle_is_said_with_what_refuses_it() -> None:
    assert "calibrate and simulate --stand-off refuse it" in limits_of(gate_site())


def test_a_wrong_calibration_is_said() -> None:
    said = limits_of(hut(calibration="collisional_kb"))
    assert "no loads in Pa s with pymunk" in said
    assert "no calibration" not in said


def test_masses_beyond_the_particles_are_said() -> None:
    scenario = hut(
        charge=[{"kind": "point", "position_m": [2.0, 4.0], "tnt_kg": 90_000.0}],
        simulation={"preset": "collisional", "overrides": {"explosive": {"ball_count": 20_000}}},
    )
    assert suitability(scenario)[0][0] == "simulate with gas"
    assert "particles cannot run it, gas can: charge[0].tnt_kg: is 90000" in limits_of(scenario)
