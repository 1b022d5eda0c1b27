"""Unfolded facades coloured by level of protection."""

from collections.abc import Sequence
from typing import Final

from blast_env.bays import Bay
from blast_env.evaluation.questions.verdict import BuildingResponse
from blast_env.plots.style import render_extra
from blast_env.response.facade import FacadeResponse
from blast_env.response.levels import LevelOfProtection

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch, Rectangle

# Darker is worse, so that the order shows without colours too.
LEVEL_COLOURS: Final = {
    LevelOfProtection.HIGH: "#f4f4ec",
    LevelOfProtection.MEDIUM: "#fbd977",
    LevelOfProtection.LOW: "#f0933c",
    LevelOfProtection.VERY_LOW: "#c8321f",
    LevelOfProtection.BELOW_STANDARDS: "#4a0d2b",
}
_LEVEL_WORDS: Final = {
    LevelOfProtection.HIGH: "high: pane unbroken (GSA 1), wall superficial",
    LevelOfProtection.MEDIUM: "medium: pane broken but held (2), wall moderate",
    LevelOfProtection.LOW: "low: glass within 1 m (3a), wall heavy",
    LevelOfProtection.VERY_LOW: "very low: glass within 3 m (3b), wall hazardous",
    LevelOfProtection.BELOW_STANDARDS: "below: glass hits a wall 3 m behind (4, 5), blowout",
}
_NOTHING: Final = "#d4d8dd"
_GAP_M: Final = 2.0
_WIDTH_IN: Final = 10.0


def facade_picture(rows: Sequence[tuple[str, BuildingResponse]], title: str) -> Figure:
    """Return the unfolded facades of a building, one row of walls per response.

    Args:
        rows: Title of each row, and the response of the building to one charge; the same building
            in all rows.
        title: Title of the picture.
    """
    figure = Figure(layout="constrained")
    axes = figure.subplots(len(rows), 1, squeeze=False)[:, 0]
    figure.suptitle(title)
    for plot, (words, response) in zip(axes, rows, strict=True):
        _draw(plot, response.facade)
        level = response.facade.level_of_protection.label
        plot.set_title(f"{words}: level of protection {level}", fontsize=10, loc="left")
    (left, right), (_, top) = axes[0].get_xlim(), axes[0].get_ylim()
    row_in = min(2.5, 1.0 + _WIDTH_IN * top / (right - left))
    figure.set_size_inches(_WIDTH_IN, 1.6 + row_in * len(rows))
    handles = [
        Patch(facecolor=LEVEL_COLOURS[level], edgecolor="0.4", label=words)
        for level, words in _LEVEL_WORDS.items()
    ]
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=2,
        fontsize=8,
        title="level of protection that a pane or a wall panel allows",
        title_fontsize=8,
    )
    return figure


def _draw(plot: Axes, facade: FacadeResponse) -> None:
    """Draw the walls side by side, seen from outside."""
    begin, ticks = 0.0, list[tuple[float, str]]()
    places = dict.fromkeys(_place_of(bay.bay) for bay in facade.bays)
    top_m = max(bay.bay.top_m for bay in facade.bays)
    for structure, wall, line_number in places:
        own = [
            index
            for index, bay in enumerate(facade.bays)
            if _place_of(bay.bay) == (structure, wall, line_number)
        ]
        low = min(facade.bays[index].bay.left_m for index in own)
        high = max(facade.bays[index].bay.right_m for index in own)
        for index in own:
            bay = facade.bays[index].bay
            # Seen from outside: x runs to the right on south walls, to the left on north ones.
            mirrored = line_number is None and wall in ("north", "west")
            left_m = begin + (high - bay.right_m if mirrored else bay.left_m - low)
            level = facade.wall_levels.get(index)
            colour = _NOTHING if level is None else LEVEL_COLOURS[level]
            _add(plot, left_m, bay.floor_m, bay.width_m, bay.height_m, colour)
            _add_panes(plot, left_m, facade, index)
        lower = "\n\n" * (len(ticks) % 2)  # labels of narrow walls would lie on each other
        ticks.append((begin + 0.5 * (high - low), f"{lower}{structure}\n{wall}"))
        begin += high - low + _GAP_M
    plot.set_xlim(-0.5, begin - _GAP_M + 0.5)
    plot.set_ylim(0.0, 1.05 * top_m)
    plot.set_aspect("equal")
    plot.set_xticks([place for place, _ in ticks], [words for _, words in ticks], fontsize=8)
    plot.set_ylabel("height (m)")
    plot.spines[["top", "right"]].set_visible(False)


def _place_of(bay: Bay) -> tuple[str, str, int | None]:
    """Return the structure, the side and, of a polygon, the number of a bay's wall."""
    return bay.structure, bay.wall, bay.line_number


def _add_panes(plot: Axes, left_m: float, facade: FacadeResponse, index: int) -> None:
    filled = facade.bays[index]
    if filled.glazing is None:
        return
    colour = LEVEL_COLOURS[facade.glass_levels[index]]
    space_m = (filled.bay.width_m - filled.panes * filled.glazing.width_m) / (filled.panes + 1)
    for number in range(filled.panes):
        x_m = left_m + space_m + number * (filled.glazing.width_m + space_m)
        y_m = filled.bay.floor_m + filled.glazing.sill_m
        _add(plot, x_m, y_m, filled.glazing.width_m, filled.glazing.height_m, colour)


def _add(plot: Axes, x_m: float, y_m: float, width_m: float, height_m: float, colour: str) -> None:
    plot.add_patch(
        Rectangle((x_m, y_m), width_m, height_m, facecolor=colour, edgecolor="0.35", linewidth=0.6)
    )
