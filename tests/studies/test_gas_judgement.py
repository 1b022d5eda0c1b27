"""What is said of two models' reductions: order, overstatement, regret."""

import numpy as np
import pytest

from studies.gas.judgement import Judgement


def test_order_overstatement_and_regret() -> None:
    """Four layouts, two charges: the first charge is ordered alike, the second the other way."""
    particle = np.array([[0.2, 0.8], [0.4, 0.6], [0.6, 0.4], [0.8, 0.2]])
    gas = np.array([[0.1, 0.1], [0.2, 0.2], [0.3, 0.3], [0.4, 0.4]])
    found = Judgement(particle, gas)
    assert found.means == pytest.approx((0.5, 0.25))
    assert found.overstatement == pytest.approx(2.0)
    assert found.regret.value == pytest.approx(0.5 * (0.0 + 0.3))
    assert found.all_pairs == pytest.approx(0.0, abs=0.2)
