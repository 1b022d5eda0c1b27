"""The cache keeps what was asked for last, and no more than it may; what its keys tell apart."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from blast_env import Charge
from blast_env.evaluation import BlastEvaluator, BlastLoads
from blast_env.evaluation.engines.particles import EventEngine
from blast_env.evaluation.record import BlastKey
from blast_env.evaluation.store import BlastStore
from tests.evaluation.cases import COURTYARD, FEW, THREATS


def key(seed: int) -> BlastKey:
    return BlastKey("hash", (), Charge((0.0, 0.0), 1.0), seed, "pymunk", "calibration", "code")


def filled(size: int, count: int) -> BlastStore:
    cache = BlastStore(size=size)
    for seed in range(count):
        cache.add(key(seed), BlastLoads((), np.array([float(seed)])))
    return cache


def kept(cache: BlastStore, count: int) -> list[int]:
    return [seed for seed in range(count) if cache.get(key(seed)) is not None]


def test_the_oldest_goes_first() -> None:
    assert kept(filled(3, 5), 5) == [2, 3, 4]


def test_what_was_asked_for_stays() -> None:
    cache = filled(3, 3)
    first = cache.get(key(0))
    assert first is not None
    assert first.module_impulse_n_s.tolist() == [0.0]
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
        key(0)._replace(calibration="other"),
        key(0)._replace(code="other"),
    ],
)
def test_every_part_of_the_key_counts(other: BlastKey) -> None:
    cache = filled(3, 1)
    assert cache.get(key(0)) is not None
    assert cache.get(other) is None


def test_threads_share_a_cache_of_few_loads() -> None:
    cache = filled(2, 2)

    def use(seed: int) -> bool:
        loads = BlastLoads((), np.array([float(seed)]))
        cache.add(key(seed), loads)
        found = cache.get(key(seed))
        return found is None or found.module_impulse_n_s.tolist() == [float(seed)]

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(use, [number % 7 for number in range(2000)]))
    assert len(cache) <= 2


def test_the_version_of_the_code_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """What an older package computed must not pass for what this one would."""
    shared = BlastStore(size=10)
    BlastEvaluator(COURTYARD, "event", cache=shared).loads(FEW, THREATS[0])
    same = BlastEvaluator(COURTYARD, "event", cache=shared)
    same.loads(FEW, THREATS[0])
    assert same.counts.blasts == 0
    monkeypatch.setattr("blast_env.evaluation.evaluator.code_version", lambda: "0.0.1+00")
    newer = BlastEvaluator(COURTYARD, "event", cache=shared)
    newer.loads(FEW, THREATS[0])
    assert newer.counts.blasts == 1


def test_the_version_of_the_engine_counts() -> None:
    shared = BlastStore(size=10)
    evaluators = [
        BlastEvaluator(COURTYARD, replace(EventEngine(), version=version), cache=shared)
        for version in ("event 1", "event 2", "event 1")
    ]
    for evaluator in evaluators:
        evaluator.loads(FEW, THREATS[0])
    assert [evaluator.counts.blasts for evaluator in evaluators] == [1, 1, 0]
