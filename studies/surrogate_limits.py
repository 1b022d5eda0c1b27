"""`python -m studies.surrogate_limits`: what limits the surrogate on sites that it has not met.

Sites, layouts, updates, networks and what these are given change one at a time. All rows of a seed
are judged on the same sites: some of those of rules and random layouts, and some of those where an
agent built.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Annotated, Final

import numpy as np
import pandas as pd
import torch
import typer
from blast_agents.surrogate.fitting import Errors, Samples, fit, load_errors
from blast_agents.surrogate.network import Fit
from blast_agents.surrogate.walls import ALL_FEATURES, FEATURES

from blast_env.arrays import BoolArray, IntArray
from blast_env.cli.output import print_line, progress_bar, user_errors
from blast_env.tables import markdown_table
from studies.surrogate import DATA, named_rows, samples_of

AGENT_DATA: Final = Path("docs/data/site_agent_blasts.parquet")
_HELD_OUT: Final = 0.25
"""Share of the sites of each table on which all fits are judged."""

_ABOUT: Final = Fit(command="", versions={}, engine="", blasts=1, sites=1)
_NAMES: Final = {FEATURES: "ways", ALL_FEATURES: "ways, horizons"}


@dataclass(frozen=True)
class Trial:
    """A fit of impulses.

    Attributes:
        ruled: Share of the sites of rules and random layouts that it learns from.
        built: The same of the sites where an agent built.
        features: What the networks are given.
        epochs: How often each sample is met.
        members: Networks.
    """

    ruled: float
    built: float
    features: int = FEATURES
    epochs: int = 20
    members: int = 1


TRIALS: Final = (
    Trial(0.25, 0.0),
    Trial(0.5, 0.0),
    Trial(1.0, 0.0),
    Trial(0.0, 0.8),
    Trial(0.5, 0.4),
    Trial(1.0, 1.0),
    Trial(1.0, 1.0, epochs=60),
    Trial(0.25, 0.0, ALL_FEATURES, 40),
    Trial(0.5, 0.0, ALL_FEATURES, 40),
    Trial(1.0, 0.0, ALL_FEATURES, 40),
    Trial(1.0, 1.0, ALL_FEATURES, 20),
    Trial(1.0, 1.0, ALL_FEATURES, 40),
)


@dataclass(frozen=True, eq=False)
class Split:
    """Which sites fits learn from and are judged on.

    Attributes:
        ruled: Sites of rules and random layouts to learn from, in a random order.
        built: Sites where an agent built, likewise.
        held_out: Samples of the others (samples,).
    """

    ruled: IntArray
    built: IntArray
    held_out: BoolArray

    @classmethod
    def of(cls, samples: Samples, is_built: BoolArray, seed: int) -> "Split":
        """Draw it.

        Args:
            samples: All samples.
            is_built: Which of them come from an agent (samples,).
            seed: Of the order of the sites.
        """
        rng = np.random.default_rng(seed)
        kinds = [rng.permutation(np.unique(samples.site[own])) for own in (~is_built, is_built)]
        cuts = [round(_HELD_OUT * len(each)) for each in kinds]
        held_out = np.concatenate([e[:cut] for e, cut in zip(kinds, cuts, strict=True)])
        ruled, built = (e[cut:] for e, cut in zip(kinds, cuts, strict=True))
        return cls(ruled, built, np.isin(samples.site, held_out))

    def sites(self, trial: Trial) -> IntArray:
        """Return the sites that a trial learns from."""
        own = ((self.ruled, trial.ruled), (self.built, trial.built))
        return np.concatenate([sites[: round(share * len(sites))] for sites, share in own])


def main(
    seeds: Annotated[int, typer.Option(min=1, help="Splits and fits of each row.")] = 3,
    sites: Annotated[int, typer.Option(min=4, help="Most sites of each table.")] = 1000,
) -> None:
    """Print the errors of each fit on what it has met and on sites that it has not."""
    torch.set_num_threads(1)  # more of them only wait for each other
    with user_errors():
        tables = [named_rows([path]) for path in (DATA, AGENT_DATA)]
        tables = [e[e["scenario"].isin(e["scenario"].unique()[:sites])] for e in tables]
        rows = pd.concat(tables, ignore_index=True)
        samples = samples_of(rows)
        # Sites are numbered in the order of their hashes.
        hashes = np.array(sorted(rows["scenario_hash"].unique()))
        is_built = np.isin(hashes[samples.site], tables[1]["scenario_hash"].unique())
        table = []
        with progress_bar("fits") as progress:
            for number, trial in enumerate(TRIALS, start=1):
                table.append(row(trial, list(results(trial, samples, is_built, range(seeds)))))
                progress(number / len(TRIALS))
    headers = (
        "sites of rules, of an agent",
        "the networks are given",
        "epochs",
        "networks",
        "rms on its sites",
        "rms on others",
        "the same within a case",
        "rank correlation in a case",
        "lost by choosing, points",
    )
    print_line(markdown_table(headers, table))


def results(
    trial: Trial, samples: Samples, is_built: BoolArray, seeds: Sequence[int]
) -> Iterator[tuple[int, int, Errors, Errors]]:
    """Yield for each seed the sites of both kinds, and the errors on these and on the others."""
    for seed in seeds:
        split = Split.of(samples, is_built, seed)
        learnt = np.isin(samples.site, split.sites(trial))
        fitted = fit(
            samples, learnt, trial.epochs, seed, _ABOUT, trial.features, trial.members, peaks=False
        )
        found = [
            load_errors(fitted, fitted.members, samples, samples.impulse, each)
            for each in (learnt, split.held_out)
        ]
        sites = [len(np.unique(samples.site[learnt & own])) for own in (~is_built, is_built)]
        yield sites[0], sites[1], found[0], found[1]


def row(trial: Trial, found: Sequence[tuple[int, int, Errors, Errors]]) -> tuple[str, ...]:
    """Return the row of a trial: medians over the seeds, with least and most."""
    (ruled, built, *_), *_ = found
    learnt, others = [each[2] for each in found], [each[3] for each in found]
    return (
        f"{ruled}, {built}",
        _NAMES[trial.features],
        str(trial.epochs),
        str(trial.members),
        _spread([each.rms for each in learnt], "{:.3f}"),
        _spread([each.rms for each in others], "{:.3f}"),
        _spread([each.within for each in others], "{:.3f}"),
        _spread([each.rank for each in others], "{:.2f}"),
        _spread([100.0 * each.lost for each in others], "{:.1f}"),
    )


def _spread(values: Sequence[float], form: str) -> str:
    low, middle, high = (form.format(each(values)) for each in (min, median, max))
    return middle if len(values) == 1 else f"{middle} ({low} to {high})"


if __name__ == "__main__":
    typer.run(main)
