"""The studies behind the collisional presets: what they make of their runs."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.container import ErrorbarContainer

from blast_env import load_scenario
from blast_env.calibration import kingery_bulmash
from blast_env.physics.presets import preset
from scripts.collisional_front import front_figure
from scripts.hopkinson_cranz import free_field, scaling_figure
from scripts.resolution_convergence import (
    Blasts,
    compared,
    own_correlation,
    random_layouts,
    with_parameters,
)
from scripts.search_collisional import (
    HIGH,
    LOW,
    Candidate,
    Score,
    candidate_table,
    front,
)
from scripts.thermal_share import reference


def candidate(number: int) -> Candidate:
    return Candidate.from_point(LOW + (HIGH - LOW) * number / 10.0)


def its_score(mape_percent: float, two_corners: float, events: float) -> Score:
    return Score(mape_percent, 0.0, 1.0, 0.57, two_corners, events)


SCORES = {
    candidate(1): its_score(3.0, 0.49, 1e5),
    candidate(2): its_score(3.1, 0.49, 1e5),  # beaten by the first
    candidate(3): its_score(6.0, 0.49, 5e4),  # cheaper
    candidate(4): its_score(30.0, 0.01, 9e5),  # worse in all
    candidate(5): its_score(1.2, 0.61, 2e5),  # better over distance, at the bound behind corners
}


def test_errors_are_in_units_of_their_bounds() -> None:
    assert its_score(6.0, 0.49, 1.0).distance_error == pytest.approx(1.0)
    assert Score(0.0, 0.0, 1.4, 0.57, 0.49, 1.0).distance_error == pytest.approx(1.0)
    assert its_score(0.0, 0.61, 1.0).shielding_error == pytest.approx(1.0)
    assert its_score(0.0, 0.49, 1.0).shielding_error == 0.0


def test_the_front_is_what_nothing_beats_in_all_three() -> None:
    table = candidate_table(SCORES)
    assert front(table).events.tolist() == [5e4, 1e5, 2e5]
    assert front(table).index.tolist() == [2, 0, 4]


def test_a_candidate_is_balls_of_its_radius_in_the_air_that_it_names() -> None:
    """The packing is kept when balls are made finer, and so is the mass of the charge."""
    each = candidate(3)
    parameters = each.parameters()
    air, explosive = parameters.air, parameters.explosive
    assert air.radius_units == pytest.approx(each.radius_units)
    packing = np.pi * air.radius_units**2 / air.spacing_units**2
    assert packing == pytest.approx(each.packing_fraction)
    assert air.mass / air.spacing_units**2 == pytest.approx(each.air_density)
    assert explosive.mass * explosive.ball_count == pytest.approx(720.0)
    assert explosive.charge_scaling == preset("collisional").explosive.charge_scaling


def test_the_figure_shows_every_candidate_and_the_presets() -> None:
    table = candidate_table(SCORES)
    table["on_front"] = table.index.isin(front(table).index)
    presets = table.iloc[:2].assign(preset=["collisional", "collisional_fine"])
    figure = front_figure(table, presets, "made up")
    for axes in figure.axes:
        offsets = np.concatenate([np.asarray(c.get_offsets()) for c in axes.collections])
        assert len(offsets) == len(SCORES) + 2
        low, high = axes.get_ylim()
        assert ((offsets[:, 1] >= low) & (offsets[:, 1] <= high)).all()


@pytest.mark.parametrize("tnt_kg", [20.0, 1000.0])
def test_the_free_field_gets_the_charge(tnt_kg: float) -> None:
    (source,) = free_field(tnt_kg, "collisional").charge
    assert source.tnt_kg == tnt_kg


def test_charges_that_scale_lie_on_one_curve_in_the_figure() -> None:
    rows = [
        (tnt_kg, z, 1e5 / z * tnt_kg ** (1.0 / 3.0), 1e3, 1e5 / z, 0.1, 0.11)
        for tnt_kg in (20.0, 100.0, 1000.0)
        for z in (2.0, 4.0, 8.0)
    ]
    names = ("tnt_kg", "scaled_distance", "i_sim", "ci95", "i_sim_scaled")
    table = pd.DataFrame(rows, columns=[*names, "reference_psi_s", "scaled_psi_s"])
    impulse, error = scaling_figure(table, "made up").axes
    bars = [each for each in impulse.containers if isinstance(each, ErrorbarContainer)]
    curves = [np.asarray(each.lines[0].get_ydata(), dtype=float) for each in bars]
    assert len(curves) == 3
    for curve in curves[1:]:
        assert curve == pytest.approx(curves[0])
    assert np.asarray(error.lines[0].get_ydata()) == pytest.approx(10.0)


def test_resolutions_are_compared_on_the_same_layouts() -> None:
    scenario = load_scenario("courtyard")
    layouts = random_layouts(scenario, 6)
    assert layouts == random_layouts(scenario, 6)
    assert len(set(layouts)) == 6
    of_preset = with_parameters(scenario, preset("collisional"))
    assert of_preset.parameters == preset("collisional")


def test_agreement_of_two_resolutions_is_that_of_their_means() -> None:
    rising = np.linspace(0.3, 0.8, 10)[:, None] + np.zeros((10, 4))
    one, other = Blasts("one", rising, 0.1), Blasts("other", rising + 0.05, 0.2)
    assert own_correlation(one) == pytest.approx(1.0)
    assert compared(one, other) == (
        "one - other: rank correlation 1.00, the second leaves +0.050 +- 0.000 more"
    )
    assert "correlation -1.00" in compared(one, Blasts("falling", rising[::-1], 0.1))


def test_the_reference_of_the_near_field_is_kingery_and_bulmash_s() -> None:
    at_10_m = [
        kingery_bulmash(quantity, 10.0, 100.0)
        for quantity in ("reflected_impulse", "incident_impulse")
    ]
    assert reference().ratio_near == pytest.approx(at_10_m[0] / at_10_m[1])
    assert reference().side_on_slope < 0.0
