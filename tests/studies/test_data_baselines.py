"""Simple models on the published blasts: they learn from them, and are asked about other sites."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from blast_env.surrogate import Samples, packaged_surrogate
from studies.data_baselines import MODELS, bare_log_impulse, pooled, recorded, scores
from studies.surrogate import named_rows, samples_of

TABLE = Path("docs/data/close_site_blasts.parquet")
SITES = 16


@pytest.fixture(scope="module")
def samples() -> Samples:
    rows: pd.DataFrame = named_rows([TABLE])
    return samples_of(rows[rows["scenario"].isin(rows["scenario"].unique()[:SITES])])


def test_a_row_stands_for_a_structure(samples: Samples) -> None:
    rows, bare = pooled(samples), bare_log_impulse(samples)
    assert rows.shape[0] == bare.shape[0] == len(samples)
    assert np.isfinite(rows).all()
    first = samples.impulse.known[: samples.counts[0]]
    assert first.min() <= bare[0] <= first.max()


def test_what_is_learnt_on_some_sites_is_nearer_on_others_than_a_bare_curve(
    samples: Samples,
) -> None:
    held_out = samples.site % 4 == 0
    off = (samples.impulse.target - bare_log_impulse(samples))[held_out]
    for name, score in scores(samples, held_out).items():
        assert name in MODELS
        assert score.rms < 0.7 * np.sqrt(np.mean(off**2)), name
        assert score.rank > 0.2, name


def test_the_packaged_surrogate_notes_its_errors_on_held_out_sites() -> None:
    score = recorded(packaged_surrogate())
    assert 0.0 < score.rms < 0.2
    assert 0.5 < score.rank <= 1.0
