"""Tables of texts on the page."""

from collections.abc import Iterable, Sequence

from nicegui import ui


def text_table(headers: Sequence[str], texts: int | None = None) -> ui.table:
    """Return an empty table of texts.

    Args:
        headers: The headers.
        texts: Number of leading text columns; the others are aligned to the right. `None` for all.
    """
    columns = [
        {
            "name": str(number),
            "field": str(number),
            "label": label,
            "align": "left" if texts is None or number < texts else "right",
        }
        for number, label in enumerate(headers)
    ]
    table = ui.table(columns=columns, rows=[], row_key="id")
    return table.props("dense flat bordered").classes("be-verdicts w-full mb-2")


def cells(rows: Iterable[Sequence[str]]) -> list[dict[str, str | int]]:
    """Return rows for a table of texts."""
    return [
        {"id": number} | {str(column): cell for column, cell in enumerate(row)}
        for number, row in enumerate(rows)
    ]
