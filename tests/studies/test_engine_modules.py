"""The distances between loads of single modules, on loads whose distance is known."""

from collections.abc import Callable

import numpy as np
import pytest

from blast_env import simulate
from blast_env.arrays import FloatArray
from blast_env.studies.benchmark.engines import BenchmarkScene
from studies.particles.agreement.modules import (
    agreement,
    distribution_distance,
    module_impulses,
    profile_distance,
    stepped,
)
from tests.scenarios import BALLISTIC_COURTYARD as COURTYARD


def loads(seed: int, blasts: int, factor: float = 1.0) -> np.ndarray:
    """Impulses of 6 modules, of which the last is never hit."""
    drawn = factor * np.random.default_rng(seed).gamma(3.0, size=(blasts, 6))
    drawn[:, 5] = 0.0
    return drawn


@pytest.mark.parametrize("distance", [distribution_distance, profile_distance])
def test_equal_engines_differ_by_no_more_than_chance(
    distance: Callable[[FloatArray, FloatArray], float],
) -> None:
    """In most draws; these five are fixed."""
    within = [agreement(distance, loads(k, 40), loads(100 + k, 300)) for k in range(5)]
    assert sum(each.value < each.chance for each in within) >= 4


@pytest.mark.parametrize("distance", [distribution_distance, profile_distance])
def test_a_fifth_more_is_more_than_chance(
    distance: Callable[[FloatArray, FloatArray], float],
) -> None:
    found = agreement(distance, loads(1, 200, 1.2), loads(2, 400))
    assert found.value > 1.3 * found.chance


def test_same_loads_in_another_order_of_modules_show_in_the_profile_alone() -> None:
    slope = loads(3, 50) * np.linspace(0.0, 5.0, 6)
    assert distribution_distance(slope[:, ::-1], slope) == pytest.approx(0.0)
    assert profile_distance(slope[:, ::-1], slope) > 0.5


def test_modules_never_hit_do_not_dilute_the_distance() -> None:
    one, other = loads(4, 50), loads(5, 50, 2.0)
    wider = [np.pad(each, ((0, 0), (0, 100))) for each in (one, other)]
    assert distribution_distance(*wider) == distribution_distance(one, other) > 0.2


def test_impulses_are_those_of_the_blasts() -> None:
    found = module_impulses(COURTYARD, "event", 2, 1)
    building = simulate(COURTYARD, seed=1, engine="event").obstacle("building")
    assert found.shape == (2, len(building.parts), 2)
    assert found[1, :, 0].sum() == pytest.approx(building.impulse)
    assert found[1, :, 1].sum() == pytest.approx(building.transferred_impulse)


def test_the_default_step_is_not_run_twice() -> None:
    assert [step for step, _ in stepped(BenchmarkScene("courtyard", COURTYARD, 0.5))] == [0.5]
    steps = dict(stepped(BenchmarkScene("courtyard", COURTYARD, 0.125)))
    assert {step: each.parameters.stepping.step_radii for step, each in steps.items()} == {
        0.5: 0.5,
        0.125: 0.125,
    }
