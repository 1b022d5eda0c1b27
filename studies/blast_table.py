"""Write the blasts of folders as one table of inputs and loads.

Searches and trainings keep their blasts in caches (`--cache`, `--blasts`, a run folder's `blasts`),
and `studies.surrogate blasts` in a table for each site. A table of them is training data for a
surrogate, and remains valid when a new version of the code invalidates a cache.
"""

import json
from collections.abc import Iterable, Iterator, Mapping
from math import isfinite
from pathlib import Path
from typing import Annotated, Final, NamedTuple

import numpy as np
import pandas as pd
import typer

from blast_env import load_scenario
from blast_env.answers.terminal import print_line
from blast_env.cli.output import user_errors
from blast_env.errors import BlastEnvError
from blast_env.evaluation import BlastKey, BlastStore, StructureLoad
from blast_env.files import make_folder
from blast_env.parquet import SUFFIX, read_frame, write_table
from blast_env.provenance import versions
from blast_env.site import Scenario, bundled_scenarios
from blast_env.sites import ITEM_SITES
from blast_env.surrogate.samples import UNKNOWN
from blast_env.tables import Column, table_of
from studies.site_names import scenario_of, site_names

COLUMNS: Final = (
    Column(
        "scenario",
        "",
        "bundled scenario of that hash, or generated site; empty: one of a file",
        True,
    ),
    Column("scenario_hash", "", "content hash of the scenario", True),
    Column(
        "layout", "", "JSON: [row, column] per module, [row, column, item, turned] per piece", True
    ),
    Column("charge_x_m", "m", "where the charge went off, from the left border"),
    Column("charge_y_m", "m", "from the lower border"),
    Column("charge_height_m", "m", "height of its centre; 0: it lay on the ground"),
    Column("tnt_kg", "kg", "its mass"),
    Column("seed", "", "of fan and air; 0 for gas dynamics, which draws none"),
    Column("engine", "", "engine with its version and fields", True),
    Column("structure", "", "name of the structure", True),
    Column("protected", "", "whether its load counts"),
    Column("impulse_pa_s", "Pa s", "mean impulse on the assessed walls"),
    Column("peak_pa", "Pa", "largest overpressure on them; missing for particles"),
    Column(
        "point_impulses_pa_s", "Pa s", "JSON: at the points of `WallPoints`; [] if unknown", True
    ),
    Column("point_peaks_pa", "Pa", "JSON: the largest overpressures there; [] if unknown", True),
)
"""One row per structure and blast."""

BLAST: Final = (
    "scenario_hash",
    "layout",
    "charge_x_m",
    "charge_y_m",
    "charge_height_m",
    "tnt_kg",
    "seed",
    "engine",
)
"""Columns that tell one blast from another."""

_AT_POINTS: Final = ("point_impulses_pa_s", "point_peaks_pa")
_DIGITS: Final = 3
"""Significant digits of loads at points: half a percent at most, a tenth of a guess's error."""


def main(
    folders: Annotated[list[Path], typer.Argument(help="Folders with blasts, and tables to join.")],
    out: Annotated[Path, typer.Option(help="The table, .parquet.")] = Path("out/blasts.parquet"),
    sites: Annotated[
        int, typer.Option(min=0, help="Generated sites of the training's seeds, to name them.")
    ] = 0,
    first: Annotated[int, typer.Option(min=0, help="How many of them are left out.")] = 0,
    kind: Annotated[
        list[str] | None, typer.Option(help="Their kinds, as for `surrogate blasts`.")
    ] = None,
    scenario: Annotated[
        list[str] | None, typer.Option(help="Scenario files to name, beside the bundled ones.")
    ] = None,
) -> None:
    """Write the table, each blast once."""
    with user_errors():
        known = (*bundled_scenarios(), *(scenario or ()))
        names = dict(named(name, load_scenario(name)) for name in known)
        for name in site_names(kind or [ITEM_SITES], first, sites):
            names.update([named(name, scenario_of(name))])
        tables = [rows for folder in folders for rows in _tables(folder, names)]
        if not any(map(len, tables)):
            raise BlastEnvError(f"no blasts in {', '.join(map(str, folders))}")
        table = _rounded(joined(tables))
        blasts = table.groupby(list(BLAST)).ngroups
        make_folder(out.parent)
        write_table(table, COLUMNS, {"blasts": blasts, **versions()}, out)
    print_line(f"{blasts:,} blasts; wrote {out}")


def _tables(source: Path, names: Mapping[str, "NamedSite"]) -> Iterator[pd.DataFrame]:
    """Yield the tables of a source: a table, a folder of tables, or the folder of a cache.

    Raises:
        BlastEnvError: If it is neither a folder nor a table.
    """
    if source.suffix == SUFFIX:
        yield read_frame(source, COLUMNS)
        return
    if not source.is_dir():
        raise BlastEnvError(f"{source}: is no folder of blasts")
    of_sites = sorted(source.glob(f"*{SUFFIX}"))
    for path in of_sites:
        yield read_frame(path, COLUMNS)
    if not of_sites:
        rows = [
            load_row(names, key, structure)
            for key, loads in BlastStore(source).items()
            for structure in loads.structures
        ]
        yield table_of(rows, COLUMNS)


def joined(tables: Iterable[pd.DataFrame]) -> pd.DataFrame:
    """Return the rows of tables, each once: of equal ones that with loads at points, if any."""
    filled = [table for table in tables if len(table)]
    rows = pd.concat(filled or [table_of([], COLUMNS)], ignore_index=True)
    order = np.argsort((rows["point_impulses_pa_s"] == UNKNOWN).to_numpy(), kind="stable")
    once = rows.iloc[order].drop_duplicates([*BLAST, "structure"])
    return once.sort_index().reset_index(drop=True)


def text_at_points(loads: Iterable[float | None]) -> str:
    """Return loads at points as JSON, rounded; null where there is none."""
    rounded = [
        None if load is None or not isfinite(load) else float(f"{load:.{_DIGITS}g}")
        for load in loads
    ]
    return json.dumps(rounded, separators=(",", ":")).replace(".0,", ",").replace(".0]", "]")


def _rounded(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table with loads at points as this version writes them: earlier ones are longer."""
    texts = {name: [text_at_points(json.loads(own)) for own in table[name]] for name in _AT_POINTS}
    return table.assign(**texts)


class NamedSite(NamedTuple):
    """A scenario of the table.

    Attributes:
        name: Its name.
        content_hash: Its content hash, with its budget; the key of a blast is without.
    """

    name: str
    content_hash: str


def named(name: str, site: Scenario) -> tuple[str, NamedSite]:
    """Return the hash in the keys of a site's blasts, and the site as the table names it."""
    return site.without_budget.content_hash, NamedSite(name, site.content_hash)


def load_row(
    names: Mapping[str, NamedSite],
    key: BlastKey,
    load: StructureLoad,
    point_impulses: str = UNKNOWN,
    point_peaks: str = UNKNOWN,
) -> dict[str, object]:
    """Return the row of a structure under a blast.

    Args:
        names: Scenarios by the hash in the keys of their blasts; others have no name.
        key: The blast.
        load: Its load on the structure.
        point_impulses: The impulses at the points of its walls, as JSON.
        point_peaks: The largest overpressures there.
    """
    site = names.get(key.scenario_hash, NamedSite("", key.scenario_hash))
    x_m, y_m = key.charge.position_m
    return {
        "scenario": site.name,
        "scenario_hash": site.content_hash,
        "layout": json.dumps(key.layout),
        "charge_x_m": x_m,
        "charge_y_m": y_m,
        "charge_height_m": key.charge.height_m,
        "tnt_kg": key.charge.tnt_kg,
        "seed": key.seed,
        "engine": key.engine,
        "structure": load.name,
        "protected": load.protected,
        "impulse_pa_s": load.impulse_pa_s,
        "peak_pa": load.peak_pa,
        "point_impulses_pa_s": point_impulses,
        "point_peaks_pa": point_peaks,
    }


if __name__ == "__main__":
    typer.run(main)
