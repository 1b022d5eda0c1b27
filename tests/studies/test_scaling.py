"""Charges of several masses, on made-up and on stored numbers."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.container import ErrorbarContainer

from blast_env.fitting.free_field import free_field
from blast_env.scenario import load_scenario
from studies.particles.scaling import scaling_figure


@pytest.mark.parametrize("tnt_kg", [20.0, 1000.0])
def test_the_free_field_gets_the_charge(tnt_kg: float) -> None:
    (source,) = free_field(tnt_kg=tnt_kg).charge
    assert source.tnt_kg == tnt_kg


def test_the_free_field_without_changes_is_the_bundled_one() -> None:
    assert free_field().content_hash == load_scenario("free_field").content_hash


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
