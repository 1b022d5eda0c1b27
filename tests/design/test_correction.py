"""What blasts tell of guesses for layouts that are alike."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blast_env.arrays import FloatArray
from blast_env.design.surrogate.correction import Correction, stacked
from blast_env.design.surrogate.correction import apart_m3 as apart_from_all_m3

NOTHING = np.empty((0, 5))


def walls(*lefts_m: float, height_m: float = 2.0) -> FloatArray:
    """Return walls of 3 m by 0.5 m that begin so far from the left border."""
    return np.array([[left, 0.0, left + 3.0, 0.5, height_m] for left in lefts_m]).reshape(-1, 5)


def apart_m3(one: FloatArray, other: FloatArray) -> float:
    """Return the volume that only one of two barriers fills; the other is met among more."""
    _, own, _ = apart_from_all_m3(one, stacked([NOTHING, other, walls(1.0, 5.0, 9.0)]))
    return float(own)


def test_the_volume_that_only_one_of_two_barriers_fills() -> None:
    one = walls(0.0, 10.0)
    assert apart_m3(one, one) == 0.0
    assert apart_m3(one, NOTHING) == apart_m3(NOTHING, one) == pytest.approx(6.0)
    assert apart_m3(one, walls(0.5, 10.0)) == pytest.approx(2 * 0.5 * 0.5 * 2.0)
    assert apart_m3(one, walls(0.0, 10.0, height_m=3.0)) == pytest.approx(3.0)
    assert apart_m3(one, walls(20.0)) == pytest.approx(9.0)
    assert apart_m3(NOTHING, NOTHING) == 0.0


@given(st.lists(st.floats(0.0, 20.0), max_size=4), st.lists(st.floats(0.0, 20.0), max_size=4))
def test_it_is_the_same_either_way_round(one: list[float], other: list[float]) -> None:
    found = apart_m3(walls(*one), walls(*other))
    assert found == pytest.approx(apart_m3(walls(*other), walls(*one)))


def test_layouts_that_are_alike_are_off_alike() -> None:
    """Guesses were right of walls on the left, and by a fifth too low for walls on the right."""
    met = [walls(0.0), walls(1.0), walls(20.0), walls(21.0)]
    correction = Correction.of(met, np.array([0.0, 0.0, 0.2, 0.2]))
    mean, spread = correction.expected([*met, walls(0.5), walls(20.5), walls(100.0)])
    assert mean[:4] == pytest.approx([0.0, 0.0, 0.2, 0.2], abs=0.02)
    assert mean[4] < 0.03
    assert mean[5] > 0.17
    assert mean[6] == pytest.approx(0.1, abs=0.02)  # as the others on the mean
    assert spread[6] == pytest.approx(0.1, rel=0.05)
    assert (spread[:4] < 0.3 * spread[6]).all()
    assert (spread[4:6] < 0.6 * spread[6]).all()


def test_one_blast_on_the_empty_site_tells_what_it_was_off_by() -> None:
    correction = Correction.of([NOTHING], np.array([-0.3]))
    mean, spread = correction.expected([NOTHING, walls(2.0)])
    assert mean == pytest.approx([-0.3, -0.3])
    assert 0.0 < spread[0] < spread[1]
