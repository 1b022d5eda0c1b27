"""What `blast-env evaluate` was called with, and what that means for files."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import isnan
from pathlib import Path

import pandas as pd

from blast_env.atomic import make_folder, write_atomically
from blast_env.evaluation import BlastEvaluator, Estimate
from blast_env.export import check_target

_PERCENT = 100.0


@dataclass(frozen=True)
class EvaluateOptions:
    """The options that a layout's file and a run have in common; see `evaluate`."""

    seeds: int
    first_seed: int | None
    processes: int
    engine: str | None
    cvar_level: float
    cache: Path | None
    export: Path | None
    out: Path | None
    as_json: bool

    def seed_range(self, default_first: int) -> range:
        """Return the seeds of the threats."""
        first = default_first if self.first_seed is None else self.first_seed
        return range(first, first + self.seeds)

    def prepare_files(self, layouts: int) -> None:
        """Refuse targets of no use before the blasts, so that no result is lost for want of one.

        Args:
            layouts: How many layouts there are to be.

        Raises:
            BlastEnvError: If `out` cannot be a folder, or `export` is of no use.
        """
        if self.export is not None:
            check_target(self.export, layouts)
        if self.out is None:
            return
        make_folder(self.out)


def write_table(table: pd.DataFrame, path: Path) -> Path:
    """Write a table as CSV; return the path."""
    with write_atomically(path) as temporary:
        table.to_csv(temporary, index=False)
    return path


def cache_record(evaluators: Iterable[BlastEvaluator]) -> dict[str, float]:
    """Return how many blasts were run and how many were known already."""
    counted = list(evaluators)
    blasts = sum(each.blasts for each in counted)
    hits = sum(each.cache_hits for each in counted)
    return {"blasts": blasts, "hits": hits, "hit_rate": hits / max(blasts + hits, 1)}


def cache_text(evaluators: Iterable[BlastEvaluator]) -> str:
    """Return the same for people."""
    record = cache_record(evaluators)
    return (
        f"{record['blasts']:g} blasts run, {record['hits']:g} known already "
        f"(cache hit rate {percent(record['hit_rate'])})"
    )


def percent(share: float) -> str:
    """Return a share for people; a dash for one that does not exist."""
    return "-" if isnan(share) else f"{_PERCENT * share:.1f} %"


def interval(estimate: Estimate) -> str:
    """Return an interval of shares; a dash where one threat says nothing about the others."""
    if isnan(estimate.low):
        return "-"
    return f"{percent(estimate.low)} to {percent(estimate.high)}"


def seeds_text(seeds: range) -> str:
    """Return what the means are over."""
    if len(seeds) == 1:
        return f"seed {seeds[0]}"
    return f"means over {len(seeds)} threats (seeds {seeds[0]} to {seeds[-1]})"
