"""What is said of two models' reductions: order, overstatement, regret."""

import numpy as np
import pytest

from studies.gas.judgement import Judgement


def test_order_overstatement_and_regret() -> None:
    """Four layouts, two charges: the first charge is ordered alike, the second the other way."""
    particle = np.array([[0.2, 0.8], [0.4, 0.6], [0.6, 0.4], [0.8, 0.2]])
    gas = np.array([[0.1, 0.1], [0.2, 0.2], [0.3, 0.3], [0.4, 0.4]])
    found = Judgement(particle, gas)
    assert found.rank_correlations == pytest.approx([1.0, -1.0])
    assert found.means == pytest.approx((0.5, 0.25))
    assert found.overstatement == pytest.approx(2.0)
    assert found.regret.value == pytest.approx(0.5 * (0.0 + 0.3))
    assert found.all_pairs == pytest.approx(0.0, abs=0.2)


def test_a_factor_is_all_that_can_be_mended_without_another_order() -> None:
    particle = np.array([[0.2], [0.4], [0.8]])
    exact = Judgement(particle, 0.25 * particle)
    assert exact.factor == pytest.approx(0.25)
    assert exact.errors == pytest.approx((0.0, 0.25 * particle.std()))
    gas = np.array([[0.1], [0.1], [0.1]])
    blind = Judgement(particle, gas)
    assert blind.factor == pytest.approx(0.1 * 1.4 / 0.84)
    assert blind.errors[0] > blind.errors[1] == pytest.approx(0.0)
