"""The paper's Tables 1 to 4 and Figure 5, from its columns. Nothing is simulated."""

from pathlib import Path
from typing import Annotated, Any, Final

import pandas as pd
import typer
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from blast_env.answers.terminal import print_line, print_table
from blast_env.calibration import (
    PAPER_UFC_LABEL,
    LinearLaw,
    ProportionalLaw,
    ScalingLaw,
    paper_table,
)
from blast_env.cli.output import print_written, save_figures, user_errors
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
from blast_env.plots.plan import INK
from blast_env.plots.style import unit_interval
from blast_env.tables import write_csv
from blast_env.units import PA_PER_PSI

# Okabe and Ito's colours, distinguishable with any colour vision.
_LOOKS: Final = (("#0072B2", "--", "s"), ("#009E73", "-.", "^"), ("#D55E00", "-", "D"))


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


def figure_5() -> Figure:
    """Return the paper's Figure 5 for all three laws, with the deviations below it."""
    figure = Figure(figsize=(7.0, 7.2), layout="constrained")
    impulse, deviation = figure.subplots(2, 1, sharex=True, height_ratios=(2.1, 1.0))
    paper = paper_table()
    look: dict[str, Any] = {"color": unit_interval(INK), "linewidth": 1.4}
    deviation.axhline(0.0, **look)
    look |= {"marker": "o", "markersize": 6.5}
    impulse.plot(paper["r_m"], paper["i_ufc_psi_s"], label=PAPER_UFC_LABEL, **look)
    for paper_law, (colour, style, marker) in zip(PAPER_LAWS, _LOOKS, strict=True):
        law = paper_law.fitted
        scaled = law(paper["i_sim"])
        look = {"color": colour, "linestyle": style, "linewidth": 1.6, "marker": marker}
        look |= {"markersize": 6.0, "markeredgecolor": "white", "markeredgewidth": 0.7}
        impulse.plot(paper["r_m"], scaled, label=_formula(law), **look)
        deviation.plot(paper["r_m"], 100.0 * (scaled / paper["i_ufc_psi_s"] - 1.0), **look)
    _label_paper(impulse, deviation)
    return figure


def _label_paper(impulse: Axes, deviation: Axes) -> None:
    """Write the title, axes and legend of Figure 5."""
    impulse.set_title("The paper's simulation, scaled by its three laws", fontweight="bold")
    impulse.set(ylabel="impulse (psi s)", ylim=(0.0, 1.2))
    impulse.legend(framealpha=1.0, edgecolor="none", labelspacing=0.7, handlelength=3.2)
    in_pa = impulse.twinx()
    in_pa.set(ylabel="impulse (Pa s)", ylim=(0.0, 1.2 * PA_PER_PSI))
    in_pa.spines["top"].set_visible(False)
    ticks = paper_table()["r_m"].tolist()
    deviation.set(
        xlabel="distance $R$ (m)", ylabel="deviation from the\nUFC column (%)", xticks=ticks
    )
    for axes in (impulse, deviation):
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)


def _formula(law: ScalingLaw) -> str:
    """Return a law as a legend entry."""
    numbers = [_number(value) for value in law.coefficients.values()]
    simulated = r"i_\mathrm{sim}"
    match law:
        case ProportionalLaw():
            return rf"proportional, ${numbers[0]}\,{simulated}$"
        case LinearLaw():
            return rf"linear, ${numbers[0]} + {numbers[1]}\,{simulated}$"
        case _:
            return rf"power law, ${numbers[0]}\,{simulated}^{{\,{numbers[1]}}}$"


def _number(value: float) -> str:
    digits, _, exponent = f"{value:.3e}".partition("e")
    return f"{value:.4g}" if abs(value) > 1e-2 else rf"{digits} \times 10^{{{int(exponent)}}}"


if __name__ == "__main__":
    typer.run(main)
