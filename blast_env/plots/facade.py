"""Facades coloured by level of protection: unfolded, and in the oblique view of the site."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from blast_env.evaluation.consequences import BuildingResponse
from blast_env.geometry import Layout
from blast_env.plots.oblique import Colour, Tile, draw_oblique
from blast_env.plots.site_plan import write_names
from blast_env.plots.style import render_extra
from blast_env.response.buildings import LevelOfProtection
from blast_env.response.facade import Bay, FacadeResponse
from blast_env.site import Scenario

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.colors import to_rgb
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
_VIEW_IN: Final = (5.2, 4.4)


def facade_picture(rows: Sequence[tuple[str, BuildingResponse]], title: str) -> Figure:
    """Return the unfolded facades of a building, one row of walls per response.

    Args:
        rows: Title of each row, and the response of the building to one charge; the same building
            in all rows.
        title: Title of the picture.
    """
    height = 1.6 + 2.5 * len(rows)
    figure = Figure(figsize=(10.0, height), layout="constrained")
    axes = figure.subplots(len(rows), 1, squeeze=False)[:, 0]
    figure.suptitle(title)
    for plot, (words, response) in zip(axes, rows, strict=True):
        _draw(plot, response.facade)
        level = response.facade.level_of_protection.label
        plot.set_title(f"{words}: level of protection {level}", fontsize=10, loc="left")
    _write_levels(figure, 2)
    return figure


def damage_view(
    scenario: Scenario,
    views: Sequence[tuple[str, Layout, Sequence[BuildingResponse]]],
    title: str,
) -> Figure:
    """Return the site in the oblique view, each bay in the colour of its level of protection.

    Args:
        scenario: The scenario.
        views: Title of each view, its layout, and the responses of the buildings to one charge.
        title: Title of the picture.
    """
    width_in, height_in = _VIEW_IN
    figure = Figure(figsize=(width_in * len(views), height_in + 1.2), layout="constrained")
    figure.suptitle(title)
    panels = figure.subplots(1, len(views), squeeze=False)[0]
    shown = []
    for axes, (words, layout, responses) in zip(panels, views, strict=True):
        tiles: dict[str, list[Tile]] = {}
        for response in responses:
            for index, each in enumerate(response.facade.bays):
                bay = each.bay
                tile = _tile(scenario, bay, to_rgb(_bay_colour(response.facade, index)))
                tiles.setdefault(bay.structure, []).append(tile)
        view, features = draw_oblique(axes, scenario, layout, tiles=tiles)
        axes.set_title(words, fontsize=10)
        shown.append((axes, features, view))
    _write_levels(figure, 2 if len(views) > 1 else 1)
    for axes, features, view in shown:
        write_names(axes, features, view)
    return figure


def _write_levels(figure: Figure, columns: int) -> None:
    handles = [
        Patch(facecolor=LEVEL_COLOURS[level], edgecolor="0.4", label=words)
        for level, words in _LEVEL_WORDS.items()
    ]
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=columns,
        fontsize=8,
        title="level of protection that a pane or a wall panel allows",
        title_fontsize=8,
    )


def _bay_colour(facade: FacadeResponse, index: int) -> str:
    found = (facade.glass_levels.get(index), facade.wall_levels.get(index))
    return LEVEL_COLOURS[min(each for each in found if each is not None)]


def _tile(scenario: Scenario, bay: Bay, colour: Colour) -> Tile:
    """Return a bay as a tile on a wall of its structure."""
    structure = next(each for each in scenario.structures if each.name == bay.structure)
    left, bottom, right, top = structure.rectangle_m
    at_m = {"west": left, "east": right, "south": bottom, "north": top}[bay.wall]
    sides = [(bay.left_m, bay.floor_m), (bay.right_m, bay.floor_m)]
    sides += [(bay.right_m, bay.top_m), (bay.left_m, bay.top_m)]
    if bay.line is not None:
        corners = [(*bay.line.point_at(along), z) for along, z in sides]
        return Tile(bay.wall, np.array(corners), colour)
    across = bay.wall in ("west", "east")
    corners = [(at_m, along, z) if across else (along, at_m, z) for along, z in sides]
    return Tile(bay.wall, np.array(corners), colour)


def _draw(plot: Axes, facade: FacadeResponse) -> None:
    """Draw the walls side by side, seen from outside."""
    begin, ticks = 0.0, []
    places = dict.fromkeys(_place_of(each.bay) for each in facade.bays)
    top_m = max(each.bay.top_m for each in facade.bays)
    for structure, wall, line_number in places:
        own = [
            index
            for index, each in enumerate(facade.bays)
            if _place_of(each.bay) == (structure, wall, line_number)
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
        ticks.append((begin + 0.5 * (high - low), f"{structure}, {wall}"))
        begin += high - low + _GAP_M
    plot.set_xlim(-0.5, begin - _GAP_M + 0.5)
    plot.set_ylim(0.0, 1.05 * top_m)
    plot.set_aspect("equal")
    plot.set_xticks([place for place, _ in ticks], [words for _, words in ticks])
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
