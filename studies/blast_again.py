"""Repeat the blasts of tables with the present engine: `python -m studies.blast_again`.

The loads in a table of `studies.blast_table` depend on the version of the engine. This command
reads sites, layouts and charges from tables and runs the blasts again, one process per site. Each
site gets a table in a folder: an interrupted command continues from there, and with more layouts
per site it runs only the new ones. The new tables have the loads at the points of walls, too, which
those of caches lack.
"""

from collections.abc import Sequence
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer

from blast_env.answers.terminal import print_line
from blast_env.cli.output import progress_bar, user_errors
from blast_env.evaluation import LoadCase
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.files import make_folder
from blast_env.geometry import Layout
from blast_env.parquet import read_frame, write_table
from blast_env.provenance import versions
from blast_env.runner import run_all
from blast_env.site.blast_site import Charge
from blast_env.surrogate.samples import elements
from studies.blast_table import COLUMNS, joined
from studies.site_blasts import SiteBlasts, kept_rows


def asked_in(
    table: pd.DataFrame, layouts: int | None, sites: int | None = None
) -> list[SiteBlasts]:
    """Return the blasts of a table by site, each once.

    Args:
        table: The table.
        sites: Maximum number of sites, the first ones of the table; `None` for all.
        layouts: Maximum number of blasts per site, first without a barrier, then drawn at random;
            `None` for all.
    """
    found = []
    for number, (name, rows) in enumerate(islice(table.groupby("scenario", sort=False), sites)):
        blasts = list(dict.fromkeys(map(_blast, rows.to_dict("records"))))
        order = np.random.default_rng(number).permutation(len(blasts))
        drawn = sorted((blasts[index] for index in order), key=lambda blast: len(blast[0]) > 0)
        found.append(SiteBlasts(str(name), tuple(drawn[:layouts])))
    return found


def _blast(row: dict[object, object]) -> tuple[Layout, LoadCase]:
    place_m = float(str(row["charge_x_m"])), float(str(row["charge_y_m"]))
    height_m, tnt_kg = float(str(row["charge_height_m"])), float(str(row["tnt_kg"]))
    charge = Charge(place_m, tnt_kg, height_m=height_m)
    return elements(str(row["layout"])), LoadCase(charge, 0)


def main(
    tables: Annotated[list[Path], typer.Argument(help="Tables of blasts, .parquet.")],
    out: Annotated[Path, typer.Option(help="Folder for the new tables.")] = Path("out/again"),
    layouts: Annotated[
        int | None, typer.Option(min=1, help="Most blasts of a site; all unless given.")
    ] = None,
    sites: Annotated[
        int | None, typer.Option(min=1, help="Most sites of a table; all unless given.")
    ] = None,
    cells: Annotated[str | None, typer.Option(help="uniform, coarse or fine.")] = None,
    processes: Annotated[int, typer.Option(min=1)] = 2,
) -> None:
    """Run the blasts of tables again; write one table for each, with the same file name."""
    with user_errors():
        make_folder(out)
        engine = GasEngine() if cells is None else GasEngine(cells=cells)
        run = partial(kept_rows, engine=engine, folder=out / "blasts")
        make_folder(out / "blasts")
        for path in tables:
            asked = asked_in(read_frame(path, COLUMNS), layouts, sites)
            with progress_bar(path.stem) as progress:
                rows: Sequence[pd.DataFrame] = run_all(run, asked, processes, progress)
            blasts = sum(len(site.blasts) for site in asked)
            write_table(joined(rows), COLUMNS, {"blasts": blasts, **versions()}, out / path.name)
            print_line(f"{blasts:,} blasts on {len(asked):,} sites; wrote {out / path.name}")


if __name__ == "__main__":
    typer.run(main)
