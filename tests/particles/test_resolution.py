"""The same air and charge with finer balls."""

import pytest

from blast_env.site.parameters import SimulationParameters, preset, with_resolution


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
