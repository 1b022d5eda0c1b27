"""The plan of a shielding study: the block, and its gauges in the colours of their ratios."""

from typing import Final

import numpy as np

from blast_env.calibration.shielding_report import ShieldingReport
from blast_env.calibration.shielding_scenes import BlockGeometry
from blast_env.geometry import Rectangle
from blast_env.rendering.extra import render_extra
from blast_env.rendering.site_plan import add_outline, draw_charge, rectangle_patch
from blast_env.rendering.style import INK, QUIET_INK, STRUCTURE, unit_interval
from blast_env.units import MODULE_SIDE_M

with render_extra():
    from matplotlib.axes import Axes
    from matplotlib.collections import PatchCollection
    from matplotlib.colors import Normalize

_GAUGE_DEPTH_M: Final = 1.0  # drawn before the faces, so that no two overlap at a corner
_PATH_OFFSET_M: Final = 1.4
_MARGIN_M: Final = 2.6
_HIGHEST_RATIO: Final = 1.0


def draw_shielding_plan(axes: Axes, report: ShieldingReport) -> None:
    """Draw the block, its gauges, the charge, and the path round the corner.

    The charge is the origin; both gauges of a symmetric pair have the colour of their mean.
    """
    geometry = report.study.geometry
    half_m, near_m = geometry.side_m / 2.0, geometry.stand_off_m
    far_m = near_m + geometry.side_m
    block = Rectangle(near_m, -half_m, far_m, half_m)
    body = rectangle_patch(block)
    body.set(facecolor="white", hatch="///", edgecolor=(*unit_interval(QUIET_INK), 0.35))
    axes.add_patch(body)
    gauges = PatchCollection(
        [rectangle_patch(rectangle) for rectangle in gauge_rectangles(geometry)],
        cmap="viridis",
        norm=Normalize(0.0, _HIGHEST_RATIO),
        edgecolor="white",
        linewidth=0.4,
        zorder=3,
    )
    ratio = report.gauges.ratio.to_numpy()
    gauges.set_array(np.tile(ratio, 2))
    axes.add_collection(gauges)
    add_outline(axes, block, edgecolor=unit_interval(STRUCTURE), linewidth=1.6, zorder=4)
    _draw_path(axes, geometry)
    draw_charge(axes, (0.0, 0.0))
    axes.text(near_m + 0.25, 0.0, "front", rotation=90.0, va="center", color=unit_interval(INK))
    axes.set_xlim(-_MARGIN_M, far_m + _MARGIN_M)
    axes.set_ylim(-half_m - _MARGIN_M, half_m + _MARGIN_M)
    axes.set_aspect("equal")
    axes.set_xlabel("x from the charge (m)")
    axes.set_ylabel("y from the charge (m)")
    axes.set_title("Plan: gauges on the sides and the back", fontsize=11)
    figure = axes.get_figure(root=True)
    assert figure is not None
    bar = figure.colorbar(gauges, ax=axes, location="right", shrink=0.9, pad=0.02, extend="max")
    bar.set_label("normal impulse / free field")


def gauge_rectangles(geometry: BlockGeometry) -> list[Rectangle]:
    """Return where the gauges are drawn, m from the charge: all once, then all mirrored in y."""
    half_m, near_m, side = geometry.side_m / 2.0, geometry.stand_off_m, geometry.side_modules
    far_m, depth = near_m + geometry.side_m, _GAUGE_DEPTH_M
    edges = [MODULE_SIDE_M * index for index in range(side)]
    upper = [
        Rectangle(near_m + edge, half_m, near_m + edge + MODULE_SIDE_M, half_m + depth)
        for edge in edges
    ]
    upper += [
        Rectangle(far_m, half_m - edge - MODULE_SIDE_M, far_m + depth, half_m - edge)
        for edge in edges[: len(geometry.back_path_m)]
    ]
    lower = [Rectangle(left, -top, right, -bottom) for left, bottom, right, top in upper]
    return upper + lower


def _draw_path(axes: Axes, geometry: BlockGeometry) -> None:
    """Draw the path whose length counts, a little off the faces, to the middle of the back."""
    half_m, near_m = geometry.side_m / 2.0, geometry.stand_off_m
    far_m, off_m = near_m + geometry.side_m, _PATH_OFFSET_M
    x_m = (0.0, near_m, near_m, far_m + off_m, far_m + off_m)
    y_m = (0.0, half_m, half_m + off_m, half_m + off_m, 0.0)
    axes.plot(x_m, y_m, color=unit_interval(INK), linestyle="--", linewidth=1.1)
    axes.annotate(
        "path to the last gauge: "
        f"{geometry.corner_path_m:.1f} + {geometry.side_m:.1f} + {half_m:.1f} m",
        ((near_m + far_m) / 2.0, half_m + off_m),
        xytext=(0.0, 4.0),
        textcoords="offset points",
        ha="center",
        fontsize=9,
    )
