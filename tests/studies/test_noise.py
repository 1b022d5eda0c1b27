"""How much of a reward is the layout: on numbers whose answer is known."""

import numpy as np
import pytest

from studies.noise import AVERAGED, Noise


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
