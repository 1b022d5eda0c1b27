"""Tables of texts and pictures on the page."""

from base64 import b64encode
from collections.abc import Iterable, Sequence

from nicegui import ui


def columns_of(
    headers: Sequence[str], texts: int | None = None, after: int = 0
) -> list[dict[str, str]]:
    """Return the columns of a table of texts.

    Args:
        headers: The headers.
        texts: Number of leading text columns; the others are aligned to the right. `None` for all.
        after: Number of text columns at the end.
    """
    numbers = range(len(headers) if texts is None else texts, len(headers) - after)
    return [
        {
            "name": str(number),
            "field": str(number),
            "label": label,
            "align": "right" if number in numbers else "left",
        }
        for number, label in enumerate(headers)
    ]


def text_table(headers: Sequence[str] = (), texts: int | None = None) -> ui.table:
    """Return an empty table of texts; see `columns_of`."""
    table = ui.table(columns=columns_of(headers, texts), rows=[], row_key="id")
    return table.props("dense flat bordered").classes("be-verdicts w-full mb-2")


def cells(rows: Iterable[Sequence[str]]) -> list[dict[str, str | int]]:
    """Return rows for a table of texts."""
    return [
        {"id": number} | {str(column): cell for column, cell in enumerate(row)}
        for number, row in enumerate(rows)
    ]


def address_of(png: bytes) -> str:
    """Return a picture as an address that holds it."""
    return f"data:image/png;base64,{b64encode(png).decode()}"
