"""The Friedlander waveform: equation 1, equation 2, and the limit where it is a triangle."""

from math import exp, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from blast_env.calibration import Friedlander, kingery_bulmash
from blast_env.errors import BlastEnvError

peaks = st.floats(1e2, 1e8)
durations = st.floats(1e-4, 1.0)
decays = st.floats(0.0, 200.0)


def test_the_waveform_is_equation_1() -> None:
    wave = Friedlander(peak=200e3, positive_duration_s=0.01, decay=1.5, arrival_s=0.03)
    assert wave.pressure(0.03) == 200e3
    assert wave.pressure(0.034) == pytest.approx(200e3 * 0.6 * exp(-0.6))
    times_s = [0.0, 0.0299, 0.04, 0.05]
    assert wave.pressure(times_s).tolist() == [0.0, 0.0, 0.0, 0.0]
    assert type(wave.pressure(0.034)) is float


@given(peaks, durations, st.floats(1e-6, 0.499))
def test_peak_duration_and_impulse_come_back(peak: float, duration_s: float, share: float) -> None:
    impulse = share * peak * duration_s
    wave = Friedlander.from_impulse(peak, duration_s, impulse, arrival_s=0.02)
    assert (wave.peak, wave.positive_duration_s, wave.arrival_s) == (peak, duration_s, 0.02)
    assert wave.impulse() == pytest.approx(impulse, rel=1e-12)
    assert wave.decay > 0.0
    assert not wave.is_triangular


@given(peaks, durations, st.floats(0.5, 100.0))
def test_without_a_solution_it_is_the_triangle_of_the_same_peak_and_impulse(
    peak: float, duration_s: float, share: float
) -> None:
    impulse = share * peak * duration_s
    wave = Friedlander.from_impulse(peak, duration_s, impulse)
    if impulse / peak / duration_s < 0.5:
        return  # rounding put it on the other side
    assert wave.is_triangular
    assert wave.peak == peak
    assert wave.impulse() == pytest.approx(impulse, rel=1e-12)
    assert wave.pressure(wave.positive_duration_s / 2.0) == pytest.approx(peak / 2.0)
    assert wave.positive_duration_s >= duration_s * (1.0 - 1e-12)


def test_the_triangle_is_the_limit_of_the_waveforms() -> None:
    below = Friedlander.from_impulse(1e5, 0.01, 500.0 * (1.0 - 1e-9))
    limit = Friedlander.from_impulse(1e5, 0.01, 500.0)
    assert not below.is_triangular
    assert limit.is_triangular
    times_s = np.linspace(0.0, 0.01, 50)
    assert below.pressure(times_s) == pytest.approx(limit.pressure(times_s), rel=1e-7, abs=1e-3)


@given(durations, decays, st.floats(0.0, 1.5))
def test_the_impulse_comes_over_time(duration_s: float, decay: float, x: float) -> None:
    wave = Friedlander(2e5, duration_s, decay, arrival_s=0.1)
    until_s = 0.1 + x * duration_s
    end_s = min(until_s, 0.1 + duration_s)
    knee_s = min(0.1 + duration_s / max(decay, 1.0), end_s)
    parts = [quad(wave.pressure, *ends)[0] for ends in ((0.1, knee_s), (knee_s, end_s))]
    assert wave.impulse_until(until_s) == pytest.approx(sum(parts), rel=1e-7, abs=1e-6)
    assert wave.impulse_until([0.0, 0.1]).tolist() == [0.0, 0.0]
    assert type(wave.impulse_until(until_s)) is float
    assert wave.impulse_until(0.1 + 2.0 * duration_s) == pytest.approx(wave.impulse(), rel=1e-12)


def test_kingery_and_bulmash_s_curves_make_waveforms() -> None:
    """Over the whole range of the reflected wave from the ground the decay exists and is sane."""
    for distance_m in np.geomspace(1.0, 180.0, 40):
        peak, duration_s, impulse = (
            kingery_bulmash(quantity, float(distance_m), 100.0)
            for quantity in ("reflected_overpressure", "positive_duration", "reflected_impulse")
        )
        wave = Friedlander.from_impulse(peak, duration_s, impulse)
        assert 0.0 < wave.decay < 100.0
        assert wave.impulse() == pytest.approx(impulse, rel=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.0, 0.01, 1.0), "peak is 0, must be above 0"),
        ((1e5, -0.01, 1.0), "positive_duration_s is -0.01, must be above 0"),
        ((1e5, 0.01, nan), "impulse is nan, must be a finite number"),
        ((1e5, 0.01, 0.0), "impulse is 0, must be above 0"),
        ((1e300, 1.0, 1e-300), "impulse is 1e-300, which is too small a share"),
        ((1e5, 0.01, 100.0, -1.0), "arrival_s is -1, must be at least 0"),
    ],
)
def test_bad_waves_are_refused(arguments: tuple[float, ...], message: str) -> None:
    with pytest.raises(BlastEnvError, match=message):
        Friedlander.from_impulse(*arguments)
