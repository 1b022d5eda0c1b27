"""Limits of the surrogate on unseen sites: `python -m studies.surrogate_limits`.

The number of sites, the inputs and the number of networks change one at a time. All rows of a seed
are judged on the same sites.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Annotated, Final

import numpy as np
import torch
import typer
from blast_agents.surrogate.fitting import Errors, Samples, fit, load_errors
from blast_agents.surrogate.network import Fit
from blast_agents.surrogate.walls import FEATURES
from blast_agents.surrogate.ways import SHARES

from blast_env.arrays import BoolArray
from blast_env.cli.output import print_line, progress_bar, user_errors
from blast_env.tables import markdown_table
from studies.surrogate import DATA, named_rows, samples_of

_HELD_OUT: Final = 0.2
"""Share of the sites on which all fits are judged."""

_ABOUT: Final = Fit(command="", versions={}, engine="", blasts=1, sites=1)
_BOTH: Final = "ways and messages"
_WAYS: Final = "ways"
_MESSAGES: Final = "messages"


@dataclass(frozen=True)
class Trial:
    """A fit of impulses.

    Attributes:
        share: Share of the sites not held out that the fit uses.
        given: Inputs of the networks besides the geometry.
        members: Number of networks.
    """

    share: float = 1.0
    given: str = _BOTH
    members: int = 1

    def seen(self, samples: Samples) -> Samples:
        """Return samples without the inputs that this trial leaves out."""
        if self.given == _WAYS:
            return replace(samples, relations=np.zeros_like(samples.relations))
        if self.given == _MESSAGES:
            features = samples.features.copy()
            features[:, FEATURES - 2 * SHARES :] = 0.0
            return replace(samples, features=features)
        return samples


TRIALS: Final = (
    Trial(0.0625),
    Trial(0.125),
    Trial(0.25),
    Trial(0.5),
    Trial(),
    Trial(given=_WAYS),
    Trial(given=_MESSAGES),
    Trial(members=5),
)


def main(
    data: Annotated[list[Path] | None, typer.Option(help="Tables of blasts.")] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Splits and fits of each row.")] = 3,
    sites: Annotated[int, typer.Option(min=4, help="Most sites of the tables.")] = 10_000,
    epochs: Annotated[int, typer.Option(min=1, help="Of each fit.")] = 30,
) -> None:
    """Print the errors of each fit on its training sites and on unseen sites."""
    torch.set_num_threads(1)  # more threads block each other
    with user_errors():
        rows = named_rows(data or DATA)
        samples = samples_of(rows[rows["scenario"].isin(rows["scenario"].unique()[:sites])])
        table = []
        with progress_bar("fits") as progress:
            for number, trial in enumerate(TRIALS, start=1):
                table.append(row(trial, list(results(trial, samples, range(seeds), epochs))))
                progress(number / len(TRIALS))
    headers = (
        "sites",
        "the networks are given",
        "networks",
        "rms on its sites",
        "rms on others",
        "the same within a case",
        "rank correlation in a case",
        "lost by choosing, points",
    )
    print_line(markdown_table(headers, table))


def results(
    trial: Trial, samples: Samples, seeds: Sequence[int], epochs: int
) -> Iterator[tuple[int, Errors, Errors]]:
    """Yield for each seed the number of training sites, the errors there, and on held-out sites."""
    given = trial.seen(samples)
    for seed in seeds:
        sites = np.random.default_rng(seed).permutation(np.unique(samples.site))
        cut = max(1, round(_HELD_OUT * len(sites)))
        own = sites[cut:][: max(1, round(trial.share * (len(sites) - cut)))]
        learnt: BoolArray = np.isin(samples.site, own)
        held_out: BoolArray = np.isin(samples.site, sites[:cut])
        fitted = fit(given, learnt, epochs, seed, _ABOUT, trial.members, peaks=False)
        found = [
            load_errors(fitted, fitted.impulse, given, given.impulse, each)
            for each in (learnt, held_out)
        ]
        yield len(own), found[0], found[1]


def row(trial: Trial, found: Sequence[tuple[int, Errors, Errors]]) -> tuple[str, ...]:
    """Return the row of a trial: medians over the seeds, with least and most."""
    learnt, others = [each[1] for each in found], [each[2] for each in found]
    return (
        str(found[0][0]),
        trial.given,
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
