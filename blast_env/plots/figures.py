"""Figures of one blast: scheme of the site, initial velocities, impulse over time."""

from collections.abc import Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from blast_env.arrays import FloatArray
from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import BlastResult
from blast_env.files import write_atomically
from blast_env.geometry import Rectangle
from blast_env.particles.tables import faces_hit
from blast_env.plots.heat_map import LoadScale, common_scale, heat_map
from blast_env.plots.plan import (
    EXPLOSIVE,
    INK,
    QUIET_INK,
    Feature,
    Kinds,
    area_feature,
)
from blast_env.plots.site_plan import (
    draw_loads,
    draw_outlines,
    draw_site,
    write_heading,
    write_names,
)
from blast_env.plots.style import (
    AIR,
    blast_title,
    count_of,
    number_on_axis,
    render_extra,
    short_number,
    shown_until_s,
    unit_interval,
)
from blast_env.site.balls import CollisionType, explosion_fan
from blast_env.site.parameters import SimulationParameters
from blast_env.site.scene import Scene, StructureOutline
from blast_env.site.structure import Colour, ModularObstacle
from blast_env.units import MS_PER_S, UNITS_PER_M
from blast_env.values import path_of

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import EllipseCollection
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine
    from matplotlib.ticker import FuncFormatter


_PLAN_HEIGHT_IN, _DETAIL_IN = 5.0, 4.4
_ARROWS = 12
_DETAIL_RADII = 4.5  # half the width of the detail, in radii of the charge


def model_scheme(scene: Scene) -> Figure:
    """Draw the initial state with its three parts numbered (Figure 1 of the paper)."""
    site_m = scene.site_m
    aspect = (site_m.right - site_m.left) / (site_m.top - site_m.bottom)
    plan_in = min(max(_PLAN_HEIGHT_IN * aspect, 4.0), 8.5) + 0.8
    figure = Figure(figsize=(plan_in + _DETAIL_IN, 6.8), layout=ConstrainedLayoutEngine(h_pad=0.08))
    plan, detail = figure.subplots(1, 2, width_ratios=(plan_in, _DETAIL_IN))
    draw_site(plan, site_m)
    _draw_obstacles(plan, scene)
    _draw_balls(plan, scene)
    _number(plan, site_m, _targets(scene, site_m))
    _draw_detail(detail, scene)
    figure.legend(
        handles=[],
        loc="outside lower center",
        title=_key(scene),
        alignment="left",
        title_fontsize=10,
        frameon=False,
    )
    figure.suptitle("Model scheme: the state at the detonation", fontsize=14, fontweight="bold")
    write_names(plan, [_feature_of(outline) for outline in scene.structures])
    return figure


def _feature_of(outline: StructureOutline) -> Feature:
    """Return a structure as a feature whose label is its name; a barrier has none."""
    kind = Kinds.PROTECTED_STRUCTURE if outline.protected else Kinds.STRUCTURE
    if outline.is_barrier:
        return area_feature(Kinds.BARRIER, outline.rectangle_m, outline.name)
    return replace(area_feature(kind, outline.rectangle_m, outline.name), label=outline.name)


def _draw_obstacles(axes: Axes, scene: Scene) -> None:
    for outline in scene.structures:
        draw_loads(axes, outline.build(), Normalize(0.0, 1.0), 0.3)
    draw_outlines(axes, scene.structures)


def _draw_balls(axes: Axes, scene: Scene) -> None:
    balls = scene.balls
    for kind, colour in (
        (CollisionType.AirBall, AIR),
        (CollisionType.ExplosionBall, EXPLOSIVE),
    ):
        chosen = balls.kind == kind
        _add_discs(axes, balls.position[chosen], balls.radius[chosen], colour)


def _add_discs(
    axes: Axes,
    position: NDArray[np.float64],
    radius: NDArray[np.float64],
    colour: Colour,
    edge: str = "none",
) -> None:
    """Add balls to scale; positions (n, 2) and radii (n,) are in units."""
    diameter_m = 2.0 * radius / UNITS_PER_M
    axes.add_collection(
        EllipseCollection(
            diameter_m,
            diameter_m,
            np.zeros_like(diameter_m),
            units="xy",
            offsets=position / UNITS_PER_M,
            offset_transform=axes.transData,
            facecolor=unit_interval(colour),
            edgecolor=edge,
            linewidth=1.2,
        )
    )


def _draw_detail(axes: Axes, scene: Scene) -> None:
    """Draw the charge enlarged, with some of the velocities."""
    explosive = scene.parameters.explosive
    centre = np.array(scene.charge.position_m)
    radius_m = (explosive.offset_units + explosive.radius_units) / UNITS_PER_M
    reach = _DETAIL_RADII * radius_m
    _draw_balls(axes, scene)
    fan = np.flatnonzero(scene.balls.kind == CollisionType.ExplosionBall)
    some = fan[np.unique(np.linspace(0, len(fan), _ARROWS, endpoint=False).astype(int))]
    # White edges on some of them show that the disc consists of balls.
    _add_discs(axes, scene.balls.position[some], scene.balls.radius[some], EXPLOSIVE, "white")
    direction = scene.balls.velocity[some] / explosive.speed_units_per_s
    axes.quiver(
        *(centre + 1.1 * radius_m * direction).T,
        *(1.9 * radius_m * direction).T,
        angles="xy",
        scale_units="xy",
        scale=1.0,
        width=0.009,
        color=unit_interval(INK),
        zorder=4,
    )
    axes.set_xlim(centre[0] - reach, centre[0] + reach)
    axes.set_ylim(centre[1] - reach, centre[1] + reach)
    axes.set_aspect("equal")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    axes.set_title(
        f"The charge enlarged: {explosive.ball_count} balls at "
        f"{explosive.speed_units_per_s / UNITS_PER_M:g} m/s\n"
        f"(edges and arrows: {len(some)} of them)",
        fontsize=11,
    )


def _targets(scene: Scene, site_m: Rectangle) -> list[tuple[int, NDArray[np.float64]]]:
    """Return the numbers and the places in metres to which their lines point, by x."""
    targets = [(2, np.array(scene.charge.position_m))]
    for outline in _numbered_structures(scene):
        last = outline.build().parts[-1]
        targets.append((3, np.array(last.centre_m)))
    is_air = scene.balls.kind == CollisionType.AirBall
    if is_air.any():
        air_m = scene.balls.position[is_air] / UNITS_PER_M
        taken = np.array([place[0] for _, place in targets])
        lonely = np.abs(air_m[:, :1] - taken).min(axis=1)
        score = lonely - 3.0 * (site_m.top - air_m[:, 1])
        targets.append((1, air_m[int(score.argmax())]))
    return sorted(targets, key=lambda target: float(target[1][0]))


def _numbered_structures(scene: Scene) -> list[StructureOutline]:
    """Return the barrier, and one structure that a line from above reaches without an obstacle."""
    barrier = [outline for outline in scene.structures if outline.is_barrier]
    structures = [outline for outline in scene.structures if not outline.is_barrier]
    structures.sort(key=lambda outline: (not outline.protected, -outline.rectangle_m.top))
    for outline in structures:
        last = outline.build().parts[-1]
        line = (last.centre_m, (last.centre_m[0], scene.site_m.top))
        others = (other for other in scene.structures if other is not outline)
        if not any(other.rectangle_m.meets_segment(*line) for other in others):
            return [outline, *barrier]
    return [*structures[:1], *barrier]


def _number(
    axes: Axes, site_m: Rectangle, targets: Sequence[tuple[int, NDArray[np.float64]]]
) -> None:
    """Write the numbers above the site, with a line from each to its target."""
    width = site_m.right - site_m.left
    least = 0.06 * width
    x = site_m.left
    for number, place in targets:
        x = max(float(place[0]), x + least)
        axes.annotate(
            str(number),
            xy=(float(place[0]), float(place[1])),
            xytext=(x, site_m.top + 0.055 * width),
            ha="center",
            va="center",
            fontsize=12,
            fontweight="bold",
            annotation_clip=False,
            bbox={"boxstyle": "circle,pad=0.25", "facecolor": "white", "edgecolor": "black"},
            arrowprops={"arrowstyle": "-", "linewidth": 1.1, "shrinkB": 0.0},
            zorder=8,
        )


def _key(scene: Scene) -> str:
    """Return the key of the numbers, with the values of this scene."""
    air, explosive = scene.parameters.air, scene.parameters.explosive
    air_count = int((scene.balls.kind == CollisionType.AirBall).sum())
    names = ", ".join(outline.name for outline in scene.structures)
    air_text = (
        f"{air_count:,} balls of {air.radius_units / UNITS_PER_M:g} m radius, "
        f"{air.spacing_units / UNITS_PER_M:g} m apart, at rest"
    )
    return (
        f"1  air particles: {air_text if air_count else 'none'}\n"
        f"2  explosive particles: {explosive.ball_count:,} balls, "
        f"{scene.charge.tnt_kg:g} kg TNT in all\n"
        f"3  obstacles of square modules of 0.5 m: {names}"
    )


# Okabe and Ito's colours, distinct for any colour vision.
_FACADES = (
    ("left", "#0072B2", "-"),
    ("right", "#D55E00", "--"),
    ("top", "#009E73", "-."),
    ("bottom", "#CC79A7", (0, (1.2, 1.2))),
)

_MOST_PANELS = 6


def impulse_over_time(result: BlastResult) -> Figure:
    """Return the cumulative impulse on each facade of each structure over time.

    The normal of a collision determines its facade. At most six structures are shown: the
    protected ones first, then those with the largest impulses.
    """
    structures = [obstacle for obstacle in result.obstacles if not obstacle.is_barrier]
    structures.sort(key=lambda obstacle: (not obstacle.protected, -obstacle.impulse))
    shown = structures[:_MOST_PANELS]
    columns = min(len(shown), 3 if len(shown) > 4 else 2)
    rows = -(-len(shown) // columns)
    figure = Figure(figsize=(max(4.6 * columns, 8.0), 1.2 + 3.6 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False, sharex=True).ravel()
    table = result.collisions.assign(facade=faces_hit(result.collisions))
    end_ms = shown_until_s(result) * MS_PER_S
    unit = result.load_unit
    for axes, obstacle in zip(panels, shown, strict=False):
        hits = table[table["structure"] == obstacle.name]
        _draw_structure(axes, obstacle, hits, end_ms, unit.factor_of(obstacle.name))
    for axes in panels[len(shown) :]:
        axes.set_visible(False)
    title, subtitle = blast_title(result.blast)
    write_heading(figure, f"{title}: impulse over time", subtitle)
    later = table.loc[table["time_s"] * MS_PER_S > end_ms, "impulse_sim"].sum()
    share = later / max(table["impulse_sim"].sum(), 1e-300)
    figure.supxlabel(
        f"Legend: sums up to the end of the run at {result.time_s * MS_PER_S:.0f} ms"
        + (f"; {share:.1%} of all impulse comes after {end_ms:.0f} ms" if later > 0.0 else ""),
        fontsize=9,
        color=unit_interval(QUIET_INK),
    )
    return figure


def _draw_structure(
    axes: Axes,
    obstacle: ModularObstacle,
    hits: pd.DataFrame,
    end_ms: float,
    factor: float | None,
) -> None:
    """Draw the impulse on each facade; `factor` converts it to Pa s, None without a calibration."""
    for facade, colour, style in _FACADES:
        own = hits[hits["facade"] == facade]
        if not len(own):
            continue
        arrived = (factor or 1.0) * own["impulse_sim"].cumsum().to_numpy()
        time_ms = own["time_s"].to_numpy() * MS_PER_S
        axes.step(
            np.concatenate(([0.0], time_ms, [max(end_ms, time_ms[-1])])),
            np.concatenate(([0.0], arrived, arrived[-1:])),
            where="post",
            color=colour,
            linestyle=style,
            linewidth=2.0,
            label=f"{facade}: {short_number(float(arrived[-1]))} ({count_of('hit', len(own))})",
        )
    if len(hits):
        axes.legend(
            loc="upper center", bbox_to_anchor=(0.5, -0.15), ncols=2, fontsize=9, frameon=False
        )
    else:
        axes.text(0.5, 0.5, "no hits", transform=axes.transAxes, ha="center", va="center")
    axes.set_xlim(0.0, end_ms or 1.0)
    axes.set_ylim(bottom=0.0)
    role = " (protected)" if obstacle.protected else ""
    axes.set_title(f"{obstacle.name}{role}", fontsize=11)
    axes.set_xlabel("time (ms)")
    axes.xaxis.set_tick_params(labelbottom=True)
    axes.set_ylabel(f"cumulative impulse ({'simulation units' if factor is None else 'Pa s'})")
    axes.yaxis.set_major_formatter(FuncFormatter(number_on_axis))
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)


__all__ = [
    "FIGURE_SUFFIXES",
    "Figure",
    "LoadScale",
    "common_scale",
    "heat_map",
    "impulse_over_time",
    "initial_velocities",
    "model_scheme",
    "png_of",
    "save_figure",
]

FIGURE_SUFFIXES = (".png", ".svg", ".pdf")
"""Suffixes of the file formats of figures."""

_DOTS_PER_IN = 150
_MOST_ARROWS = 36
_MOST_NAMED_ANGLES = 16


def save_figure(figure: Figure, path: str | Path) -> Path:
    """Save a figure, in the format of the suffix.

    Returns:
        The path.

    Raises:
        BlastEnvError: If the suffix is none of `FIGURE_SUFFIXES` or the file cannot be written;
            no file remains then.
    """
    path = path_of(path)
    suffix = path.suffix.lower()
    if suffix not in FIGURE_SUFFIXES:
        raise BlastEnvError(
            f"{path}: cannot save a figure with the suffix {path.suffix!r}, "
            f"must be one of {', '.join(FIGURE_SUFFIXES)}"
        )
    if suffix == ".png":
        content = png_of(figure, _DOTS_PER_IN)
    else:
        buffer = BytesIO()  # `savefig` would leave a file open after an error
        figure.savefig(buffer, format=suffix[1:], dpi=_DOTS_PER_IN)
        content = buffer.getvalue()
    with write_atomically(path) as temporary:
        temporary.write_bytes(content)
    return path


def png_of(figure: Figure, dots_per_in: float) -> bytes:
    """Return a figure as PNG, faster than `savefig`, which draws all twice to find the layout."""
    before = figure.dpi
    figure.set_dpi(dots_per_in)
    buffer = BytesIO()
    FigureCanvasAgg(figure).print_png(buffer)  # type: ignore[no-untyped-call]
    figure.set_dpi(before)
    return buffer.getvalue()


def initial_velocities(parameters: SimulationParameters, count: int = 12) -> Figure:
    """Return a picture of the initial velocities of a fan of balls (Figure 2 of the paper).

    Args:
        parameters: The parameters of the blast model.
        count: Number of balls of the fan, 1 to 36; the charge itself has more.

    Raises:
        BlastEnvError: If the count is out of bounds.
    """
    if not 1 <= count <= _MOST_ARROWS:
        raise BlastEnvError(f"count is {count}, must be 1 to {_MOST_ARROWS}")
    explosive = parameters.explosive
    fan = explosion_fan(
        explosive.model_copy(update={"ball_count": count, "fan_phase": "fixed"}),
        (0.0, 0.0),
        np.random.default_rng(0),
    )
    speed_m_per_s = explosive.speed_units_per_s / UNITS_PER_M
    figure = Figure(figsize=(7.0, 7.4), layout="constrained")
    axes = figure.subplots()
    _draw_arrows(axes, fan.velocity / UNITS_PER_M, speed_m_per_s)
    reach = 1.45 * speed_m_per_s
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    axes.set(xlabel="velocity in x (m/s)", ylabel="velocity in y (m/s)")
    axes.set_title(
        f"Initial velocities of {count} explosive balls", fontsize=13, fontweight="bold", pad=24
    )
    axes.text(
        0.5,
        1.015,
        f"$v_0$ = {explosive.speed_units_per_s:g} units/s = {speed_m_per_s:g} m/s at the angles "
        rf"$\theta_i = 2\pi i/{count}$; a charge has {explosive.ball_count} balls",
        transform=axes.transAxes,
        ha="center",
        va="bottom",
        color=unit_interval(QUIET_INK),
    )
    return figure


def _draw_arrows(axes: Axes, velocity: FloatArray, speed: float) -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    axes.plot(
        speed * np.cos(angle),
        speed * np.sin(angle),
        color=unit_interval(QUIET_INK),
        linewidth=0.8,
        linestyle=":",
    )
    tails = 0.12 * velocity
    axes.quiver(
        *tails.T,
        *(velocity - tails).T,
        angles="xy",
        scale_units="xy",
        scale=1.0,
        width=0.006,
        color=unit_interval(INK),
        zorder=2,
    )
    axes.scatter(
        tails[:, 0], tails[:, 1], s=45, color=unit_interval(EXPLOSIVE), edgecolor="white", zorder=3
    )
    named = len(velocity) <= _MOST_NAMED_ANGLES
    for index, (x, y) in enumerate(velocity, start=1):
        degrees = 360.0 * index / len(velocity)
        sideways = x / speed
        axes.text(
            1.05 * x,
            1.07 * y,
            rf"$\theta_{{{index}}}$ = {degrees:.4g}°" if named else f"{degrees:.4g}°",
            ha="center" if abs(sideways) < 0.1 else "left" if sideways > 0.0 else "right",
            va="center",
            fontsize=10,
        )
