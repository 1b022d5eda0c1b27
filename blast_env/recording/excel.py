"""The workbook of a blast, by pandas' writer."""

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import datetime
from io import BytesIO
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, NamedTuple

import pandas as pd
from pandas.api import types
from xlsxwriter.exceptions import XlsxFileError

from blast_env.calibration import LoadUnit
from blast_env.errors import BlastEnvError
from blast_env.files import scratch_folder, write_atomically
from blast_env.physics.structure import BARRIER_NAME
from blast_env.recording.tables import (
    COLLISION_COLUMNS,
    MODULE_COLUMNS,
    RecordedBlast,
    RunRecord,
    modules_in_pa_s,
    structures_in_pa_s,
)
from blast_env.tables import Column
from blast_env.values import path_of

SUFFIX: Final = ".xlsx"

EXCEL_ROWS: Final = 1_048_576
"""The most rows on a sheet that Excel's format allows."""

LONGEST_VALUE: Final = 400
"""The most characters of the run record in one cell; the rest follows in the next row."""

MOST_PRINTED_ROWS: Final = 400
"""The most rows in the print area of a sheet, some ten pages; it can be removed."""

CHARTED_MODULES: Final = 30
"""The most bars of a chart; labels of more are not readable."""

_OPTIONS: Final[Mapping[str, bool]] = MappingProxyType(
    {"strings_to_formulas": False, "strings_to_urls": False, "strings_to_numbers": False}
)
"""Keeps a user's name that begins with = a text, not a formula."""

_CREATED: Final = datetime(2000, 1, 1)
_EXACT_INTEGER: Final = 10**15  # Excel rounds greater ones
_BUTTON: Final = 4  # width of the button of the filter, in characters
_RECORD_WIDTH: Final = 44  # characters of a column of the run record
_ROW_HEIGHT: Final = 15  # points

_NUMBER_FORMATS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "s": "0.000000",
        "m": "0.000",
        "rad": "0.0000",
        "deg": "0.0",
        "sim": "#,##0.00",
        "sim mass": "0.0000",
        "sim units/s": "#,##0.0",
        "Pa s": "#,##0.0",
        "Pa": "#,##0",
        "m2": "#,##0.00",
    }
)
_LABELS: Final[Mapping[str, str]] = MappingProxyType({"impulse_sim": "impulse, m|v|"})
_EXPLANATION_COLUMNS: Final = tuple(
    Column(name, "", "") for name in ("sheet", "column", "unit", "meaning")
)
_UNITS: Final = (
    ("sim", "simulation unit of impulse: sim mass x sim unit / s"),
    ("sim mass", "simulation unit of mass"),
    ("sim units/s", "simulation units of length per second; 4 units are 1 m"),
)

_CHART_SHEET: Final = "Most loaded"
_CHART_COLUMN: Final = 2  # of the sheet `Run`
_LABEL_COLUMNS: Final = tuple(
    column for column in MODULE_COLUMNS if column.name in ("module_id", "structure", "hits")
)
_WIDTH: Final = 640  # pixels
_HEIGHT_WITHOUT_BARS: Final = 150
_BAR_HEIGHT: Final = 19
_FEWEST_BARS: Final = 10  # least bars for the height of a chart; the title of the axis needs it
_COLOURS: Final = ("#7A042E", "#F08030", "#2F6690", "#5B8E7D", "#8E7DBE", "#8A8A8A")


class SheetTable(NamedTuple):
    """A table for one sheet, with the meanings of its columns."""

    name: str
    table: pd.DataFrame
    columns: Sequence[Column]


def write_workbook(
    blast: RecordedBlast, path: str | Path, max_rows_per_sheet: int = EXCEL_ROWS
) -> Path:
    """Write a workbook with the run record, the tables and charts of the impulse per module.

    Its sheets are `Run` (with the charts), `Structures`, `Modules`, `Collisions`, `Most loaded`
    (the data of the charts) and `Columns`, which explains every column. A table too long for one
    sheet continues in `Collisions 2` and so on. The file is written whole or not at all, and two
    workbooks of the same blast are identical to the last byte.

    Args:
        blast: The blast.
        path: The file, with the suffix `.xlsx`; an existing one is replaced.
        max_rows_per_sheet: The most rows of a table on one sheet, its header included.

    Returns:
        The path.

    Raises:
        BlastEnvError: If the suffix is wrong or the file cannot be written there.
        ValueError: If `max_rows_per_sheet` is less than 2 or more than Excel allows.
    """
    if not 2 <= max_rows_per_sheet <= EXCEL_ROWS:
        raise ValueError(
            f"max_rows_per_sheet is {max_rows_per_sheet}, must be between 2 and {EXCEL_ROWS}"
        )
    record = blast.run_record
    tables = (
        SheetTable("Structures", *structures_in_pa_s(blast.structures, blast.load_unit)),
        SheetTable("Modules", *modules_in_pa_s(blast.modules, blast.load_unit)),
        SheetTable("Collisions", blast.collisions, COLLISION_COLUMNS),
    )
    with _workbook(path, record, f"Blast {record['scenario']}, seed {record['seed']}") as writer:
        sheets = _Sheets(writer, max_rows_per_sheet)
        sheets.add_record(record)
        for each in tables:
            sheets.add(each)
        charts = chart_data(blast)
        sheets.add_whole(_CHART_SHEET, charts.table, charts.columns)
        add_charts(writer.book, writer.sheets["Run"], charts)
        sheets.add(_explanations(tables, _UNITS))
    return path_of(path)


def write_tables(
    record: RunRecord, tables: Sequence[SheetTable], path: str | Path, title: str | None = None
) -> Path:
    """Write a workbook with a run record and tables, and a sheet that explains their columns.

    As with `write_workbook`, the file is written whole or not at all, and is identical to the last
    byte for the same content.

    Args:
        record: The run record, with the version of the package.
        tables: The tables.
        path: The file.
        title: Title of the file; by default that of a blast.

    Returns:
        The path.

    Raises:
        BlastEnvError: If the suffix is wrong or the file cannot be written there.
    """
    title = title or f"Blast {record['scenario']}, engine {record['engine']}"
    with _workbook(path, record, title) as writer:
        sheets = _Sheets(writer, EXCEL_ROWS)
        sheets.add_record(record)
        for each in (*tables, _explanations(tables, ())):
            sheets.add(each)
    return path_of(path)


@contextmanager
def _workbook(path: str | Path, record: RunRecord, title: str) -> Iterator[Any]:
    """Yield a writer of an empty workbook, which becomes the file if the block succeeds."""
    path = path_of(path)
    if path.suffix.lower() != SUFFIX:
        raise BlastEnvError(f"{path}: has the suffix {path.suffix!r}, must have {SUFFIX!r}")
    digest = f", digest {record['digest']}" if "digest" in record else ""
    # XlsxWriter would leave its scratch files after a failure.
    with write_atomically(path) as temporary, scratch_folder() as scratch:
        options = {**_OPTIONS, "tmpdir": str(scratch), "use_zip64": True}
        # In memory first: on a full device, the archive would try again at garbage collection.
        content = BytesIO()
        try:
            with pd.ExcelWriter(
                content, engine="xlsxwriter", engine_kwargs={"options": options}
            ) as writer:
                writer.book.set_properties(
                    {
                        "title": title,
                        "comments": f"blast-env {record['blast-env version']}{digest}",
                        "created": _CREATED,
                    }
                )
                yield writer
            temporary.write_bytes(content.getbuffer())
        except (OSError, XlsxFileError) as error:
            raise BlastEnvError(f"{path}: cannot be written: {error}") from error


class _Sheets:
    """Adds sheets with frozen headings to a workbook.

    Args:
        writer: Writer of an empty workbook.
        max_rows: The most rows of a table on one sheet, its header included.
    """

    def __init__(self, writer: Any, max_rows: int) -> None:
        self._writer, self._max_rows = writer, max_rows
        wrapped = {"valign": "top", "align": "left", "indent": 1, "text_wrap": True}
        heading = wrapped | {"bold": True, "bg_color": "#ECE2C6", "bottom": 1}
        self._wrapped = writer.book.add_format(wrapped)
        self._text_heading = writer.book.add_format(heading)
        self._number_heading = writer.book.add_format(heading | {"align": "right", "indent": 0})

    def add(self, part: SheetTable) -> None:
        """Add a table, on several sheets if it is too long for one."""
        per_sheet = self._max_rows - 1
        for number, start in enumerate(range(0, max(len(part.table), 1), per_sheet), start=1):
            name = part.name if number == 1 else f"{part.name} {number}"
            self.add_whole(name, part.table.iloc[start : start + per_sheet], part.columns)

    def add_whole(self, name: str, table: pd.DataFrame, columns: Sequence[Column]) -> None:
        """Add a table on one sheet: headings with units and notes, formats, widths, a filter."""
        shown = pd.DataFrame({each.name: readable(table[each.name]) for each in columns})
        sheet = self._write(name, shown)
        lines = 1
        for index, column in enumerate(columns):
            values, heading = shown[column.name], header(column)
            number_format = _number_format(values, column.unit)
            width = max(_heading_width(heading), _values_width(values, number_format))
            lines = max(lines, len(textwrap.wrap(heading, width)))
            sheet.set_column(index, index, width + _BUTTON, self._format(number_format))
            is_text = number_format == "@"
            sheet.write_string(
                0, index, heading, self._text_heading if is_text else self._number_heading
            )
            if column.meaning:
                sheet.write_comment(0, index, column.meaning, {"y_scale": 0.6})
        sheet.set_row(0, _ROW_HEIGHT * (1 + lines))  # the button of the filter covers the last
        sheet.autofilter(0, 0, len(table), len(columns) - 1)
        if len(table) > MOST_PRINTED_ROWS:
            sheet.print_area(0, 0, MOST_PRINTED_ROWS, len(columns) - 1)
            sheet.set_header(f"&RPrinted: the first {MOST_PRINTED_ROWS} of {len(table):,} rows")

    def add_record(self, record: Mapping[str, str | int | float]) -> None:
        """Add the run record as pairs on the sheet `Run`."""
        pairs = [
            (f"{name}, continued" if number else name, line)
            for name, value in record.items()
            for number, line in enumerate(record_cells(value))
        ]
        sheet = self._write("Run", pd.DataFrame(pairs, columns=["quantity", "value"]))
        sheet.set_column(0, 1, _RECORD_WIDTH, self._wrapped)
        for index, heading in enumerate(("quantity", "value")):
            sheet.write_string(0, index, heading, self._text_heading)
        for row, (_, line) in enumerate(pairs, start=1):
            # Set here, not by the viewing program: it determines the place of the charts beside.
            lines = textwrap.wrap(str(line), _RECORD_WIDTH - 2)
            sheet.set_row(row, _ROW_HEIGHT * max(1, len(lines)))

    def _write(self, name: str, table: pd.DataFrame) -> Any:
        """Write the values of a table below the row of headings, and return the sheet."""
        table.to_excel(self._writer, sheet_name=name, index=False, header=False, startrow=1)
        sheet = self._writer.sheets[name]
        sheet.freeze_panes(1, 0)
        sheet.set_landscape()
        sheet.set_paper(9)  # A4
        sheet.fit_to_pages(1, 0)
        sheet.repeat_rows(0)
        sheet.set_footer("&L&F&C&A&R&P / &N")
        return sheet

    def _format(self, number_format: str) -> Any:
        # The indent separates a text from the number on its left.
        indent = {"align": "left", "indent": 1} if number_format == "@" else {}
        style = {"num_format": number_format, "valign": "top"} | indent
        return self._writer.book.add_format(style)


def header(column: Column) -> str:
    """Return the heading of a column, with its unit: `first hit (s)`."""
    label = _LABELS.get(column.name)
    if label is None:
        suffix = "_" + column.unit.replace(" ", "_").lower()
        label = column.name.removesuffix(suffix).replace("_", " ")
    return f"{label} ({column.unit})" if column.unit else label


def readable(values: "pd.Series[Any]") -> "pd.Series[Any]":
    """Return the values with words for booleans, which programs show in different ways."""
    if types.is_bool_dtype(values):
        return values.map({True: "yes", False: "no"}).astype("str")
    return values


def record_cells(value: str | int | float) -> list[str | int | float]:
    """Return the contents of the cells, one below the other, for a value of the run record.

    Nothing is cut or rounded: long texts take several cells, large integers become texts.
    """
    if isinstance(value, bool):
        return ["yes" if value else "no"]
    if isinstance(value, int) and abs(value) > _EXACT_INTEGER:
        return [str(value)]
    if isinstance(value, str):
        return list(textwrap.wrap(value, LONGEST_VALUE)) or [""]
    return [value]


def _number_format(values: "pd.Series[Any]", unit: str) -> str:
    """Return the number format for values of a unit, in Excel's notation; "@" for texts."""
    if types.is_float_dtype(values):
        return _NUMBER_FORMATS.get(unit, "0.000")
    return "0" if types.is_integer_dtype(values) else "@"


def _values_width(values: "pd.Series[Any]", number_format: str) -> int:
    """Return the number of characters of the longest value."""
    present = values.dropna()
    if present.empty:
        return 0
    if number_format == "@":
        return int(present.str.len().max())
    decimals = len(number_format.partition(".")[2])
    return len(f"{present.abs().max():,.0f}") + len("-.") + decimals


def _heading_width(text: str) -> int:
    """Return the fewest characters for a heading of at most two lines with its unit unbroken."""
    unit = text[text.find("(") :] if "(" in text else ""
    width = max(len(word) for word in text.split())
    while True:
        lines = textwrap.wrap(text, width)
        if len(lines) <= 2 and any(unit in line for line in lines):
            return width
        width += 1


def _explanations(tables: Sequence[SheetTable], units: Sequence[tuple[str, str]]) -> SheetTable:
    """Return a table of the meanings of every column and every unit."""
    rows = [
        (each.name, header(column), column.unit, column.meaning)
        for each in tables
        for column in each.columns
    ]
    rows += [("", "", unit, meaning) for unit, meaning in units]
    names = [column.name for column in _EXPLANATION_COLUMNS]
    return SheetTable("Columns", pd.DataFrame(rows, columns=names), _EXPLANATION_COLUMNS)


class Ranking(NamedTuple):
    """The most loaded modules of some structures, for one chart.

    Attributes:
        title: Title of the chart.
        modules: Rows of the module table, the highest impulse first.
    """

    title: str
    modules: pd.DataFrame


class ChartData(NamedTuple):
    """The data of the charts of a workbook.

    Attributes:
        label: The quantity of the bars, with its unit.
        rankings: One per chart.
        structures: The structures of the ranked modules, as the legend names them.
        columns: The columns of the table; the last ones belong to the structures.
        table: One row per module, chart after chart; its impulse is in its structure's column.
    """

    label: str
    rankings: tuple[Ranking, ...]
    structures: tuple[str, ...]
    columns: tuple[Column, ...]
    table: pd.DataFrame


def chart_data(blast: RecordedBlast) -> ChartData:
    """Return the data of the charts of a blast."""
    rankings = tuple(_rankings(blast))
    # The empty head provides the columns if nothing was hit.
    ranked = pd.concat([blast.modules.head(0), *(ranking.modules for ranking in rankings)])
    # In the order of the scenario, so that the colours do not depend on the loads.
    present = blast.structures["structure"].isin(ranked["structure"])
    structures = tuple(blast.structures.loc[present, "structure"])
    unit = blast.load_unit
    impulses = tuple(
        Column(f"impulse_on_{structure}_pa_s", "Pa s", unit.label)
        if unit.is_calibrated
        else Column(f"impulse_on_{structure}_sim", "sim", "sum of m |v| over the collisions")
        for structure in structures
    )
    table = ranked[[column.name for column in _LABEL_COLUMNS]].copy()
    impulse = unit.factor * ranked["impulse_sim"]
    for structure, column in zip(structures, impulses, strict=True):
        table[column.name] = impulse.where(ranked["structure"] == structure)
    label = unit.label if unit.is_calibrated else "impulse, m|v| (sim)"
    return ChartData(label, rankings, _names(structures, unit), _LABEL_COLUMNS + impulses, table)


def _names(structures: Sequence[str], unit: LoadUnit) -> tuple[str, ...]:
    """Return the names of structures in the legend, with their loads if known."""
    loads = (unit.of_structures.get(structure) for structure in structures)
    return tuple(
        structure if load is None else f"{structure}: {load.scaled.pa_s:,.1f} Pa s"
        for structure, load in zip(structures, loads, strict=True)
    )


def add_charts(workbook: Any, sheet: Any, data: ChartData) -> None:
    """Put the charts onto the sheet of the run record, or a note that there is nothing to chart.

    Args:
        workbook: The workbook, which has the table of `data` on another sheet.
        sheet: The sheet for the charts, side by side.
        data: The data of the charts.
    """
    if not data.rankings:
        options = {"x_offset": 20, "height": 40}
        sheet.insert_textbox(1, _CHART_COLUMN, "No module was hit.", options)
    first = 0
    for number, ranking in enumerate(data.rankings):
        chart = workbook.add_chart({"type": "bar", "subtype": "stacked"})
        _add_series(chart, data, slice(first, first + len(ranking.modules)))
        _add_labels(chart, ranking, data.label)
        place = {"object_position": 3, "x_offset": 20 + number * (_WIDTH + 20), "y_offset": 5}
        sheet.insert_chart(1, _CHART_COLUMN, chart, place)
        first += len(ranking.modules)


def _rankings(blast: RecordedBlast) -> Iterator[Ranking]:
    """Yield a ranking of the protected structures and one of the barrier, if they were hit."""
    structures = blast.structures
    is_barrier = structures["structure"] == BARRIER_NAME
    protected = structures["protected"] & ~is_barrier
    groups = {"protected structures": protected, "barrier": is_barrier}
    if not protected.any():  # a study of the model, not of protection
        groups = {"structures": ~is_barrier, "barrier": is_barrier}
    for name, rows in groups.items():
        in_group = blast.modules["structure"].isin(structures.loc[rows, "structure"])
        hit = blast.modules[in_group & (blast.modules["hits"] > 0)]
        if len(hit):
            yield _ranking(name, hit, blast.load_unit)


def _ranking(name: str, hit: pd.DataFrame, unit: LoadUnit) -> Ranking:
    # Stable, so that equal loads keep the order of the module table.
    ranked = hit.sort_values("impulse_sim", ascending=False, kind="stable")
    top = ranked.head(CHARTED_MODULES)
    which = "" if len(top) == len(hit) else f"the {len(top)} most loaded of "
    # Loads in Pa s have no sum over structures; the legend gives the load on each.
    total = "" if unit.is_calibrated else f": {hit['impulse_sim'].sum():,.0f} (sim)"
    modules = "module" if len(hit) == 1 else "modules"
    return Ranking(f"Impulse on the {name}{total}, {which}{len(hit)} {modules} hit", top)


def _add_series(chart: Any, data: ChartData, rows: slice) -> None:
    """Add one series per structure, for some rows of the table."""
    part = data.table.iloc[rows]
    first, last = rows.start + 1, rows.stop  # on the sheet, below the headings
    label = data.columns.index(_LABEL_COLUMNS[0])
    for index, structure in enumerate(data.structures):
        column = len(_LABEL_COLUMNS) + index
        if part[data.columns[column].name].isna().all():
            continue
        chart.add_series(
            {
                "name": structure,
                "categories": [_CHART_SHEET, first, label, last, label],
                "values": [_CHART_SHEET, first, column, last, column],
                "fill": {"color": _COLOURS[index % len(_COLOURS)]},
                "gap": 40,
            }
        )


def _add_labels(chart: Any, ranking: Ranking, label: str) -> None:
    chart.set_title({"name": ranking.title, "name_font": {"size": 12}})
    chart.set_x_axis(
        {
            "name": label,
            "num_format": "#,##0",
            "major_gridlines": {"visible": True, "line": {"color": "#D9D9D9"}},
        }
    )
    chart.set_y_axis(
        {
            "name": "module, by its centre (m)",
            "reverse": True,  # the first row on top, and the impulse's axis still at the bottom
            "crossing": "max",
            "num_font": {"size": 8},
            "interval_unit": 1,
        }
    )
    chart.set_legend({"position": "bottom"})
    chart.set_size(
        {
            "width": _WIDTH,
            "height": _HEIGHT_WITHOUT_BARS + _BAR_HEIGHT * max(len(ranking.modules), _FEWEST_BARS),
        }
    )
