import math
from functools import partial

import numpy as np
import pytest

from blast_env.errors import BlastEnvError
from blast_env.layout import usable_cells
from blast_env.site import (
    Charge,
    PointSource,
    RectangleSource,
    Scenario,
    ScenarioError,
    SegmentSource,
    load_scenario,
    preset,
)
from tests.site.documents import Document, changed, full_document, minimal_document


def scenario_from(document: Document) -> Scenario:
    return Scenario.from_document(document, "test")


def test_segment_source_reaches_all_of_the_segment_and_nothing_else() -> None:
    source = SegmentSource(kind="segment", tnt_kg=1.0, start_m=(1.0, 2.0), end_m=(5.0, 10.0))
    rng = np.random.default_rng(0)
    points = np.array([source.sample_position_m(rng) for _ in range(500)])
    assert np.allclose(points[:, 1], 2.0 * points[:, 0])
    assert points[:, 0].min() < 1.1
    assert points[:, 0].max() > 4.9
    assert ((points[:, 0] >= 1.0) & (points[:, 0] <= 5.0)).all()


def test_rectangle_source_reaches_all_of_the_rectangle_and_nothing_else() -> None:
    source = RectangleSource(kind="rectangle", tnt_kg=1.0, corner_m=(1.0, 2.0), size_m=(4.0, 8.0))
    rng = np.random.default_rng(0)
    points = np.array([source.sample_position_m(rng) for _ in range(500)])
    assert np.allclose(points.min(axis=0), [1.0, 2.0], atol=0.1)
    assert np.allclose(points.max(axis=0), [5.0, 10.0], atol=0.1)
    assert (points >= [1.0, 2.0]).all()
    assert (points <= [5.0, 10.0]).all()


def test_sources_are_drawn_by_their_weights() -> None:
    document = minimal_document()
    document["charge"] = [
        {"kind": "point", "position_m": [3.0, 5.0], "tnt_kg": 1.0, "weight": 3.0},
        {"kind": "point", "position_m": [4.0, 5.0], "tnt_kg": 2.0},
    ]
    scenario, rng = scenario_from(document), np.random.default_rng(0)
    charges = [scenario.sample_charge(rng) for _ in range(2000)]
    assert set(charges) == {Charge((3.0, 5.0), 1.0), Charge((4.0, 5.0), 2.0)}
    assert charges.count(Charge((3.0, 5.0), 1.0)) / 2000 == pytest.approx(0.75, abs=0.04)


def test_charge_radius_is_that_of_the_fan_with_its_balls() -> None:
    # Offset 1 unit and radius 1 unit; 4 units are a metre.
    assert scenario_from(minimal_document()).charge_radius_m == 0.5


def test_hash_ignores_the_sign_of_zero() -> None:
    document = changed(minimal_document(), ("structures", 0, "corner_m"), [10.0, 0.0])
    negative = changed(document, ("structures", 0, "corner_m"), [10.0, -0.0])
    assert scenario_from(document).content_hash == scenario_from(negative).content_hash


@pytest.mark.parametrize("distance_m", [15.0, 30.0, 60.0, 90.0, 120.0, 0.75])
def test_stand_off_is_the_distance_from_charge_to_facade(distance_m: float) -> None:
    original = load_scenario("free_field")
    scenario = original.at_stand_off(distance_m)
    building = scenario.structures[0].rectangle_m
    source = scenario.charge[0]
    assert isinstance(source, PointSource)
    assert building.left - source.position_m[0] == distance_m
    assert building.bottom == original.structures[0].rectangle_m.bottom
    assert scenario.site.width_m - building.right == 10.0
    assert scenario.site.height_m == original.site.height_m


def test_same_stand_off_is_the_same_scenario() -> None:
    scenario = load_scenario("free_field")
    assert scenario.at_stand_off(30.0) == scenario
    assert scenario.at_stand_off(120.0).at_stand_off(30.0) == scenario
    assert scenario.at_stand_off(31.0).content_hash != scenario.content_hash


@pytest.mark.parametrize(
    ("distance_m", "words"),
    [
        (0.25, "must keep clear of it by 0.5 m"),
        (1e6, "less than or equal to 2000"),
        (math.inf, "should be a finite number"),
    ],
)
def test_stand_off_out_of_bounds_is_named(distance_m: float, words: str) -> None:
    with pytest.raises(ScenarioError, match=words):
        load_scenario("free_field").at_stand_off(distance_m)


@pytest.mark.parametrize("distance_m", [0.0, -15.0, math.nan])
def test_stand_off_must_be_positive(distance_m: float) -> None:
    with pytest.raises(BlastEnvError, match="must be greater than 0"):
        load_scenario("free_field").at_stand_off(distance_m)


def test_stand_off_needs_one_point_and_one_structure() -> None:
    segment = {"kind": "segment", "start_m": [3.0, 3.0], "end_m": [3.0, 7.0], "tnt_kg": 1.0}
    for document in (full_document(), changed(minimal_document(), ("charge", 0), segment)):
        with pytest.raises(BlastEnvError, match="one point charge and one structure"):
            scenario_from(document).at_stand_off(15.0)


def test_stand_off_needs_the_structure_on_the_right() -> None:
    document = changed(minimal_document(), ("charge", 0, "position_m"), [18.0, 5.0])
    with pytest.raises(BlastEnvError, match="to the right of the charge"):
        scenario_from(document).at_stand_off(15.0)


def test_another_charge_replaces_the_threat_and_changes_the_hash() -> None:
    scenario = load_scenario("courtyard")
    fixed = scenario.with_charge(Charge((8.0, 15.0), 50.0))
    drawn = fixed.sample_charge(np.random.default_rng(0))
    assert drawn == Charge((8.0, 15.0), 50.0)
    assert fixed.content_hash != scenario.content_hash
    with pytest.raises(ScenarioError, match="building"):
        scenario.with_charge(Charge((28.0, 15.0), 50.0))


@pytest.mark.parametrize("name", ["courtyard", "free_field", "perimeter_gate", "control_room"])
def test_a_scenario_may_have_the_charges_that_it_draws_and_no_others(name: str) -> None:
    scenario = load_scenario(name)
    for seed in range(20):
        charge = scenario.sample_charge(np.random.default_rng(seed))
        assert isinstance(charge, Charge)
        assert scenario.may_have(charge)
        x_m, y_m = charge.position_m
        others = (
            charge._replace(position_m=(x_m + 200.0, y_m)),
            charge._replace(position_m=(math.nan, y_m)),
            charge._replace(tnt_kg=charge.tnt_kg + 1.0),
            charge._replace(height_m=charge.height_m + 0.1),
        )
        assert not any(map(scenario.may_have, others))


def test_a_line_of_charges_ends_at_its_ends() -> None:
    source = SegmentSource(kind="segment", tnt_kg=1.0, start_m=(1.0, 2.0), end_m=(4.0, 6.0))
    assert source.has_place((1.0, 2.0))
    assert source.has_place((2.5, 4.0))
    assert source.has_place((4.0, 6.0))
    assert not source.has_place((4.003, 6.004))
    assert not source.has_place((2.5, 4.001))


def test_other_parameters_are_added_to_the_scenario_s_own() -> None:
    scenario = load_scenario("courtyard")
    changed = scenario.with_simulation(overrides={"air": {"mass": 0.2}})
    again = changed.with_simulation(overrides={"air": {"spacing_units": 6.0}})
    assert (again.parameters.air.mass, again.parameters.air.spacing_units) == (0.2, 6.0)
    assert scenario.parameters.air.mass == preset("collisional").air.mass
    with pytest.raises(ScenarioError, match="did you mean 'mass'"):
        scenario.with_simulation(overrides={"air": {"mas": 0.2}})
    with pytest.raises(ScenarioError, match="did you mean 'ballistic'"):
        scenario.with_simulation(preset="balistic")


@pytest.mark.parametrize(
    "charge",
    [
        Charge((20.5, 8.5), 50.0),  # in a structure
        # on the border
        Charge((10.0, 8.0), 50.0),  # in the build zone: fewer usable cells than modules
        Charge((8.0, 15.0), -1.0),
        Charge((float("nan"), 15.0), 50.0),
    ],
)
def test_a_charge_that_does_not_fit_has_the_problems_of_the_whole_document(charge: Charge) -> None:
    """`with_charge` checks the charge alone, and must find all that a file with it would have."""
    full = full_document()
    full["build_zone"]["stock"] = usable_cells(scenario_from(full)).sum().item()
    scenario = scenario_from(full)
    document = scenario.model_dump()
    point = {"kind": "point", **charge._asdict()}
    for change, sources in (
        (partial(scenario.with_charge, charge), [point]),
        (partial(scenario.with_possible_charges, [charge]), [*document["charge"], point]),
    ):
        changes = {"charge": sources}
        with pytest.raises(ScenarioError) as expected:
            Scenario.from_document(document | changes, scenario.name)
        with pytest.raises(ScenarioError) as found:
            change()
        assert str(found.value) == str(expected.value)


def test_a_copy_has_a_hash_of_its_own() -> None:
    """The hash is computed once for each scenario, and copies take over what a scenario holds."""
    scenario = load_scenario("courtyard")
    before = scenario.content_hash
    lighter = tuple(source.model_copy(update={"tnt_kg": 50.0}) for source in scenario.charge)
    copied = scenario.model_copy(update={"charge": lighter})
    assert copied.content_hash != before
    assert copied.model_copy(update={"charge": scenario.charge}).content_hash == before
    assert scenario == load_scenario("courtyard")
    assert copied != scenario
