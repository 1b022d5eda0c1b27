"""Rank correlations of layouts between the engines, on loads whose order is known."""

import numpy as np
import pytest
from scipy.stats import spearmanr

from blast_env import simulate
from blast_env.physics.scene import Charge
from blast_env.scenario import check_layout
from scripts.rank_layouts import (
    ENGINES,
    STATISTICS,
    between_engines,
    correlation,
    measured_loads,
    of_event,
    of_pymunk,
    random_layouts,
    spearman,
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
def test_bootstrap_interval_surrounds_the_value(name: str) -> None:
    found = correlation(noisy_loads(0.5), STATISTICS[name], np.random.default_rng(1))
    assert found.low < found.value < found.high
    assert found.high - found.low < 0.2


def test_random_layouts_are_allowed_and_of_all_sizes() -> None:
    layouts = random_layouts(COURTYARD, 60, np.random.default_rng(2))
    assert COURTYARD.build_zone is not None
    for layout in layouts:
        check_layout(COURTYARD, layout)
    sizes = {len(layout) for layout in layouts}
    assert min(sizes) <= 3
    assert max(sizes) == COURTYARD.build_zone.stock


def test_loads_are_those_of_the_blasts() -> None:
    layouts: list[tuple[tuple[int, int], ...]] = [(), ((10, 0), (11, 0))]
    charges = [Charge((5.0, 12.0), 100.0), Charge((5.0, 16.0), 100.0)]
    loads = measured_loads(COURTYARD, layouts, charges, 1)
    assert loads.shape == (len(ENGINES), 2, 2, 2)
    # Engine 1 is the event engine; its second lot has the seeds 2 and 3.
    expected = simulate(COURTYARD, layouts[1], 3, ENGINES[1], charges[1])
    assert loads[1, 1, 1, 1] == expected.impulse_sim("building")
