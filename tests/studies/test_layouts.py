"""Rank correlations of layouts between the engines, on loads whose order is known."""

import numpy as np
import pytest
from scipy.stats import spearmanr

from blast_env import simulate
from blast_env.physics.presets import preset
from blast_env.physics.scene import Charge
from studies.particles.agreement import layouts as study
from studies.particles.agreement.layouts import (
    AVERAGED,
    ENGINES,
    STATISTICS,
    Blasts,
    Noise,
    between_engines,
    compared,
    correlation,
    measured_loads,
    of_event,
    of_pymunk,
    own_correlation,
    spearman,
    with_parameters,
    without_noise,
)
from tests.scenarios import BALLISTIC_COURTYARD as COURTYARD


def noisy_loads(noise: float, shift: float = 0.0) -> np.ndarray:
    """Loads of 300 layouts in 2 lots of 4 blasts; the second engine sees another order."""
    rng = np.random.default_rng(3)
    truth, other = rng.normal(size=(2, 300))
    signal = np.array([truth, np.cos(shift) * truth + np.sin(shift) * other])
    return signal[:, None, :, None] + noise * rng.normal(size=(2, 2, 300, 4))


def test_spearman_is_scipy_s_mean_over_the_columns() -> None:
    rng = np.random.default_rng(0)
    one, other = rng.integers(0, 6, size=(2, 40, 3)).astype(float)  # with ties
    expected = np.mean([spearmanr(one[:, k], other[:, k]).statistic for k in range(3)])
    assert spearman(one, other) == pytest.approx(expected)


def test_seed_noise_lowers_all_correlations_alike() -> None:
    """Engines that agree but for noise are as close to each other as each is to itself."""
    loads = noisy_loads(noise=1.0)
    assert 0.4 < between_engines(loads) < 0.6
    assert of_pymunk(loads) == pytest.approx(between_engines(loads), abs=0.06)
    assert of_event(loads) == pytest.approx(between_engines(loads), abs=0.06)
    assert without_noise(loads) == pytest.approx(1.0, abs=0.06)


def test_another_order_shows_through_the_noise() -> None:
    loads = noisy_loads(noise=1.0, shift=np.pi / 3)
    assert without_noise(loads) == pytest.approx(0.5, abs=0.15)
    assert of_event(loads) > between_engines(loads) + 0.1


def test_averaging_seeds_brings_all_correlations_up() -> None:
    loads = noisy_loads(noise=1.0)
    averaged = loads.mean(axis=-1, keepdims=True)
    for statistic in (between_engines, of_pymunk, of_event):
        assert statistic(averaged) > statistic(loads) + 0.15


@pytest.mark.parametrize("name", STATISTICS)
def test_bootstrap_interval_surrounds_the_value(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(study, "_RESAMPLES", 400)
    found = correlation(noisy_loads(0.5), STATISTICS[name], np.random.default_rng(1))
    assert found.low < found.value < found.high
    assert found.high - found.low < 0.2


def test_loads_are_those_of_the_blasts() -> None:
    layouts: list[tuple[tuple[int, int], ...]] = [(), ((10, 0), (11, 0))]
    charges = [Charge((5.0, 12.0), 100.0), Charge((5.0, 16.0), 100.0)]
    loads = measured_loads(COURTYARD, layouts, charges, 1)
    assert loads.shape == (len(ENGINES), 2, 2, 2)
    # Engine 1 is the event engine; its second lot has the seeds 2 and 3.
    expected = simulate(COURTYARD, layouts[1], 3, ENGINES[1], charges[1])
    assert loads[1, 1, 1, 1] == expected.impulse_sim("building")


def test_agreement_of_two_resolutions_is_that_of_their_means() -> None:
    rising = np.linspace(0.3, 0.8, 10)[:, None] + np.zeros((10, 4))
    one, other = Blasts("one", rising, 0.1), Blasts("other", rising + 0.05, 0.2)
    assert own_correlation(one) == pytest.approx(1.0)
    assert compared(one, other) == (
        "one - other: rank correlation 1.00, the second leaves +0.050 +- 0.000 more"
    )
    assert "correlation -1.00" in compared(one, Blasts("falling", rising[::-1], 0.1))


def test_resolutions_run_exactly_the_parameters_of_the_preset() -> None:
    of_preset = with_parameters(COURTYARD, preset("collisional"))
    assert of_preset.parameters == preset("collisional")


def test_signal_and_noise_are_told_apart() -> None:
    """Of layouts that differ by 0.2 and draws that shift all layouts by 0.1, and each by 0.05."""
    rng = np.random.default_rng(4)
    layout, draw = 0.2 * rng.normal(size=(400, 1)), 0.1 * rng.normal(size=400)
    impulses = 0.5 + layout + draw + 0.05 * rng.normal(size=(400, 400))
    found = Noise.of(impulses, np.ones(400))
    assert found.signal == pytest.approx(0.2, rel=0.1)
    assert found.noise == pytest.approx(np.hypot(0.1, 0.05), rel=0.1)
    assert found.reduction_noise == pytest.approx(found.noise)
    assert found.paired_noise == pytest.approx(0.05, rel=0.1)
    assert len(found.cells()) == 4 + len(AVERAGED)
