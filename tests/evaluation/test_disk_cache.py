"""The cache in a folder gives back what was put in, or nothing: never anything else."""

import multiprocessing
import os
from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from blast_env import Charge
from blast_env.errors import BlastEnvError
from blast_env.evaluation import (
    BlastEvaluator,
    BlastKey,
    BlastLoads,
    DiskCache,
    LoadsCache,
    ParticleLoad,
    draw_threats,
    evaluate_layout,
)
from blast_env.evaluation.engines import find_engine
from tests.evaluation.cases import COURTYARD, FEW, THREATS
from tests.gas_sites import hut

PAIRS = [(FEW, threat) for threat in THREATS[:2]]


def key(seed: int) -> BlastKey:
    charge = Charge((0.1, 2.0 / 3.0), 1.0)
    return BlastKey("hash", ((1, 2), (3, 4)), charge, seed, "engine", "calibration", "code")


def loads(seed: int) -> BlastLoads:
    """Loads with numbers that need every bit."""
    notes = ("far", "b\n")
    sums = {"impulse_sim": 0.1 + 0.2, "transferred_impulse_sim": 1.0 / 3.0}
    house = ParticleLoad("haus ß", True, 2.0, 1e-300, 0.7, 2.0, False, notes, "b", **sums)
    structures = (house, replace(house, name="b", notes=()))
    return BlastLoads(structures, np.array([0.0, float(seed), np.pi, 1e300]))


def same(one: BlastLoads | None, other: BlastLoads) -> bool:
    """Whether two loads are equal to the last bit."""
    if one is None or one.structures != other.structures:
        return False
    return one.module_impulse_sim.tobytes() == other.module_impulse_sim.tobytes()


def test_loads_come_back_to_the_last_bit_also_for_another_object(tmp_path: Path) -> None:
    DiskCache(tmp_path / "a" / "b").add(key(3), loads(3))
    cache = DiskCache(tmp_path / "a" / "b")
    assert same(cache.get(key(3)), loads(3))
    assert len(cache) == 1


def test_any_flipped_byte_and_any_cut_is_noticed_and_the_file_goes(tmp_path: Path) -> None:
    cache = DiskCache(tmp_path)
    cache.add(key(0), loads(0))
    (file,) = tmp_path.iterdir()
    whole = file.read_bytes()
    flipped = [
        whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :]
        for place in range(0, len(whole), 7)
    ]
    damaged = [*flipped, b"", whole[:20], whole[:-1], whole + b"\0"]
    for content in damaged:
        file.write_bytes(content)
        assert cache.get(key(0)) is None
        assert not file.exists()
    assert cache.damaged == len(damaged)


def test_a_sound_file_under_the_name_of_another_blast_is_not_believed(tmp_path: Path) -> None:
    cache = DiskCache(tmp_path)
    cache.add(key(0), loads(0))
    (first,) = tmp_path.iterdir()
    cache.add(key(1), loads(1))
    (second,) = set(tmp_path.iterdir()) - {first}
    second.write_bytes(first.read_bytes())
    assert cache.get(key(1)) is None
    assert same(cache.get(key(0)), loads(0))


def test_a_damaged_blast_is_simulated_again_and_kept_again(tmp_path: Path) -> None:
    first = BlastEvaluator(COURTYARD, "event", cache=tmp_path).loads_of_many(PAIRS)
    damaged = sorted(tmp_path.iterdir())[0]
    damaged.write_bytes(damaged.read_bytes()[:-8] + b"12345678")
    again = BlastEvaluator(COURTYARD, "event", cache=tmp_path)
    assert all(map(same, again.loads_of_many(PAIRS), first))
    assert (again.blasts, again.cache_hits) == (1, 1)
    third = BlastEvaluator(COURTYARD, "event", cache=tmp_path)
    third.loads_of_many(PAIRS)
    assert third.cache_hit_rate == 1.0


def test_the_folder_stays_small_and_what_was_asked_for_stays(tmp_path: Path) -> None:
    DiskCache(tmp_path).add(key(0), loads(0))
    (file,) = tmp_path.iterdir()
    size = file.stat().st_size
    os.utime(file, ns=(0, 0))  # long ago
    cache = DiskCache(tmp_path, most_bytes=10 * size)
    known = {file}
    for seed in range(1, 40):
        cache.add(key(seed), loads(seed))
        taken = sum(each.stat().st_size for each in tmp_path.iterdir())
        assert taken <= 10 * size
        if seed == 1:
            assert cache.get(key(1)) is not None
        for each in set(tmp_path.iterdir()) - known:
            os.utime(each, ns=(seed, seed))
            known.add(each)
        cache.get(key(1))  # so that it is always the last one that was used
    assert cache.get(key(0)) is None
    assert same(cache.get(key(1)), loads(1))
    assert len(cache) >= 5


def test_other_files_are_left_alone(tmp_path: Path) -> None:
    notes = tmp_path / "notes.txt"
    notes.write_text("mine")
    cache = DiskCache(tmp_path, most_bytes=0)
    cache.add(key(0), loads(0))
    assert len(cache) == 0
    assert notes.read_text() == "mine"


def _fill(folder: Path, first: int, wrong: "multiprocessing.Queue[int]") -> None:
    """Add and read blasts that another process adds and reads at the same time."""
    count = 0
    for most_bytes in (256_000_000, 6_000):
        cache = DiskCache(folder / str(most_bytes), most_bytes)
        for seed in (*range(first, 40), *range(first)):
            cache.add(key(seed), loads(seed))
            for asked in (seed, (seed + 20) % 40):
                found = cache.get(key(asked))
                count += found is not None and not same(found, loads(asked))
        count += 1000 * cache.damaged
    wrong.put(count)


@pytest.mark.slow
def test_two_processes_at_once_never_read_anything_half_written(tmp_path: Path) -> None:
    """Also while each deletes what the other one has just written."""
    context = multiprocessing.get_context("spawn")
    wrong: multiprocessing.Queue[int] = context.Queue()
    workers = [context.Process(target=_fill, args=(tmp_path, first, wrong)) for first in (0, 20)]
    for worker in workers:
        worker.start()
    assert [wrong.get(timeout=300) for _ in workers] == [0, 0]
    for worker in workers:
        worker.join()
    large, small = tmp_path / "256000000", tmp_path / "6000"
    assert len(list(large.iterdir())) == 40
    assert 0 < sum(file.stat().st_size for file in small.iterdir()) < 2 * 6_000
    assert not list(tmp_path.glob("*/.*"))


def test_worker_processes_leave_the_writing_to_the_parent(tmp_path: Path) -> None:
    evaluator = BlastEvaluator(COURTYARD, "event", cache=tmp_path)
    first = evaluator.loads_of_many(PAIRS, processes=2)
    assert len(list(tmp_path.iterdir())) == 2
    again = BlastEvaluator(COURTYARD, "event", cache=tmp_path)
    assert all(map(same, again.loads_of_many(PAIRS, processes=2), first))
    assert again.blasts == 0


def test_evaluations_share_a_folder_or_a_cache(tmp_path: Path) -> None:
    first = evaluate_layout(COURTYARD, FEW, (0, 1), engine="event", cache=tmp_path)
    shared = LoadsCache(100)
    for cache in (tmp_path, shared, shared):
        again = evaluate_layout(COURTYARD, FEW, (0, 1), engine="event", cache=cache)
        assert again.to_dict() == first.to_dict()
    assert len(shared) == 4


def test_a_folder_that_cannot_be_written_costs_a_warning_and_no_result(tmp_path: Path) -> None:
    cache = DiskCache(tmp_path / "gone")
    cache.folder.rmdir()
    evaluator = BlastEvaluator(COURTYARD, "event", cache=cache)
    with pytest.warns(RuntimeWarning, match="a blast is not kept: .*there is no folder"):
        evaluator.loads(*PAIRS[0])
    assert evaluator.blasts == 1


@pytest.mark.parametrize(
    ("cache", "words"),
    [(3, "cache is 3, must be a folder or have the methods get and add"), ("file", "cannot be")],
)
def test_what_is_no_cache_is_refused(
    cache: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("mine")
    with pytest.raises(BlastEnvError, match=words):
        BlastEvaluator(COURTYARD, "event", cache=cache)
    with pytest.raises(BlastEnvError, match="most_bytes is -1, must be at least 0"):
        DiskCache("folder", -1)


EMPTY = b'{"structures": [], "bays": []}\n'


@pytest.mark.parametrize(
    "content", [b"", EMPTY, b"not JSON\n", b'[{"name": 3}]\n', EMPTY + b"1234567"]
)
def test_wrong_content_with_a_right_checksum_counts_as_damaged(
    content: bytes, tmp_path: Path
) -> None:
    """As another program or version would write it under the same key."""
    cache = DiskCache(tmp_path)
    cache.add(key(0), loads(0))
    (path,) = tmp_path.iterdir()
    line, _, _ = path.read_bytes()[32:].partition(b"\n")
    body = line + b"\n" + content
    path.write_bytes(sha256(body).digest() + body)
    if content == EMPTY:  # no structure and no module: of some other scenario
        assert cache.get(key(0)) is not None
    else:
        assert cache.get(key(0)) is None
        assert cache.damaged == 1
        assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "wrong",
    [
        lambda good: replace(good, module_impulse_sim=good.module_impulse_sim[1:]),
        lambda good: replace(good, module_impulse_sim=good.module_impulse_sim * np.nan),
        lambda good: replace(good, structures=good.structures[:0]),
        lambda good: replace(
            good, structures=tuple(replace(each, name="x") for each in good.structures)
        ),
        lambda good: replace(
            good, structures=tuple(replace(each, impulse_pa_s=np.inf) for each in good.structures)
        ),
    ],
)
def test_loads_that_cannot_be_those_of_the_scenario_are_simulated_again(
    wrong: Callable[[BlastLoads], BlastLoads],
) -> None:
    shared = LoadsCache(10)
    first = BlastEvaluator(COURTYARD, "event", cache=shared)
    good = first.loads(*PAIRS[0])
    shared.add(first.key(*PAIRS[0]), wrong(good))
    again = BlastEvaluator(COURTYARD, "event", cache=shared)
    assert same(again.loads(*PAIRS[0]), good)
    assert again.blasts == 1


def test_entries_that_others_own_are_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a shared folder like /tmp, tidying may delete only what is one's own."""
    cache = DiskCache(tmp_path, most_bytes=5_000)
    cache.add(key(0), loads(0))
    (foreign,) = tmp_path.iterdir()
    os.utime(foreign, ns=(1, 1))
    unlink = Path.unlink

    def sticky(path: Path, missing_ok: bool = False) -> None:
        if path == foreign:
            raise PermissionError(1, "Operation not permitted")
        unlink(path, missing_ok)

    monkeypatch.setattr(Path, "unlink", sticky)
    for seed in range(1, 40):
        cache.add(key(seed), loads(seed))
    assert foreign.exists()
    assert 2 < len(cache) < 20
    assert same(cache.get(key(39)), loads(39))


def test_loads_of_gas_dynamics_are_kept_too(tmp_path: Path) -> None:
    """They have no simulation units, which are NaN, and suction on walls is negative."""
    site = hut()
    threat = draw_threats(site, (0,))[0]
    for blasts in (1, 0):
        evaluator = BlastEvaluator(site, find_engine("gas", 0.5), cache=tmp_path)
        evaluator.loads((), threat)
        assert evaluator.blasts == blasts
