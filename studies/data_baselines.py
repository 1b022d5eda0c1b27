"""What simple models make of the published blasts, beside the packaged surrogate.

All see the same inputs of the same sites and are asked about the same held-out ones, those of
`python -m studies.surrogate fit`. The surrogate sees each point of a wall; the others need one row
per structure, and get means, least and largest values over its points.
"""

from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

import numpy as np
import typer
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.linear_model import RidgeCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from blast_env.answers.terminal import print_line
from blast_env.arrays import BoolArray, FloatArray
from blast_env.cli.output import user_errors
from blast_env.errors import BlastEnvError
from blast_env.surrogate import Surrogate, packaged_surrogate
from blast_env.surrogate.fit_record import Check
from blast_env.surrogate.holdout import Predictions, errors_of, folds
from blast_env.surrogate.samples import Samples
from blast_env.tables import markdown_table
from studies.surrogate import DATA, EVERY, named_rows, samples_of

SEED: Final = 0
"""Seed of the order of sites in the fit of the packaged surrogate."""

_STRENGTHS: Final = tuple(np.logspace(-2.0, 4.0, 13))
"""Strengths of the ridge, of which cross-validation takes one."""

Model = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""Takes rows, their targets, and other rows; returns predictions for those."""


class Score(NamedTuple):
    """Errors of the impulses on held-out sites; see `blast_env.surrogate.fitting.Errors`."""

    rms: float
    rank: float
    lost: float


def pooled(samples: Samples) -> FloatArray:
    """Return a row of inputs for each structure (samples, inputs).

    They are the mean, the least and the largest value of each feature over its points, by area
    alike, and the mean over points of the sums of the relations over the solids.
    """
    starts = np.cumsum(samples.counts) - samples.counts
    sizes = samples.counts[:, None]
    features = samples.features
    ends = np.cumsum(samples.counts * samples.solids)[:-1]
    # Sample by sample: in one call all rows, gigabytes in half precision, would be converted first.
    sums = [own.sum(axis=0, dtype=np.float64) for own in np.split(samples.relations, ends)]
    return np.hstack(
        (
            np.add.reduceat(features, starts) / sizes,
            np.minimum.reduceat(features, starts),
            np.maximum.reduceat(features, starts),
            np.array(sums) / sizes,
        )
    ).astype(np.float64)


def bare_log_impulse(samples: Samples) -> FloatArray:
    """Return the logarithm of Kingery and Bulmash's mean impulse, nothing in its way (samples,)."""
    starts = np.cumsum(samples.counts) - samples.counts
    weighted = samples.area_m2 * np.exp(samples.impulse.known)
    found: FloatArray = np.log(
        np.add.reduceat(weighted, starts) / np.add.reduceat(samples.area_m2, starts)
    )
    return found


def linear(rows: FloatArray, target: FloatArray, asked: FloatArray) -> FloatArray:
    """Predict by ridge regression on standardised inputs."""
    model = make_pipeline(StandardScaler(), RidgeCV(_STRENGTHS)).fit(rows, target)
    return np.asarray(model.predict(asked), dtype=np.float64)


def trees(rows: FloatArray, target: FloatArray, asked: FloatArray) -> FloatArray:
    """Predict by gradient-boosted trees."""
    model = HistGradientBoostingRegressor(max_iter=400, learning_rate=0.05, random_state=SEED)
    return np.asarray(model.fit(rows, target).predict(asked), dtype=np.float64)


MODELS: Final[Mapping[str, Model]] = {
    "linear": linear,
    "trees": trees,
}


def scores(samples: Samples, held_out: BoolArray) -> dict[str, Score]:
    """Return the score of each model, fitted to the samples that are not held out."""
    rows, bare = pooled(samples), bare_log_impulse(samples)
    target, cases = samples.impulse.target, samples.case[held_out]
    found = {}
    for name, model in MODELS.items():
        guessed = bare[held_out] + model(
            rows[~held_out], (target - bare)[~held_out], rows[held_out]
        )
        known = Predictions(guessed, np.zeros_like(guessed))
        off = errors_of(known, target[held_out], cases)
        found[name] = Score(off.rms, off.rank, off.lost)
    return found


def recorded(surrogate: Surrogate) -> Score:
    """Return what the fit of a surrogate noted on the same sites.

    Raises:
        BlastEnvError: If it noted nothing.
    """
    check: Check | None = surrogate.fit.impulse
    if check is None:
        raise BlastEnvError("the surrogate has no record of held-out sites")
    return Score(check.rms, check.rank, check.lost)


def main() -> None:
    """Print the errors of simple models and of the packaged surrogate on held-out sites."""
    with user_errors():
        samples = samples_of(named_rows(DATA))
        held_out = folds(samples.site, EVERY, SEED)[0]
        found = {**scores(samples, held_out), "packaged surrogate": recorded(packaged_surrogate())}
        headers = (
            f"impulses on {len(np.unique(samples.site[held_out]))} held-out sites",
            "error of ln(load), rms",
            "rank correlation in a case",
            "lost by choosing",
        )
        rows = [
            (name, f"{score.rms:.3f}", f"{score.rank:.2f}", f"{100.0 * score.lost:.1f} points")
            for name, score in found.items()
        ]
        print_line(markdown_table(headers, rows))


if __name__ == "__main__":
    typer.run(main)
