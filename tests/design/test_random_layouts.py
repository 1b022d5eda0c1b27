import numpy as np
import pytest

from blast_env import load_scenario
from blast_env.design.rules import random_layout
from blast_env.layout import LayoutState
from tests.agents.sites import site


@pytest.mark.parametrize("name", ["courtyard", "perimeter_gate", "street_junction"])
def test_random_layouts_are_legal_and_use_what_there_is(name: str) -> None:
    """Full stock, or nothing left that could be afforded or would leave the way open."""
    scenario = load_scenario(name)
    for seed in range(5):
        placement = LayoutState.of(scenario, random_layout(scenario, np.random.default_rng(seed)))
        assert placement.is_full


def test_the_generator_decides_everything() -> None:
    scenario = load_scenario("courtyard")
    first, again, other = (
        random_layout(scenario, np.random.default_rng(seed)) for seed in (3, 3, 4)
    )
    assert first == again
    assert set(first) != set(other)


def test_every_usable_cell_is_as_likely() -> None:
    """Chi-square over 3 x 4 cells of which two are kept out: 99.99 % of such sums are below 34."""
    scenario = site(
        rows=3,
        columns=4,
        stock=1,
        keep_outs=[{"corner_m": (15.0, 15.0), "size_m": (1.0, 0.5), "reason": "a tree"}],
    )
    rng, counts = np.random.default_rng(0), np.zeros((3, 4))
    for _ in range(1000):
        ((row, column, *_),) = random_layout(scenario, rng)
        counts[row, column] += 1
    assert counts[0, :2].sum() == 0
    tried = counts.ravel()[2:]
    assert float(((tried - 100.0) ** 2 / 100.0).sum()) < 34.0


def test_without_a_zone_there_is_no_layout() -> None:
    assert random_layout(load_scenario("free_field"), np.random.default_rng(0)) == ()
