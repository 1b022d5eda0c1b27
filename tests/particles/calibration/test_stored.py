"""Stored calibrations: conversion per metre of facade, refusals, damaged files."""

import json
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from blast_env import Charge, load_scenario, simulate
from blast_env.calibration import PowerLaw, paper_table, shape_rms_percent
from blast_env.errors import BlastEnvError, UnknownNameError
from blast_env.evaluation.engines import CALIBRATED_ENGINES
from blast_env.geometry import Rectangle
from blast_env.particles.calibration import (
    CalibrationError,
    FreeFieldStudy,
    calibrated_engines,
    kingery_bulmash_reference,
    load_calibration,
    paper_reference,
    save_calibration,
    seen_width_m,
    stored_calibrations,
)
from blast_env.particles.calibration.free_field import free_field
from blast_env.site import Scenario, preset, with_overrides
from tests.scenarios import BALLISTIC_COURTYARD

CALIBRATION = load_calibration("ballistic_kb_100kg")
of_every_engine = pytest.mark.parametrize("engine", CALIBRATED_ENGINES)
of_every_calibration = pytest.mark.parametrize(
    ("name", "engine"),
    [(name, engine) for name in stored_calibrations() for engine in calibrated_engines(name)],
)


def test_the_ballistic_preset_meets_its_bounds_on_held_out_seeds() -> None:
    """The bounds that it was chosen for, on stored runs of seeds that the search did not use."""
    ufc = load_calibration("ballistic_ufc")
    assert ufc.metrics.mape_percent <= 8.0
    assert ufc.metrics.integral_error_percent <= 1.5
    assert shape_rms_percent(ufc.i_sim, paper_table().i_sim.to_numpy()) <= 20.0
    assert min(ufc.seeds) >= 1000
    assert ufc.distances_m == tuple(15.0 * n for n in range(1, 9))


@of_every_calibration
def test_the_collisional_preset_meets_its_bounds_on_held_out_seeds(name: str, engine: str) -> None:
    """An exponent far from 1 would mean that the law hides a wrong decay."""
    if not name.startswith("collisional"):
        return
    stored = load_calibration(name, engine)
    assert stored.metrics.mape_percent <= 6.0
    assert stored.metrics.integral_error_percent <= 1.5
    assert 0.7 <= stored.coefficients["B"] <= 1.4
    assert min(stored.seeds) >= 1000
    scaled_distance = np.array(stored.distances_m) / stored.tnt_kg ** (1.0 / 3.0)
    assert scaled_distance[[0, -1]] == pytest.approx([1.72, 8.62], abs=0.01)


@of_every_calibration
def test_every_engine_has_its_own_calibration_whose_metrics_follow_from_its_columns(
    name: str, engine: str
) -> None:
    stored = load_calibration(name, engine)
    i_sim, reference = np.array(stored.i_sim), np.array(stored.i_reference_psi_s)
    exponent, intercept = np.polyfit(np.log(i_sim), np.log(reference), 1)
    law = stored.scaling_law
    assert isinstance(law, PowerLaw)
    assert pytest.approx((np.exp(intercept), exponent)) == (law.A, law.B)
    mape = 100.0 * np.mean(np.abs(law(i_sim) / reference - 1.0))
    assert stored.metrics.mape_percent == pytest.approx(mape)
    assert (stored.name, stored.engine) == (name, engine)
    stored.check(preset(stored.preset), engine)
    for key, (low, high) in stored.coefficient_intervals.items():
        assert low < stored.coefficients[key] < high


def test_settings_of_the_other_engine_do_not_matter() -> None:
    coarse = with_overrides(preset("ballistic"), {"stepping": {"contact_time_s": 1e-5}})
    CALIBRATION.check(coarse, "pymunk")
    with pytest.raises(CalibrationError, match="preset 'ballistic'"):
        load_calibration("ballistic_kb_100kg", "event").check(coarse, "event")


@of_every_engine
def test_a_blast_is_converted_by_the_calibration_of_its_engine(engine: str) -> None:
    result = simulate(load_scenario("free_field"), seed=1, engine=engine)
    law = load_calibration("ballistic_ufc", engine).scaling_law
    expected = law(result.impulse_sim("building"))
    scaled = result.impulse("building")
    assert scaled.psi_s == pytest.approx(expected, rel=1e-12)
    assert scaled.pa_s == pytest.approx(6894.757293168 * scaled.psi_s)
    assert scaled.in_range


def test_other_parameters_and_other_engines_are_refused() -> None:
    with pytest.raises(CalibrationError, match="not made for engine 'mine', only for event, pymu"):
        load_calibration("ballistic_ufc", "mine")
    scenario = BALLISTIC_COURTYARD
    with pytest.raises(CalibrationError, match="engine 'pymunk', the simulation ran on 'event'"):
        CALIBRATION.check(scenario.parameters, "event")
    other = scenario.with_simulation(overrides={"air": {"mass": 0.5}})
    with pytest.raises(CalibrationError, match="preset 'ballistic'"):
        simulate(other, engine="pymunk").impulse("building")


def test_a_scenario_without_a_calibration_says_which_there_are() -> None:
    document = BALLISTIC_COURTYARD.model_dump() | {"calibration": None}
    unprotected = Scenario.from_document(document, "bare")
    with pytest.raises(CalibrationError, match="ballistic_kb_100kg"):
        simulate(unprotected, engine="pymunk").impulse("building")
    misnamed = Scenario.from_document(document | {"calibration": "balistic_ufc"}, "misnamed")
    with pytest.raises(UnknownNameError, match="did you mean 'ballistic_ufc'"):
        simulate(misnamed, engine="pymunk").impulse("building")
    with pytest.raises(CalibrationError, match="'barrier' is no structure"):
        simulate(BALLISTIC_COURTYARD, [(8, 0)], engine="pymunk").impulse("barrier")


def test_twice_the_width_is_not_twice_the_load() -> None:
    """Within the noise: three standard errors of the ratio are about 0.12 with 16 seeds."""
    seeds = range(16)
    raw, scaled = [], []
    for side_modules in (20, 40):
        wide = free_field(side_modules=side_modules).at_stand_off(40.0)
        results = [simulate(wide, seed=seed, engine="event") for seed in seeds]
        raw.append(np.mean([result.impulse_sim("building") for result in results]))
        scaled.append(np.mean([result.impulse("building").psi_s for result in results]))
    assert raw[1] / raw[0] > 1.6
    assert scaled[1] / scaled[0] == pytest.approx(1.0, abs=0.12)


def test_outside_its_cases_it_converts_and_says_so() -> None:
    scenario = BALLISTIC_COURTYARD
    near = simulate(scenario, charge=Charge((5.0, 15.0), 100.0), engine="pymunk").impulse(
        "building"
    )
    assert near.in_range
    assert near.notes == ()
    light = simulate(scenario, charge=Charge((5.0, 15.0), 50.0), engine="pymunk").impulse(
        "building"
    )
    assert not light.in_range
    assert "charge 50 kg TNT is not 100 kg" in light.notes
    assert light.psi_s > 0.0
    assert CALIBRATION.convert(1000.0, 5.0, 1.0, 100.0).notes == (
        f"distance 1.00 m is outside {CALIBRATION.distances_m[0]:g} to "
        f"{CALIBRATION.distances_m[-1]:g} m",
    )


def test_charges_are_related_by_hopkinson_cranz_scaling_where_that_was_checked() -> None:
    """Eight times the mass, twice the distance and twice the impulse: twice the result."""
    law = CALIBRATION.model_copy(update={"tnt_range_kg": (20.0, 1000.0)})
    small = law.convert(1e5, 10.0, 20.0, 100.0)
    large = law.convert(2e5, 10.0, 40.0, 800.0)
    assert large.psi_s == pytest.approx(2.0 * small.psi_s)
    assert large.in_range
    assert law.convert(1e5, 10.0, 20.0, 100.0) == CALIBRATION.convert(1e5, 10.0, 20.0, 100.0)
    assert law.convert(1e5, 10.0, 90.0, 800.0).notes == ("distance 90.00 m is outside 16 to 80 m",)
    assert law.convert(1e5, 10.0, 50.0, 2000.0).notes == (
        "charge 2000 kg TNT is not between 20 and 1000 kg",
    )


def test_a_calibration_says_which_impulse_it_converts() -> None:
    scenario = BALLISTIC_COURTYARD
    result = simulate(scenario, seed=1, engine="pymunk")
    other = CALIBRATION.model_copy(update={"simulated": "transferred_impulse"})
    building = result.obstacle("building")
    ratio = building.transferred_impulse / building.impulse
    expected = result.impulse("building").psi_s * ratio ** CALIBRATION.coefficients["B"]
    assert result.impulse("building", other).psi_s == pytest.approx(expected)


def test_a_blast_that_was_cut_off_says_so() -> None:
    limited = BALLISTIC_COURTYARD.with_simulation(overrides={"stepping": {"most_collisions": 500}})
    result = simulate(limited, engine="event")
    scaled = result.impulse("building", load_calibration("ballistic_kb_100kg", "event"))
    assert not scaled.in_range
    assert any("limit of collisions" in note for note in scaled.notes)


def test_the_width_is_the_one_that_the_charge_sees() -> None:
    building = Rectangle(20.0, 10.0, 24.0, 20.0)
    assert seen_width_m(building, (0.0, 15.0)) == pytest.approx(10.0)
    assert seen_width_m(building, (22.0, 0.0)) == pytest.approx(4.0)
    assert seen_width_m(building, (17.0, 10.0)) == pytest.approx((10.0 + 4.0) / np.sqrt(2.0))


def test_saving_and_loading_round_trips_and_damage_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "mine.json"
    save_calibration(CALIBRATION, path)
    assert load_calibration(path) == CALIBRATION
    content = json.loads(path.read_text())
    path.write_text(json.dumps(content | {"facade_width_m": 99.0}))
    with pytest.raises(CalibrationError, match=r"mine\.json: .*was edited"):
        load_calibration(path)
    path.write_text(json.dumps({}))
    with pytest.raises(CalibrationError, match=r"mine\.json: .*the checksum does not match"):
        load_calibration(path)
    with pytest.raises(CalibrationError, match="there is no such file"):
        load_calibration(tmp_path / "none.json")
    with pytest.raises(UnknownNameError, match="did you mean 'ballistic_ufc'"):
        load_calibration("balistic_ufc")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"i_sim": [1.0]}, "i_sim must have 8 values"),
        ({"coefficients": {"A": 1.0}}, "coefficients must be 'A' or 'B' of a power law"),
        ({"coefficients": {"A": -1.0, "B": 1.0}}, "A is -1.0, must be above 0"),
        ({"tnt_range_kg": [200.0, 100.0]}, "tnt_range_kg must be around tnt_kg"),
    ],
)
def test_values_that_do_not_fit_are_refused(changes: dict, words: str, tmp_path: Path) -> None:
    """Also with the right checksum, which anybody can make."""
    path = tmp_path / "mine.json"
    content = CALIBRATION.model_dump(mode="json") | changes
    checksum = sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
    path.write_text(json.dumps(content | {"checksum": checksum}))
    with pytest.raises(CalibrationError, match=f"mine.json: .*{words}"):
        load_calibration(path)


def test_references_refuse_distances_that_they_do_not_have() -> None:
    with pytest.raises(BlastEnvError, match="no value at 20 m"):
        paper_reference((15.0, 20.0))
    with pytest.raises(BlastEnvError, match="Z"):
        kingery_bulmash_reference((0.1,), 100.0)


@pytest.mark.parametrize(
    ("name", "engine"),
    [
        ("ballistic_ufc", "pymunk"),
        ("ballistic_ufc", "event"),
        ("collisional_kb_20kg", "event"),
    ],
)
def test_the_simulator_still_gives_what_the_calibration_was_made_from(
    name: str, engine: str
) -> None:
    """A digest of parameters does not see a change of the code; the blasts do.

    1.5 half-widths of the mean of three seeds are about three standard errors.
    """
    stored = load_calibration(name, engine)
    seeds = stored.seeds[:3]
    scenario = free_field(stored.tnt_kg).with_simulation(stored.preset)
    study = FreeFieldStudy(scenario, stored.distances_m[:1], seeds, engine)
    mean = study.run()[f"{stored.simulated}_sim"].mean()
    half_width = stored.i_sim_ci95[0] * np.sqrt(len(stored.seeds) / len(seeds))
    assert mean == pytest.approx(stored.i_sim[0], abs=1.5 * half_width)
