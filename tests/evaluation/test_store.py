"""A store gives back what was put in, to the last bit, or nothing; loads in it cost no blast."""

import multiprocessing
import pickle
import shutil
import sqlite3
import sys
import warnings
from collections import namedtuple
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from itertools import count
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from blast_env import Charge
from blast_env.errors import BlastEnvError, BlastEnvWarning
from blast_env.evaluation import (
    BlastEvaluator,
    BlastKey,
    BlastLoads,
    BlastStore,
    LoadCase,
    StructureLoad,
    draw_threats,
    evaluate_layout,
)
from blast_env.evaluation.engines import find_engine
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.evaluation.engines.particles import EventEngine
from blast_env.evaluation.questions.verdict import Consequences, bay_table
from blast_env.evaluation.record import BlastRecord
from blast_env.evaluation.validation import Validation, ValidationStatus
from blast_env.site import Scenario
from blast_env.store import Store
from tests.attack.disks import file_size_limit
from tests.blasts import consequences
from tests.evaluation.cases import COURTYARD, FEW, THREATS
from tests.gas_sites import hut
from tests.report.sites import LAYOUT, glazed_hut
from tests.site.test_hardening import TAKEN, glazed_yard

# --- Contents of any kind, in a file.


FORKING = pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
"""Forks begin at once; later versions of Python warn of threads, which here do nothing."""


def filled(path: Path) -> Store:
    store = Store(path)
    store.put("key 2", b"a first content, which a later one takes the place of")
    for number in range(3):
        store.put(f"key {number}", bytes([number]) * 2000)
    return store


def test_contents_come_back_for_another_object_and_a_copy(tmp_path: Path) -> None:
    first = filled(tmp_path / "a" / "store")
    for store in (first, Store(tmp_path / "a" / "store"), pickle.loads(pickle.dumps(first))):
        assert store.get("key 1") == bytes([1]) * 2000
        assert store.get("key 3") is None
        assert len(store) == 3
        assert list(store.items()) == [(f"key {k}", bytes([k]) * 2000) for k in range(3)]


def test_any_damage_is_an_error_or_a_missing_content_and_never_a_wrong_one(tmp_path: Path) -> None:
    path = tmp_path / "store"
    filled(path).__del__()  # which closes it, so that all of it is in one file
    whole = path.read_bytes()
    assert [path.name for path in tmp_path.iterdir()] == ["store"]
    flipped = [
        whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :]
        for place in range(0, len(whole), 331)
    ]
    refused = 0
    for content in [*flipped, whole[: len(whole) // 2], whole[:50], b"x" * 5000]:
        for path in tmp_path.iterdir():
            path.unlink()
        path.write_bytes(content)
        try:
            with warnings.catch_warnings(record=True) as notes:
                warnings.simplefilter("always")
                store = Store(path)
                found = [store.get(f"key {number}") for number in range(3)]
        except BlastEnvError:
            refused += 1
        else:
            assert len(notes) == (1 if store.damaged else 0)
            whole_or_none = zip(found, range(3), strict=True)
            assert all(content in (None, bytes([k]) * 2000) for content, k in whole_or_none)
    assert refused >= 3


def test_damaged_contents_go_with_one_note(tmp_path: Path) -> None:
    store = filled(tmp_path / "store")
    with closing(sqlite3.connect(tmp_path / "store")) as other:
        other.execute("UPDATE contents SET content = ? WHERE key = 'key 1'", (b"other",))
        other.execute("UPDATE contents SET key = 'key 9' WHERE key = 'key 2'")
        other.commit()
    with pytest.warns(BlastEnvWarning, match="store: has a damaged entry") as notes:
        found = [store.get(f"key {number}") for number in (0, 1, 9)]  # 9 is that of another key
    assert found == [bytes(2000), None, None]
    assert (len(notes), store.damaged, len(store)) == (1, 2, 1)


def test_content_that_cannot_be_decoded_counts_as_damaged(tmp_path: Path) -> None:
    store = Store(tmp_path / "store")
    store.put("key", b"3.5")
    assert store.read("key", float) == 3.5
    with pytest.warns(BlastEnvWarning, match="has a damaged entry"):
        assert store.read("key", int) is None
    assert store.damaged == 1
    assert store.read("key", float) is None


def test_files_of_others_are_refused_and_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "other"
    with closing(sqlite3.connect(path)) as other:
        other.execute("CREATE TABLE contents (mine TEXT)")
        other.commit()
    content = path.read_bytes()
    with pytest.raises(BlastEnvError, match=r"other: is damaged, or no store .* another format"):
        Store(path)
    assert path.read_bytes() == content
    with pytest.raises(BlastEnvError, match="cannot be used"):
        Store(tmp_path)
    with pytest.raises(BlastEnvError, match="most_bytes is -1, must be at least 0"):
        Store(tmp_path / "new", -1)


def test_the_oldest_go_when_there_is_no_more_room(tmp_path: Path) -> None:
    store = Store(tmp_path / "store", most_bytes=10_000)
    for number in range(40):
        store.put(str(number), bytes(1000))
        assert len(store) <= 10
    assert [int(key) for key, _ in store.items()] == list(range(40 - len(store), 40))
    assert len(store) >= 9


def test_a_full_device_costs_the_new_content_alone(tmp_path: Path) -> None:
    store = filled(tmp_path / "store")
    with file_size_limit(1000), pytest.raises(BlastEnvError, match="store: cannot be used"):
        store.put("large", bytes(100_000))
    assert store.get("large") is None
    store.put("key 3", b"fits")
    assert len(store) == 4
    assert len(Store(tmp_path / "store")) == 4


def _mixed(path: Path, first: int) -> int:
    """Put and get what others put and get at the same time; return the number of errors."""
    store, wrong = Store(path, 20_000), 0
    for number in (*range(first, 40), *range(first)):
        store.put(str(number), bytes([number]) * 1000)
        for asked in (number, (number + 20) % 40):
            wrong += store.get(str(asked)) not in (None, bytes([asked]) * 1000)
    return wrong + store.damaged


@FORKING
def test_processes_at_once_never_read_anything_half_written(tmp_path: Path) -> None:
    """Also while each deletes what another one has just written, and all make the file."""
    with multiprocessing.get_context("fork").Pool(3) as pool:
        jobs = [(tmp_path / str(k), first) for k in range(3) for first in (0, 13, 26)]
        assert sum(pool.starmap(_mixed, jobs, chunksize=1)) == 0


@FORKING
def test_a_forked_process_opens_its_own_connection(tmp_path: Path) -> None:
    store = filled(tmp_path / "store")
    process = multiprocessing.get_context("fork").Process(target=store.put, args=("child", b"1"))
    process.start()
    process.join()
    assert process.exitcode == 0
    store.put("parent", b"2")
    assert (store.get("child"), store.get("parent"), len(store)) == (b"1", b"2", 5)


def _put_for_ever(store: Store, pipe: Connection) -> None:
    for number in count():
        store.put(str(number), bytes([number % 256]) * 3000)
        pipe.send(number)


@FORKING
def test_a_killed_process_leaves_all_that_it_had_put_and_nothing_half_written(
    tmp_path: Path,
) -> None:
    for most in (1, 17, 60):
        store = Store(tmp_path / str(most))
        receiver, sender = multiprocessing.Pipe(duplex=False)
        process = multiprocessing.get_context("fork").Process(
            target=_put_for_ever, args=(store, sender)
        )
        process.start()
        last = 0
        while last < most:
            last = receiver.recv()
        process.kill()
        process.join()
        while receiver.poll():
            last = receiver.recv()
        for number in range(last + 1):
            assert store.get(str(number)) == bytes([number % 256]) * 3000
        assert (len(store) - last, store.damaged) in ((1, 0), (2, 0))


@pytest.mark.parametrize("content", [b"", b"S"])
def test_a_store_that_has_lost_its_content_says_so_once(content: bytes, tmp_path: Path) -> None:
    Store(tmp_path / "a.sqlite").put("key", b"content")
    for path in tmp_path.iterdir():
        path.unlink()
    (tmp_path / "a.sqlite").write_bytes(content)
    with pytest.warns(BlastEnvWarning, match=r"a\.sqlite: has lost its content") as notes:
        store = Store(tmp_path / "a.sqlite")
    assert len(notes) == 1
    assert store.get("key") is None
    store.put("key", b"content")
    assert Store(tmp_path / "a.sqlite").get("key") == b"content"


@pytest.mark.skipif(sys.platform == "win32", reason="without limits of files")
def test_a_full_device_is_named_as_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = Store(tmp_path / "a.sqlite")
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage(10**6, 10**6, 0))
    with (
        file_size_limit(1000),
        pytest.raises(BlastEnvError, match=r"a\.sqlite: cannot be written: the device is full"),
    ):
        store.put("key", bytes(100_000))


# --- Loads, in a file.

PAIRS = [(FEW, threat) for threat in THREATS[:2]]


def key(seed: int) -> BlastKey:
    charge = Charge((0.1, 2.0 / 3.0), 1.0)
    return BlastKey("hash", ((1, 2), (3, 4)), charge, seed, "engine", "calibration", "code")


def loads(seed: int) -> BlastLoads:
    """Loads with numbers that need every bit."""
    notes = ("far", "b\n")
    house = StructureLoad(
        *("haus ß", True, 2.0, 1e-300, 0.7, 2.0, False, notes, "b"),
        validation=Validation(ValidationStatus.OUTSIDE, "far"),
        impulse_sim=0.1 + 0.2,
    )
    structures = (house, replace(house, name="b", notes=()))
    return BlastLoads(structures, np.array([0.0, float(seed), np.pi, 1e300]))


def same(one: BlastLoads | None, other: BlastLoads) -> bool:
    """Whether two loads are equal to the last bit."""
    if one is None or one.structures != other.structures:
        return False
    return one.module_impulse_n_s.tobytes() == other.module_impulse_n_s.tobytes()


def test_loads_come_back_to_the_last_bit_also_for_another_object(tmp_path: Path) -> None:
    BlastStore(tmp_path / "a" / "b").add(key(3), loads(3))
    cache = BlastStore(tmp_path / "a" / "b")
    assert same(cache.get(key(3)), loads(3))
    assert len(cache) == 1


def changed(folder: Path, content: bytes) -> None:
    """Replace the content of the first blast, with the right checksum."""
    store = Store(folder / "blasts.sqlite")
    key, _ = next(store.items())
    store.put(key, content)


def test_other_files_are_left_alone(tmp_path: Path) -> None:
    notes = tmp_path / "notes.txt"
    notes.write_text("mine")
    cache = BlastStore(tmp_path, most_bytes=0)
    cache.add(key(0), loads(0))
    assert len(cache) == 0
    assert notes.read_text() == "mine"


def test_worker_processes_leave_the_writing_to_the_parent(tmp_path: Path) -> None:
    evaluator = BlastEvaluator(COURTYARD, "event", cache=tmp_path)
    first = evaluator.loads_of_many(PAIRS, processes=2)
    assert len(BlastStore(tmp_path)) == 2
    again = BlastEvaluator(COURTYARD, "event", cache=tmp_path)
    assert all(map(same, again.loads_of_many(PAIRS, processes=2), first))
    assert again.counts.blasts == 0


def test_evaluations_share_a_folder_or_a_cache(tmp_path: Path) -> None:
    first = evaluate_layout(COURTYARD, FEW, (0, 1), engine="event", cache=tmp_path)
    shared = BlastStore(size=100)
    for cache in (tmp_path, shared, shared):
        again = evaluate_layout(COURTYARD, FEW, (0, 1), engine="event", cache=cache)
        assert again.to_dict() == first.to_dict()
    assert len(shared) == 4


def test_a_file_that_cannot_be_written_costs_a_warning_and_no_result(tmp_path: Path) -> None:
    evaluator = BlastEvaluator(COURTYARD, "event", cache=tmp_path)
    with (
        file_size_limit(1000),
        pytest.warns(BlastEnvWarning, match="a blast is not kept: .*sqlite: cannot be used"),
    ):
        evaluator.loads(*PAIRS[0])
    assert evaluator.counts.blasts == 1


def test_a_file_that_is_damaged_later_costs_warnings_and_no_result(tmp_path: Path) -> None:
    first = BlastEvaluator(COURTYARD, "event", cache=tmp_path).loads(*PAIRS[0])
    again = BlastEvaluator(COURTYARD, "event", cache=tmp_path)
    with closing(sqlite3.connect(tmp_path / "blasts.sqlite")) as other:
        other.execute("DROP TABLE contents")
        other.commit()
    with pytest.warns(BlastEnvWarning) as warned:
        assert same(again.loads(*PAIRS[0]), first)
    words = [str(warning.message)[:25] for warning in warned]
    assert words == ["a blast counts as missing", "a blast is not kept: " + words[1][21:]]


@pytest.mark.parametrize(
    ("cache", "words"), [(3, "cache is 3, must be a folder or a BlastStore"), ("file", "cannot be")]
)
def test_what_is_no_cache_is_refused(
    cache: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("mine")
    with pytest.raises(BlastEnvError, match=words):
        BlastEvaluator(COURTYARD, "event", cache=cache)
    with pytest.raises(BlastEnvError, match="most_bytes is -1, must be at least 0"):
        BlastStore("folder", most_bytes=-1)


EMPTY = BlastRecord(BlastLoads((), np.zeros(0))).encoded()


@pytest.mark.parametrize(
    "content", [b"", EMPTY, b"not JSON\n", b'[{"name": 3}]\n', EMPTY + b"1234567"]
)
def test_wrong_content_with_a_right_checksum_counts_as_damaged(
    content: bytes, tmp_path: Path
) -> None:
    """As another program or version would write it under the same key."""
    BlastStore(tmp_path).add(key(0), loads(0))
    changed(tmp_path, content)
    cache = BlastStore(tmp_path)
    if content == EMPTY:  # no structure and no module: of some other scenario
        assert cache.get(key(0)) is not None
        assert cache.get(key(0)._replace(seed=1)) is None
    else:
        with pytest.warns(BlastEnvWarning, match="has a damaged entry, which counts as missing"):
            assert cache.get(key(0)) is None
        assert (cache.damaged, len(cache)) == (1, 0)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda good: replace(good, module_impulse_sim=good.module_impulse_sim[1:]),
        lambda good: replace(good, module_impulse_sim=good.module_impulse_sim * np.nan),
        lambda good: replace(good, structures=good.structures[:0]),
        lambda good: replace(
            good, structures=tuple(replace(structure, name="x") for structure in good.structures)
        ),
        lambda good: replace(
            good,
            structures=tuple(
                replace(structure, impulse_pa_s=np.inf) for structure in good.structures
            ),
        ),
    ],
)
def test_loads_that_cannot_be_those_of_the_scenario_are_simulated_again(
    wrong: Callable[[BlastLoads], BlastLoads], tmp_path: Path
) -> None:
    first = BlastEvaluator(COURTYARD, "event")
    good = first.loads(*PAIRS[0])
    BlastStore(tmp_path).add(first.key(*PAIRS[0]), wrong(good))
    again = BlastEvaluator(COURTYARD, "event", cache=tmp_path)
    assert same(again.loads(*PAIRS[0]), good)
    assert again.counts.blasts == 1


def test_loads_of_gas_dynamics_are_kept_too(tmp_path: Path) -> None:
    """They have no simulation units, which are NaN, and suction on walls is negative."""
    site = hut()
    threat = draw_threats(site, (0,))[0]
    for blasts in (1, 0):
        evaluator = BlastEvaluator(site, find_engine("gas", 0.5), cache=tmp_path)
        evaluator.loads((), threat)
        assert evaluator.counts.blasts == blasts


# --- Loads in memory, as many as there is room for; what keys tell apart.


def in_memory(size: int, count: int) -> BlastStore:
    cache = BlastStore(size=size)
    for seed in range(count):
        cache.add(key(seed), BlastLoads((), np.array([float(seed)])))
    return cache


def kept(cache: BlastStore, count: int) -> list[int]:
    return [seed for seed in range(count) if cache.get(key(seed)) is not None]


def test_the_oldest_goes_first() -> None:
    assert kept(in_memory(3, 5), 5) == [2, 3, 4]


def test_what_was_asked_for_stays() -> None:
    cache = in_memory(3, 3)
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
    cache = in_memory(3, 1)
    assert cache.get(key(0)) is not None
    assert cache.get(other) is None


def test_threads_share_a_cache_of_few_loads() -> None:
    cache = in_memory(2, 2)

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


# --- Consequences, whose blasts are in a file.

CHARGE = Charge((2.0, 4.0), 5.0)


def on_gas(folder: Path, scenario: Scenario | None = None) -> BlastEvaluator:
    return BlastEvaluator(scenario or glazed_hut(), GasEngine(), cache=folder)


def tables(found: Consequences) -> tuple[pd.DataFrame, pd.DataFrame]:
    return bay_table({"": found}), found.barriers[0].pieces


def test_a_stored_blast_has_the_same_consequences(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = consequences(on_gas(tmp_path), LAYOUT, [CHARGE])
    monkeypatch.setattr(GasEngine, "record", None)  # no blast
    again = consequences(on_gas(tmp_path), LAYOUT, [CHARGE])
    for table, same in zip(tables(first), tables(again), strict=True):
        pd.testing.assert_frame_equal(table, same, check_exact=True)
    assert len(tables(first)[0]) > 0
    for name in ("neighbours", "unchecked", "unjudged", "notes", "is_flagged", "force_words"):
        assert getattr(again, name) == getattr(first, name)
    (one,), (other,) = first.responses, again.responses
    np.testing.assert_array_equal(one.facade.pressure_pa, other.facade.pressure_pa)
    assert (one.validations, one.known, one.charge) == (
        other.validations,
        other.known,
        other.charge,
    )
    known = on_gas(tmp_path)
    known.loads(LAYOUT, LoadCase(CHARGE))
    assert known.counts.blasts == 0  # an evaluation has the loads of the same blast, too
    with pytest.raises(TypeError):
        consequences(known, (), [CHARGE])  # another layout is another blast


def test_a_hardened_facade_responds_to_the_blast_of_the_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site = glazed_yard(charges="mean")
    charge = site.sample_charge(np.random.default_rng(0))
    in_memory = BlastEvaluator(site, GasEngine())
    for known in (in_memory, on_gas(tmp_path, site)):
        plain = consequences(known, (), [charge])
    fresh = consequences(on_gas(tmp_path / "other", site), (TAKEN,), [charge])
    monkeypatch.setattr(GasEngine, "record", None)  # no blast
    for known in (in_memory, on_gas(tmp_path, site)):
        hardened = consequences(known, (TAKEN,), [charge])
        pd.testing.assert_frame_equal(tables(hardened)[0], tables(fresh)[0])
        assert not tables(hardened)[0].equals(tables(plain)[0])


def test_walls_of_a_polygon_that_get_windows_later_have_a_verdict_too(tmp_path: Path) -> None:
    """The first blast had no bays on the west wall, so its record cannot answer for them."""
    document = glazed_hut().model_dump(mode="json", exclude_none=True)
    hut = document["structures"][0]
    left, bottom, right, top = glazed_hut().structures[0].rectangle_m
    corners = [[left, bottom], [right, bottom], [right, top], [left, top]]
    parts = [{"walls": [wall], "glazing": "low"} for wall in ("east", "west")]
    kept = {key: hut[key] for key in ("name", "protected", "height_m")}
    polygon = kept | {"kind": "polygon", "outline_m": corners}

    def walls(count: int) -> set[str]:
        facade = {"bay_m": 1.0, "parts": parts[:count]}
        site = document | {"structures": [polygon | {"facade": facade}]}
        evaluator = on_gas(tmp_path, Scenario.from_document(site, "polygon"))
        return set(tables(consequences(evaluator, (), [CHARGE]))[0]["wall"])

    assert (walls(1), walls(2), walls(1)) == ({"east"}, {"east", "west"}, {"east"})


def test_a_slower_wall_does_not_respond_to_the_short_histories_of_a_faster_one(
    tmp_path: Path,
) -> None:
    """A run goes on for a period of the slowest component: kept histories may end too early."""

    def walls(wall: str, folder: str) -> pd.DataFrame:
        document = glazed_hut().model_dump(mode="json", exclude_none=True)
        document["structures"][0]["facade"] = {"bay_m": 1.0, "wall": wall}
        evaluator = on_gas(tmp_path / folder, Scenario.from_document(document, "walled_hut"))
        return tables(consequences(evaluator, (), [CHARGE]))[0]

    fast = walls("concrete_200", "cache")
    pd.testing.assert_frame_equal(walls("steel_stud", "cache"), walls("steel_stud", "other"))
    pd.testing.assert_frame_equal(walls("concrete_200", "cache"), fast)
