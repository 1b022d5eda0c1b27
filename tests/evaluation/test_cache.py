"""The cache keeps what was asked for last, and no more than it may."""

import numpy as np
import pytest

from blast_env import Charge
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastLoads
from blast_env.evaluation.cache import BlastKey, LoadsCache


def key(seed: int) -> BlastKey:
    return BlastKey("hash", (), Charge((0.0, 0.0), 1.0), seed, "pymunk")


def filled(size: int, count: int) -> LoadsCache:
    cache = LoadsCache(size)
    for seed in range(count):
        cache.add(key(seed), BlastLoads((), np.array([float(seed)])))
    return cache


def kept(cache: LoadsCache, count: int) -> list[int]:
    return [seed for seed in range(count) if cache.get(key(seed)) is not None]


def test_the_oldest_goes_first() -> None:
    assert kept(filled(3, 5), 5) == [2, 3, 4]


def test_what_was_asked_for_stays() -> None:
    cache = filled(3, 3)
    first = cache.get(key(0))
    assert first is not None
    assert first.module_impulse_sim.tolist() == [0.0]
    cache.add(key(3), first)
    assert kept(cache, 4) == [0, 2, 3]


@pytest.mark.parametrize(
    "other",
    [
        key(0)._replace(scenario_hash="other"),
        key(0)._replace(layout=((0, 0),)),
        key(0)._replace(charge=Charge((0.0, 0.0), 2.0)),
        key(0)._replace(seed=1),
        key(0)._replace(engine="other"),
    ],
)
def test_every_part_of_the_key_counts(other: BlastKey) -> None:
    cache = filled(3, 1)
    assert cache.get(key(0)) is not None
    assert cache.get(other) is None


def test_a_cache_of_size_zero_keeps_nothing() -> None:
    assert len(filled(0, 2)) == 0


def test_a_negative_size_is_refused() -> None:
    with pytest.raises(BlastEnvError, match="cache_size is -1, must be at least 0"):
        LoadsCache(-1)
