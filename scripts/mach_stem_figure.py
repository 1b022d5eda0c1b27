"""The figure of `scripts.mach_stem`: density in front of a wall, and the height of the stem."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from blast_env.rendering.site_plan import write_heading
from blast_env.units import MS_PER_S

if TYPE_CHECKING:
    from scripts.mach_stem import DensityField

_PANELS: Final = 4
_HIGHEST_DENSITY: Final = 2.5
_NEAR_WALL, _FREE = "#D55E00", "#FFFFFF"


def mach_stem_figure(
    fields: Sequence["DensityField"], transition_deg: float, subtitle: str
) -> Figure:
    """Return the density at four times with both fronts, and the stem's height over the angle.

    Args:
        fields: The fields, by time.
        transition_deg: Angle of incidence at which a stem begins, or NaN.
        subtitle: What was run.
    """
    figure = Figure(figsize=(15.0, 8.0), layout="constrained")
    grid = figure.add_gridspec(2, 3, width_ratios=(1.0, 1.0, 0.9))
    shown = np.linspace(len(fields) // 4, len(fields) - 1, _PANELS).round().astype(int)
    panels = [figure.add_subplot(grid[place // 2, place % 2]) for place in range(_PANELS)]
    images = [_draw_density(axes, fields[index]) for axes, index in zip(panels, shown, strict=True)]
    bar = figure.colorbar(images[0], ax=panels, location="bottom", shrink=0.6, extend="max")
    bar.set_label("number of air balls per area / that of the air at rest")
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside lower left", facecolor="#8FA3B0"
    )
    _draw_heights(figure.add_subplot(grid[:, 2]), fields, transition_deg)
    found = (
        "no transition can be told"
        if np.isnan(transition_deg)
        else f"a Mach stem begins at about {transition_deg:.0f}°"
    )
    write_heading(figure, f"Reflection at a long wall: {found}", subtitle)
    return figure


def _draw_density(axes: Axes, field: "DensityField") -> AxesImage:
    rows_m, along_m = field.from_wall_m, field.front_m
    height_m, width_m = 2.0 * field.stand_off_m, 3.0 * field.stand_off_m
    cell_m = rows_m[1] - rows_m[0]
    image = axes.imshow(
        field.density,
        origin="lower",
        extent=(0.0, cell_m * field.density.shape[1], 0.0, height_m),
        vmin=0.0,
        vmax=_HIGHEST_DENSITY,
        cmap="viridis",
        aspect="equal",
    )
    half = len(rows_m) // 2 if field.has_front else 0
    axes.plot(along_m[:half], rows_m[:half], color=_NEAR_WALL, lw=2.0, label="front at the wall")
    axes.plot(
        field.undisturbed_front_m[:half],
        rows_m[:half],
        color=_FREE,
        lw=1.6,
        ls="--",
        label="front of the other side, mirrored",
    )
    axes.axhline(field.stand_off_m, color=_FREE, lw=0.6, ls=":")
    if field.has_front and field.stem_height_m > 0.0:
        axes.axhline(field.stem_height_m, color=_NEAR_WALL, lw=0.8, ls=":")
    axes.plot(0.0, field.stand_off_m, "*", color="#E21C24", ms=14, mec="black", clip_on=False)
    axes.set(xlim=(0.0, width_m), ylim=(0.0, height_m))
    axes.set_xlabel("along the wall (m)")
    axes.set_ylabel("from the wall (m)")
    angle = field.incidence_deg
    words = (
        "no front at the wall can be told"
        if np.isnan(angle)
        else f"incidence {angle:.0f}°, stem {field.stem_height_m:.1f} m"
    )
    axes.set_title(f"{MS_PER_S * field.time_s:.1f} ms, {words}", fontsize=11)
    return image


def _draw_heights(axes: Axes, fields: Sequence["DensityField"], transition_deg: float) -> None:
    angle_deg = [field.incidence_deg for field in fields]
    axes.plot(angle_deg, [field.stem_height_m for field in fields], "o", color=_NEAR_WALL)
    axes.axhline(fields[0].stand_off_m, color="black", lw=0.8, ls=":", label="stand-off")
    if not np.isnan(transition_deg):
        axes.axvline(
            transition_deg, color="black", ls="--", label=f"transition {transition_deg:.0f}°"
        )
    axes.set_xlabel("angle of incidence of the undisturbed front\nat the wall (°); 0 is head-on")
    axes.set_ylabel("height of the stem (m)")
    axes.set_xlim(0.0, 90.0)
    axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.3)
    axes.legend()
