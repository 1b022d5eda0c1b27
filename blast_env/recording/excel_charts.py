"""The charts of the Excel workbook: the most loaded modules, as bars."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import pandas as pd

from blast_env.physics.structure import BARRIER_NAME
from blast_env.recording.tables import MODULE_COLUMNS, Column

if TYPE_CHECKING:
    from blast_env.simulation import BlastResult

CHARTED_MODULES: Final = 30
"""The most bars of a chart; the labels of more cannot be read."""

_LABEL_COLUMNS: Final = tuple(
    column for column in MODULE_COLUMNS if column.name in ("module_id", "structure", "hits")
)
_WIDTH: Final = 640  # pixels
_HEIGHT_WITHOUT_BARS: Final = 150
_BAR_HEIGHT: Final = 19
_FEWEST_BARS: Final = 10  # what the height is at least made for; the axis's title needs it
_COLOURS: Final = ("#7A042E", "#F08030", "#2F6690", "#5B8E7D", "#8E7DBE", "#8A8A8A")


class Ranking(NamedTuple):
    """The most loaded modules of some structures, for one chart.

    Attributes:
        title: Title of the chart.
        modules: Rows of the module table, the highest impulse first.
    """

    title: str
    modules: pd.DataFrame


class ChartData(NamedTuple):
    """What the charts of a workbook show.

    Attributes:
        rankings: One a chart.
        structures: The structures of the ranked modules.
        columns: The columns of the table; the last ones belong to the structures.
        table: One row a module, chart after chart; its impulse is in its structure's column.
    """

    rankings: tuple[Ranking, ...]
    structures: tuple[str, ...]
    columns: tuple[Column, ...]
    table: pd.DataFrame


def chart_data(result: "BlastResult") -> ChartData:
    """Return what there is to chart of a blast."""
    rankings = tuple(_rankings(result))
    # The empty head gives the columns when nothing was hit.
    ranked = pd.concat([result.modules.head(0), *(ranking.modules for ranking in rankings)])
    # In the order of the scenario, so that the colours do not depend on who is hit most.
    present = result.structures["structure"].isin(ranked["structure"])
    structures = tuple(result.structures.loc[present, "structure"])
    impulses = tuple(
        Column(f"impulse_on_{structure}_sim", "sim", "sum of m |v| over the collisions")
        for structure in structures
    )
    table = ranked[[column.name for column in _LABEL_COLUMNS]].copy()
    for structure, column in zip(structures, impulses, strict=True):
        table[column.name] = ranked["impulse_sim"].where(ranked["structure"] == structure)
    return ChartData(rankings, structures, _LABEL_COLUMNS + impulses, table)


def add_charts(workbook: Any, sheet: Any, column: int, data_sheet: str, data: ChartData) -> None:
    """Put the charts onto a sheet, side by side, or a note that there is nothing to chart.

    Args:
        workbook: The workbook.
        sheet: The sheet that the charts are put onto.
        column: The column of the sheet at which the first chart starts.
        data_sheet: Name of the sheet that has the table of `data`, under one row of headings.
        data: What to show.
    """
    if not data.rankings:
        sheet.insert_textbox(1, column, "No module was hit.", {"x_offset": 20, "height": 40})
    first = 0
    for number, ranking in enumerate(data.rankings):
        chart = workbook.add_chart({"type": "bar", "subtype": "stacked"})
        _add_series(chart, data_sheet, data, slice(first, first + len(ranking.modules)))
        _add_labels(chart, ranking)
        place = {"object_position": 3, "x_offset": 20 + number * (_WIDTH + 20), "y_offset": 5}
        sheet.insert_chart(1, column, chart, place)
        first += len(ranking.modules)


def _rankings(result: "BlastResult") -> Iterator[Ranking]:
    """Yield a ranking of the protected structures and one of the barrier, as far as hit."""
    structures = result.structures
    is_barrier = structures["structure"] == BARRIER_NAME
    protected = structures["protected"] & ~is_barrier
    groups = {"protected structures": protected, "barrier": is_barrier}
    if not protected.any():  # a study of the model, not of protection
        groups = {"structures": ~is_barrier, "barrier": is_barrier}
    for name, rows in groups.items():
        in_group = result.modules["structure"].isin(structures.loc[rows, "structure"])
        hit = result.modules[in_group & (result.modules["hits"] > 0)]
        if len(hit):
            yield _ranking(name, hit)


def _ranking(name: str, hit: pd.DataFrame) -> Ranking:
    """Return the ranking of the modules that were hit in a group of structures."""
    # Stable, so that equal loads keep the order of the module table.
    ranked = hit.sort_values("impulse_sim", ascending=False, kind="stable")
    top = ranked.head(CHARTED_MODULES)
    which = "" if len(top) == len(hit) else f"the {len(top)} most loaded of "
    total = f"{hit['impulse_sim'].sum():,.0f}"
    modules = "module" if len(hit) == 1 else "modules"
    return Ranking(f"Impulse on the {name}: {total} (sim), {which}{len(hit)} {modules} hit", top)


def _add_series(chart: Any, sheet: str, data: ChartData, rows: slice) -> None:
    """Add one series a structure, for some rows of the table."""
    part = data.table.iloc[rows]
    first, last = rows.start + 1, rows.stop  # on the sheet, below the headings
    label = data.columns.index(_LABEL_COLUMNS[0])
    for index, structure in enumerate(data.structures):
        column = len(_LABEL_COLUMNS) + index
        impulse = part[data.columns[column].name]
        if impulse.isna().all():
            continue
        chart.add_series(
            {
                "name": structure,
                "categories": [sheet, first, label, last, label],
                "values": [sheet, first, column, last, column],
                # Constant memory keeps no cells from which XlsxWriter could fill its cache.
                "categories_data": part[_LABEL_COLUMNS[0].name].tolist(),
                "values_data": impulse.astype(object).where(impulse.notna(), None).tolist(),
                "fill": {"color": _COLOURS[index % len(_COLOURS)]},
                "gap": 40,
            }
        )


def _add_labels(chart: Any, ranking: Ranking) -> None:
    """Add the title, the titles of the axes and the legend, and set the size."""
    chart.set_title({"name": ranking.title, "name_font": {"size": 12}})
    chart.set_x_axis(
        {
            "name": "impulse, m|v| (sim)",
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
