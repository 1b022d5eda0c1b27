"""The table of barrier pieces: does the barrier itself stand?"""

from math import isnan
from typing import TYPE_CHECKING, Final

from blast_env.cli.output import ResultTable, print_line, result_console
from blast_env.units import MS_PER_S, PA_PER_KPA

if TYPE_CHECKING:  # a third of a second to import
    import pandas as pd

_HEADERS: Final = (
    *("piece", "what it does", "mass (kg)", "peak push (kPa)", "push (Pa s)"),
    *("slides (m)", "tilt, 1 overturns", "overturns at (ms)"),
)
_MOST_ROWS: Final = 12


def print_pieces(pieces: "pd.DataFrame", title: str) -> None:
    """Print what becomes of a barrier's pieces, those that move most first; nothing without any.

    Args:
        pieces: As `GasResult.pieces`.
        title: Of the table, before how many do what.
    """
    if not len(pieces):
        return
    counts = ", ".join(f"{count} {word}" for word, count in outcome_counts(pieces).items())
    table = ResultTable(f"{title}: {counts}", _HEADERS, text_columns=2)
    ordered = pieces.sort_values(["tilt", "slide_m"], ascending=False, kind="stable")
    for row in ordered.head(_MOST_ROWS).to_dict("records"):
        overturn_s = row["overturn_s"]
        table.add_row(
            row["piece"],
            row["outcome"],
            f"{row['mass_kg']:,.0f}",
            f"{row['peak_pa'] / PA_PER_KPA:,.1f}",
            f"{row['impulse_pa_s']:,.0f}",
            f"{row['slide_m']:.2f}",
            f"{row['tilt']:.2f}",
            "-" if isnan(overturn_s) else f"{MS_PER_S * overturn_s:,.0f}",
        )
    result_console().print(table)
    if len(ordered) > _MOST_ROWS:
        print_line(f"and {len(ordered) - _MOST_ROWS} more pieces that move less")


def outcome_counts(pieces: "pd.DataFrame") -> dict[str, int]:
    """Return how many pieces do what, the most frequent first."""
    return {str(word): int(n) for word, n in pieces["outcome"].value_counts().items()}
