"""Loads come back from a store as they were, to the last bit; damage costs a blast."""

import sqlite3
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from blast_env import Charge
from blast_env.errors import BlastEnvError, BlastEnvWarning
from blast_env.evaluation import (
    BlastEvaluator,
    BlastKey,
    BlastLoads,
    BlastStore,
    StructureLoad,
    draw_threats,
    evaluate_layout,
)
from blast_env.evaluation.engines import find_engine
from blast_env.evaluation.record import BlastRecord
from blast_env.evaluation.validation import Validation, ValidationStatus
from blast_env.store import Store
from tests.attack.disks import file_size_limit
from tests.evaluation.cases import COURTYARD, FEW, THREATS
from tests.gas_sites import hut

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
    words = [str(each.message)[:25] for each in warned]
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
            good, structures=tuple(replace(each, name="x") for each in good.structures)
        ),
        lambda good: replace(
            good, structures=tuple(replace(each, impulse_pa_s=np.inf) for each in good.structures)
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
