"""The model scheme, the paper's Figure 1: air, explosive, obstacles."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from blast_env.geometry import Rectangle
from blast_env.physics.particles import CollisionType
from blast_env.physics.structure import Colour, load_colour
from blast_env.rendering.captions import write_names
from blast_env.rendering.extra import render_extra
from blast_env.rendering.site_plan import (
    draw_outline,
    draw_site,
    in_metres,
    rectangle_patch,
)
from blast_env.rendering.style import AIR, BARRIER, EXPLOSIVE, INK, STRUCTURE, unit_interval
from blast_env.scene import Scene, StructureOutline
from blast_env.units import UNITS_PER_M

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.collections import EllipseCollection, PatchCollection
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

_PLAN_HEIGHT_IN, _DETAIL_IN = 5.0, 4.4
_ARROWS = 12
_DETAIL_RADII = 4.5  # half the width of the detail, in radii of the charge


def model_scheme(scene: Scene) -> Figure:
    """Return the initial state with its three parts numbered, the paper's Figure 1."""
    site_m = in_metres(scene.site)
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
    write_names(plan, scene.structures, below=True)
    return figure


def _draw_obstacles(axes: Axes, scene: Scene) -> None:
    for outline in scene.structures:
        is_barrier = outline.cells is not None
        modules = PatchCollection(
            [rectangle_patch(in_metres(part.rectangle)) for part in outline.build().parts],
            facecolor=unit_interval(load_colour(0.0)),
            edgecolor=unit_interval(BARRIER if is_barrier else STRUCTURE),
            linewidth=0.8 if is_barrier else 0.3,
        )
        axes.add_collection(modules)
        draw_outline(axes, outline)


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
    # A white edge on some of them shows that the disc is made of balls.
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
    """Return what is numbered: the number and the place in metres that its line points to."""
    targets = [(2, np.array(scene.charge.position_m))]
    for outline in _numbered_structures(scene):
        last = outline.build().parts[-1]
        targets.append((3, np.array([last.x, last.y]) / UNITS_PER_M))
    is_air = scene.balls.kind == CollisionType.AirBall
    if is_air.any():
        air_m = scene.balls.position[is_air] / UNITS_PER_M
        taken = np.array([place[0] for _, place in targets])
        lonely = np.abs(air_m[:, :1] - taken).min(axis=1)
        score = lonely - 3.0 * (site_m.top - air_m[:, 1])
        targets.append((1, air_m[int(score.argmax())]))
    return sorted(targets, key=lambda target: float(target[1][0]))


def _numbered_structures(scene: Scene) -> list[StructureOutline]:
    """Return the barrier and one structure that a line from above reaches past all others."""
    barrier = [outline for outline in scene.structures if outline.cells is not None]
    structures = [outline for outline in scene.structures if outline.cells is None]
    structures.sort(key=lambda outline: (not outline.protected, -outline.rectangle.top))
    for outline in structures:
        last = outline.build().parts[-1]
        line = ((last.x, last.y), (last.x, scene.site.top))
        others = (other for other in scene.structures if other is not outline)
        if not any(other.rectangle.meets_segment(*line) for other in others):
            return [outline, *barrier]
    return [*structures[:1], *barrier]


def _number(
    axes: Axes, site_m: Rectangle, targets: Sequence[tuple[int, NDArray[np.float64]]]
) -> None:
    """Write the numbers above the site, with a line from each to what it names."""
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
    """Return what the numbers mean, with the figures of this scene."""
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
