"""`python -m studies.reproduce_paper`: the paper's Tables 1 to 4 and Figure 5, from its columns.

Nothing is simulated: i_sim and i_ufc are the paper's own, and the rest is worked out again. Says
of each table how far the printed cells are off, and where the paper contradicts itself.
"""

from pathlib import Path
from typing import Annotated, Final

import numpy as np
import pandas as pd
import typer
from rich.table import Table

from blast_env.cli.output import make_table, result_console, user_errors
from blast_env.files import make_folder
from blast_env.fitting.paper import (
    CONTRADICTIONS,
    PAPER_LAWS,
    TABLE_4_DECIMALS,
    comparative_table,
    comparison_table,
    deviations,
    figure_5,
    metrics_row,
)
from blast_env.rendering.figures import save_figure
from blast_env.tables import write_csv

OUT: Final = Path("out/paper")


def reproduce(out: Path) -> list[Path]:
    """Print the tables and what is to be said of them; write them and the figure.

    Args:
        out: The folder to write to; it is made if need be.

    Returns:
        The files.

    Raises:
        BlastEnvError: If something cannot be written; no file is left half-written then.
    """
    make_folder(out)
    console, written = result_console(), []
    headers: tuple[str, ...] = ("R (m)", "i_ufc", "i_sim", "i_scaled", "E_abs", "E%")
    for law in PAPER_LAWS:
        table = comparison_table(law)
        title = f"Table {law.number}: {law.name} (impulses in psi s)"
        formats = (".0f", f".{law.decimals[0]}f", ".2f", *(f".{n}f" for n in law.decimals))
        console.print(rich_table(title, headers, table, formats))
        console.print(largest_deviation(table, law.decimals))
        written.append(write_csv(table, out / f"table_{law.number}.csv", "%.10g"))
    table = comparative_table()
    headers = ("scaling method", "MAPE (%)", "RMSE (psi s)", "integral error (%)")
    formats = ("s", *(f".{n}f" for n in TABLE_4_DECIMALS))
    console.print(rich_table("Table 4: comparison", headers, table, formats))
    console.print(largest_deviation(table, TABLE_4_DECIMALS))
    written.append(write_csv(table, out / "table_4.csv", "%.10g"))
    console.print(coefficient_table())
    console.print(f"{CONTRADICTIONS}\n")
    written.append(save_figure(figure_5(), out / "figure_5.png"))
    for path in written:
        console.print(f"wrote {path}", markup=False)
    return written


def rich_table(
    title: str, headers: tuple[str, ...], table: pd.DataFrame, formats: tuple[str, ...]
) -> Table:
    """Return the first columns of a table, rounded, one for each format."""
    shown = make_table(title, headers)
    for row in table.itertuples(index=False):
        cells = zip(row, formats, strict=False)
        shown.add_row(*(format(value, wanted) for value, wanted in cells))
    return shown


def largest_deviation(table: pd.DataFrame, decimals: tuple[int, int, int]) -> str:
    """Return a sentence about how far the printed cells are from ours."""
    largest = np.abs(deviations(table, decimals)).max()
    return (
        f"largest deviation from a printed cell: {largest:.2f} of its last digit"
        f" ({'within' if largest <= 0.5 else 'BEYOND'} the paper's rounding)\n"
    )


def coefficient_table() -> Table:
    """Return the coefficients of the paper's text and of its columns, and what they give."""
    headers = ("law", "from", "coefficients", "MAPE (%)", "RMSE (psi s)", "integral error (%)")
    table = make_table("Coefficients, and the row of Table 4 that they give", headers, 3)
    for law in PAPER_LAWS:
        for source, coefficients in (("text", law.in_text), ("columns", law.fitted)):
            named = (f"{name} = {value:.5g}" for name, value in coefficients.coefficients.items())
            measures = zip(metrics_row(coefficients), TABLE_4_DECIMALS, strict=True)
            row = (f"{value:.{digits}f}" for value, digits in measures)
            table.add_row(law.name, source, ", ".join(named), *row)
    return table


def main(
    out: Annotated[Path, typer.Option(help="Folder for the tables and the figure.")] = OUT,
) -> None:
    """Reproduce the paper's Tables 1 to 4 and Figure 5 from its own columns."""
    with user_errors():
        reproduce(out)


if __name__ == "__main__":
    typer.run(main)
