"""The renderer of documents for the page in a browser."""

from nicegui import ui

from blast_env.answers.document import TYPOGRAPHIC, Document, Line, Picture, Table

_CLASSES = {"answer": "text-bold", "flag": "be-refused", "quiet": "be-quiet"}


def show(document: Document) -> None:
    """Show a document in the current element."""
    for section in document.sections:
        if section.title:
            ui.label(section.title).classes("be-head")
        for part in section.parts:
            if isinstance(part, Line):
                ui.label(part.text(TYPOGRAPHIC)).classes(_CLASSES.get(part.kind, ""))
            elif isinstance(part, Table):
                ui.label(part.title).classes("be-quiet")
                fill(text_table(), part)
            elif isinstance(part, Picture):
                image = ui.element("img").classes("w-full")
                image.props(f'src="{part.address}" alt="{part.caption}"')


def text_table() -> ui.table:
    """Return an empty table."""
    table = ui.table(columns=[], rows=[], row_key="id")
    return table.props("dense flat bordered").classes("be-verdicts w-full mb-2")


def fill(element: ui.table, table: Table) -> None:
    """Put a table into an element of `text_table`, which is hidden without rows."""
    element.columns = [
        {
            "name": str(number),
            "field": str(number),
            "label": label,
            "align": "right" if table.is_number(number) else "left",
        }
        for number, label in enumerate(table.headers)
    ]
    element.rows = [
        {"id": number} | {str(column): cell for column, cell in enumerate(row)}
        for number, row in enumerate(table.cells(TYPOGRAPHIC))
    ]
    element.visible = bool(table.rows)
