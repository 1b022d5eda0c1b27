"""Charge, air and parameters at the start: the fan, other charges, finer balls."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env import load_scenario, simulate
from blast_env.errors import BlastEnvError
from blast_env.layout import build_site
from blast_env.particles import Balls, build_scene, explosion_fan
from blast_env.site import (
    Charge,
    ExplosiveParameters,
    Scenario,
    SimulationParameters,
    for_charge,
    preset,
    with_overrides,
    with_resolution,
)

KEPT = ExplosiveParameters(ball_count=20_000)


def fan(parameters: ExplosiveParameters) -> Balls:
    return explosion_fan(parameters, (50.0, 60.0), np.random.default_rng(0))


def kinetic_energy(balls: Balls) -> float:
    return float(0.5 * (balls.mass * (balls.velocity**2).sum(axis=1)).sum())


def test_every_ball_flies_straight_out_in_its_own_direction() -> None:
    balls = fan(ExplosiveParameters(ball_count=720))
    outwards = balls.position - (50.0, 60.0)
    assert np.hypot(*outwards.T) == pytest.approx(KEPT.offset_units)
    assert balls.velocity == pytest.approx(2000.0 / KEPT.offset_units * outwards)
    angle = np.sort(np.arctan2(*balls.velocity.T[::-1]))
    assert np.diff(angle) == pytest.approx(2.0 * np.pi / 720)
    assert balls.mass == pytest.approx(KEPT.mass)


@pytest.mark.parametrize("share", [0.25, 0.75, 1.0])
def test_the_thermal_share_moves_energy_and_adds_none(share: float) -> None:
    """With 20,000 balls the energy of the random part scatters by less than 1 %."""
    hot = fan(KEPT.model_copy(update={"thermal_share": share}))
    assert kinetic_energy(hot) == pytest.approx(kinetic_energy(fan(KEPT)), rel=0.03)
    direction = (hot.position - (50.0, 60.0)) / KEPT.offset_units
    radial = (hot.velocity * direction).sum(axis=1)
    assert radial.mean() == pytest.approx(2000.0 * np.sqrt(1.0 - share), abs=40.0)
    across = hot.velocity - radial[:, np.newaxis] * direction
    assert (across**2).sum(axis=1).mean() == pytest.approx(share / 2.0 * 2000.0**2, rel=0.03)


# --- The same air and charge with finer balls.


def air_density(parameters: SimulationParameters) -> float:
    return parameters.air.mass / parameters.air.spacing_units**2


def packing_fraction(parameters: SimulationParameters) -> float:
    return (parameters.air.radius_units / parameters.air.spacing_units) ** 2


def charge_mass(parameters: SimulationParameters) -> float:
    return parameters.explosive.mass * parameters.explosive.ball_count


@pytest.mark.parametrize("factor", [0.7, 1.0, 1.5, 3.0])
def test_air_and_charge_stay_what_they_are(factor: float) -> None:
    coarse = preset("collisional")
    fine = with_resolution(coarse, factor)
    for quantity in (air_density, packing_fraction, charge_mass):
        assert quantity(fine) == pytest.approx(quantity(coarse))
    assert fine.air.radius_units == pytest.approx(coarse.air.radius_units / factor)
    assert fine.explosive.speed_units_per_s == coarse.explosive.speed_units_per_s


def test_a_way_of_the_same_length_costs_the_same() -> None:
    """It has twice as many collisions, each of which takes half as much, to first order."""
    coarse, fine = preset("collisional"), with_resolution(preset("collisional"), 2.0)
    assert 1.0 - fine.air.elasticity**2 == pytest.approx((1.0 - coarse.air.elasticity**2) / 2.0)
    assert fine.contact.air_shrink**2 == pytest.approx(coarse.contact.air_shrink)


def test_the_presets_are_one_physics_at_two_resolutions() -> None:
    expected = with_resolution(preset("collisional"), 2.0).model_dump()
    for group, values in preset("collisional_fine").model_dump().items():
        for name, value in values.items():
            if isinstance(value, float):
                assert value == pytest.approx(expected[group][name]), (group, name)
            else:
                assert value == expected[group][name], (group, name)


# --- Other charges than the reference charge.


# With a base impulse, which the presets leave out.
DENSE = with_overrides(preset("collisional"), {"contact": {"base_impulse": 0.01}})
masses = st.floats(2.0, 50_000.0)


def enlarged(parameters: SimulationParameters, scale: float) -> SimulationParameters:
    """The same blast with all lengths and times longer, balls included."""
    air, explosive, contact = parameters.air, parameters.explosive, parameters.contact
    return with_overrides(
        parameters,
        {
            "air": {
                "radius_units": scale * air.radius_units,
                "spacing_units": scale * air.spacing_units,
                "mass": scale**2 * air.mass,
            },
            "explosive": {
                "radius_units": scale * explosive.radius_units,
                "mass": scale**2 * explosive.mass,
            },
            "contact": {
                "minimum_radius_units": scale * contact.minimum_radius_units,
                # A momentum: masses grow with the area, speeds stay.
                "base_impulse": scale**2 * contact.base_impulse,
            },
            "stepping": {"time_limit_s": scale * parameters.stepping.time_limit_s},
        },
    )


def numbers(parameters: SimulationParameters) -> dict[str, float]:
    return {
        f"{group}.{name}": value
        for group, values in parameters.model_dump().items()
        for name, value in values.items()
        if isinstance(value, float | int)
    }


@given(tnt_kg=masses)
def test_another_charge_is_the_reference_blast_enlarged_with_balls_as_small_as_before(
    tnt_kg: float,
) -> None:
    """What similarity demands: nothing but resolution may tell two scaled blasts apart."""
    scale = (tnt_kg / 100.0) ** (1.0 / 3.0)
    expected = with_resolution(enlarged(DENSE, scale), scale)
    expected = with_overrides(expected, {"explosive": {"reference_tnt_kg": tnt_kg}})
    assert numbers(for_charge(DENSE, tnt_kg)) == pytest.approx(numbers(expected))


@given(tnt_kg=st.floats(0.01, 50_000.0))
def test_scaling_by_mass_changes_the_mass_of_the_balls_and_nothing_else(tnt_kg: float) -> None:
    sparse = preset("ballistic")
    expected = with_overrides(
        sparse, {"explosive": {"mass": tnt_kg / 100.0, "reference_tnt_kg": tnt_kg}}
    )
    assert numbers(for_charge(sparse, tnt_kg)) == pytest.approx(numbers(expected))


@pytest.mark.parametrize("name", ["ballistic", "collisional"])
def test_the_reference_charge_has_the_parameters_as_they_are(name: str) -> None:
    """To the last bit: calibrations depend on it."""
    assert for_charge(preset(name), 100.0) == preset(name)
    again = for_charge(for_charge(preset(name), 250.0), 250.0)
    assert again == for_charge(preset(name), 250.0)


def test_a_scene_has_the_parameters_of_its_charge() -> None:
    """Each charge that a scenario draws has its own."""
    scenario = load_scenario("courtyard").with_simulation("collisional")
    for tnt_kg, count in ((100.0, 1125), (800.0, 2250)):
        scene = build_scene(scenario, charge=Charge((5.0, 15.0), tnt_kg))
        assert scene.parameters == for_charge(scenario.parameters, tnt_kg)
        assert (scene.balls.kind == 1).sum() == count


def test_a_charge_too_small_for_the_balls_is_refused() -> None:
    """Its few collisions would have to take more than all of the energy."""
    lossy = with_overrides(
        SimulationParameters(), {"explosive": {"charge_scaling": "hopkinson_cranz"}}
    )
    for_charge(lossy, 10.0)
    with pytest.raises(BlastEnvError, match=r"tnt_kg is 5: .* for 100 kg.* at most 2.21"):
        for_charge(lossy, 5.0)
    with pytest.raises(BlastEnvError, match=r"stepping.time_limit_s would be 200 .*60"):
        for_charge(lossy, 1e8)


def test_only_particles_refuse_such_a_charge() -> None:
    document = load_scenario("courtyard").model_dump()
    document["charge"] = [{"kind": "point", "position_m": (5.0, 15.0), "tnt_kg": 5.0}]
    document["simulation"]["overrides"] = {"explosive": {"charge_scaling": "hopkinson_cranz"}}
    document["simulation"]["preset"] = "ballistic"
    scenario = Scenario.from_document(document, "small charge")
    assert build_site(scenario).charge.tnt_kg == 5.0  # all that gas dynamics needs
    with pytest.raises(BlastEnvError, match=r"courtyard: charge: tnt_kg is 5: the parameters"):
        build_scene(scenario)


def mean_impulse(tnt_kg: float, scaled_distance: float) -> float:
    """Impulse per metre of facade over the cube root of the charge's mass.

    On the free field with borders nearer to the way from charge to building.
    """
    document = load_scenario("free_field").with_simulation("collisional").model_dump()
    document["site"] |= {"width_m": 47.0, "height_m": 30.0}
    document["charge"][0]["position_m"] = (5.0, 15.0)
    document["structures"][0]["corner_m"] = (35.0, 10.0)
    field = Scenario.from_document(document, "near borders")
    field = field.at_stand_off(scaled_distance * tnt_kg ** (1.0 / 3.0))
    charge = Charge((5.0, 15.0), tnt_kg)
    results = [simulate(field, seed=seed, engine="event", charge=charge) for seed in range(6)]
    loads = [result.obstacle("building").transferred_impulse for result in results]
    return float(np.mean(loads)) / (tnt_kg / 100.0) ** (1.0 / 3.0)


@pytest.mark.slow
def test_impulses_obey_hopkinson_cranz_scaling() -> None:
    """At Z = 3 m/kg^(1/3), 100 and 1000 kg; one standard error of the ratio is about 6 %.

    With losses that do not follow the charge, 1000 kg gives 0.82 of this.
    """
    assert mean_impulse(1000.0, 3.0) / mean_impulse(100.0, 3.0) == pytest.approx(1.0, abs=0.16)
