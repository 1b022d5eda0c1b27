"""The paper's Tables 1 to 4 and Figure 5, from its columns. Nothing is simulated."""

from pathlib import Path
from typing import Annotated

import pandas as pd
import typer

from blast_env.cli.output import (
    print_line,
    print_table,
    print_written,
    save_figures,
    user_errors,
)
from blast_env.files import make_folder
from blast_env.particles.paper import (
    CONTRADICTIONS,
    PAPER_LAWS,
    TABLE_4_DECIMALS,
    comparative_table,
    comparison_table,
    deviations,
    metrics_row,
)
from blast_env.plots.calibration_figures import figure_5
from blast_env.tables import write_csv


def main(
    out: Annotated[Path, typer.Option(help="Folder for the tables and the figure.")] = Path(
        "out/paper"
    ),
) -> None:
    """Recompute the paper's Tables 1 to 4 and Figure 5 from its own columns.

    The command prints the deviation from the printed cells of each table, and the contradictions in
    the paper.
    """
    with user_errors():
        make_folder(out)
        written: list[Path] = []
        headers: tuple[str, ...] = ("R (m)", "i_ufc", "i_sim", "i_scaled", "E_abs", "E%")
        for law in PAPER_LAWS:
            table = comparison_table(law)
            title = f"Table {law.number}: {law.name} (impulses in psi s)"
            formats = (".0f", f".{law.decimals[0]}f", ".2f", *(f".{n}f" for n in law.decimals))
            print_rounded(title, headers, table, formats)
            print_line(largest_deviation(table, law.decimals))
            written.append(write_csv(table, out / f"table_{law.number}.csv", "%.10g"))
        table = comparative_table()
        headers = ("scaling method", "MAPE (%)", "RMSE (psi s)", "integral error (%)")
        formats = ("s", *(f".{n}f" for n in TABLE_4_DECIMALS))
        print_rounded("Table 4: comparison", headers, table, formats)
        print_line(largest_deviation(table, TABLE_4_DECIMALS))
        written.append(write_csv(table, out / "table_4.csv", "%.10g"))
        print_coefficients()
        print_line(f"{CONTRADICTIONS}\n")
        print_written(written + save_figures((out / "figure_5.png", figure_5)))


def print_rounded(
    title: str, headers: tuple[str, ...], table: pd.DataFrame, formats: tuple[str, ...]
) -> None:
    """Print the first columns of a table, rounded, one for each format."""
    rows = [
        [format(value, wanted) for value, wanted in zip(row, formats, strict=False)]
        for row in table.itertuples(index=False)
    ]
    print_table(title, headers, rows)


def largest_deviation(table: pd.DataFrame, decimals: tuple[int, int, int]) -> str:
    """Return the largest deviation of the computed cells from the printed ones, in words."""
    largest = abs(deviations(table, decimals)).max()
    return (
        f"largest deviation from a printed cell: {largest:.2f} of its last digit"
        f" ({'within' if largest <= 0.5 else 'BEYOND'} the paper's rounding)\n"
    )


def print_coefficients() -> None:
    """Print the coefficients of the paper's text and of its columns, with their errors."""
    rows = []
    for law in PAPER_LAWS:
        for source, coefficients in (("text", law.in_text), ("columns", law.fitted)):
            named = (f"{name} = {value:.5g}" for name, value in coefficients.coefficients.items())
            measures = zip(metrics_row(coefficients), TABLE_4_DECIMALS, strict=True)
            errors = (f"{value:.{digits}f}" for value, digits in measures)
            rows.append((law.name, source, ", ".join(named), *errors))
    headers = ("law", "from", "coefficients", "MAPE (%)", "RMSE (psi s)", "integral error (%)")
    print_table("Coefficients, and the row of Table 4 that they give", headers, rows, 3)


if __name__ == "__main__":
    typer.run(main)
