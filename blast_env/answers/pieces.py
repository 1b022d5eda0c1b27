"""The answer on a barrier under one charge: its pieces, the largest movement first."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from blast_env.answers.document import AnyPart, Line, Number, Table
from blast_env.evaluation.engines.pieces import outcome_words
from blast_env.units import MS_PER_S, PA_PER_KPA

if TYPE_CHECKING:  # a third of a second to import
    import pandas as pd

_PIECES: Final = (
    *("piece", "response", "mass (kg)", "net peak (kPa)", "net impulse (Pa s)"),
    *("sliding (m)", "tilt (1: overturned)", "overturned at (ms)"),
)
_MOST_PIECES: Final = 12


def pieces_answer(pieces: "pd.DataFrame", title: str) -> Iterator[AnyPart]:
    """Yield the table of a barrier's pieces, the largest movement first, if there are any.

    Args:
        pieces: One row per piece; see `blast_env.evaluation.engines.pieces.PIECE_COLUMNS`.
        title: Title of the table, before the counts of the outcomes.
    """
    if not len(pieces):
        return
    ordered = pieces.sort_values(["tilt", "slide_m"], ascending=False, kind="stable")
    rows = [
        (
            row["piece"],
            row["outcome"],
            Number(row["mass_kg"]),
            Number(row["peak_pa"] / PA_PER_KPA),
            Number(row["impulse_pa_s"]),
            f"{row['slide_m']:.2f}",
            f"{row['tilt']:.2f}",
            Number(MS_PER_S * row["overturn_s"]),
        )
        for row in ordered.head(_MOST_PIECES).to_dict("records")
    ]
    yield Table.of(f"{title}: {outcome_words(pieces)}", _PIECES, rows, 2)
    if len(ordered) > _MOST_PIECES:
        yield Line.of(f"and {len(ordered) - _MOST_PIECES} more pieces with smaller movements")
