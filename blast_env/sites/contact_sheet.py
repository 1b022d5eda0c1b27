"""A picture of many sites, side by side."""

from collections.abc import Mapping, Sequence
from math import ceil
from types import MappingProxyType
from typing import Any, Final

from blast_env.errors import BlastEnvError
from blast_env.geometry import Rectangle
from blast_env.plan import EXPLOSIVE, INK, PROTECTED, QUIET_INK, SITE, STRUCTURE
from blast_env.rendering.site_plan import rectangle_patch
from blast_env.rendering.style import count_of, render_extra, unit_interval
from blast_env.scenario import BuildZone, Scenario, VehicleSource
from blast_env.scenario.zone import source_bounds_m

with render_extra():
    from matplotlib import patheffects
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import FancyArrowPatch, Patch

_COLUMNS: Final = 4
_PANEL_IN: Final = 3.0
_TITLE_IN: Final = 0.5
_LEGEND_IN: Final = 0.8
_FONT: Final = 12.5
_SCALE_M: Final = 10.0
_WAY_PLACES: Final = (0.5, 0.75, 0.25, 0.875, 0.125)

_GROUND: Final = "site"
_CHARGE: Final = "where the charge may be"
_ENTRY: Final = "where a vehicle enters"
_PROTECTED: Final = "protected building"
_OTHER: Final = "other building"
_DEARER: Final = "modules cost more"
_KEEP_OUT: Final = "keep-out"
_ZONE: Final = "build zone"

Style = Mapping[str, Any]

_AREAS: Final[Mapping[str, Style]] = MappingProxyType(
    {
        _GROUND: {
            "facecolor": unit_interval(SITE),
            "edgecolor": unit_interval(QUIET_INK),
            "linewidth": 0.8,
        },
        _CHARGE: {"facecolor": unit_interval(EXPLOSIVE)},
        _ENTRY: {"facecolor": (0.80, 0.47, 0.65)},
        _PROTECTED: {"facecolor": unit_interval(PROTECTED)},
        _OTHER: {"facecolor": unit_interval(STRUCTURE)},
        _DEARER: {"facecolor": (0.99, 0.84, 0.48)},
        _KEEP_OUT: {
            "fill": False,
            "hatch": "//////",
            "edgecolor": unit_interval(QUIET_INK),
            "linewidth": 0.6,
        },
        _ZONE: {
            "fill": False,
            "edgecolor": unit_interval(INK),
            "linestyle": "--",
            "linewidth": 1.3,
        },
    }
)
"""How areas are drawn, in this order, by what the legend calls them."""

_WAY: Final[Style] = MappingProxyType({"color": (0.10, 0.35, 0.85), "linewidth": 2.0})
_SCALE: Final[Style] = MappingProxyType({"color": unit_interval(INK), "linewidth": 3.0})


def contact_sheet(sites: Sequence[Scenario]) -> Figure:
    """Return a picture of sites and what they differ in, four in a row.

    Args:
        sites: At least one.

    Raises:
        BlastEnvError: If there is none.
    """
    if not sites:
        raise BlastEnvError("sites: there are none, must be at least one")
    rows = ceil(len(sites) / _COLUMNS)
    height_in = rows * (_PANEL_IN + _TITLE_IN) + _LEGEND_IN
    figure = Figure(figsize=(_COLUMNS * _PANEL_IN, height_in))
    figure.set_layout_engine("constrained", h_pad=0.08)
    panels = list(figure.subplots(rows, _COLUMNS, squeeze=False).flat)
    for axes, site in zip(panels, sites, strict=False):
        _draw(axes, site)
    for axes in panels[len(sites) :]:
        axes.set_visible(False)
    figure.legend(
        handles=_legend(), loc="outside lower center", ncols=4, fontsize=_FONT, frameon=False
    )
    return figure


def _draw(axes: Axes, site: Scenario) -> None:
    ground = site.site.rectangle_m
    axes.set_aspect("equal")
    axes.set(xlim=ground[0::2], ylim=ground[1::2])
    axes.axis("off")
    axes.set_title(_title(site), fontsize=_FONT, color=unit_interval(INK))
    _add(axes, _GROUND, ground)
    for structure in site.structures:
        _add(axes, _PROTECTED if structure.protected else _OTHER, structure.rectangle_m)
        if structure.height_m is not None:
            words = f"{structure.height_m:g} m"
            text = axes.text(*structure.rectangle_m.centre, words, ha="center", va="center")
            text.set(fontsize=_FONT - 2.5, color=unit_interval(INK), zorder=2.5)
            text.set_path_effects([patheffects.withStroke(linewidth=2.5, foreground="white")])
    for source in site.charge:
        # A stretch of road has no width, and would not be seen.
        what = _ENTRY if isinstance(source, VehicleSource) else _CHARGE
        _add(axes, what, source_bounds_m(source).grown(0.4))
    if site.build_zone is not None:
        _draw_zone(axes, site.build_zone)
        _draw_way(axes, site.build_zone, [each.rectangle_m for each in site.structures])
    left, bottom = ground.grown(-1.0)[:2]
    scale = Line2D([left, left + _SCALE_M], [bottom, bottom])
    scale.set(**_SCALE)
    axes.add_line(scale)


def _draw_zone(axes: Axes, zone: BuildZone) -> None:
    for area in zone.cost_areas:
        _add(axes, _DEARER, area.rectangle_m)
    for keep_out in zone.keep_outs:
        _add(axes, _KEEP_OUT, keep_out.rectangle_m)
    _add(axes, _ZONE, zone.rectangle_m)


def _add(axes: Axes, what: str, rectangle_m: Rectangle) -> None:
    """Draw an area in the style of what it is."""
    patch = rectangle_patch(rectangle_m)
    patch.set(linewidth=0.0, zorder=1.0 + list(_AREAS).index(what) / len(_AREAS))
    patch.set(**_AREAS[what])
    axes.add_patch(patch)


def _draw_way(axes: Axes, zone: BuildZone, structures_m: Sequence[Rectangle]) -> None:
    """Draw an arrow between the sides that the access way connects, if there is one.

    Where the way runs is left open; the arrow is where no structure stands.
    """
    if zone.access_way is None:
        return
    left, bottom, right, top = zone.rectangle_m
    places: list[tuple[tuple[float, float], tuple[float, float]]] = []
    for share in _WAY_PLACES:
        x, y = left + share * (right - left), bottom + share * (top - bottom)
        along_x = zone.access_way.between == "left_right"
        places.append(((left, y), (right, y)) if along_x else ((x, bottom), (x, top)))
    start, end = next(
        (ends for ends in places if not any(each.meets_segment(*ends) for each in structures_m)),
        places[0],
    )
    arrow = FancyArrowPatch(start, end, arrowstyle="<->", mutation_scale=16.0, shrinkA=0, shrinkB=0)
    arrow.set(zorder=3.0, **_WAY)
    axes.add_patch(arrow)
    middle = ((start[0] + end[0]) / 2.0, (start[1] + end[1]) / 2.0)
    text = axes.text(*middle, f"{zone.access_way.width_m:g} m", ha="center", va="center")
    plate = {"facecolor": "white", "edgecolor": "none", "boxstyle": "square, pad=0.15"}
    text.set(fontsize=_FONT - 1.5, color=_WAY["color"], bbox=plate, zorder=3.1)


def _title(site: Scenario) -> str:
    """Return what cannot be drawn, in two lines."""
    charge = " or ".join(f"{source.tnt_kg:g}" for source in site.charge) + " kg TNT"
    zone = site.build_zone
    if zone is None:
        return f"{site.name}\n{charge}"
    budget = "" if zone.budget is None else f", budget {zone.budget:g}"
    if zone.items:
        return (
            f"{site.name}: {count_of('item', len(zone.items))}{budget}\n"
            f"{charge}, clearance {zone.clearance_m:g} m"
        )
    return (
        f"{site.name}: {count_of('module', zone.stock)}, {charge}\n"
        f"clearance {zone.clearance_m:g} m{budget}"
    )


def _legend() -> list[Artist]:
    """Return an entry for everything that may be drawn."""
    handles: list[Artist] = []
    for label, style in _AREAS.items():
        if label != _GROUND:
            patch = Patch(linewidth=0.0, label=label)
            patch.set(**style)
            handles.append(patch)
    lines = {
        "access way that must stay open": {**_WAY, "marker": "D", "markersize": 4.0},
        f"{_SCALE_M:g} m": _SCALE,
    }
    for label, style in lines.items():
        line = Line2D([], [], label=label)
        line.set(**style)
        handles.append(line)
    return handles
