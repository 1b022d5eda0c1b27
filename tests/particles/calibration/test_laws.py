"""Laws from simulated to reference impulse: fits, conversion, inversion, bad input."""

import warnings

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env.calibration import (
    FewDistancesWarning,
    LinearLaw,
    PowerLaw,
    ProportionalLaw,
    ScalingLaw,
    fit_linear,
    fit_power_law,
    fit_proportional,
    paper_table,
)
from blast_env.errors import BlastEnvError
from blast_env.particles.calibration.laws import Fit

FITS = (fit_proportional, fit_linear, fit_power_law)
LAWS = (ProportionalLaw(4.27e-5), LinearLaw(-0.017, 4.39e-5), PowerLaw(1.24e-4, 0.881))
I_SIM = [100.0, 300.0, 500.0, 900.0]
I_REFERENCE = [0.1, 0.2, 0.4, 0.5]

impulses = st.lists(st.floats(1.0, 1e5), min_size=4, max_size=12, unique=True)


def paper_columns() -> tuple[pd.Series, pd.Series]:
    table = paper_table()
    return table["i_sim"], table["i_ufc_psi_s"]


def test_the_paper_s_columns_give_the_known_coefficients() -> None:
    """Known from the tables themselves; k is not the 4.343e-5 of the paper's text."""
    proportional, linear, power = (fit(*paper_columns()) for fit in FITS)
    assert proportional.coefficients == pytest.approx({"k": 4.2707e-5}, rel=1e-5)
    assert linear.coefficients == pytest.approx({"a": -0.016963, "b": 4.3916e-5}, rel=1e-5)
    assert power.coefficients == pytest.approx({"A": 1.2413e-4, "B": 0.88133}, rel=2e-5)


@given(impulses, st.data())
def test_the_line_is_that_of_equation_8_as_printed(x: list[float], data: st.DataObject) -> None:
    y = data.draw(st.lists(st.floats(0.1, 10.0), min_size=len(x), max_size=len(x)))
    if np.ptp(x) < 1e-3 * max(x):
        return  # the printed form loses all digits there
    law = fit_linear(x, y)
    n, sx, sy = len(x), np.sum(x), np.sum(y)
    b = (n * np.dot(x, y) - sx * sy) / (n * np.dot(x, x) - sx**2)
    scale = max(y) / np.ptp(x)
    assert law.b == pytest.approx(b, rel=1e-6, abs=1e-6 * scale)
    assert law.a == pytest.approx((sy - b * sx) / n, rel=1e-6, abs=1e-6 * scale * max(x))


@given(impulses)
def test_a_fit_finds_the_law_that_made_the_numbers(x: list[float]) -> None:
    if np.ptp(x) < 1e-3 * max(x):
        return
    for fit, law in zip(FITS, (LAWS[0], LinearLaw(0.3, 4.39e-5), LAWS[2]), strict=True):
        found = fit(x, law(x))
        assert found(x) == pytest.approx(law(x), rel=1e-9)
        assert type(found) is type(law)


@pytest.mark.parametrize("law", LAWS)
@given(i_sim=st.floats(1e-3, 1e6))
def test_the_inverse_undoes_the_law(law: ScalingLaw, i_sim: float) -> None:
    assert law.inverse(law(i_sim)) == pytest.approx(i_sim, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("law", LAWS)
def test_numbers_stay_numbers_and_arrays_keep_their_shape(law: ScalingLaw) -> None:
    grid = np.array([[1.0, 2.0, 3.0], [0.0, 5.0, 6.0]])
    converted = law(grid)
    assert converted.shape == grid.shape
    assert type(law(5.0)) is float
    assert law(5.0) == converted[1, 1]
    assert law(pd.Series([5.0, 6.0])).tolist() == converted[1, 1:].tolist()
    assert type(law.inverse(0.5)) is float
    assert law.inverse(converted) == pytest.approx(grid)


@pytest.mark.parametrize("law", LAWS)
def test_negative_impulses_and_what_is_no_number_are_refused(law: ScalingLaw) -> None:
    with pytest.raises(BlastEnvError, match="i_sim is -1, must be at least 0"):
        law(-1.0)
    with pytest.raises(BlastEnvError, match=r"i_sim\[1, 0\] is -2, must be at least 0"):
        law(np.array([[1.0, 2.0], [-2.0, 4.0]]))
    with pytest.raises(BlastEnvError, match=r"i_sim\[1\] is nan, must be a finite number"):
        law([1.0, float("nan")])
    with pytest.raises(BlastEnvError, match="i_sim must be made of numbers"):
        law("much")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("law", "reference"),
    [(LAWS[0], -0.1), (LAWS[1], -0.018), (LAWS[2], -0.1), (PowerLaw(1.0, -1.0), 0.0)],
)
def test_a_reference_out_of_reach_has_no_inverse(law: ScalingLaw, reference: float) -> None:
    with pytest.raises(BlastEnvError, match=r"i_reference\[1\] is .* no i_sim of at least 0"):
        law.inverse([0.5, reference])


@pytest.mark.parametrize("law", [LinearLaw(0.3, 0.0), PowerLaw(0.3, 0.0), ProportionalLaw(0.0)])
def test_a_constant_has_no_inverse(law: ScalingLaw) -> None:
    with pytest.raises(BlastEnvError, match=r"no inverse: [kbB] is 0"):
        law.inverse(0.3)


def test_a_falling_power_law_refuses_zero() -> None:
    with pytest.raises(BlastEnvError, match="i_sim is 0, must be above 0"):
        PowerLaw(1.0, -0.5)(0.0)


@pytest.mark.parametrize("fit", FITS)
@pytest.mark.parametrize(
    ("i_sim", "i_reference", "message"),
    [
        ([], [], "i_sim is empty"),
        ([7.0, 7.0, 7.0, 7.0], I_REFERENCE, r"i_sim is 7 at every distance \(4\)"),
        ([1.0, float("nan"), 3.0, 4.0], I_REFERENCE, r"i_sim\[1\] is nan"),
        ([1.0, 2.0, -3.0, 4.0], I_REFERENCE, r"i_sim\[2\] is -3, must be at least 0"),
        (I_SIM, [0.1, 0.2, 0.0, 0.4], r"i_reference\[2\] is 0, must be above 0"),
        (I_SIM, I_REFERENCE[:3], "i_sim has 4 values and i_reference 3"),
    ],
)
def test_bad_input_is_named(
    fit: Fit, i_sim: list[float], i_reference: list[float], message: str
) -> None:
    with pytest.raises(BlastEnvError, match=message):
        fit(i_sim, i_reference)


@pytest.mark.parametrize("fit", FITS)
def test_fewer_than_four_distances_warn_where_the_fit_is_called(fit: Fit) -> None:
    with pytest.warns(FewDistancesWarning, match="3 distances, should be at least 4") as caught:
        fit(I_SIM[:3], I_REFERENCE[:3])
    assert caught[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fit(I_SIM, I_REFERENCE)
