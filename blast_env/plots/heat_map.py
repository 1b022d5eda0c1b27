"""The impulse on every module, in its place on the site."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isqrt
from typing import NamedTuple

from blast_env.calibration import LoadUnit
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import BlastResult
from blast_env.geometry import Rectangle
from blast_env.particles.objects import ModularObstacle, ModularPart
from blast_env.plots.plan import INK, PROTECTED, STANDING, Feature, blast_features, without
from blast_env.plots.site_plan import (
    add_bar,
    draw_loads,
    draw_outlines,
    draw_plan,
    legend_of_loads,
    load_colours,
    write_heading,
    write_legend,
    write_names,
)
from blast_env.plots.style import (
    blast_title,
    nice_ceiling,
    render_extra,
    short_number,
    unit_interval,
)
from blast_env.site.structures import buildings_of
from blast_env.units import MODULE_SIDE_M
from blast_env.values import count_of

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

_HEIGHT_IN = 6.6
_PLAN_HEIGHT_IN, _PLAN_WIDTHS_IN = 4.6, (4.0, 8.0)
_PANELS_HEIGHT_IN, _PANELS_WIDTHS_IN = 4.9, (2.2, 6.0)
_PLAN_LABELS_IN, _PANEL_LABELS_IN, _COLOUR_BAR_IN = 1.0, 0.7, 1.3
_MOST_PANELS = 4
_REACH_M = 0.25  # around an enlarged building
_POINTS_PER_IN = 72.0
_LARGEST_NUMBER_PT, _SMALLEST_NUMBER_PT = 9.0, 5.5
_DARK_SHARE = 0.55  # of the scale; numbers turn white there


class LoadScale(NamedTuple):
    """A colour scale of module loads.

    Attributes:
        full: The load of a module at the end of the scale, in the unit; 0 without any load.
        unit: Unit of the loads shown.
    """

    full: float
    unit: LoadUnit

    @classmethod
    def of(cls, results: Sequence[BlastResult]) -> "LoadScale":
        """Return a common scale of results, which ends at their largest load, rounded up.

        It is that of a protected module, or of any if these have none. The unit is that of the
        result with the largest load.
        """
        loads = [_largest_load(result) for result in results]
        largest = max(loads)
        unit = results[loads.index(largest)].load_unit
        return cls(nice_ceiling(unit.factor * largest) if largest > 0.0 else 0.0, unit)

    @property
    def norm(self) -> Normalize:
        """The scale for matplotlib."""
        return Normalize(0.0, self.full or 1.0)


def _largest_load(result: BlastResult) -> float:
    """Return the largest load of a protected module, or of any module if these have none."""
    for obstacles in (
        [obstacle for obstacle in result.obstacles if obstacle.protected],
        list(result.obstacles),
    ):
        loads = [part.impulse for obstacle in obstacles for part in obstacle.parts]
        if max(loads, default=0.0) > 0.0:
            return max(loads)
    return 0.0


def heat_map(result: BlastResult, among: Sequence[BlastResult] = ()) -> Figure:
    """Return the impulse on every module, on the site plan and enlarged.

    The protected buildings are enlarged, or all if none is protected; at most four, those with the
    largest impulses.

    Args:
        among: Results with the same colour scale, for comparisons of their maps.
    """
    chosen = _chosen(result)
    scale = LoadScale.of([result, *among])
    columns = isqrt(len(chosen) - 1) + 1
    rows = -(-len(chosen) // columns)
    widths_in = _widths_in(result, chosen, columns, rows)
    layout = ConstrainedLayoutEngine(h_pad=0.08)
    figure = Figure(figsize=(sum(widths_in), _HEIGHT_IN), layout=layout)
    halves = figure.add_gridspec(1, 2, width_ratios=widths_in)
    overview = figure.add_subplot(halves[0])
    _draw_overview(overview, result, scale)
    places = halves[1].subgridspec(rows, columns)
    panels = [figure.add_subplot(places[index]) for index in range(len(chosen))]
    room_in = (
        (widths_in[1] - _COLOUR_BAR_IN) / columns - _PANEL_LABELS_IN,
        _PANELS_HEIGHT_IN / rows,
    )
    for axes, building in zip(panels, chosen, strict=True):
        _draw_panel(axes, result, building, scale, room_in)
    _add_colour_bar(figure, panels, scale, result)
    destructible = any(obstacle.capacity is not None for obstacle in result.obstacles)
    write_legend(figure, legend_of_loads(_features(result), destructible=destructible))
    title, subtitle = blast_title(result.blast)
    write_heading(figure, f"{title}: impulse per module", subtitle)
    write_names(overview, _features(result), inside=False)
    return figure


@dataclass(frozen=True, eq=False)
class _Building:
    """A building, or a structure, to enlarge."""

    name: str
    obstacles: tuple[ModularObstacle, ...]

    @property
    def protected(self) -> bool:
        """Whether the load of at least one structure counts."""
        return any(obstacle.protected for obstacle in self.obstacles)

    @property
    def impulse(self) -> float:
        """Sum over the structures, simulation units."""
        return sum(obstacle.impulse for obstacle in self.obstacles)

    @property
    def modules(self) -> tuple[ModularPart, ...]:
        """The modules of the structures."""
        return tuple(part for obstacle in self.obstacles for part in obstacle.parts)

    @property
    def size_modules(self) -> tuple[float, float]:
        """Columns and rows of modules in the rectangle around the structures."""
        left, bottom, right, top = Rectangle.around(
            [obstacle.rectangle_m for obstacle in self.obstacles]
        )
        return (right - left) / MODULE_SIDE_M, (top - bottom) / MODULE_SIDE_M


def _chosen(result: BlastResult) -> list[_Building]:
    structures = result.blast.scenario.structures_with(result.blast.layout)
    buildings = [
        _Building(name, tuple(result.obstacle(part.name) for part in parts))
        for name, parts in buildings_of(structures).items()
    ]
    protected = [building for building in buildings if building.protected]
    by_impulse = sorted(protected or buildings, key=lambda structure: -structure.impulse)
    return by_impulse[:_MOST_PANELS]


def _widths_in(
    result: BlastResult, chosen: list[_Building], columns: int, rows: int
) -> tuple[float, float]:
    """Return widths for plan and panels that leave little empty space beside them."""
    site = result.blast.scene.site
    plan = _PLAN_HEIGHT_IN * (site.right - site.left) / (site.top - site.bottom)
    widest = max(across / along for across, along in (building.size_modules for building in chosen))
    panels = _PANELS_HEIGHT_IN / rows * widest * columns
    plan, panels = (
        min(max(width, least), most)
        for width, (least, most) in ((plan, _PLAN_WIDTHS_IN), (panels, _PANELS_WIDTHS_IN))
    )
    return plan + _PLAN_LABELS_IN, panels + columns * _PANEL_LABELS_IN + _COLOUR_BAR_IN


def _draw_overview(axes: Axes, result: BlastResult, scale: LoadScale) -> None:
    # Modules are filled with the colours of their loads.
    draw_plan(axes, without(_features(result), *STANDING))
    for obstacle in result.obstacles:
        draw_loads(axes, obstacle, scale.norm, 0.25, scale.unit.factor)
    draw_outlines(axes, result.obstacles)
    axes.set_title("Site", fontsize=11)


def _features(result: BlastResult) -> tuple[Feature, ...]:
    blast = result.blast
    return blast_features(blast.scenario, blast.layout, blast.scene.charge)


def _total(result: BlastResult, building: _Building) -> str:
    """Return the load on a building in words: in Pa s for a single part with a calibration."""
    if len(building.obstacles) == 1:
        try:
            return f"{result.impulse(building.obstacles[0].name).pa_s:,.0f} Pa s"
        except BlastEnvError:
            pass
    return f"{building.impulse:,.0f} in all"


def _draw_panel(
    axes: Axes,
    result: BlastResult,
    building: _Building,
    scale: LoadScale,
    room_in: tuple[float, float],
) -> None:
    for obstacle in building.obstacles:
        draw_loads(axes, obstacle, scale.norm, 0.6, scale.unit.factor)
    draw_outlines(axes, building.obstacles)
    left, bottom, right, top = Rectangle.around(
        [obstacle.rectangle_m for obstacle in building.obstacles]
    )
    axes.set(xlim=(left - _REACH_M, right + _REACH_M), ylim=(bottom - _REACH_M, top + _REACH_M))
    axes.set(aspect="equal", xlabel="x (m)", ylabel="y (m)")
    axes.spines[:].set_visible(False)
    hits = sum(part.hits for part in building.modules)
    title = result.blast.scenario.title_of(building.name)
    axes.set_title(
        f"{title}{' (protected)' if building.protected else ''}\n"
        f"{_total(result, building)} from {count_of('hit', hits)}",
        fontsize=11,
        color=unit_interval(PROTECTED if building.protected else INK),
    )
    columns, rows = building.size_modules
    cell_pt = _POINTS_PER_IN * min(room_in[0] / (columns + 1.0), room_in[1] / (rows + 1.0))
    _write_numbers(axes, building, scale, min(0.34 * cell_pt, _LARGEST_NUMBER_PT))


def _write_numbers(axes: Axes, building: _Building, scale: LoadScale, size_pt: float) -> None:
    """Write the impulse into every module that was hit, if the text size is legible."""
    if size_pt < _SMALLEST_NUMBER_PT:
        return
    for part in building.modules:
        if part.hits:
            load = scale.unit.factor * part.impulse
            dark = scale.norm(load) > _DARK_SHARE
            centre = part.rectangle_m.centre
            number = axes.text(
                *centre,
                short_number(load),
                ha="center",
                va="center",
                fontsize=size_pt,
                color="white" if dark else unit_interval(INK),
                zorder=4,
            )
            if part.destroyed:  # keep the cross off the number
                ground = load_colours()(scale.norm(load))
                number.set_bbox({"facecolor": ground, "edgecolor": "none", "pad": 1.5})


def _add_colour_bar(
    figure: Figure, panels: list[Axes], scale: LoadScale, result: BlastResult
) -> None:
    beyond = any(
        scale.unit.factor * part.impulse > scale.full
        for obstacle in result.obstacles
        for part in obstacle.parts
    )
    colours, label = (
        ScalarMappable(scale.norm, load_colours()),
        f"{scale.unit.label}; white: not hit",
    )
    extend = "max" if beyond else "neither"
    add_bar(figure, panels, colours, label, extend=extend, shrink=0.85, pad=0.03)
