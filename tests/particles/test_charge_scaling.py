"""Other charges than the reference charge."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env import load_scenario, simulate
from blast_env.errors import BlastEnvError
from blast_env.layout.build_scene import build_scene, build_site
from blast_env.site import Scenario
from blast_env.site.parameters import (
    SimulationParameters,
    for_charge,
    preset,
    with_overrides,
    with_resolution,
)
from blast_env.site.scene import Charge
from blast_env.site.zone import source_bounds_m

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
    """Impulse per metre of facade over the cube root of the charge's mass."""
    scale = (tnt_kg / 100.0) ** (1.0 / 3.0)
    field = load_scenario("free_field").with_simulation("collisional")
    field = field.at_stand_off(scaled_distance * tnt_kg ** (1.0 / 3.0))
    (source,) = field.charge
    x_m, y_m = source_bounds_m(source).centre
    results = [
        simulate(field, seed=seed, engine="event", charge=Charge((x_m, y_m), tnt_kg))
        for seed in range(3)
    ]
    loads = [result.obstacle("building").transferred_impulse for result in results]
    return float(np.mean(loads)) / scale


@pytest.mark.slow
def test_impulses_obey_hopkinson_cranz_scaling() -> None:
    """At Z = 3 m/kg^(1/3), 100 and 1000 kg; one standard error of the ratio is about 9 %.

    With losses that do not follow the charge, 1000 kg gives 0.72 of this.
    """
    assert mean_impulse(1000.0, 3.0) / mean_impulse(100.0, 3.0) == pytest.approx(1.0, abs=0.2)
