"""What more blasts would bring: fits of the surrogate to parts of the sites, all else equal.

`python -m studies.learning_curve` prints the table of docs/researchers/surrogate.md.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import torch
import typer

from blast_env.answers.terminal import print_line
from blast_env.arrays import BoolArray
from blast_env.cli.output import progress_bar, user_errors
from blast_env.provenance import versions
from blast_env.surrogate.fit_record import Fit
from blast_env.surrogate.fitting import fit
from blast_env.surrogate.holdout import folds, load_errors
from blast_env.surrogate.samples import Samples
from blast_env.tables import markdown_table
from studies.surrogate import DATA, EVERY, named_rows, samples_of

BUNDLED: Final = Path("docs/data/gas_blasts.parquet")
"""Blasts on bundled sites, which no fit sees."""

SHARES: Final = (0.125, 0.25, 0.5, 1.0)


def parts_of(
    site: np.ndarray, held_out: BoolArray, shares: Sequence[float], seed: int
) -> list[BoolArray]:
    """Return the masks of samples on shares of the sites; larger ones have the smaller ones.

    Args:
        site: Index of the site of each sample (samples,).
        held_out: Mask of the samples that belong to no part (samples,).
        shares: The shares of the other sites, above 0 to 1.
        seed: Seed of their order.
    """
    order = np.random.default_rng(seed).permutation(np.unique(site[~held_out]))
    return [np.isin(site, order[: round(share * len(order))]) for share in shares]


def main(
    data: Annotated[list[Path] | None, typer.Option(help="Tables of blasts.")] = None,
    other: Annotated[Path, typer.Option(help="Table of sites that no fit sees.")] = BUNDLED,
    share: Annotated[list[float] | None, typer.Option(help="Shares of the sites.")] = None,
    members: Annotated[int, typer.Option(min=2, help="Networks of a fit.")] = 2,
    epochs: Annotated[int, typer.Option(min=1, help="Passes over all sites.")] = 4,
    every: Annotated[int, typer.Option(min=2, help="One of so many sites is held out.")] = EVERY,
    seed: int = 0,
) -> None:
    """Print the errors of impulses of fits to parts of the sites.

    All fits have as many updates as the one to all sites: a smaller part is passed more often.
    """
    torch.set_num_threads(1)  # more threads block each other, for minutes on busy cores
    with user_errors(), progress_bar("fits") as progress:
        samples = samples_of(named_rows(data or DATA))
        others = samples_of(named_rows([other]))
        held_out = folds(samples.site, every, seed)[0]
        shares = sorted(share or SHARES)
        masks, rows = parts_of(samples.site, held_out, shares, seed), []
        for number, (part, chosen) in enumerate(zip(shares, masks, strict=True), start=1):
            passes = max(1, round(epochs / part))
            rows.append(_row(samples, chosen, held_out, others, (members, passes, seed)))
            progress(number / len(shares))
    headers = ("sites", "loads", "within a case", "rank", "lost by choosing")
    more = ("bundled: within a case", "rank", "lost by choosing")
    print_line(markdown_table((*headers, *more), rows))


def _row(
    samples: Samples,
    chosen: BoolArray,
    held_out: BoolArray,
    others: Samples,
    settings: tuple[int, int, int],
) -> tuple[str, ...]:
    """Fit to the chosen samples; return their numbers, and errors on both kinds of others."""
    members, epochs, seed = settings
    sites, loads = len(np.unique(samples.site[chosen])), int(chosen.sum())
    about = Fit(command="", versions=versions(), engine="", blasts=loads, sites=sites)
    fitted = fit(samples, chosen, epochs, seed, about, members, peaks=False)
    row = [f"{sites:,}", f"{loads:,}"]
    for asked, which in ((samples, held_out), (others, np.ones(len(others), dtype=bool))):
        off = load_errors(fitted, fitted.impulse, asked, asked.impulse, which)
        row += [f"{off.within:.3f}", f"{off.rank:.2f}", f"{100.0 * off.lost:.1f} points"]
    return tuple(row)


if __name__ == "__main__":
    typer.run(main)
