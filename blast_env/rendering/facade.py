"""Facades unfolded, each bay in the colour of what becomes of it."""

from collections.abc import Sequence
from typing import Final

from blast_env.evaluation.consequences import BuildingResponse
from blast_env.rendering.style import render_extra
from blast_env.response.facade import FacadeResponse
from blast_env.response.glass import GlazingCondition
from blast_env.response.walls import DamageLevel

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch, Rectangle

_DAMAGE_COLOURS: Final = ("#e8e8e8", "#f6d87a", "#ee9c4e", "#d65a3a", "#8c1d18")
_GLASS_COLOURS: Final = ("#9fd3f2", "#7fb7a4", "#c9d46a", "#f0c04a", "#e0803a", "#b3261e")
_DAMAGE_WORDS: Final = ("superficial", "moderate", "heavy", "hazardous", "blowout")
_GLASS_WORDS: Final = (
    "1: no break",
    "2: breaks, retained",
    "3a: within 1 m",
    "3b: within 3 m",
    "4: low on a wall 3 m behind",
    "5: high on it",
)
_GAP_M: Final = 2.0


def facade_picture(rows: Sequence[tuple[str, BuildingResponse]], title: str) -> Figure:
    """Return the facades of a building, unfolded, a row of walls each.

    Args:
        rows: What a row shows, in words, and the building under one charge; the same building in
            all rows.
        title: Above the picture.
    """
    height = 1.4 + 2.3 * len(rows)
    figure = Figure(figsize=(10.0, height), layout="constrained")
    axes = figure.subplots(len(rows), 1, squeeze=False)[:, 0]
    figure.suptitle(title)
    for plot, (words, response) in zip(axes, rows, strict=True):
        _draw(plot, response.facade)
        level = response.facade.level_of_protection.label
        plot.set_title(f"{words}: level of protection {level}", fontsize=10, loc="left")
    handles = [
        Patch(facecolor=colour, edgecolor="0.4", label=f"wall: {words}")
        for colour, words in zip(_DAMAGE_COLOURS, _DAMAGE_WORDS, strict=True)
    ]
    handles += [
        Patch(facecolor=colour, edgecolor="0.4", label=f"pane {words}")
        for colour, words in zip(_GLASS_COLOURS, _GLASS_WORDS, strict=True)
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=8)
    return figure


def _draw(plot: Axes, facade: FacadeResponse) -> None:
    """Draw the walls side by side, seen from outside."""
    damage = dict(zip(facade.walled.tolist(), facade.walls.levels, strict=True))
    conditions = dict(zip(facade.glazed.tolist(), facade.glazing.condition.tolist(), strict=True))
    begin, ticks = 0.0, []
    places = dict.fromkeys((each.bay.structure, each.bay.wall) for each in facade.bays)
    top_m = max(each.bay.top_m for each in facade.bays)
    for structure, wall in places:
        own = [
            index
            for index, each in enumerate(facade.bays)
            if (each.bay.structure, each.bay.wall) == (structure, wall)
        ]
        low = min(facade.bays[index].bay.left_m for index in own)
        high = max(facade.bays[index].bay.right_m for index in own)
        for index in own:
            bay = facade.bays[index].bay
            # Seen from outside: x runs to the right on south walls, to the left on north ones.
            mirrored = wall in ("north", "west")
            offset = high - bay.right_m if mirrored else bay.left_m - low
            level = damage.get(index, DamageLevel.SUPERFICIAL)
            _add(
                plot, begin + offset, bay.floor_m, bay.width_m, bay.height_m, _DAMAGE_COLOURS[level]
            )
            _add_panes(plot, begin + offset, facade, index, conditions.get(index))
        ticks.append((begin + 0.5 * (high - low), f"{structure}, {wall}"))
        begin += high - low + _GAP_M
    plot.set_xlim(-0.5, begin - _GAP_M + 0.5)
    plot.set_ylim(0.0, 1.05 * top_m)
    plot.set_aspect("equal")
    plot.set_xticks([place for place, _ in ticks], [words for _, words in ticks])
    plot.set_ylabel("height (m)")
    plot.spines[["top", "right"]].set_visible(False)


def _add_panes(
    plot: Axes, left_m: float, facade: FacadeResponse, index: int, condition: float | None
) -> None:
    filled = facade.bays[index]
    if filled.glazing is None or condition is None:
        return
    colour = _GLASS_COLOURS[GlazingCondition(int(condition)) - 1]
    space_m = (filled.bay.width_m - filled.panes * filled.glazing.width_m) / (filled.panes + 1)
    for number in range(filled.panes):
        x_m = left_m + space_m + number * (filled.glazing.width_m + space_m)
        y_m = filled.bay.floor_m + filled.glazing.sill_m
        _add(plot, x_m, y_m, filled.glazing.width_m, filled.glazing.height_m, colour)


def _add(plot: Axes, x_m: float, y_m: float, width_m: float, height_m: float, colour: str) -> None:
    plot.add_patch(
        Rectangle((x_m, y_m), width_m, height_m, facecolor=colour, edgecolor="0.35", linewidth=0.6)
    )
