"""What the plan of a site shows of vehicles: entries, the ground they reach, the stand-off."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from blast_env.geometry import Element
from blast_env.rendering.style import EXPLOSIVE, INK, render_extra, unit_interval
from blast_env.scenario import Scenario, VehicleSource
from blast_env.scenario.build_scene import vehicle_reach, worst_places
from blast_env.scenario.sections import PointM
from blast_env.scenario.vehicles import nearest_point_m, squares_of
from blast_env.units import MODULE_SIDE_M

with render_extra():
    from matplotlib import patheffects
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

REACHED_ALPHA: Final = 0.16
_ENTRY_WIDTH: Final = 4.0
_LINE_WIDTH: Final = 1.4


def draw_vehicles(axes: Axes, scenario: Scenario, layout: Sequence[Element] = ()) -> None:
    """Draw the ground that vehicles reach, their entries, and the stand-off that is left of each.

    The stand-off is the line from the vehicle's worst place to the nearest wall that counts, with
    its length in metres.

    Args:
        axes: The site plan, in metres.
        scenario: The scenario; without a vehicle, nothing is drawn.
        layout: What stands on the build zone.
    """
    for source in scenario.vehicles:
        _draw_ground(axes, scenario, source, layout)
        for ends_m in source.lines_m:
            axes.add_line(_entry(ends_m))
        place_m = worst_places(scenario, source, layout).places_m[0]
        _draw_stand_off(axes, scenario, place_m)


def stand_off_text(scenario: Scenario, layout: Sequence[Element]) -> str:
    """Return how near vehicles come with a layout and without, in words; empty without any."""
    if not scenario.vehicles:
        return ""
    with_layout, bare = (
        min(worst_places(scenario, source, each).stand_off_m for source in scenario.vehicles)
        for each in (layout, ())
    )
    if not layout:
        return f"stand-off {bare:.1f} m"
    return f"stand-off {with_layout:.1f} m, {bare:.1f} m without the barrier"


def vehicle_legend(scenario: Scenario) -> list[Artist]:
    """Return the legend entries for what `draw_vehicles` draws."""
    if not scenario.vehicles:
        return []
    colour = unit_interval(EXPLOSIVE)
    return [
        Patch(facecolor=(*colour, REACHED_ALPHA), label="ground that a vehicle reaches"),
        _entry(),
        _stand_off(),
    ]


def _entry(ends_m: Sequence[PointM] = ()) -> Line2D:
    """Return the line of an entry; without ends, one for the legend."""
    return Line2D(
        [x_m for x_m, _ in ends_m],
        [y_m for _, y_m in ends_m],
        color=unit_interval(EXPLOSIVE),
        linewidth=_ENTRY_WIDTH,
        solid_capstyle="butt",
        label="entry of a vehicle",
        zorder=3.5,
    )


def _stand_off(ends_m: Sequence[PointM] = ()) -> Line2D:
    """Return the line of a stand-off; without ends, one for the legend."""
    return Line2D(
        [x_m for x_m, _ in ends_m],
        [y_m for _, y_m in ends_m],
        color=unit_interval(INK),
        linewidth=_LINE_WIDTH,
        linestyle=(0, (3.0, 1.5)),
        label="stand-off",
        zorder=5.5,
    )


def _draw_ground(
    axes: Axes, scenario: Scenario, source: VehicleSource, layout: Sequence[Element]
) -> None:
    rows, columns = squares_of(scenario.site)
    ground = vehicle_reach(scenario, source, layout).ground(rows, columns)
    shades = np.zeros((rows, columns, 4))
    shades[ground] = (*unit_interval(EXPLOSIVE), REACHED_ALPHA)
    extent_m = (0.0, columns * MODULE_SIDE_M, 0.0, rows * MODULE_SIDE_M)
    view = axes.axis()
    axes.imshow(
        shades, origin="lower", extent=extent_m, interpolation="none", zorder=1.4, aspect="equal"
    )
    axes.axis(view)


def _draw_stand_off(axes: Axes, scenario: Scenario, place_m: PointM) -> None:
    wall_m = nearest_point_m(scenario.structures, place_m)
    axes.add_line(_stand_off([place_m, wall_m]))
    length_m = float(np.hypot(*np.subtract(place_m, wall_m)))
    text = axes.annotate(
        f"{length_m:.1f} m",
        ((place_m[0] + wall_m[0]) / 2.0, (place_m[1] + wall_m[1]) / 2.0),
        xytext=(0.0, 6.0),
        textcoords="offset points",
        ha="center",
        va="bottom",
        fontsize=9,
        color=unit_interval(INK),
        zorder=6,
    )
    text.set_path_effects([patheffects.withStroke(linewidth=3, foreground="white")])
    text.set_in_layout(False)
