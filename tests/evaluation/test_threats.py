"""Threats are the charges that `simulate` would draw, and wrong seeds are named."""

from typing import Any

import numpy as np
import pytest

from blast_env import Blast, Charge
from blast_env.errors import BlastEnvError
from blast_env.evaluation import Threat, draw_threats
from tests.evaluation.cases import COURTYARD, SEEDS


def test_a_seed_draws_the_charge_of_its_blast() -> None:
    for seed, threat in zip(SEEDS, draw_threats(COURTYARD, SEEDS), strict=True):
        assert threat.seed == seed
        assert threat.charge == Blast(COURTYARD, seed=seed).scene.charge


def test_numbers_of_other_types_make_the_same_threat() -> None:
    """They become keys of a cache and go into JSON files."""
    plain = Threat(Charge((5.0, 15.0), 100.0), 3)
    numpy_charge: Any = (np.array([5, 15]), np.float32(100.0))
    numpy_seed: Any = np.int64(3)
    other = Threat(numpy_charge, numpy_seed)
    assert other == plain
    assert hash(other) == hash(plain)
    assert type(other.seed) is int
    assert draw_threats(COURTYARD, np.arange(2)) == draw_threats(COURTYARD, range(2))


@pytest.mark.parametrize(
    ("seeds", "words"),
    [
        ([], "there are none, must be at least one"),
        ([4, 2, 4], r"seeds\[2\] is 4, is there already"),
        ([0, -7], r"seeds\[1\] is -7, must be at least 0"),
        ([0.5], r"seeds\[0\] is 0.5, must be an integer"),
        ([True], r"seeds\[0\] is True, must be an integer"),
    ],
)
def test_unusable_seeds_are_named(seeds: list, words: str) -> None:
    with pytest.raises(BlastEnvError, match=words):
        draw_threats(COURTYARD, seeds)


@pytest.mark.parametrize("charge", [5.0, ((1.0, 2.0, 3.0), 1.0), (("left", 1.0), 1.0)])
def test_unusable_charges_are_named(charge: Any) -> None:
    with pytest.raises(BlastEnvError, match="must be"):
        Threat(charge, 0)
    with pytest.raises(BlastEnvError, match="seed is -1, must be at least 0"):
        Threat(Charge((5.0, 15.0), 100.0), -1)
