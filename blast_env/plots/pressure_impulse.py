"""Pressure-impulse diagrams: the margin of each bay to the next level, for several layouts."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.plots.facade import LEVEL_COLOURS
from blast_env.plots.style import number_on_axis, render_extra
from blast_env.response.components import FacadeBay, Glazing, Wall
from blast_env.response.damage import damage_numbers, under_triangle
from blast_env.response.facade import FacadeResponse
from blast_env.response.glass import pane_of
from blast_env.response.levels import LevelOfProtection, level_of
from blast_env.response.sdof import impulses
from blast_env.response.walls import panel_of
from blast_env.units import PA_PER_KPA

with render_extra():
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch
    from matplotlib.ticker import FuncFormatter

_PEAKS: Final = 24
_HALVINGS: Final = 8
_MOST_PANELS: Final = 4
_REACH: Final = 3.0
_DECADES: Final = 100.0  # largest ratio of loads; smaller ones are outside the picture
_PANEL_IN: Final = (4.9, 4.2)
_INK: Final = ("#0072B2", "#000000")

Component = tuple[Glazing | Wall, float]
"""A component, and the height of its storey, m; 0 for glazing."""

Members = tuple[list[int], ...]
"""For each row, the indices of the bays of a component."""


def pressure_impulse_diagram(rows: Sequence[tuple[str, FacadeResponse]], title: str) -> Figure:
    """Return one diagram per component, with one point per bay and row: its peak and its impulse.

    Regions are those of a triangular load without a rise time. The point of a bay is in the
    diagram of its component in that row. The four components with most points are shown.

    Args:
        rows: Name and facade response of each row, with the same bays: without a layout, and with
            one. Hardening replaces the components of bays.
        title: Title of the picture.
    """
    groups = _groups([facade.bays for _, facade in rows])[:_MOST_PANELS]
    columns = min(len(groups), 2)
    lines = -(-len(groups) // columns)
    width_in, height_in = _PANEL_IN
    size_in = (width_in * columns + (2.0 if columns == 1 else 0.0), height_in * lines + 1.5)
    figure = Figure(figsize=size_in, layout="constrained")
    figure.suptitle(title)
    for number, (component, members) in enumerate(groups, start=1):
        _draw(figure.add_subplot(lines, columns, number), component, members, rows)
    handles: list[Artist] = [
        Patch(facecolor=LEVEL_COLOURS[level], edgecolor="0.4", label=level.label)
        for level in reversed(LevelOfProtection)
    ]
    handles += [
        Line2D([], [], color=colour, marker=marker, linestyle="", markerfacecolor=fill, label=words)
        for (words, _), colour, marker, fill in zip(rows, _INK, "os", ("none", "w"), strict=False)
    ]
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=4,
        fontsize=8,
        title="level of protection under a triangular load; a point is a bay",
        title_fontsize=8,
    )
    return figure


def _groups(rows: Sequence[Sequence[FacadeBay]]) -> list[tuple[Component, Members]]:
    """Return the components, each with its bays in each row, those with most bays first."""
    found: list[tuple[Component, Members]] = []
    for row, bays in enumerate(rows):
        for index, bay in enumerate(bays):
            for component in (bay.glazing, bay.wall):
                if component is None:
                    continue
                storey_m = round(bay.bay.height_m, 3) if isinstance(component, Wall) else 0.0
                key = (component, storey_m)
                members = next((own for known, own in found if known == key), None)
                if members is None:
                    members = tuple([] for _ in rows)
                    found.append((key, members))
                members[row].append(index)
    return sorted(found, key=lambda item: -sum(map(len, item[1])))


def _draw(
    axes: Axes,
    component: Component,
    members: Members,
    rows: Sequence[tuple[str, FacadeResponse]],
) -> None:
    loads = [_loads(facade, own) for (_, facade), own in zip(rows, members, strict=True)]
    every = np.concatenate(loads)
    most = every.max(axis=0)
    # The picture holds all points, and a factor beyond them, but at most so many decades.
    low, high = np.maximum(every.min(axis=0), most / _DECADES) / _REACH, most * _REACH
    peak_kpa = np.geomspace(low[0], high[0], _PEAKS)
    bounds = level_bounds(component, PA_PER_KPA * peak_kpa, (low[1], high[1]))
    begin = np.full(_PEAKS, low[1])
    for level in reversed(LevelOfProtection):
        end = bounds.get(level, np.full(_PEAKS, high[1]))
        axes.fill_betweenx(peak_kpa, begin, end, color=LEVEL_COLOURS[level], alpha=0.75, lw=0.0)
        begin = end
    styles = zip(loads, _INK, "os", ("none", "w"), strict=False)
    for points, colour, marker, fill in styles:
        axes.plot(
            points[:, 1], points[:, 0], marker, color=colour, markerfacecolor=fill, markersize=5.0
        )
    if len(loads) == 2:
        places = [
            dict(zip(own, points, strict=True)) for own, points in zip(members, loads, strict=True)
        ]
        # The same bay with and without the layout, joined.
        for index in places[0].keys() & places[1].keys():
            ends = np.array([place[index] for place in places])
            axes.plot(ends[:, 1], ends[:, 0], "-", color="0.25", linewidth=0.5)
    axes.set(xscale="log", yscale="log", xlim=(low[1], high[1]), ylim=(low[0], high[0]))
    axes.set(xlabel="peak specific impulse (Pa s)", ylabel="peak of the bay-average pressure (kPa)")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(number_on_axis))
        axis.set_minor_formatter("")
    axes.set_title(component[0].title, fontsize=9)


def _loads(facade: FacadeResponse, members: Sequence[int]) -> FloatArray:
    """Return peak (kPa) and impulse (Pa s) of bays (bays, 2)."""
    pressure = facade.pressure_pa[list(members)]
    impulse = impulses(facade.time_s, pressure).max(axis=1)
    peak = pressure.max(axis=1) / PA_PER_KPA
    points: FloatArray = np.maximum(np.column_stack([peak, impulse]), 1e-3)
    return points


def level_bounds(
    component: Component, peak_pa: FloatArray, impulses_pa_s: tuple[float, float]
) -> dict[LevelOfProtection, FloatArray]:
    """Return the largest impulse of a triangular load for which a component keeps each level.

    Args:
        peak_pa: Peaks of the loads (peaks,).
        impulses_pa_s: Range of impulses; a bound outside it is replaced by the nearer end.

    Returns:
        Bounds in Pa s (peaks,) by level, the best first; below standards there is none.
    """
    found: dict[LevelOfProtection, FloatArray] = {}
    chosen, storey_m = component
    part = panel_of(chosen, storey_m) if isinstance(chosen, Wall) else pane_of(chosen)
    for level in sorted(LevelOfProtection, reverse=True)[:-1]:
        low, high = (np.full(len(peak_pa), impulse_pa_s) for impulse_pa_s in impulses_pa_s)
        # Bisection of the logarithm of the impulse, at all peaks at once: damage grows with it.
        for _ in range(_HALVINGS):
            middle = np.sqrt(low * high)
            damage = damage_numbers(under_triangle(part, peak_pa, middle))
            allows = np.array([level_of(own) >= level for own in damage.tolist()])
            low, high = np.where(allows, middle, low), np.where(allows, high, middle)
        found[level] = np.sqrt(low * high)
    return found
