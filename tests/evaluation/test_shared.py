"""Consequences come back from a store as they were, and other inputs find none."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from blast_env.evaluation import BlastEvaluator, LoadCase
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.evaluation.questions.verdict import Consequences, bay_table
from blast_env.site import Charge, Scenario
from tests.blasts import consequences
from tests.report.sites import LAYOUT, glazed_hut
from tests.site.test_hardening import TAKEN, glazed_yard

CHARGE = Charge((2.0, 4.0), 5.0)


def evaluator(folder: Path, scenario: Scenario | None = None) -> BlastEvaluator:
    return BlastEvaluator(scenario or glazed_hut(), GasEngine(), cache=folder)


def tables(found: Consequences) -> tuple[pd.DataFrame, pd.DataFrame]:
    return bay_table({"": found}), found.barriers[0].pieces


def test_a_stored_blast_has_the_same_consequences(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = consequences(evaluator(tmp_path), LAYOUT, [CHARGE])
    monkeypatch.setattr(GasEngine, "record", None)  # no blast
    again = consequences(evaluator(tmp_path), LAYOUT, [CHARGE])
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
    known = evaluator(tmp_path)
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
    for known in (in_memory, evaluator(tmp_path, site)):
        plain = consequences(known, (), [charge])
    fresh = consequences(evaluator(tmp_path / "other", site), (TAKEN,), [charge])
    monkeypatch.setattr(GasEngine, "record", None)  # no blast
    for known in (in_memory, evaluator(tmp_path, site)):
        hardened = consequences(known, (TAKEN,), [charge])
        pd.testing.assert_frame_equal(tables(hardened)[0], tables(fresh)[0])
        assert not tables(hardened)[0].equals(tables(plain)[0])
