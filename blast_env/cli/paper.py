"""`blast-env paper`: the paper's Tables 1 to 4 and Figure 5, from its columns."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rich.table import Table

from blast_env.cli.command import FOLDER, Command, option
from blast_env.cli.output import ResultTable, result_console, save_pictures
from blast_env.files import make_folder
from blast_env.tables import write_csv

if TYPE_CHECKING:  # takes a third of a second to import
    import pandas as pd


@dataclass(frozen=True, kw_only=True)
class PaperCommand(Command):
    """Recompute the paper's Tables 1 to 4 and Figure 5 from its own columns.

    Nothing is simulated. The command gives the deviation from the printed cells of each table, and
    the contradictions in the paper.
    """

    out: Path = option(Path("out/paper"), "Folder for the tables and the figure.", writes=FOLDER)

    def __call__(self) -> None:
        """Print the tables with their deviations; write them and the figure."""
        # Here, because pandas takes a third of a second to import.
        from blast_env.particles.paper import (
            CONTRADICTIONS,
            PAPER_LAWS,
            TABLE_4_DECIMALS,
            comparative_table,
            comparison_table,
        )

        make_folder(self.out)
        console, written = result_console(), []
        headers: tuple[str, ...] = ("R (m)", "i_ufc", "i_sim", "i_scaled", "E_abs", "E%")
        for law in PAPER_LAWS:
            table = comparison_table(law)
            title = f"Table {law.number}: {law.name} (impulses in psi s)"
            formats = (".0f", f".{law.decimals[0]}f", ".2f", *(f".{n}f" for n in law.decimals))
            console.print(rich_table(title, headers, table, formats))
            console.print(largest_deviation(table, law.decimals))
            written.append(write_csv(table, self.out / f"table_{law.number}.csv", "%.10g"))
        table = comparative_table()
        headers = ("scaling method", "MAPE (%)", "RMSE (psi s)", "integral error (%)")
        formats = ("s", *(f".{n}f" for n in TABLE_4_DECIMALS))
        console.print(rich_table("Table 4: comparison", headers, table, formats))
        console.print(largest_deviation(table, TABLE_4_DECIMALS))
        written.append(write_csv(table, self.out / "table_4.csv", "%.10g"))
        console.print(coefficient_table())
        console.print(f"{CONTRADICTIONS}\n")
        written += save_pictures(lambda: [_save_figure(self.out / "figure_5.png")])
        for path in written:
            console.print(f"wrote {path}", markup=False)


def _save_figure(path: Path) -> Path:
    # Here, because pictures need the extra `render`.
    from blast_env.plots.calibration_figures import figure_5
    from blast_env.plots.figures import save_figure

    return save_figure(figure_5(), path)


def rich_table(
    title: str, headers: tuple[str, ...], table: "pd.DataFrame", formats: tuple[str, ...]
) -> Table:
    """Return the first columns of a table, rounded, one for each format."""
    shown = ResultTable(title, headers)
    for row in table.itertuples(index=False):
        cells = zip(row, formats, strict=False)
        shown.add_row(*(format(value, wanted) for value, wanted in cells))
    return shown


def largest_deviation(table: "pd.DataFrame", decimals: tuple[int, int, int]) -> str:
    """Return the largest deviation of the computed cells from the printed ones, in words."""
    from blast_env.particles.paper import deviations

    largest = abs(deviations(table, decimals)).max()
    return (
        f"largest deviation from a printed cell: {largest:.2f} of its last digit"
        f" ({'within' if largest <= 0.5 else 'BEYOND'} the paper's rounding)\n"
    )


def coefficient_table() -> Table:
    """Return the coefficients of the paper's text and of its columns, with their errors."""
    from blast_env.particles.paper import PAPER_LAWS, TABLE_4_DECIMALS, metrics_row

    headers = ("law", "from", "coefficients", "MAPE (%)", "RMSE (psi s)", "integral error (%)")
    table = ResultTable("Coefficients, and the row of Table 4 that they give", headers, 3)
    for law in PAPER_LAWS:
        for source, coefficients in (("text", law.in_text), ("columns", law.fitted)):
            named = (f"{name} = {value:.5g}" for name, value in coefficients.coefficients.items())
            measures = zip(metrics_row(coefficients), TABLE_4_DECIMALS, strict=True)
            row = (f"{value:.{digits}f}" for value, digits in measures)
            table.add_row(law.name, source, ", ".join(named), *row)
    return table
